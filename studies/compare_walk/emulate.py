"""Walks of the emulated robot with some numbers changed, through the files that a user would write.

A change becomes a body, a model or a controller file next to the requested ones; `ranger-sim walk` takes the
same files, so that the result can walk anywhere.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

from ranger_sim.boards.main_brain import controllers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files, terms
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from studies.compare_walk import gait
from studies.compare_walk.candidates import BY_NAME

PROGRAM = "head-2015"
SECONDS_PER_STEP = 3.0  # a slower robot counts as standing (chosen by us: five times a step)


@dataclasses.dataclass
class Emulator:
    """Walks one scenario. `walks`: how many so far. `settled`: strides at the end of `steps` that form the gait."""

    scenario: Scenario
    steps: int = 18
    settled: int = 3
    walks: int = 0

    def __post_init__(self) -> None:
        controller = controllers.load(self.scenario.controller)
        if controller.program != PROGRAM:
            raise UserError(
                f"controller {controller.name}: for program {controller.program!r}; the log's states are those of "
                f"{PROGRAM!r}"
            )
        body_files.load(self.scenario.body)
        if self.scenario.model_file is not None:
            terms.load(self.scenario.model_file)

    def walk(self, changes: Mapping[str, float] | None = None) -> gait.Walk:
        """The walk with these changes, {candidate's name: value}."""
        with tempfile.TemporaryDirectory() as folder:
            return self._walk(with_changes(self.scenario, changes or {}, pathlib.Path(folder)))

    def _walk(self, scenario: Scenario) -> gait.Walk:
        self.walks += 1
        with contextlib.closing(Ranger(scenario, log="full")) as robot:
            limit_s = SECONDS_PER_STEP * (self.steps + 1)
            robot.run(StopRule(steps=self.steps, time_s=limit_s), limit_s)
            return gait.of_robot(robot)

    def settled_strides(self, changes: Mapping[str, float] | None = None) -> list[gait.Stride]:
        """The last strides of the walk; none when the robot fell or stopped before it had as many as two more."""
        walk = self.walk(changes)
        strides = walk.strides()
        if walk.ended or len(strides) < self.settled + 2:
            return []
        return strides[-self.settled :]


def with_changes(scenario: Scenario, changes: Mapping[str, float], folder: pathlib.Path) -> Scenario:
    """The scenario with the changes as files in `folder`: extended-body.toml, -model.toml, -controller.toml."""
    wanted = {name: float(value) for name, value in changes.items() if value != 0.0}
    kinds: dict[str, dict[str, float]] = {"body": {}, "term": {}, "floor": {}, "firmware": {}}
    for name, value in wanted.items():
        candidate = BY_NAME[name]
        for key in candidate.keys or ("slope_rad",):
            kinds[candidate.kind][key] = kinds[candidate.kind].get(key, 0.0) + value
    files: dict[str, Any] = {}
    if kinds["body"]:
        files["body"] = str(write_body(scenario.body, kinds["body"], folder / "extended-body.toml"))
    if kinds["term"]:
        files["model_file"] = str(write_model(scenario.model_file, kinds["term"], folder / "extended-model.toml"))
    if kinds["firmware"]:
        path = folder / "extended-controller.toml"
        files["controller"] = str(write_controller(scenario.controller, kinds["firmware"], path))
    return dataclasses.replace(scenario, slope_rad=scenario.slope_rad + kinds["floor"].get("slope_rad", 0.0), **files)


def write_body(name: str, changes: Mapping[str, float], path: pathlib.Path) -> pathlib.Path:
    """A body file with these numbers added to the body's."""
    base = body_files.load(name)
    origin = "found by `python -m studies.compare_walk`"
    lines = [f'title = "{base.title}, extended"', f'description = "{origin}"', f"base = {json.dumps(base_name(name))}"]
    lines += ["", "[parameters]", *(f"{key} = {float(base.values[key]) + value!r}" for key, value in changes.items())]
    lines += ["", "[sources]", *(f'{key} = "{origin}: {value:+.4g}"' for key, value in changes.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def base_name(name: str) -> str:
    """The name of a base for a file in another folder."""
    return str(pathlib.Path(name).resolve()) if str(name).endswith(".toml") else str(name)


def write_model(path: str | None, offsets: Mapping[str, float], target: pathlib.Path) -> pathlib.Path:
    """A model file: the terms of `path` and these sensors' offsets."""
    tables = [] if path is None else terms.content_of(path).get("term", [])
    tables += [{"form": "sensor_offset", "at": place, "value": value} for place, value in offsets.items()]
    lines = []
    for table in tables:
        lines += ["[[term]]", *(f"{key} = {json.dumps(value)}" for key, value in table.items()), ""]
    target.write_text("\n".join(lines), encoding="utf-8")
    terms.load(target)
    return target


def write_controller(name: str, changes: Mapping[str, float], path: pathlib.Path) -> pathlib.Path:
    """A parameter set with these numbers added to the set's."""
    base = controllers.load(name)
    origin = "found by `python -m studies.compare_walk`"
    lines = [f'title = "{base.title}, extended"', f"base = {json.dumps(base_name(name))}", "", "[parameters]"]
    lines += [f"{key} = {base.values[key] + value!r}" for key, value in changes.items()]
    lines += ["", "[reasons]", *(f'{key} = "{origin}: {value:+.4g}"' for key, value in changes.items())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path
