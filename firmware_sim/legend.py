"""The meaning of the numbers in a board's activity log: its tasks, interrupts, slots, by name."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class TaskLegend:
    """One line of a board's schedule, in cycles; `limit` 0: no limit. `entries`: of an occasional list."""

    name: str
    cost: int
    limit: int
    per_item: int
    item: str
    spins: bool = False  # until something has happened
    entries: tuple[int, ...] = ()  # task numbers, in the order in which they come round


@dataclasses.dataclass(frozen=True)
class InterruptLegend:
    """One source of the vectored interrupt controller, in cycles. `fast`: it is on the FIQ."""

    name: str
    cost: int
    per_item: int
    latency: int
    fast: bool


@dataclasses.dataclass(frozen=True)
class Legend:
    """A board of `hz` core clock. Tasks and interrupts are at their numbers; `rows`: task numbers by row, in order.

    `cycles_per_ns` is that of its own crystal, `slot_ns` and `slot_cycles` the length of a slot of its schedule.
    """

    board: str
    hz: int
    cycles_per_ns: float
    slot_ns: int
    slot_cycles: int
    tasks: tuple[TaskLegend, ...]
    interrupts: tuple[InterruptLegend, ...]
    rows: tuple[tuple[int, ...], ...]
