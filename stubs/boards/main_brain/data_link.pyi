# Generated from boards/main_brain/data_link.py and boards/main_brain/data_link.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.datatable.store import DataStore
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import EventQueue
from typing import Any

POINTS_PER_SEGMENT: int
POINT_BYTES: int
SEGMENT_BYTES: int
SEGMENT_SUM: int
RING_SEGMENTS: int
MOST_FULL: int
HALF_FULL: int
PACKET_BYTES: int
PACKET_SUM: int
RECEIVE_RING: int
CHANNELS: int
MEDIUM: int
FAST: int
IDENTIFIER: int
LARGEST_SUM: int
STEP_SHIFT: int
FAST_LIST: int
MEDIUM_LIST: int
ALL_VARIABLES: int
RETURN: int
NEW_FOR_COMPUTER: int
COMPUTERS_BITS: int
BYTE: int
NOT_ITS_OWN: int
SINGLE: int
SIGNED: int
UNSIGNED: int
KINDS: dict[str, int]

class DataLink:
    chip: Microcontroller
    uart: HsUart
    store: DataStore
    report: Any
    checked: bool
    dma_was_off: bool
    restart_source: InterruptSource
    code_full: int
    code_buffer_full: int
    code_dma_off: int
    code_checksum: int
    code_no_parameter: int
    code_limit: int
    code_id_out_of_range: int
    last_id: int
    first_channel: int
    kinds: MutableSequence[int]
    fast: MutableSequence[int]
    medium: MutableSequence[int]
    ring: MutableSequence[int]
    least: MutableSequence[float]
    most: MutableSequence[float]
    segments: MutableSequence[int]
    filling: int
    sending: int
    used: int
    in_segment: int
    checksum: int
    fast_count: int
    medium_count: int
    phase: int
    fast_place: int
    medium_place: int
    slow_id: int
    rate_sum: int
    calls_to_wait: int
    points: int
    segments_sent: int
    steps: int
    ring_write: int
    ring_read: int
    packets: int
    bad_packets: int
    refused: int
    ring_full: int
    def __init__(self, chip: Microcontroller, uart: HsUart, store: DataStore, report: Any, checked: bool = True, dma_off_at_start: bool = False) -> None: ...
    def build_lists(self) -> None: ...
    def allowed_steps(self) -> int: ...
    def send_data(self) -> Any: ...
    def on_restart(self, queue: EventQueue) -> None: ...
    def on_sent(self, queue: EventQueue) -> None: ...
    def swap_buffers(self) -> Any: ...
    def waiting(self) -> int: ...
    def parse(self) -> Any: ...
