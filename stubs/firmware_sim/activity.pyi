# Generated from firmware_sim/activity.py and firmware_sim/activity.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.row_stream import RowStream
from typing import Any
from typing import final
import array

TASK_RAN: int
WAIT_RAN: int
INTERRUPT_RAN: int
MAIN_LOOP_RAN: int
SLOT_BEGAN: int
SLOT_ENDED: int
SLOT_OVERRAN: int
TASK_DROPPED: int
COLUMN_KIND: int
COLUMN_NUMBER: int
COLUMN_START: int
COLUMN_END: int
COLUMN_CYCLES: int
COLUMN_LATENCY: int
COLUMN_ROW: int
COLUMN_ITEMS: int
ACTIVITY_COLUMNS: int
USUAL_ROWS: int

@final
class ActivityLog(RowStream):
    sinks: list[Any]
    handed: int
    laps: int
    keep_ns: int
    code_open: bool
    list_open: bool
    irq_open: bool
    code_kind: int
    code_number: int
    code_start: int
    code_cycles: int
    code_row: int
    code_items: int
    list_number: int
    list_cycles: int
    irq_number: int
    irq_start: int
    irq_cycles: int
    irq_latency: int
    irq_row: int
    irq_items: int
    def __init__(self, rows: Any = ...) -> None: ...
    def add_sink(self, sink: Any) -> None: ...
    def flush(self) -> None: ...
    @property
    def written(self) -> int: ...
    def newest(self) -> array.array: ...
    def put(self, kind: int, number: int, start: int, end: int, cycles: int, latency: int, row: int, items: int) -> None: ...
    def begin_code(self, kind: int, number: int, start: int, cycles: int, row: int, items: int) -> None: ...
    def end_code(self, time: int) -> None: ...
    def begin_irq(self, number: int, start: int, cycles: int, latency: int, row: int, items: int) -> None: ...
    def end_irq(self, time: int) -> None: ...
