"""The variables of a walk as one ASAM MDF 4 file.

MDF 4 is the measurement format of the CAN world: asammdf's viewer, CANape, INCA, PlotJuggler (with its
plug-in) and MATLAB open it, and it keeps unit, description and a time base per channel. Each variable
of the data table is one channel at the times when its value or its stamp changed, so a variable sent
at 45 Hz has 45 samples a second.
"""

import pathlib
import tempfile
import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np

from ranger_sim import datatable
from ranger_sim.datatable.generated import all_variables
from ranger_sim.tools.recordings.mdf_writer import Channel, MdfWriter
from ranger_sim.tools.recordings.mdf_writer import Group as MdfGroup

# (group name, time in s, [(channel, unit, description, samples)])
Group = tuple[str, Any, list[tuple[str, str, str, Any]]]

DTYPES = {"f32": "<f4", "i32": "<i4", "u32": "<u4"}
WORD = np.dtype([("time_s", "<f8"), ("word", "<u4")])  # a row of a variable, before conversion to its type
FLUSH_S = 5.0  # of virtual time: the loss of a slow variable in a killed run; chosen by us


class VariablesFile:
    """The file, filled block by block as the run's recorder hands them over. OSError when it cannot be written.

    `robot`: a `ranger.robot.Ranger` that has not been closed.
    """

    def __init__(self, robot: Any, path: pathlib.Path) -> None:
        self.start_ns = robot.start_ns
        self.numbers = np.array(list(all_variables.NAMES), dtype=np.int64)
        self.sampled = len(robot.plant.sample_names)
        scenario = robot.scenario
        properties = {
            "author": "ranger-sim",
            "subject": "a walk of the Cornell Ranger, simulated",
            "controller": str(scenario.controller),
            "body": str(scenario.body),
            "seed": str(scenario.seed),
            "data table": datatable.table_hash(),
        }
        self.writer = MdfWriter(path, groups_of(robot), properties)
        self.last: Any = None  # words of the last row
        self.last_s = 0.0
        self.written_s = np.full(len(self.numbers), -np.inf)  # when each variable was written last
        self.flush_at_s = FLUSH_S

    def add_samples(self, rows: Any) -> None:
        """Rows of the body's samples: time in s, then the values."""
        found = np.array(rows, dtype="<f8")
        found[:, 0] -= self.start_ns * 1e-9
        dtype = np.dtype([("time_s", "<f8"), *((f"value_{place}", "<f8") for place in range(self.sampled))])
        self.writer.append(0, np.ascontiguousarray(found).view(dtype).ravel())

    def add_words(self, rows: Any) -> None:
        """Rows of the main brain's table: time in ns, then every word. Unchanged words are left out."""
        if not len(rows):
            return
        time_s = (rows[:, 0] - self.start_ns) * 1e-9
        words = rows[:, 1:][:, self.numbers]
        changed = np.ones(words.shape, dtype=bool)
        changed[1:] = words[1:] != words[:-1]
        if self.last is not None:
            changed[0] = words[0] != self.last
        self._append(changed, time_s, words)
        self.last, self.last_s = words[-1].copy(), float(time_s[-1])
        if self.last_s >= self.flush_at_s:
            self.flush_at_s = self.last_s + FLUSH_S
            self.writer.flush()

    def _append(self, changed: Any, time_s: Any, words: Any) -> None:
        variables, at = np.nonzero(changed.T)
        if not len(at):
            return
        rows = np.empty(len(at), dtype=WORD)
        rows["time_s"] = time_s[at]
        rows["word"] = words[at, variables].astype(np.uint32)
        present, begins = np.unique(variables, return_index=True)
        for variable, part in zip(present, np.split(rows, begins[1:]), strict=True):
            self.written_s[variable] = part["time_s"][-1]
            self.writer.append(1 + int(variable), part)

    def close(self) -> None:
        """Finish the file: every variable's last value is repeated at the last time."""
        if self.last is not None:
            late = (self.written_s < self.last_s)[np.newaxis, :]
            self._append(late, np.array([self.last_s]), self.last[np.newaxis, :])
        self.writer.close()

    def abandon(self) -> None:
        """Close the file without finishing it; its content can be read."""
        self.writer.abandon()


def groups_of(robot: Any) -> list[MdfGroup]:
    """The body, then a group for every variable."""
    body = tuple(
        Channel(f"plant.{name}", unit, "true state of the body", "<f8")
        for name, unit in robot.plant.sample_names.items()
    )
    descriptions = {row.id: row.description for row in datatable.load().variables}
    variables = (
        Channel(name, all_variables.UNITS[number], descriptions[number], DTYPES[all_variables.TYPES[number]])
        for number, name in all_variables.NAMES.items()
    )
    return [MdfGroup("plant", body), *(MdfGroup(each.name, (each,)) for each in variables)]


def write(robot: Any, path: pathlib.Path) -> None:
    """Write the contents of the robot's log. `robot`: a `ranger.robot.Ranger` whose log was not "none"."""
    file = VariablesFile(robot, path)
    try:
        for rows in robot.logbook.kept("samples"):
            file.add_samples(rows)
        for rows in robot.logbook.kept("words"):
            file.add_words(rows)
        file.close()
    finally:
        file.abandon()


def write_groups(groups: Iterable[Group], path: pathlib.Path) -> None:
    """Groups of channels from elsewhere, whole or not at all."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's dependencies announce their own deprecations on import
        from asammdf import MDF, Signal

        with MDF(version="4.10") as file:
            for name, time_s, channels in groups:
                file.append(
                    [
                        Signal(samples=values, timestamps=time_s, name=channel, unit=unit, comment=comment)
                        for channel, unit, comment, values in channels
                    ],
                    comment=name,
                    common_timebase=True,
                )
            with tempfile.TemporaryDirectory(dir=path.parent, prefix=".mdf") as folder:
                saved = file.save(pathlib.Path(folder) / path.name, compression=2)
                pathlib.Path(saved).replace(path)
