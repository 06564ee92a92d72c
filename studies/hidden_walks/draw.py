"""One hidden walk: drawn by a seed, walked in the emulator, and its log as a recording."""

import dataclasses
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ranger_sim.boards.main_brain import controllers
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.plant import body_files
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.walks import written
from ranger_sim.sysid.dataset import Channel, Dataset, Finding
from studies.hidden_walks.kinds import TOLERANCES, Kind

TYPES = {"f32": np.float32, "i32": np.int32, "u32": np.uint32}
LINK_ROWS = 10
OF_2015 = ("MCH_ANGLE", "E_LO_ANGLE", "FSM_LEG")
BOARDS = ("MCH_", "MCFO_", "MCFI_", "UI_", "E_", "FSM_", "C_", "P_", "D_", "DC", "DP")


@dataclasses.dataclass(frozen=True)
class Hidden:
    """kind: None for a sound walk; size in the unit of its parameter; at: when a fault begins; loose: tolerances."""

    kind: Kind | None
    size: float
    seed: int
    floor_m: float
    charge: float
    steps: int = 48
    at: str = "step 1"
    loose: bool = True
    controller: str = "record-2011"
    foreign: str = ""


def scenario_of(hidden: Hidden, folder: pathlib.Path) -> Scenario:
    """The scenario with its files in the folder."""
    body = dict(body_files.load("ranger").values)
    gains = dict(controllers.load(hidden.controller).values)
    kind = hidden.kind
    changed: dict[str, float] = {}
    tuned: dict[str, float] = {}
    for key, deviation in deviations(hidden).items():
        changed[key] = body[key] + deviation
    made: dict[str, Any] = {}
    if kind is not None:
        for values, additions, out in ((body, kind.body, changed), (gains, kind.controller, tuned)):
            for key, weight in additions.items():
                now = out.get(key, values[key])
                out[key] = now * (1.0 + weight * hidden.size) if kind.relative else now + weight * hidden.size
        if kind.term is not None:
            form, place, key, zero = kind.term
            (folder / "m.toml").write_text(f'[[term]]\nform = "{form}"\nat = "{place}"\n{key} = {zero + hidden.size}\n')
            made["model_file"] = str(folder / "m.toml")
        if kind.scenario:
            made[kind.scenario] = hidden.size
    if hidden.foreign == "compliant floor":
        text = 'base = "ranger"\n[parameters]\ncontact = "compliant"\n[sources]\ncontact = "hidden"\n'
        (folder / "b.toml").write_text(text)
        made["body"] = str(folder / "b.toml")
    elif changed:
        made["body"] = written(folder / "b.toml", "ranger", changed, "sources")
    if tuned:
        made["controller"] = written(folder / "c.toml", hidden.controller, tuned, "reasons")
    else:
        made["controller"] = hidden.controller
    return Scenario(seed=hidden.seed, floor_roughness_m=hidden.floor_m, battery_charge=hidden.charge, **made)


def deviations(hidden: Hidden) -> dict[str, float]:
    """What the body of a walk differs by within its tolerances, by key of a body file."""
    if not hidden.loose:
        return {}
    draw = generator(hidden.seed, "body of a hidden walk")
    return {key: deviation * float(draw.standard_normal()) for key, deviation in TOLERANCES.items()}


def tolerance_of(hidden: Hidden) -> float:
    """What the tolerances add to the hidden size, in its unit."""
    kind = hidden.kind
    if kind is None or kind.relative:
        return 0.0
    drawn = deviations(hidden)
    parts = [drawn[key] / weight for key, weight in kind.body.items() if key in drawn]
    return sum(parts) / len(parts) if parts else 0.0


def recorded(hidden: Hidden) -> Dataset:
    """The walk's recording: every variable of boards and main brain at its changes, as a run's folder has it."""
    with tempfile.TemporaryDirectory(prefix="hidden-walk-") as name:
        robot = Ranger(scenario_of(hidden, pathlib.Path(name)), "full")
    try:
        if hidden.kind is not None and hidden.kind.fault is not None:
            places, mode, key, factor = hidden.kind.fault
            for place in places:
                robot.inject(place, mode, hidden.at, **dict[str, Any]({key: factor * hidden.size}))
        stop = StopRule(steps=hidden.steps)
        while not robot.run(stop):
            pass
        rec = robot.recorded()
        time_s = (rec.word_times_ns - robot.start_ns) * 1e-9
        channels = {}
        for number, variable in all_variables.NAMES.items():
            if variable.startswith(BOARDS):
                value = rec.words[:, number].astype(np.uint32).view(TYPES[all_variables.TYPES[number]]).astype(float)
                kept = np.ones(len(value), dtype=bool)
                kept[1:-1] = value[1:-1] != value[:-2]
                unit = all_variables.UNITS[number]
                channels[variable] = Channel(variable, unit, time_s[kept], value[kept])
        dataset = Dataset("hidden", channels)
        if robot.fell_ns() >= 0:
            dataset.findings.append(Finding("", "fell", time_s[-1], time_s[-1], 1.0, "", "the robot fell"))
        return dataset
    finally:
        robot.close()


def as_row(dataset: Dataset, row: str) -> Dataset:
    """The recording by one row of the table: "full", "link" (50 Hz, no parameters) or "2015" (three channels)."""
    if row == "full":
        return dataset
    channels = {}
    for place, (name, channel) in enumerate(sorted(dataset.channels.items())):
        if name.startswith(("C_", "P_", "D_", "DC", "DP")) or (row == "2015" and name not in OF_2015):
            continue
        start, stop = channel.time_s[0], channel.time_s[-1]
        grid = start + 0.02 * np.arange(int((stop - start) / 0.02) + 1) + 0.002 * (place % LINK_ROWS)
        rows = np.searchsorted(channel.time_s, grid + 1e-6, side="right") - 1
        channels[name] = Channel(name, channel.unit, grid, channel.value[rows])
    return dataclasses.replace(dataset, channels=channels)


def parameters(dataset: Dataset) -> Mapping[str, float]:
    """The controller's parameters in the recording."""
    return {name: float(each.value[-1]) for name, each in dataset.channels.items() if name.startswith(("C_", "P_"))}
