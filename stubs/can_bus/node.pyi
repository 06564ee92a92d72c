# Generated from can_bus/node.py and can_bus/node.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.foundation.events import EventQueue
from typing import Any
from typing import final

OPERATING: int
RESET: int
BUS_OFF: int
JOINING: int
UNPLUGGED: int
ICR_ERROR_WARNING: int
ICR_ERROR_PASSIVE: int
ICR_BUS_ERROR: int
ICR_FIELD_SHIFT: int
ICR_FIELD_MASK: int
ICR_RECEIVING: int
ICR_KIND_SHIFT: int
KIND_BIT: int
KIND_FORM: int
KIND_STUFF: int
KIND_OTHER: int
WARNING_LIMIT: int
PASSIVE_LIMIT: int
BUS_OFF_LIMIT: int
RECEIVE_ERRORS_MOST: int
RECEIVER_CALMED: int
SENDER_PENALTY: int
SUSPEND_BITS: int
SEQUENCE_BITS: int
RECOVERY_SEQUENCES: int
TRANSMIT_ERRORS_OFF: int

@final
class Node:
    inbox: EventQueue
    following: Node
    ends: TransmitEnds
    index: int
    order: int
    controller: int
    mode: int
    transmit_errors: int
    receive_errors: int
    listening: bool
    passive: bool
    silent: bool
    sent: int
    received: int
    warning: bool
    name: str
    sequences_left: int
    join_from: int
    suspend_bit: int
    off_ns: int
    sending_end: int
    refused: int
    aborted: int
    single_shot_skipped: int
    flushed: int
    arbitrations_lost: int
    retries: int
    def __init__(self, name: Any, index: int, inbox: EventQueue, controller: int, order: int) -> None: ...
    def renew(self, name: Any) -> None: ...
    def connect(self, ends: Any) -> None: ...
    def end_unsent(self, buffer: Any, time: Any, status: Any) -> None: ...
    def forgive(self) -> None: ...
    def count_receive_errors(self, penalty: int) -> None: ...
    def confine(self, time: int, interrupts: int) -> bool: ...
    def leave(self) -> None: ...
    def unplug(self) -> None: ...
    def take_over(self, other: Any) -> None: ...
    def start_joining(self, bit: Any) -> None: ...
    def count_sequences(self, free_bit: Any, start: Any) -> None: ...
    def join(self) -> bool: ...
