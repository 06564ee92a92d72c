# Generated from harness/faults/error_watch.py and harness/faults/error_watch.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.step_watch import StepWatch
from typing import Any
from typing import final

@final
class ErrorWatch(StepWatch):
    boards: list[Any]
    codes: int
    count: int
    before: MutableSequence[int]
    rows: RowStream
    def __init__(self, boards: list[Any], codes: int) -> None: ...
    def before_step(self, now_ns: int) -> Any: ...
