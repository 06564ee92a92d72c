"""Sends the frames of absent boards, so that the others receive what they need at the right rates.

Each variable has its period (the bus schedule's numbers included) and its value: the table's initial one until
`set` changes it. Without the router this module also sends its TIMESTAMP, and the commands of the main brain: once
each at the start and then by the schedule; those that the schedule does not name once a second.
"""

from __future__ import annotations

import heapq
import math
from fractions import Fraction

from ranger_sim.datatable.model import Table, Variable
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside.bus_schedule import command_variables, robots_table, schedule_of_board
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.outside.supervision import SYNC, expected_periods

DATA_8 = 8  # flags of a data frame of eight bytes
SPREAD_NS = 137_000  # between first sendings, so that frames do not come all at once; chosen by us: longer than a frame
ON_DEMAND_NS = 1_000_000_000  # chosen by us: a board that is switched on later has every command within a second


class RestBus:
    """The generator for the absent boards of a profile. Frames as tuples (time_ns, bus, identifier, flags, lo, hi)."""

    def __init__(self, profile: Profile, start_ns: int = 0, table: Table | None = None) -> None:
        self.table = table if table is not None else robots_table()
        self.start_ns = start_ns
        self.words: dict[int, int] = {}
        self.sync_id = self.table.variable(SYNC).id
        self.frames = 0
        self._due: list[tuple[int, int, str, int, int]] = []  # next, order, bus, identifier, period in ns
        schedules = profile.schedules()
        absent = profile.absent()
        router, brain = self.table.with_role("router")[0], self.table.with_role("main brain")[0]
        for name in absent:
            board = self.table.board(name)
            if board.role == "satellite":
                for variable_name, (_, gap) in expected_periods(board, schedule_of_board(schedules, board)).items():
                    variable = self.table.variable(variable_name)
                    if not variable.is_error_word and self._is_needed(variable, absent):
                        self._add(variable, board.buses[0].lower(), int(gap * 1_000_000))
        if router.name in absent:
            sync = self.table.variable(SYNC)
            for bus in profile.buses:
                self._add(sync, bus, int((sync.period_ms or Fraction(1)) * 1_000_000))
            # without the router the main brain reaches no board (see harness/outside/profile.py), so both are absent
            slot_ns = brain.slot_us * 1000
            for variable in command_variables(self.table):
                for bus, schedule in schedules.items():
                    if bus.upper() in variable.buses and self._is_needed(variable, absent):
                        named = variable.name in schedule.every
                        period = slot_ns * schedule.turns(variable.name) if named else ON_DEMAND_NS
                        self._add(variable, bus, period)

    def _is_needed(self, variable: Variable, absent: tuple[str, ...]) -> bool:
        """True when a present board subscribes to it."""
        return any(name not in absent and self.table.board(name).firmware for name in variable.subscribers)

    def _add(self, variable: Variable, bus: str, period_ns: int) -> None:
        order = len(self._due)
        first = self.start_ns + (order * SPREAD_NS) % period_ns
        heapq.heappush(self._due, (first, order, bus, variable.id, period_ns))
        self.words[variable.id] = word_of_value(variable.type, variable.initial_as_stored)

    def set(self, name: str, value: float) -> None:
        """Send `value` from now on. UserError when no absent board sends this variable or the value does not fit."""
        variable = self.table.variable(name)
        if variable.id not in self.words or variable.id == self.sync_id:
            raise UserError(f"rest-bus: {variable.name} is not sent from here; {variable.publisher} sends it")
        low, high = variable.minimum, variable.maximum
        if not math.isfinite(value) or (low is not None and value < low) or (high is not None and value > high):
            raise UserError(
                f"rest-bus: {variable.name} = {value!r} is outside {low} to {high} {variable.unit}".rstrip()
            )
        try:
            self.words[variable.id] = word_of_value(variable.type, value)
        except (ValueError, OverflowError) as error:
            raise UserError(f"rest-bus: {variable.name} = {value!r}: {error}") from None

    @property
    def next_time(self) -> int:
        """When the next frame is due, ns; NEVER without absent boards."""
        return self._due[0][0] if self._due else NEVER

    def due(self, now_ns: int) -> list[tuple[int, str, int, int, int, int]]:
        """Every frame due up to and including `now_ns`, in order of time, stamped with the network time."""
        found = []
        while self._due and self._due[0][0] <= now_ns:
            time, order, bus, identifier, period = self._due[0]
            heapq.heapreplace(self._due, (time + period, order, bus, identifier, period))
            stamp = (time - self.start_ns) // 1_000_000 & 0xFFFFFFFF
            word = stamp if identifier == self.sync_id else self.words[identifier]
            found.append((time, bus, identifier, DATA_8, word, stamp))
        self.frames += len(found)
        return found
