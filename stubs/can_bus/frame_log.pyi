# Generated from can_bus/frame_log.py and can_bus/frame_log.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.row_stream import FrameStream
from typing import Any
from typing import final

@final
class FrameLog:
    stream: FrameStream | None
    frames: list[Any]
    capacity: int
    dropped: int
    def __init__(self, capacity: int) -> None: ...
    def take(self) -> list[Any]: ...
