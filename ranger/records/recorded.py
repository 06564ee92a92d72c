"""The records of a run, as arrays for reports and files. Times are s since power-up."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np

from ranger_sim import datatable
from ranger_sim.boards.counters import RangerCounters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.ranger.conditions import STATE_VARIABLES, state_names


@dataclasses.dataclass
class Series:
    """One variable over time: name, unit, description, time_s and values (arrays of one length)."""

    name: str
    unit: str
    description: str
    time_s: np.ndarray
    values: np.ndarray


class Recorded:
    """The kept part of a run. `robot`: a Ranger whose log is not "none".

    samples: dict of arrays by the plant's sample names, and time_s. steps: (number, length_m, time_s,
    onto_outer) arrays of the last steps. bus_load: {bus: (time_s, load 0-1)}. slot_histograms: {board:
    (percent of the slot, count)}.
    """

    def __init__(self, robot: Any) -> None:
        self.robot = robot
        rows = robot.logbook.samples()
        self.samples = {"time_s": rows[:, 0] - robot.start_ns * 1e-9}
        for column, name in enumerate(robot.plant.sample_names, start=1):
            self.samples[name] = rows[:, column]
        self.word_times_ns, self.words = robot.logbook.words()
        self.steps = robot.plant.recent_steps()
        self.bus_load = {bus.name: self._load(bus) for bus in robot.buses}
        self.slot_histograms = {name: self._histogram(counters) for name, counters in robot.counters().items()}
        self.footholds = robot.plant.recent_footholds()

    def _load(self, bus: Any) -> Any:
        windows = np.array(bus.load.windows())
        last = bus.load.count * 0.01
        return last - 0.01 * np.arange(len(windows), 0, -1) + 0.005, windows

    @staticmethod
    def _histogram(counters: RangerCounters) -> Any:
        counts = np.array(counters.slots.histogram)
        return 5.0 * np.arange(len(counts)), counts

    def machine_states(self, machine: str) -> Any:
        """(time_s, state numbers, {number: name}) of one of the main brain's machines."""
        number = all_variables.ID_OF[STATE_VARIABLES[machine]]
        states = self.words[:, number].astype(int)
        return self._seconds(self.word_times_ns), states, state_names(self.robot, machine)

    def state_text(self, times_s: Any) -> list[list[str]]:
        """The states of hip and feet at the given times, three lines each."""
        parts = []
        for machine in ("hip", "outer_foot", "inner_foot"):
            time, states, names = self.machine_states(machine)
            at = np.clip(np.searchsorted(time, times_s, side="right") - 1, 0, max(0, len(states) - 1))
            parts.append([f"{machine.replace('_', ' ')}: {names.get(int(states[i]), '?')}" for i in at])
        return [list(row) for row in zip(*parts, strict=True)]

    def _seconds(self, time_ns: Any) -> Any:
        return (time_ns - self.robot.start_ns) * 1e-9

    def variables(self) -> Iterator[Any]:
        """Yield a Series for every variable that was ever written, at the times when it changed."""
        time_s = self._seconds(self.word_times_ns)
        descriptions = {row.id: row.description for row in datatable.load().variables}
        for number, name in all_variables.NAMES.items():
            column = self.words[:, number]
            if len(column) == 0:
                continue
            changed = np.concatenate([[True], column[1:] != column[:-1]])
            changed[-1] = True
            words = column[changed].astype(np.uint32)
            kind = all_variables.TYPES[number]
            values = words.view({"f32": np.float32, "i32": np.int32, "u32": np.uint32}[kind])
            yield Series(name, all_variables.UNITS[number], descriptions[number], time_s[changed], values)
