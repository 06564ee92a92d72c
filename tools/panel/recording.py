"""The page's source for recordings: a run's folder, MF4, RoboDAQ's text, CSV, or frames with their DBC files."""

from __future__ import annotations

import dataclasses
import math
import pathlib
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ranger_sim import datatable
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.readers import run_folder
from ranger_sim.sysid.recipe import Recipe
from ranger_sim.sysid.twins import steps
from ranger_sim.tools.panel.channels import EMPTY, Channel, Times, Trace, Values, between, thinned
from ranger_sim.tools.panel.inside.buses import Bus
from ranger_sim.tools.panel.inside.recorded import NO_SLOTS, REPORTED_SLOTS, Decoded, RunLogs
from ranger_sim.tools.panel.source import ANKLES, KNOWN_POSE, LEGS, TRUE_POSE, Source, known_pose, known_states
from ranger_sim.tools.recordings import datasets

TRUTH = "plant."  # begins the names of quantities that only a simulation knows of the body


@dataclasses.dataclass(frozen=True)
class Event:
    """A channel becomes equal to, less or greater than a value: two recordings are aligned by their first one."""

    channel: str
    sign: str
    value: float

    @classmethod
    def typed(cls, text: str) -> Event:
        """Parse `FSM_HIP = 3`, `hip_rad < -0.2`. UserError for other text."""
        found = re.fullmatch(r"\s*(\S+?)\s*([=<>])\s*(\S+)\s*", text)
        try:
            value = float(found[3]) if found else math.nan
        except ValueError:
            value = math.nan
        if found is None or not math.isfinite(value):
            raise UserError(f"event {text!r}: it reads like FSM_HIP = 3 or hip_rad < -0.2")
        return cls(found[1], found[2], value)

    def first(self, dataset: Dataset) -> float:
        """Its first time, s; not at the beginning, where it may have held for long. UserError if never."""
        channel = dataset.channels.get(self.channel) or dataset.channels.get(TRUTH + self.channel)
        if channel is None:
            raise UserError(f"{dataset.name}: {unknown('channel', self.channel, dataset.channels)}")
        is_so = {"=": np.equal, "<": np.less, ">": np.greater}[self.sign](channel.value, self.value)
        begins = np.flatnonzero(is_so[1:] & ~is_so[:-1]) + 1
        if not len(begins):
            raise UserError(f"{dataset.name}: {self.channel} {self.sign} {self.value:g} does not begin anywhere in it")
        return float(channel.time_s[begins[0]])


class RecordingSource(Source):
    """One or two recordings, the second overlaid on the first: `shift_s` later, after aligning the events of `align`.

    how: of `reading.open_recording`; options: the same as a command line has them. UserError for an unreadable
    recording, or one in which the event never occurs.
    """

    def __init__(
        self,
        paths: Sequence[str],
        how: Mapping[str, Any] | None = None,
        shift_s: float = 0.0,
        align: Event | None = None,
        options: Sequence[str] = (),
    ) -> None:
        super().__init__()
        how = dict(how or {})
        databases = how.get("databases", ())
        if how.get("recipe"):
            how["recipe"] = recipe = Recipe.load(how["recipe"])
            databases = databases or recipe.databases
        decoded = [Decoded(pathlib.Path(path), databases) if databases else None for path in paths]
        read_in = [read(path, how, frames) for path, frames in zip(paths, decoded, strict=True)]
        if align is not None:
            first, second = (align.first(dataset) for dataset in read_in)
            shift_s += first - second
        self.title = " and ".join(pathlib.Path(path).name for path in paths)
        known = {row.name: row for row in datatable.load().variables}
        self.data: list[tuple[np.ndarray, np.ndarray, float | None]] = []
        for number, (path, dataset) in enumerate(zip(paths, read_in, strict=True)):
            group = "" if number == 0 else f" ({pathlib.Path(path).name})"
            by_changes = (pathlib.Path(path) / run_folder.VARIABLES).is_file()  # it keeps changes, not samples
            for name, channel in dataset.channels.items():
                row = known.get(name)
                whose = "body" if name.startswith(TRUTH) else row.publisher if row is not None else "recording"
                description = row.description if row is not None else ""
                shown = name.removeprefix(TRUTH) + group
                states = known_states().get(name, {})
                self.channels.append(Channel(shown, channel.unit, description, whose + group, states))
                times = channel.time_s + (shift_s if number else 0.0)
                period = None if by_changes or len(times) < 3 else float(np.median(np.diff(times))) or None
                self.data.append((times, channel.value.astype(np.float32), period))
        if not self.data:
            raise UserError(f"{paths[0]}: there is no channel in it")
        self.inside = [
            inside_of(pathlib.Path(path), dataset, frames, shift_s if number else 0.0, self.span()[1], bool(number))
            for number, (path, dataset, frames) in enumerate(zip(paths, read_in, decoded, strict=True))
        ]
        self.loads = [bus for part in self.inside for bus in part.buses if bus.load is not None]
        self.channels += [channel for bus in self.loads for channel in bus.channels()]
        errors = any(name in known and name.startswith("ERROR_") for dataset in read_in for name in dataset.channels)
        walks = [path for path, dataset in zip(paths, read_in, strict=True) if steps.shows_steps(dataset.channels)]
        self.walks = tuple(pathlib.Path(path).name for path in walks)
        self.recordings = [[path, *options] for path in walks]
        offered = {"play": True, "errors": errors, "twins": bool(walks)}
        self.can = frozenset(name for name, is_so in offered.items() if is_so)
        self.number = {channel.name: place for place, channel in reversed(list(enumerate(self.channels)))}
        legs_known = any(all(name in self.number for name in pair) for pair in LEGS)
        if all(name in self.number for name in TRUE_POSE):
            self.pose_names = TRUE_POSE
        elif legs_known and all(name in self.number for name in ANKLES):
            self.pose_names = KNOWN_POSE

    async def run(self) -> None:
        """Read the logs of frames, which may take a minute for an hour of them."""
        self.is_coming = True
        for part in self.inside:
            await part.run()
        self.is_coming = False

    def recording(self, walk: int) -> list[str]:
        return self.recordings[walk]

    def close(self) -> None:
        """Close the logs."""
        for part in self.inside:
            part.close()

    def _load(self, channel: int) -> Bus | None:
        return self.loads[channel - len(self.data)] if channel >= len(self.data) else None

    def span(self) -> tuple[float, float]:
        times = [times for times, _, _ in self.data if len(times)]
        return (min(float(each[0]) for each in times), max(float(each[-1]) for each in times)) if times else (0.0, 0.0)

    def trace(self, channel: int, begin: float, end: float, points: int) -> Trace:
        if (bus := self._load(channel)) is not None:
            return bus.memory.trace(0, begin, end, points)
        times, values, period = self.data[channel]
        return thinned(times, values, begin, end, points, period) if len(times) else EMPTY

    def samples(self, channel: int, begin: float, end: float) -> tuple[Times, Values]:
        if (bus := self._load(channel)) is not None:
            times, shares = bus.memory.fine.rows()
            return between(times, shares[:, 0], begin, end)
        times, values, _ = self.data[channel]
        return between(times, values, begin, end)

    def values(self, wanted: list[int], at: float | None) -> list[float | None]:
        found: list[float | None] = []
        for channel in wanted:
            if (bus := self._load(channel)) is not None:
                found.append(bus.value(at))
                continue
            times, values, _ = self.data[channel]
            place = len(times) - 1 if at is None else int(np.searchsorted(times, at, side="right")) - 1
            value = float(values[place]) if place >= 0 else None
            found.append(value if value is not None and np.isfinite(value) else None)
        return found

    def pose(self, at: float | None) -> tuple[float, list[float]] | None:
        if not self.pose_names:
            return None
        wanted = TRUE_POSE if self.pose_names is TRUE_POSE else (*LEGS[0], *LEGS[1], *ANKLES)
        names = [name for name in wanted if name in self.number]
        values = dict(zip(names, self.values([self.number[name] for name in names], at), strict=True))
        known = [value for value in values.values() if value is not None]
        if self.pose_names is TRUE_POSE:
            found = known if len(known) == len(values) else None
        else:
            found = known_pose(values)
        return None if found is None else (self.span()[1] if at is None else at, found)

    def state(self, at: float | None) -> dict[str, Any]:
        end_s = self.span()[1]
        no_slots = f"{NO_SLOTS} {REPORTED_SLOTS}" if "MCH_EXECUTION_TIME" in self.number else NO_SLOTS
        buses = [bus for part in self.inside for bus in part.buses]
        return {
            "time_s": end_s,
            "buses": {bus.name: bus.content(at, end_s) for bus in buses},
            "frames": {bus.name: bus.listed(at) for bus in buses},
            "errors": [row for part in self.inside for row in part.errors.content(end_s, at)],
            "missing": {"slots": no_slots, "buses": " ".join(dict.fromkeys(part.note() for part in self.inside))},
        }


def read(path: str, how: Mapping[str, Any], frames: Decoded | None) -> Dataset:
    """The channels of one recording, including a simulated body's. how: of `reading.open_recording`.

    frames: receives its frames, if it has any.
    """
    if (pathlib.Path(path) / run_folder.VARIABLES).is_file() and not any(how.values()):
        return run_folder.read(path, truth=True)
    each_frame = None if frames is None else frames.take
    return datasets.open_recording(path, each_frame=each_frame, **how)


def inside_of(
    path: pathlib.Path, dataset: Dataset, frames: Decoded | None, shift_s: float, end_s: float, is_second: bool
) -> Decoded | RunLogs:
    """The data that one recording keeps in addition to its channels."""
    group = f" ({path.name})" if is_second else ""
    if frames is None or not frames.words:
        return RunLogs(path, dataset, group, shift_s, end_s)
    frames.done(group, shift_s)
    return frames
