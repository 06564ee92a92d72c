# Generated from foundation/row_stream.py and foundation/row_stream.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final

DIGEST_BYTES: int

class RowStream:
    used: int
    capacity: int
    last_time_ns: int
    number: int
    columns: int
    @property
    def integers(self) -> MutableSequence[int]: ...
    reals: MutableSequence[float]
    is_real: bool
    digest: Any
    sink: Any
    def __init__(self, code: Any, columns: int, hashed: Any, block_rows: Any = 512, number: int = 0) -> None: ...
    def finish_row(self, time_ns: int) -> None: ...
    def flush(self) -> None: ...

@final
class FrameStream(RowStream):
    def __init__(self, bus: Any) -> None: ...
    def add(self, time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> None: ...
