# Generated from can_bus/frame_log.py and can_bus/frame_log.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.foundation.row_stream import RowStream
from typing import Any
from typing import final

TIMES_COLUMNS: int
TIMES_START: int
TIMES_ASKED: int
TIMES_END: int
TIMES_IDENTIFIER: int
TIMES_SENDER: int
TIMES_LOW: int
TIMES_HIGH: int
TIMES_BUFFER_SHIFT: int
SENDER_SHIFT: int

@final
class FrameTimes(RowStream):
    def __init__(self) -> None: ...
    def add(self, start: int, asked: int, end: int, identifier: int, sender: int, lo: int, hi: int) -> None: ...

@final
class FrameLog:
    stream: FrameStream | None
    times: FrameTimes
    frames: list[Any]
    capacity: int
    dropped: int
    def __init__(self, capacity: int) -> None: ...
    def take(self) -> list[Any]: ...
