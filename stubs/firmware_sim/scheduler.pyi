# Generated from firmware_sim/scheduler.py and firmware_sim/scheduler.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.activity import ActivityLog
from ranger_sim.firmware_sim.counters import SlotCounters
from typing import Any
from typing import final

NORMAL_TASK: int
OCCASIONAL_TASK: int
WAIT_TASK: int
HISTOGRAM_BINS: int
ENTRY: int
ENTRY_CODE: int
ENTRY_OWNER: int
ENTRY_NS: int
ENTRY_CALLS: int

class Task:
    kind: int
    base_cycles: int
    per_item: int
    most_cycles: int
    noted_calls: int
    noted_cycles: int
    noted_most: int
    noted_last: int
    noted_when: int
    number: int
    scheduler: SlotScheduler | None
    routine: Any
    speaks: bool
    hits: int
    name: str
    item: str
    def __init__(self, function: Any, cost: int = 0, limit: int = 0, per_item: int = 0, item: str = '', name: Any = None) -> None: ...
    def usual_calls(self) -> int: ...
    def settle(self) -> None: ...
    @property
    def function(self) -> Any: ...
    @function.setter
    def function(self, function: Any) -> None: ...
    @property
    def cost(self) -> int: ...
    @cost.setter
    def cost(self, cycles: int) -> None: ...
    @property
    def limit(self) -> int: ...
    @limit.setter
    def limit(self, cycles: int) -> None: ...
    @property
    def calls(self) -> int: ...
    @property
    def total_cycles(self) -> int: ...
    @property
    def max_cycles(self) -> int: ...
    @property
    def last_cycles(self) -> int: ...
    def __repr__(self) -> str: ...

@final
class Wait(Task):
    waits: int
    def __init__(self, function: Any, cost: Any = 0, limit: Any = 0, name: Any = None) -> None: ...

@final
class Occasional(Task):
    tasks: list[Any]
    position: int
    extra_idle_call: bool
    def __init__(self, tasks: Any, cost: Any = 20, limit: Any = 0, name: Any = 'occasional', extra_idle_call: bool = True) -> None: ...
    def next_task(self) -> Task: ...

@final
class Schedule:
    slot_ns: int
    divider: int
    tick_cost: int
    tick_slot: int
    tick_latency: int
    every: list[Any]
    rows: list[Any]
    last: list[Any]
    completion_flag: bool
    announces: bool
    def __init__(self, slot_us: Any = 500, every: Any = ..., rows: Any = ..., last: Any = ..., occasional: Any = None, occasional_row: Any = 0, divider: int = 1, completion_flag: bool = True, tick_cost: int = 60, tick_slot: int = 4, tick_latency: Any = None, slot_ns: Any = None, extra_idle_call: Any = True, speakers: Any = None) -> None: ...
    def row_tasks(self, row: int) -> list[Any]: ...
    def all_tasks(self) -> list[Any]: ...

@final
class SlotScheduler:
    position: int
    end: int
    done: bool
    late: bool
    recording: bool
    started: bool
    row: int
    row_count: int
    announces: bool
    tasks: list[Any]
    functions: list[Any]
    @property
    def numbers(self) -> MutableSequence[int]: ...
    divider_count: int
    divider: int
    row_start: int
    run_before: int
    slot_count: int
    listed_tasks: int
    slot_time: int
    tick_time: int
    finished_time: int
    slot_cycles: int
    near_limit_cycles: int
    histogram_step: int
    last_slot_cycles: int
    total_slot_cycles: int
    max_slot_cycles: int
    row_starts: MutableSequence[int]
    histogram: MutableSequence[int]
    @property
    def table_kept(self) -> MutableSequence[int]: ...
    @property
    def leads_kept(self) -> MutableSequence[int]: ...
    schedule: Schedule
    ns_per_cycle: float
    slot_ns: int
    overruns: int
    dropped_tasks: int
    near_limits: int
    late_time: int
    late_count: int
    late_row: int
    log: ActivityLog
    def __init__(self, schedule: Schedule, slot_cycles: int, ns_per_cycle: float = 0.0) -> None: ...
    def layout(self) -> None: ...
    def retune(self, ns_per_cycle: Any) -> None: ...
    def lay(self, task: Task) -> None: ...
    def lay_leads(self) -> None: ...
    def speaks_from(self, code_time: int, tick_time: int) -> int: ...
    def counters(self) -> SlotCounters: ...
    @property
    def run_tasks(self) -> int: ...
    def tick(self, timer_time: int) -> bool: ...
    def close(self, cycles: int) -> bool: ...
    def attach_log(self, log: ActivityLog | None) -> None: ...
    def log_begin(self) -> None: ...
    def log_overrun(self, time: int) -> None: ...
    def log_end(self, since: int, time: int, cycles: int) -> None: ...
    def find(self, name: Any) -> Any: ...
    def replace(self, name: Any, function: Any, cost: Any = None, limit: Any = None, per_item: Any = None) -> Any: ...
    def task_cycles(self) -> dict[Any, Any]: ...
