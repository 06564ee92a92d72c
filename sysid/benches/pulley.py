"""Motor and pulley with a hanging mass (appendix 8.4, figure 30): what friction holds, and how fast it lets fall.

Friction with true stick, eq. 34 and 35 of the appendix: at rest any torque up to the static one, in motion the dynamic
one against it. (The plant's own friction is smoothed and creeps below it, so it has no load at which motion begins.)

    held, I = 0       mass on in steps of 5 g until it moves: tapped, the dynamic friction; untapped, the static one
    held, I           the motor pulls up: mass off in steps until it rises, mass on in steps until it falls
    falling, I = 0    a mass that falls steadily, its speed by the encoder

Columns: current_A, mass_kg (first that moved, or that falls), side (+1: it falls, or would; -1: the motor lifts it),
tapped (1, 0), speed_rad_per_s (0 where motion only began).
"""

import dataclasses

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.benches.motor import BENCH_MOTOR, readings
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.instruments import CURRENT_SENSOR, SHAFT_SPEED

RADIUS_M = 0.025  # of the pulley [A 8.4.1]
GRAVITY = 9.81
MASS_STEP_KG = 0.005  # [A 8.4.1]
CURRENTS_A = (-1.2, -0.9, -0.6, -0.3, 0.3, 0.6, 0.9, 1.2)  # the mass hangs on the side that the motor lifts
REPEATS = 6  # of each trial. Chosen by us
FALLING_KG = (0.06, 0.1, 0.14, 0.18, 0.22, 0.26, 0.3)  # 1.4 to 19 rad/s. Chosen by us
# Relative scatter of friction from place to place of brushes and teeth. Chosen by us.
FRICTION_SCATTER = 0.05


@dataclasses.dataclass(frozen=True)
class StickFriction:
    """Eq. 35: constants in N m at the output, shares of |G K I|; s: at rest, d: in motion."""

    C0s: float = 0.01
    C0d: float = 0.01
    mu_s: float = 0.1
    mu_d: float = 0.1
    C1: float = 0.0033

    @classmethod
    def of(cls, motor: MotorParameters) -> "StickFriction":
        """Static and dynamic alike, as table 3 has it."""
        C0, mu = motor.constant_friction_Nm, motor.load_friction
        return cls(C0, C0, mu, mu, motor.viscous_friction_Nms)

    def holds(self, torque_Nm: float, drive_Nm: float) -> bool:
        """Whether a shaft at rest stays so under a torque in all, with `drive_Nm` of G K I in it."""
        return abs(torque_Nm) <= self.C0s + self.mu_s * abs(drive_Nm)

    def moves(self, torque_Nm: float, drive_Nm: float) -> bool:
        """Whether a shaft that a tap has set in motion goes on."""
        return abs(torque_Nm) > self.C0d + self.mu_d * abs(drive_Nm)

    def speed(self, torque_Nm: float, drive_Nm: float) -> float:
        """Steady speed under a torque in all; 0 where dynamic friction stops it."""
        over = abs(torque_Nm) - self.C0d - self.mu_d * abs(drive_Nm)
        return 0.0 if over <= 0.0 else float(np.copysign(over / self.C1, torque_Nm))


def first_mass_kg(friction: StickFriction, drive_Nm: float, side: float, tapped: bool, scale: float = 1.0) -> float:
    """Mass at which motion begins when it is changed by MASS_STEP_KG: added (side +1) or taken off (-1) from one that
    balances the motor; `scale`: friction here, against its mean."""
    balance = abs(drive_Nm) / (GRAVITY * RADIUS_M)
    steps = round(balance / MASS_STEP_KG)
    here = dataclasses.replace(
        friction,
        C0s=friction.C0s * scale,
        C0d=friction.C0d * scale,
        mu_s=friction.mu_s * scale,
        mu_d=friction.mu_d * scale,
    )
    while steps >= 0:
        torque = steps * MASS_STEP_KG * GRAVITY * RADIUS_M - abs(drive_Nm)
        # towards `side` it is let go; the other way it would be a start on the wrong side
        if torque * side > 0.0 and (here.moves(torque, drive_Nm) if tapped else not here.holds(torque, drive_Nm)):
            return steps * MASS_STEP_KG
        steps += 1 if side > 0.0 else -1
    return float("nan")  # no mass at all was still too much for the motor to lift


def pulley(
    motor: MotorParameters = BENCH_MOTOR,
    seed: int = 1,
    friction: StickFriction | None = None,
    terms: BenchTerms = NOTHING,
) -> Dataset:
    """All trials of appendix 8.4.1 to 8.4.5."""
    motor = terms.of_bench("pulley").motor("hip_motor", motor)
    friction = friction if friction is not None else StickFriction.of(motor)
    GK = motor.gear * motor.torque_constant_Nm_per_A
    trials = [(0.0, 1.0), *((current, side) for current in CURRENTS_A for side in (1.0, -1.0))]
    scatter = generator(seed, "pulley: friction here")
    rows = []
    for current, side in trials:
        for tapped in (True, False):
            for _ in range(REPEATS):
                scale = 1.0 + FRICTION_SCATTER * float(scatter.standard_normal())
                mass = first_mass_kg(friction, GK * current, side, tapped, scale)
                rows.append((current, mass, side, float(tapped), 0.0))
    for mass in FALLING_KG:
        for _ in range(2):
            scale = 1.0 + FRICTION_SCATTER * float(scatter.standard_normal())
            over = mass * GRAVITY * RADIUS_M - scale * friction.C0d
            rows.append((0.0, mass, 1.0, 1.0, max(over, 0.0) / friction.C1))
    table = np.array([row for row in rows if np.isfinite(row[1])])
    moving = table[:, 4] > 0.0
    made = readings(
        "pulley",
        seed,
        {
            "current_A": (table[:, 0], CURRENT_SENSOR),
            "mass_kg": (table[:, 1], None),
            "side": (table[:, 2], None),
            "tapped": (table[:, 3], None),
            "speed_rad_per_s": (table[:, 4], SHAFT_SPEED),
        },
    )
    made.channels["speed_rad_per_s"].value[~moving] = 0.0
    return made
