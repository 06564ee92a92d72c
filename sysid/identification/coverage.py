"""Do the intervals hold the truth as often as they say? Many benches of many machines, each with its own instruments.

Every seed draws a machine (each number 10 % to either side of the robot's, centres of mass 40 g m), the errors of all
instruments, and all noise; the whole of tables 2 and 3 is identified, in the paper's steps and by the joint fits, and
each 95 % interval is asked for its truth.
"""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

from scipy import stats

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.benches import ankle_sine, leg, motor, pulley, springs
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.fit import Fit
from ranger_sim.sysid.identification import legs as identify_legs
from ranger_sim.sysid.identification import motor as identify_motor
from ranger_sim.sysid.identification import springs as identify_springs

SPREAD = 0.1
MOTOR_NUMBERS = (
    "resistance_ohm",
    "contact_drop_V",
    "torque_constant_Nm_per_A",
    "load_friction",
    "constant_friction_Nm",
    "viscous_friction_Nms",
)
BODY_NUMBERS = (
    "outer_mass_moment_kg_m",
    "inner_mass_moment_kg_m",
    "outer_hip_inertia_kg_m2",
    "inner_hip_inertia_kg_m2",
    "hip_spring_Nm_per_rad",
    "ankle_spring_Nm_per_rad",
)


@dataclasses.dataclass(frozen=True)
class Machine:
    """What is measured. terms: what a model file adds to motor and body."""

    motor: MotorParameters
    body: BodyParameters
    terms: BenchTerms = NOTHING

    def truth(self) -> dict[str, float]:
        """The numbers of tables 2 and 3, and of the ankle that hangs, by the names of the fits."""
        m, b, a = self.terms.motor("hip_motor", self.motor), self.body, ankle_sine.HANGING
        outer, inner = leg.legs_of(b)
        return {
            "R": m.loop_resistance_ohm,
            "V_c": m.contact_drop_V,
            "K": m.torque_constant_Nm_per_A,
            "C_1": m.viscous_friction_Nms,
            **dict.fromkeys(("C_0", "C_0d", "C_0s"), m.constant_friction_Nm),
            **dict.fromkeys(("mu", "mu_d", "mu_s"), m.load_friction),
            "outer_cm": outer.cm_kg_m,
            "outer_wm": outer.wm_kg_m,
            "outer_J_hip": outer.J_hip_kg_m2,
            "inner_cm": inner.cm_kg_m,
            "inner_wm": inner.wm_kg_m,
            "inner_J_hip": inner.J_hip_kg_m2,
            "k_h": b.hip_spring_Nm_per_rad,
            "k_s": b.ankle_spring_Nm_per_rad + b.ankle_return_Nm_per_rad,
            "J_foot": a.foot_inertia_kg_m2,
            "k_r": a.ankle_return_Nm_per_rad,
            "return_Nm": a.ankle_return_Nm_per_rad * a.ankle_return_rest_rad,
            "ankle_C_0": ankle_sine.MOTOR.constant_friction_Nm,
        }


ROBOT = Machine(motor.BENCH_MOTOR, BodyParameters())


def drawn(seed: int) -> Machine:
    """A machine near the robot."""
    random = generator(seed, "coverage: machine")

    def shifted(of: object, names: Iterable[str]) -> dict[str, Any]:
        return {name: getattr(of, name) * float(random.uniform(1.0 - SPREAD, 1.0 + SPREAD)) for name in names}

    centres: dict[str, Any] = {
        f"{side}_mass_offset_kg_m": float(random.uniform(-0.04, 0.04)) for side in ("outer", "inner")
    }
    return Machine(
        dataclasses.replace(ROBOT.motor, **shifted(ROBOT.motor, MOTOR_NUMBERS)),
        dataclasses.replace(ROBOT.body, **shifted(ROBOT.body, BODY_NUMBERS), **centres),
    )


def fits_of_motor(machine: Machine, seed: int) -> dict[str, Fit]:
    """{"steps: R": fit ...} of table 3, by path and name."""
    data = (
        motor.stall(machine.motor, seed),
        motor.cantilever(machine.motor, seed),
        pulley.pulley(machine.motor, seed),
    )
    path = identify_motor.steps(*data)
    whole = identify_motor.joint(*data)
    found = {f"steps: {name}": path.stall for name in ("R", "V_c")}
    found["steps: K"] = path.power
    found |= {f"steps: {name}": path.friction for name in ("C_1", "C_0d", "C_0s", "mu_d", "mu_s")}
    return found | {f"joint: {name}": whole for name in identify_motor.TABLE_3}


def fits_of_legs(machine: Machine, seed: int) -> dict[str, Fit]:
    """The same of table 2's inertial numbers."""
    data = (leg.level(machine.body, seed), leg.hang(machine.body, seed), leg.pendulum(machine.body, seed))
    path = identify_legs.steps(*data)
    whole = identify_legs.joint(*data)
    found: dict[str, Fit] = {}
    for name in identify_legs.LEGS:
        found |= {
            f"steps: {name}_cm": path.level,
            f"steps: {name}_wm": path.hang,
            f"steps: {name}_J_hip": path.periods[name],
        }
    return found | {f"joint: {name}": whole for name in identify_legs.TABLE_2_LEGS}


def fits_of_springs(machine: Machine, seed: int) -> dict[str, Fit]:
    """The same of table 2's springs."""
    return {
        "joint: k_h": identify_springs.hip(springs.hip_spring(machine.body, seed)),
        "joint: k_s": identify_springs.ankle(springs.ankle_spring(machine.body, seed)),
    }


PARTS: dict[str, Callable[[Machine, int], dict[str, Fit]]] = {
    "motor": fits_of_motor,
    "legs": fits_of_legs,
    "springs": fits_of_springs,
}


@dataclasses.dataclass
class Count:
    """Of one number over all seeds: intervals that held the truth, fits refused, squares of error by standard error."""

    held: int = 0
    asked: int = 0
    refused: int = 0
    square: float = 0.0
    relative_width: float = 0.0

    @property
    def share(self) -> float:
        """Part of the intervals that held."""
        return self.held / self.asked if self.asked else float("nan")

    @property
    def spread(self) -> float:
        """Root mean square of error over standard error: 1 where the standard errors are right."""
        return (self.square / self.asked) ** 0.5 if self.asked else float("nan")


def count(seeds: Iterable[int], parts: Iterable[str] = tuple(PARTS), done: Callable[[int], None] | None = None) -> dict:
    """{name: Count} over the seeds."""
    counts: dict[str, Count] = {}
    for number, seed in enumerate(seeds):
        machine = drawn(seed)
        truth = machine.truth()
        for part in parts:
            for label, fitted in PARTS[part](machine, seed).items():
                name = label.partition(": ")[2]
                counted = counts.setdefault(label, Count())
                if fitted.refused:
                    counted.refused += 1
                    continue
                counted.asked += 1
                counted.held += fitted.covers(name, truth[name])
                counted.square += ((fitted[name] - truth[name]) / fitted.standard_errors[name]) ** 2
                low, high = fitted.ci95[name]
                counted.relative_width += 0.5 * (high - low) / max(abs(truth[name]), 1e-300)
        if done is not None:
            done(number + 1)
    return counts


def bounds(asked: int, numbers: int, rate: float = 0.95, failure: float = 1e-3) -> tuple[int, int]:
    """Fewest and most of `asked` intervals that may hold when each does at `rate`.

    All of `numbers` quantities lie inside together with a probability of 1 - `failure` at least (Bonferroni).
    """
    each = failure / numbers / 2.0
    return int(stats.binom.ppf(each, asked, rate)), int(stats.binom.isf(each, asked, rate))
