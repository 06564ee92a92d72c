"""One emulated walk as its steps' features: what a twin is made of."""

import dataclasses
import pathlib
import tempfile
from collections.abc import Mapping
from typing import Any

import numpy as np

from ranger_sim.boards.main_brain import controllers
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation import random_arrays
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.plant import body_files
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.walks import written
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.twins import features, steps, twin_file
from ranger_sim.tools.twins.causes import BY_KEY, TWINS, Change

NUMPY = {"f32": np.float32, "i32": np.int32, "u32": np.uint32}
LINK_ROWS = 10  # of the even clock between two values on the data link: 50 Hz
FIRST = 2  # steps that are left out: the launch by hand and the one after it
FALLING = 3  # steps before a fall that are left out


@dataclasses.dataclass(frozen=True)
class Task:
    """One walk to make. key: TWINS' key, "" for a sound robot; tolerances: the body is drawn within them."""

    name: str
    seed: int
    controller: str
    body: str
    key: str = ""
    size: float = 0.0
    floor_m: float = 0.0
    charge: float = 1.0
    tolerances: bool = False
    steps: int = 48


@dataclasses.dataclass(frozen=True)
class Walked:
    """leg: (k,) that swings; full, link: (k, p) features by the table's rate and by the data link's."""

    leg: np.ndarray
    full: Array
    link: Array
    fell: bool


def values_of(body: str, controller: str) -> dict[str, float]:
    """The sound body's and controller's numbers, by name."""
    found = {name: float(value) for name, value in body_files.load(body).values.items() if not isinstance(value, str)}
    return found | {name: float(value) for name, value in controllers.load(controller).values.items()}


def columns_of(robot: Ranger) -> dict[str, Array]:
    """The main brain's variables that steps are made of, on the even clock."""
    recorded = robot.recorded()
    time_s = (recorded.word_times_ns - robot.start_ns) * 1e-9
    grid = time_s[0] + steps.CLOCK_S * np.arange(int((time_s[-1] - time_s[0]) / steps.CLOCK_S + 1e-6) + 1)
    rows = np.searchsorted(time_s, grid + 0.25 * steps.CLOCK_S, side="right") - 1
    found = {}
    for name in {*steps.VARIABLES, *steps.COUNTED}:
        number = all_variables.ID_OF[name]
        words = recorded.words[rows, number].astype(np.uint32)
        found[name] = words.view(NUMPY[all_variables.TYPES[number]]).astype(np.float64)
    return found


def drawn(task: Task, values: Mapping[str, float]) -> list[Change]:
    """The changes of a task: its cause, and every tolerance of a sound robot but this one at random."""
    cause = [BY_KEY[task.key].change(task.size, values)] if task.key else []
    if not task.tolerances:
        return cause
    loose = [twin for twin in TWINS if twin.tolerance and twin.key != task.key]
    draws = random_arrays.generator(task.seed, "tolerances of a twin").normal(size=len(loose))
    sizes = [float(draw) * twin.tolerance for draw, twin in zip(draws, loose, strict=True)]
    return cause + [twin.change(size, values) for twin, size in zip(loose, sizes, strict=True)]


def scenario_of(task: Task, folder: pathlib.Path) -> tuple[Scenario, list[tuple[str, str, Mapping[str, float]]]]:
    """The scenario of a task with the faults to inject; files that it needs are written to the folder."""
    values = values_of(task.body, task.controller)
    made: dict[str, Any] = {"controller": task.controller, "body": task.body}
    body: dict[str, float] = {}
    controller: dict[str, float] = {}
    terms: list[Mapping[str, Any]] = []
    faults: list[tuple[str, str, Mapping[str, float]]] = []
    for change in drawn(task, values):
        for total, part in ((body, change.body), (controller, change.controller)):
            for name, value in part.items():
                total[name] = total.get(name, values[name]) + value - values[name]
        terms += change.terms
        faults += change.faults
        made |= change.scenario
    if body:
        made["body"] = written(folder / "body.toml", task.body, body, "sources")
    if controller:
        made["controller"] = written(folder / "controller.toml", task.controller, controller, "reasons")
    if terms:
        lines = [
            "[[term]]\n" + "".join(f"{key} = {value!r}\n".replace("'", '"') for key, value in each.items())
            for each in terms
        ]
        (folder / "model.toml").write_text("\n".join(lines), encoding="utf-8")
        made["model_file"] = str(folder / "model.toml")
    scenario = Scenario(seed=task.seed, floor_roughness_m=task.floor_m, battery_charge=task.charge, **made)
    return scenario, faults


def walk(task: Task) -> Walked:
    """Let it walk, and read the features of its steps."""
    with tempfile.TemporaryDirectory(prefix="ranger-sim-twin-") as name:
        scenario, faults = scenario_of(task, pathlib.Path(name))
        robot = Ranger(scenario, "full")
    try:
        for place, mode, parameters in faults:
            robot.inject(place, mode, "step 1", **dict[str, Any](parameters))
        stop = StopRule(steps=task.steps)
        while not robot.run(stop):
            pass
        columns, fell = columns_of(robot), robot.fell_ns() >= 0
        phases = random_arrays.generator(task.seed, "phases of a link").integers(0, LINK_ROWS, len(columns))
    finally:
        robot.close()
    return walked(columns, fell, phases.tolist())


def walked(columns: Mapping[str, Array], fell: bool, phases: list[int]) -> Walked:
    """The features of the steps, by both rates; those of a fall are left out."""
    both = []
    for every in (1, LINK_ROWS):
        found = steps.of_columns(steps.by_link(columns, every, phases) if every > 1 else columns, every * steps.CLOCK_S)
        assert found is not None  # the emulator has every variable
        both.append((found.leg, features.of(found)))
    (leg, full), (_, link) = both
    last = len(leg) - (FALLING if fell else 0)
    return Walked(leg[FIRST:last], full[FIRST:last], link[FIRST : min(last, len(link))], fell)


def fingerprint(body: str, controller: str) -> str:
    """Of the numbers of body and controller."""
    return twin_file.fingerprint(values_of(body, controller))
