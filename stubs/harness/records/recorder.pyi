# Generated from harness/records/recorder.py and harness/records/recorder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.row_stream import RowStream
from typing import Any
from typing import final

@final
class Recorder:
    frames: list[Any]
    samples: RowStream
    words: RowStream
    def __init__(self, buses: Any, sample_columns: Any, word_columns: Any) -> None: ...
    def streams(self) -> dict[Any, Any]: ...
    def trace_digest(self) -> Any: ...
