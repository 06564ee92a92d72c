"""The simulator of a diagnosis from figures: walks of the emulated robot, and their results."""

import contextlib
import dataclasses
import json
import math
import pathlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ranger_sim.boards.main_brain import controllers
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.campaigns.cases import Case, Settings, version
from ranger_sim.plant import body_files
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.ranger.walks import REFERENCE
from ranger_sim.tools.command_line.files import replace_file
from ranger_sim.tools.command_line.workers import workers
from studies.figures.question import Candidate, Outcome, Point

LEAST_STEPS = 20  # required of a walk: the summary leaves five of them out of its means
# A walk that takes three times the time of such a walk counts as stopped (chosen by us).
PATIENCE_S, PATIENCE_S_PER_STEP = 10.0, 1.8
STORE = "walks.json"

# name: unit, meaning. Those of a bench need no walk: they are the body's numbers as a measurement yields them.
WALK_FIGURES = {
    "step_length_m": ("m", "mean length of a step"),
    "step_time_s": ("s", "mean time of a step"),
    "step_length_sd_m": ("m", "standard deviation of the steps' lengths"),
    "step_time_sd_s": ("s", "standard deviation of the steps' times"),
    "speed_m_per_s": ("m/s", "length over time"),
    "motor_power_W": ("W", "drawn by the motors"),
    "net_motor_power_W": ("W", "drawn by the motors, less what they gave back"),
    "hip_power_W": ("W", "drawn by the hip's motor"),
    "outer_ankle_power_W": ("W", "drawn by the outer ankles' motor"),
    "inner_ankle_power_W": ("W", "drawn by the inner ankles' motor"),
    "strike_delay_s": ("s", "mean time from a heel strike to its detection"),
    "double_stance_s": ("s", "mean time with both feet on the floor, of a step"),
    "least_clearance_m": ("m", "least height of a swinging foot at mid-stance"),
}
BENCH_FIGURES = {
    "sole_to_hip_m": ("m", "from the floor to the hip's axis, leg and foot upright: l + r - d"),
    "ankle_height_m": ("m", "from the floor to the ankle's axis, foot flat: r - d, mean of the legs"),
    "hanging_angle_rad": ("rad", "of a leg that hangs from the hip, from plumb: atan(w m / c m) (appendix 7.2)"),
    "holding_torque_Nm": ("N m", "that holds a leg level: m c g (appendix 7.2)"),
    "pendulum_period_s": ("s", "of a leg that swings from the hip, small angles: eq. 30 of the appendix"),
    "hip_spring_Nm_per_rad": ("N m/rad", "of the hip's spring, by a pull (appendix 7.3)"),
}
FIGURES = {**WALK_FIGURES, **BENCH_FIGURES}


@dataclasses.dataclass(frozen=True)
class Setup:
    """The walk. settle_steps: a fall before these counts as a failed start, which is ours, not as a fall."""

    controller: str = Scenario.controller
    body: str = Scenario.body
    steps: int = 60
    seeds: int = 3
    floor_roughness_m: float = 0.0
    settle_steps: int = 10

    @classmethod
    def of(cls, path: pathlib.Path, table: Mapping[str, Any]) -> "Setup":
        """From the [run] of a file. UserError for missing values."""
        defaults = dataclasses.asdict(cls())
        for key, value in table.items():
            if key not in defaults:
                raise UserError(f"{path}: [run] {key}: unknown key (available: {', '.join(defaults)})")
            kind = type(defaults[key])
            wanted = (int, float) if kind is float else (kind,)
            if not isinstance(value, wanted) or isinstance(value, bool):
                raise UserError(f"{path}: [run] {key} = {value!r}: {kind.__name__} is expected")
        setup = cls(**table)
        if setup.steps < LEAST_STEPS or setup.seeds < 2 or not 0 <= setup.settle_steps < setup.steps:
            raise UserError(
                f"{path}: [run] steps {setup.steps}, seeds {setup.seeds}, settle_steps {setup.settle_steps}: allowed "
                f"are {LEAST_STEPS} steps and more, 2 seeds and more, and fewer settle_steps than steps"
            )
        return setup

    def number(self, key: str) -> float:
        """The number of a key, `body.NAME` or `controller.NAME`, before anything is changed. UserError for no such."""
        group, _, name = key.partition(".")
        if group == "body":
            value = body_files.load(self.body).values.get(name)
        elif group == "controller":
            value = controllers.load(self.controller).values.get(name)
        else:
            raise UserError(f"{key}: body.NAME or controller.NAME is expected")
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise UserError(f"{key}: the {group} has no such number")
        return float(value)

    def settings(self, moved: Mapping[str, float], seed: int) -> Settings:
        """A walk with these numbers."""
        walk = {
            "controller": self.controller,
            "body": self.body,
            "seed": seed,
            "floor_roughness_m": self.floor_roughness_m,
        }
        groups: dict[str, dict[str, float]] = {"body": {}, "controller": {}}
        for key, value in moved.items():
            group, _, name = key.partition(".")
            groups[group][name] = value
        return Settings(walk=walk, controller=groups["controller"], body=groups["body"], machine=REFERENCE)


class Walks:
    """The simulator: outcomes of points, in parallel processes; `folder` keeps them, by version and settings."""

    def __init__(
        self, setup: Setup, candidates: Sequence[Candidate], jobs: int = 1, folder: pathlib.Path | None = None
    ) -> None:
        self.setup = setup
        self.candidates = {each.name: each for each in candidates}
        self.jobs = jobs
        self.version = version(REFERENCE)
        self.path = folder / STORE if folder is not None else None
        self.known: dict[str, dict[str, Any]] = {}
        if self.path is not None and self.path.exists():
            with contextlib.suppress(json.JSONDecodeError):  # an incomplete line: those walks are walked again
                self.known = json.loads(self.path.read_text(encoding="utf-8"))

    def moved(self, changes: Mapping[str, float]) -> dict[str, float]:
        """The numbers of body and controller for changed values of candidates."""
        shifts: dict[str, float] = {}
        for name, value in changes.items():
            candidate = self.candidates[name]
            for key, factor in candidate.moves.items():
                shifts[key] = shifts.get(key, 0.0) + factor * (value - candidate.value)
        return {key: float(f"{self.setup.number(key) + shift:.9g}") for key, shift in shifts.items()}

    def __call__(self, points: Sequence[Point]) -> Iterator[Outcome]:
        return self.walked([(self.moved(dict(point.changes)), point.seed) for point in points])

    def walked(self, bodies: Sequence[tuple[Mapping[str, float], int]]) -> Iterator[Outcome]:
        """Outcomes of walks with these numbers and seeds, in their order."""
        orders = [Order(self.setup.settings(moved, seed), self.setup.steps, self.setup.settle_steps)
                  for moved, seed in bodies]  # fmt: skip
        keys = [order.key(self.version) for order in orders]
        new = {key: order for key, order in zip(keys, orders, strict=True) if key not in self.known}
        with contextlib.ExitStack() as stack:
            each: Any = map
            if self.jobs > 1 and len(new) > 1:
                each = stack.enter_context(workers(self.jobs))
            found = zip(list(new), each(walk, list(new.values())), strict=True)
            for key in keys:
                while key not in self.known:
                    case, outcome = next(found)
                    self.known[case] = outcome
                    self._keep()
                yield Outcome(**self.known[key])

    def _keep(self) -> None:
        if self.path is not None:
            replace_file(self.path, (json.dumps(self.known, indent=0, sort_keys=True) + "\n").encode())


@dataclasses.dataclass(frozen=True)
class Order:
    """One walk."""

    settings: Settings
    steps: int
    settle_steps: int

    def key(self, of_version: str) -> str:
        """The key under which its outcome is stored."""
        return Case(self.settings).key(of_version, {"steps": self.steps, "settle_steps": self.settle_steps})


def walk(order: Order) -> dict[str, Any]:
    """The outcome of one walk, as plain data."""
    with contextlib.closing(order.settings.robot()) as robot:
        bench = of_bench(robot.plant.parameters)
        stop = StopRule(steps=order.steps, time_s=PATIENCE_S + PATIENCE_S_PER_STEP * order.steps)
        while not robot.run(stop, 60.0):
            pass
        summary, steps = robot.summary(), robot.steps
        returned_W = sum(motor.returned_J for motor in robot.plant.motors) / max(robot.walked_s, 1e-9)
    begun = steps > order.settle_steps
    return {
        # the last steps before a fall are not of a gait, so that a walk that fell has none of its figures
        "figures": {**bench, **(of_walk(summary, returned_W) if steps == order.steps else {})},
        "survived": float(max(0, steps - order.settle_steps)),
        "failed": begun and steps < order.steps,
    }


def of_walk(summary: Mapping[str, Any], returned_W: float) -> dict[str, float]:
    """The figures that a walk has."""
    powers = summary["motor_powers_W"]
    delay_ms = summary["heel_strike_delay_ms"]["mean"]
    found = {
        "step_length_m": summary["mean_step_length_m"],
        "step_time_s": summary["mean_step_time_s"],
        "step_length_sd_m": summary["std_step_length_m"],
        "step_time_sd_s": summary["std_step_time_s"],
        "speed_m_per_s": summary["speed_m_per_s"],
        "motor_power_W": summary["motor_power_W"],
        "net_motor_power_W": summary["motor_power_W"] - returned_W,
        "hip_power_W": powers["hip"],
        "outer_ankle_power_W": powers["outer_ankle"],
        "inner_ankle_power_W": powers["inner_ankle"],
        "strike_delay_s": None if delay_ms is None else 1e-3 * delay_ms,
        "double_stance_s": summary["double_stance_s"],
        "least_clearance_m": summary["oddities"]["min_clearance_m"],
    }
    return {name: float(value) for name, value in found.items() if value is not None and math.isfinite(value)}


def of_bench(body: BodyParameters) -> dict[str, float]:
    """Results of benches on a body; means of the legs."""
    radius = 0.5 * (body.outer_foot_radius_m + body.inner_foot_radius_m)
    height = radius - 0.5 * (body.outer_ankle_offset_m + body.inner_ankle_offset_m)
    moment = 0.5 * (body.outer_mass_moment_kg_m + body.inner_mass_moment_kg_m)
    offset = 0.5 * (body.outer_mass_offset_kg_m + body.inner_mass_offset_kg_m)
    inertia = 0.5 * (body.outer_hip_inertia_kg_m2 + body.inner_hip_inertia_kg_m2)
    restoring = body.gravity_m_per_s2 * math.hypot(moment, offset)
    return {
        "sole_to_hip_m": body.leg_length_m + height,
        "ankle_height_m": height,
        "hanging_angle_rad": math.atan2(offset, moment),
        "holding_torque_Nm": body.gravity_m_per_s2 * moment,
        "pendulum_period_s": 2.0 * math.pi * math.sqrt(inertia / restoring) if restoring > 0.0 else math.inf,
        "hip_spring_Nm_per_rad": body.hip_spring_Nm_per_rad,
    }
