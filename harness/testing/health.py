"""Checks for what no healthy robot does: overruns, lost frames, bus errors, bus-off, errors beyond the normal, a fall.

It also reports an injected fault that never acted: what the test saw proves nothing about that fault.

The columns normal_per_s and normal_at_start of the master table's errors.csv define what is normal. A test may expect
what is not normal; an expected event that does not occur is a fault as well.
"""

import dataclasses
import re
from collections.abc import Iterable, Mapping
from typing import Any

from ranger_sim.can_bus.node import BUS_OFF
from ranger_sim.firmware_sim.counters import ProgramCounters
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.names import Names
from ranger_sim.harness.normal_errors import most_normal
from ranger_sim.harness.records import vital_signs

# Further errors of a board when an event that the test expects occurs.
OF_OVERRUNS = ("ASCHED_DNF", "SCHED_SLOT_NEAR_LIMIT", "SCHED_TASK_LIMIT")
OF_BUS_ERRORS = re.compile(r"CAN\d_(BUS_RX|BUS_TX|ERR_WARN|ERR_PASS|TX_BUSOFF)")
OF_BUS_OFF = re.compile(r"CAN\d_\w+")

Amount = bool | int | str


@dataclasses.dataclass(frozen=True)
class Expected:
    """What a test expects beyond the normal, and fails without.

    errors: names of the table, or "MCH:AE_SPIKE" for one board. overruns, lost_frames, bus_errors, bus_off, dead: True
    (at least one), a number (exactly that many), or the name of the board or bus that has them. fall: it falls.
    idle_faults: injected faults that do not act, in the same form; a name is place and mode.
    """

    errors: tuple[str, ...] = ()
    overruns: Amount = False
    lost_frames: Amount = False
    bus_errors: Amount = False
    bus_off: Amount = False
    dead: Amount = False
    fall: bool = False
    idle_faults: Amount = False

    def check(self, names: Names, boards: Iterable[str]) -> None:
        """UserError for an error that is not in the table, and for a board that the machine does not have."""
        for text in self.errors:
            board, _, name = text.rpartition(":")
            if name not in names.codes:
                raise UserError(f"expected error {text!r}: {unknown('error', name, names.codes)}")
            if board and board not in boards:
                raise UserError(f"expected error {text!r}: {unknown('board', board, boards)}")


@dataclasses.dataclass(frozen=True)
class Seen:
    """All counts at one time."""

    time_ns: int
    boards: Mapping[str, ProgramCounters]
    lost: Mapping[str, int]  # by bus: frames that a receiving node did not get
    bus_errors: Mapping[str, int]  # by bus
    flushed: Mapping[str, int]  # by board: frames that waited when it went bus-off
    off: tuple[str, ...]  # boards with a controller that is bus-off now


def observe(robot: Any) -> Seen:
    """Take the counts."""
    boards = robot.counters()
    lost, errors = {}, {}
    flushed: dict[str, int] = {}
    off = set()
    for bus in robot.buses:
        figures = vital_signs.can(robot, bus, boards)
        lost[bus.name], errors[bus.name] = figures["lost"] + figures["queue_full"], figures["errors"]
        for node in bus.nodes:
            flushed[node.name] = flushed.get(node.name, 0) + node.flushed
            if node.mode == BUS_OFF:
                off.add(node.name)
    for end in robot.polled:
        if hasattr(end, "overflow"):  # a bus on an interface outside
            lost[end.name] += end.counters()["overflow"]
            errors[end.name] += end.errors
    return Seen(robot.loop.time, boards, lost, errors, flushed, tuple(sorted(off)))


class Health:
    """Monitors `robot` from now on; `faults` returns what happened since, and starts again.

    from_power_up: events since power-up count as well, and errors that are normal once after it are accepted.
    """

    def __init__(self, robot: Any, from_power_up: bool = False) -> None:
        self.robot = robot
        whole = from_power_up or robot.loop.time <= robot.start_ns
        self.before: Seen | None = None if whole else observe(robot)
        self.had_fallen = bool(robot.ended) and not whole
        self.judged_faults = 0 if whole else len(robot.faults)  # injected before monitoring began

    def faults(self, expected: Expected | None = None) -> list[str]:
        """A line for each unexpected event, and for each expected one that did not occur."""
        wanted = expected if expected is not None else Expected()
        wanted.check(self.robot.names, self.robot.boards)
        now, before = observe(self.robot), self.before
        off = wanted.bus_off is not False
        lost = since(now.lost, before.lost if before is not None else {})
        broken = since(now.bus_errors, before.bus_errors if before is not None else {})
        found = [
            *self._errors(wanted, now, before),
            *amount("slot overruns", wanted.overruns, self._overruns(now, before)),
            *amount("lost frames", wanted.lost_frames, lost, off),
            *amount("error frames", wanted.bus_errors, broken, off),
            *amount("bus-off", wanted.bus_off, self._bus_off(now, before)),
            *amount("boards that do not run", wanted.dead, self._dead(now)),
            *self._fall(wanted),
            *amount("injected faults that did not act", wanted.idle_faults, self._idle()),
        ]
        found += [
            line
            for end in self.robot.polled
            if hasattr(end, "watch") and end.watch.faults
            for line in end.watch.lines()
        ]
        self.before, self.had_fallen = now, bool(self.robot.ended)
        self.judged_faults = len(self.robot.faults)
        return found

    def _errors(self, wanted: Expected, now: Seen, before: Seen | None) -> list[str]:
        start_ns = self.robot.start_ns if before is None else before.time_ns
        passed_s = (now.time_ns - start_ns) * 1e-9
        names = self.robot.names
        missing = set(wanted.errors)
        found = []
        for board, counters in now.boards.items():
            for code, total in enumerate(counters.errors):
                events = total - (before.boards[board].errors[code] if before is not None else 0)
                if not events:
                    continue
                name = names.errors.get(code, str(code))
                of_test = {name, f"{board}:{name}"} & set(wanted.errors)
                missing -= of_test
                if of_test or excused(wanted, board, name):
                    continue
                rate = names.normal_per_s.get(code, {}).get(board, 0.0)
                if events > most_normal(names, board, code, passed_s, before is None):
                    normal = f"normal is up to {rate:g} a second" if rate else "normal is none"
                    meaning = names.descriptions.get(code, "")
                    found.append(f"{board}: {events} x {name} ({meaning}) in {passed_s:.3f} s, {normal}")
        found += [f"expected and not seen: error {text}" for text in sorted(missing)]
        return found

    @staticmethod
    def _overruns(now: Seen, before: Seen | None) -> dict[str, int]:
        return since(
            {name: board.slots.overruns for name, board in now.boards.items()},
            {name: board.slots.overruns for name, board in before.boards.items()} if before is not None else {},
        )

    def _bus_off(self, now: Seen, before: Seen | None) -> dict[str, int]:
        """Boards that are bus-off, or were: their error module reports it, or frames were discarded."""
        found = since(now.flushed, before.flushed if before is not None else {})
        for name, board in now.boards.items():
            for code, total in enumerate(board.errors):
                if self.robot.names.errors.get(code, "").endswith("_TX_BUSOFF"):
                    found[name] = found.get(name, 0) + total
                    found[name] -= before.boards[name].errors[code] if before is not None else 0
        for name in now.off:
            found[name] = max(1, found.get(name, 0))
        return found

    def _dead(self, now: Seen) -> dict[str, int]:
        lost = {death["board"] for death in self.robot.deaths}
        alive = vital_signs.alive
        return {name: int(name in lost or not alive(self.robot, board)) for name, board in now.boards.items()}

    def _idle(self) -> dict[str, int]:
        """How many faults injected since then have not acted, by place; without cancelled ones."""
        idle: dict[str, int] = {}
        for fault in self.robot.faults[self.judged_faults :]:
            called_off = fault.stop_wanted and fault.activated_ns < 0
            if not fault.acted and not called_off:
                name = f"{fault.place.name}:{fault.mode}"
                idle[name] = idle.get(name, 0) + 1
        return idle

    def _fall(self, wanted: Expected) -> list[str]:
        robot = self.robot
        fell = bool(robot.ended) and not self.had_fallen
        if fell and not wanted.fall:
            return [f"{robot.end_word} ({robot.ended}) at {robot.time_s:.3f} s{robot.whereabouts()}"]
        if wanted.fall and not fell:
            return [f"expected and not seen: {robot.end_name}"]
        return []


def excused(wanted: Expected, board: str, name: str) -> bool:
    """Whether an error follows from another event that the test expects."""
    if wanted.overruns and name in OF_OVERRUNS:
        return not isinstance(wanted.overruns, str) or wanted.overruns == board
    if wanted.bus_off and OF_BUS_OFF.fullmatch(name):
        return True
    return bool(wanted.bus_errors) and OF_BUS_ERRORS.fullmatch(name) is not None


def since(now: Mapping[str, int], before: Mapping[str, int]) -> dict[str, int]:
    """How much each has grown."""
    return {name: count - before.get(name, 0) for name, count in now.items()}


def amount(what: str, wanted: Amount, found: Mapping[str, int], may_be: bool = False) -> list[str]:
    """Lines for unexpected counts, and for missing expected ones; `found`: how many, by board or bus.

    may_be: it follows from another event that the test expects.
    """
    there = {name: count for name, count in found.items() if count}
    listed = ", ".join(f"{name} {count}" for name, count in there.items())
    if wanted is False:
        return [f"{what}: {listed}"] if there and not may_be else []
    if wanted is True:
        return [] if there else [f"expected and not seen: {what}"]
    if isinstance(wanted, str):
        others = {name: count for name, count in there.items() if name != wanted}
        lines = [] if wanted in there else [f"expected and not seen: {what} of {wanted}"]
        return lines + ([f"{what}: {listed}, expected only of {wanted}"] if others else [])
    total = sum(there.values())
    return [] if total == wanted else [f"{what}: {listed or 'none'}, expected are {wanted}"]
