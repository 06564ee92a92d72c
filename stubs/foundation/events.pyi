# Generated from foundation/events.py and foundation/events.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

STAGE_PLANT: int
STAGE_PINS: int
STAGE_BUS: int
STAGE_INTERRUPTS: int
STAGE_SLOTS: int
ORDER_PINS: int
ORDER_BUS: int
ORDER_INTERRUPTS: int
PIN_EDGE: int
CAN_RX: int
CAN_TX_DONE: int
CAN_STATUS: int
UART_BYTE: int
SSP_SEGMENT: int
CAN_REQUEST: int
CAN_ABORT: int
CAN_MODE: int
PWM_UPDATE: int
PIN_OUTPUT: int
SSP_START: int
SSP_LOAD: int
UART_OUTPUT: int
FLAG_REMOTE: int
FLAG_SINGLE_SHOT: int
FLAG_EXTENDED: int
FLAG_ERROR: int
TX_SENT: int
TX_ABORTED: int
TX_LOST: int
ROW: int
ROW_KIND: int
NEVER: int

class Outbox:
    def push(self, time: int, order: int, kind: int, a: int = 0, b: int = 0, c: int = 0, d: int = 0, e: int = 0, f: int = 0, ref: Any = None) -> None: ...
    def request(self, time: int, controller: int, buffer: int, identifier: int, flags: int, lo: int, hi: int) -> None: ...

@final
class EventQueue(Outbox):
    head: int
    tail: int
    head_time: int
    size: int
    place: int
    pushed: int
    ref: Any
    time: int
    order: int
    kind: int
    a: int
    b: int
    c: int
    d: int
    e: int
    f: int
    urgent_until: int
    refs: list[Any]
    @property
    def rows_kept(self) -> MutableSequence[int]: ...
    @property
    def came_kept(self) -> MutableSequence[int]: ...
    @property
    def due_kept(self) -> MutableSequence[int]: ...
    def __init__(self, capacity: Any = 256) -> None: ...
    @property
    def count(self) -> int: ...
    def wake(self, came: Any, due: Any, place: Any) -> None: ...
    def _make_room(self) -> None: ...
    def push(self, time: int, order: int, kind: int, a: int = 0, b: int = 0, c: int = 0, d: int = 0, e: int = 0, f: int = 0, ref: Any = None) -> None: ...
    def put(self, time: int, order: int, kind: int, a: int, b: int, c: int, d: int, e: int, f: int) -> int: ...
    def take(self) -> bool: ...
    def clear(self) -> None: ...
