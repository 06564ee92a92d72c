# Generated from boards/modules/ssp_link.py and boards/modules/ssp_link.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from typing import Any
from typing import final

SEGMENT_HALF_WORDS: int
CHECKSUM: int
FRAME_HALF_WORDS: int
FRAME_ROW: int
SEGMENT_ROWS: int
HEADER_ONES: int
HEADER_REMOTE: int
HEADER_SHIFT: int
HEADER_MARK: int
IDENTIFIER: int
HALF_WORD: int
MOST_BEFORE_A_FRAME: int
ROUTER_RECEIVE_SEGMENTS: int
RECEIVE_MASK: int
MAIN_BRAIN_SEGMENTS: int
ROUTER_CIRCLE: int
MAIN_BRAIN_CIRCLE: int
EXCHANGE_NS: int

def checksum(segment: SspSegment) -> int: ...
def finish(segment: SspSegment, used: int) -> None: ...
def empty_segment() -> SspSegment: ...
def add_frame(segment: SspSegment, header: int, word0: int, word1: int) -> int: ...
def frames_in(segment: SspSegment) -> int: ...
def corrupted_copy(segment: SspSegment, index: int, flipped_bits: int) -> SspSegment: ...

@final
class MainBrainSspLink:
    empty: SspSegment
    packing: SspSegment | None
    queue: list[Any]
    received: list[Any]
    queue_read: int
    queue_count: int
    received_count: int
    segments: int
    frames: int
    last_id: int
    received_frames: MutableSequence[int]
    segments_received: int
    segments_sent: int
    frames_received: int
    frames_sent: int
    first_is_junk: bool
    report: Any
    checksum_errors: int
    receive_full: int
    transmit_full: int
    ids_out_of_range: int
    code_checksum: int
    code_receive_full: int
    code_transmit_full: int
    code_id_out_of_range: int
    def __init__(self, report: Any, last_id: int, first_is_junk: bool = True) -> None: ...
    def exchanged(self, segment: SspSegment) -> SspSegment: ...
    def receive(self, segment: SspSegment) -> bool: ...
    def parsed(self) -> list[Any]: ...
    def shifted(self, segment: SspSegment) -> SspSegment: ...
    def next_segment(self) -> SspSegment: ...
    def parse(self) -> int: ...
    def send(self, identifier: int, word0: int, word1: int) -> bool: ...
    def flush(self) -> int: ...

@final
class RouterSspLink:
    received_write: int
    received_read: int
    position: int
    packing: SspSegment
    half_words: int
    push_time: int
    first: int
    last: int
    segments: list[Any]
    received: list[Any]
    received_frames: MutableSequence[int]
    rx_id: int
    rx_flags: int
    rx_word0: int
    rx_word1: int
    exchange_running: bool
    exchange_done: bool
    frames_may_straddle: bool
    empty: SspSegment
    push_step_ns: int
    segments_sent: int
    segments_received: int
    frames_sent: int
    frames_received: int
    report: Any
    checksum_errors: int
    receive_overwritten: int
    transmit_lost: int
    low_rate: int
    code_receive_overwritten: int
    code_low_rate: int
    code_checksum: int
    code_transmit_full: int
    def __init__(self, report: Any, frames_may_straddle: bool = False) -> None: ...
    def half_words_waiting(self) -> int: ...
    def push(self, identifier: int, flags: int, word0: int, word1: int, now: int) -> bool: ...
    def next_segment(self, now: int) -> SspSegment: ...
    def tick(self, now: int) -> SspSegment: ...
    def receive(self, segment: SspSegment) -> None: ...
    def has_segments(self) -> bool: ...
    def take(self) -> bool: ...
