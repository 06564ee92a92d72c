"""A board's counters, by name. The board reports them itself (`Board.counters`), in this process or another."""

import dataclasses
import types
import typing
from typing import Any, TypeVar

Counters = TypeVar("Counters")


@dataclasses.dataclass(frozen=True)
class SlotCounters:
    """How a board kept its slots. Cycles are those of whole slots, interrupts included."""

    count: int
    latest_ns: int  # start of the latest slot
    finished_ns: int  # end of the latest row that ran to its end, or of the last task of one that was cut short
    overruns: int
    dropped_tasks: int
    near_limits: int
    max_cycles: int
    total_cycles: int
    histogram: list[int]  # slots by cycles: bins of 5 % of a slot, the last one for overruns
    slot_ns: int  # length of a slot


@dataclasses.dataclass(frozen=True)
class CanCounters:
    """One CAN controller, and the program's queues at it."""

    controller: int
    received: int
    sent: int
    data_overruns: int  # frames that came while both receive buffers were taken
    receive_lost: int  # frames that a full receive queue did not take
    queue_full: int  # frames that a full transmit queue did not take
    skipped: int = 0  # frames that were not sent because the one before still waited


@dataclasses.dataclass(frozen=True)
class BoardCounters:
    """A board of `hz` core clock. `unclaimed`: messages for which it has no peripheral."""

    hz: int
    unclaimed: int
    slots: SlotCounters
    can: list[CanCounters] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class ProcessorCounters:
    """A processor that executes a firmware image: all instructions and cycles, and those of them that were skipped in
    loops that waited, which alone depend on the steps in which time was passed.
    """

    instructions: int
    cycles: int
    idle_instructions: int
    idle_cycles: int


@dataclasses.dataclass(frozen=True)
class ProgramCounters(BoardCounters):
    """Further values of its program. `time_ms`: the machine's time as the program has it; `errors`: how often it noted
    each error, by error number.
    """

    time_ms: int = 0
    errors: list[int] = dataclasses.field(default_factory=list)


def as_dict(counters: Any) -> dict[str, Any]:
    """Counters as numbers, lists and dictionaries of them, as JSON can carry them."""
    return dataclasses.asdict(counters)


def from_dict(kind: type[Counters], found: dict[str, Any]) -> Counters:
    """Counters of the class `kind` from what `as_dict` gave; TypeError for a name that is missing or unknown."""
    types_of = typing.get_type_hints(kind)
    return kind(**{name: _value(types_of.get(name), each) for name, each in found.items()})


def _value(kind: Any, found: Any) -> Any:
    """A field of the type `kind`: a number, counters, a list of either, or None."""
    if isinstance(kind, types.UnionType) and found is not None:
        [kind] = (each for each in kind.__args__ if each is not types.NoneType)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type) and found is not None:
        return from_dict(kind, found)
    if typing.get_origin(kind) is list:
        [item] = typing.get_args(kind)
        return [_value(item, each) for each in found]
    return found
