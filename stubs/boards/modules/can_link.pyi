# Generated from boards/modules/can_link.py and boards/modules/can_link.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.foundation.events import EventQueue
from typing import Any
from typing import final

IDENTIFIERS: int
RECEIVE_RING: int
RECEIVE_MASK: int
RECEIVED: int
SEND_RING: int
SEND_MASK: int
QUEUED: int
FIRST_BUFFER: int
SECOND_BUFFER: int
RECEIVE_CYCLES: int
ERROR_CYCLES: int
STORM_CYCLES: int
TRANSMIT_CYCLES: int
PLACE_CYCLES: int

@final
class CanLink(Sender):
    controller: CanController
    time_identifier: int
    search_cycles: int
    receivers: list[Any]
    rx_write: int
    rx_read: int
    tx_write: int
    tx_read: int
    received: int
    delivered: int
    queued: int
    ignored: int
    most_waiting: int
    rx_rows: MutableSequence[int]
    tx_rows: MutableSequence[int]
    chip: Microcontroller
    errors: ErrorModule
    controller_errors: Any
    report_full: bool
    full_ring_kills: bool
    stuck: bool
    receive_lost: int
    send_lost: int
    code_receive_full: int
    code_send_full: int
    built: bool
    built_identifier: int
    built_value: int
    built_time: int
    def __init__(self, chip: Microcontroller, controller: CanController, time: NetworkTime, errors: ErrorModule, report_full: bool = True, full_ring_kills: bool = True) -> None: ...
    def attach(self, receive_slot: Any = 0, error_slot: Any = 8) -> None: ...
    def listen(self, identifier: Any, receiver: Receiver) -> None: ...
    def on_receive(self, queue: EventQueue) -> None: ...
    def on_error(self, queue: EventQueue) -> None: ...
    def receive_all(self) -> Any: ...
    def build(self, identifier: int, value_word: int, time_word: int) -> None: ...
    def transmit(self) -> None: ...
    def send_words(self, identifier: int, value_word: int, time_word: int) -> bool: ...
    def feed(self) -> Any: ...
