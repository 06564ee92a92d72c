"""A board whose program in C runs in another process, as the machine sees it before that process starts.

The program is never loaded here. What the machine has to know of it comes from its trial, as JSON: `description`.
"""

import dataclasses
from typing import Any

from ranger_sim.firmware_sim.legend import InterruptLegend, Legend, TaskLegend
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import FirmwareError

KINDS = {"str": str, "int": int, "bool": bool, "float": float}


def description(board: Any) -> dict[str, Any]:
    """Of a board with its program, in the process of its trial."""
    return {
        "legend": dataclasses.asdict(board.legend()),
        "names_transmitters": bool(board.scheduler.names_transmitters),
        "next_time": board.next_time,
    }


class StandIn(Microcontroller):
    """Board `name`: its inbox and its wires are here, its program is not. UserError for an unreadable description."""

    def __init__(self, name: str, hz: int, crystal: Any, found: Any) -> None:
        Microcontroller.__init__(self, name, hz, crystal)
        self.out_of_process = True
        try:
            self.described = _legend(found["legend"])
            self.names_transmitters = _checked(found, "names_transmitters", bool)
            self.next_time = _checked(found, "next_time", int)
        except (KeyError, TypeError, ValueError, IndexError):
            raise FirmwareError(f"{name}: its program writes over the description of its schedule") from None

    def legend(self) -> Legend:
        return self.described

    def connect_edges(self, buffer: EdgeBuffer, pin: int, partner_pin: int) -> None:
        """Nothing: edges go to the process as messages."""

    def write_counts(self) -> None:
        """Nothing ran here."""

    def advance(self, until: int) -> int:
        raise FirmwareError(f"{self.name}: its program runs in a separate process, which has not been started")


def _checked(found: Any, name: str, kind: type) -> Any:
    value = found[name]
    if type(value) is not kind or (kind is not str and not -NEVER <= float(found[name]) <= NEVER):
        raise TypeError(name)
    return value


def _legend(found: Any) -> Legend:
    """A Legend of what `dataclasses.asdict` made of one."""
    tasks = tuple(_row(TaskLegend, each, entries=_numbers(each["entries"])) for each in found["tasks"])
    interrupts = tuple(_row(InterruptLegend, each) for each in found["interrupts"])
    rows = tuple(_numbers(row) for row in found["rows"])
    if not (found["slot_ns"] >= 0 and all(0 <= number < len(tasks) for row in rows for number in row)):
        raise ValueError("a row with an unknown task")
    return _row(Legend, found, tasks=tasks, interrupts=interrupts, rows=rows)


def _row(kind: Any, found: Any, **parts: Any) -> Any:
    plain = {
        each.name: _checked(found, each.name, _kind(each))
        for each in dataclasses.fields(kind)
        if each.name not in parts
    }
    return kind(**plain, **parts)


def _kind(field: Any) -> type:
    return KINDS[field.type] if isinstance(field.type, str) else field.type


def _numbers(found: Any) -> tuple[int, ...]:
    if not all(type(each) is int for each in found):
        raise TypeError("numbers")
    return tuple(found)
