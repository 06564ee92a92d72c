"""Logs of a session: RoboDAQ's text format, and the measurement format of `ranger-sim walk` (ASAM MDF 4)."""

from __future__ import annotations

import array
import pathlib
from collections.abc import Iterator
from typing import IO, Any, Protocol

from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.files import writable_folder
from ranger_sim.tools.robodaq import catalogue
from ranger_sim.tools.robodaq.codec import Point


class Log(Protocol):
    """Receives every point; `close` finishes the file."""

    path: pathlib.Path

    def on_point(self, point: Point) -> None:
        """Keep a point."""

    def close(self) -> None:
        """Finish the file."""


class TextLog:
    """`NAME<tab>id` per variable, then `id<tab>value<tab>robot time in ms` per point (robot.md C6.1)."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.file: IO[str] = path.open("w", encoding="utf-8", newline="\n")
        for number, name in all_variables.NAMES.items():
            self.file.write(f"{name}\t{number}\t\n")

    def on_point(self, point: Point) -> None:
        self.file.write(f"{point.number}\t{catalogue.text_of(point.number, point.word)}\t{point.stamp}\n")

    def close(self) -> None:
        self.file.close()


class MeasurementLog:
    """One channel per variable at the times at which its value was written; the file is written at the end.

    A value never written (stamp 0), a repeated one, or one whose stamp lies before the last one is left out, because
    time runs forward in this format.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.stamps: dict[int, array.array[int]] = {}
        self.values: dict[int, array.array[float]] = {}

    def on_point(self, point: Point) -> None:
        stamps = self.stamps.get(point.number)
        if stamps is None:
            stamps = self.stamps[point.number] = array.array("q")
            self.values[point.number] = array.array("d")
        if point.stamp == 0 or (stamps and point.stamp <= stamps[-1]):
            return
        stamps.append(point.stamp)
        self.values[point.number].append(catalogue.value_of(point.number, point.word))

    def groups(self) -> Iterator[tuple[str, Any, list[tuple[str, str, str, Any]]]]:
        """(group, time in s, [(channel, unit, description, samples)]) of every variable that was written."""
        import numpy as np

        for number in sorted(self.stamps):
            name = all_variables.NAMES[number]
            row = parameters.find(name)
            kind = {"f32": np.float32, "i32": np.int64, "u32": np.int64}[row.type]
            if len(self.stamps[number]):
                yield (
                    name,
                    np.array(self.stamps[number], dtype=float) * 1e-3,
                    [(name, row.unit, row.description, np.array(self.values[number]).astype(kind))],
                )

    def close(self) -> None:
        from ranger_sim.tools.recordings import variables_file

        variables_file.write_groups(self.groups(), self.path)


def open_log(name: str) -> Log:
    """A log whose format follows from the name's ending: .txt or .mf4."""
    path = pathlib.Path(name)
    if path.suffix not in (".txt", ".mf4"):
        raise UserError(f"--log {name}: the name must end in .txt (RoboDAQ's text) or .mf4 (ASAM MDF 4)")
    if path.is_dir():
        raise UserError(f"--log {name}: this is a folder, a file is needed")
    writable_folder(path.parent)
    return TextLog(path) if path.suffix == ".txt" else MeasurementLog(path)
