# Generated from harness/wiring/board_wires.py and harness/wiring/board_wires.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.events import Outbox
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.plant.bridge import Bridge
from typing import Any
from typing import final

CONTROLLERS: Any

@final
class WordWire:
    source: int
    word: int
    board: Board
    def __init__(self, source: int, board: Board, word: int) -> None: ...

@final
class SspWire:
    master: EventQueue
    slave: EventQueue
    exchange_ns: int
    exchanges: int
    loaded: Any
    tampering: Any
    watch: RowStream | None
    def __init__(self, master: Any, slave: Any, exchange_ns: int, idle_segment: Any) -> None: ...
    def start(self, time_ns: int, segment: Any) -> None: ...
    def load(self, segment: Any) -> None: ...

@final
class BoardWires(Outbox):
    board: Board
    drive: Bridge | None
    window_ns: int
    silent_until: int
    watchdog_pin: int
    low_side_2_pin: int
    low_side_6_pin: int
    low_side_2: bool
    low_side_6: bool
    buses: list[Any]
    nodes: MutableSequence[int]
    link: SspWire
    watch: RowStream | None
    can_lines: dict[Any, Any]
    serial_lines: dict[Any, Any]
    def __init__(self, board: Board, window_ns: int) -> None: ...
    def connect_bus(self, controller: Any, bus: Any, node: Any) -> None: ...
    def _connect_ends(self, controller: Any) -> None: ...
    def lead_from(self, board: Any) -> None: ...
    def connect_drive(self, drive: Any, watchdog_pin: Any, low_side_2_pin: Any, low_side_6_pin: Any) -> None: ...
    def push(self, time: int, order: int, kind: int, a: int = 0, b: int = 0, c: int = 0, d: int = 0, e: int = 0, f: int = 0, ref: Any = None) -> None: ...
    def request(self, time: int, controller: int, buffer: int, identifier: int, flags: int, lo: int, hi: int) -> None: ...
    def _spoke_early(self, time: Any) -> None: ...
    def _to_bus_outside(self, kind: Any, time: Any, controller: Any, b: Any, c: Any, d: Any, e: Any, f: Any) -> None: ...
    def _to_serial_line(self, time: Any, uart: Any, byte: Any, count: Any, data: Any) -> None: ...
