"""Springs by a scale's pull (appendix 7.3, figure 25).

    hip-spring     the robot lies on its side, so that gravity has no part; a leg is pulled out and let back in steps.
                   angle_rad, force_N, side (direction of the pull), outward (1: pulled out, 0: let back in)
    ankle-spring   the motor holds its angle, the foot is pulled. angle_rad, force_N, side. The measured spring is the
                   cable with the soft return springs in parallel.

The hip's gearbox has friction: the scale shows more when pulled out and less when let back in. The difference gives it.
"""

import dataclasses

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.plant.electrics.motor_parameters import HIP_MOTOR, MotorParameters
from ranger_sim.plant.mechanics.parameters import BodyParameters, hip_spring_torque_Nm
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.benches.motor import readings
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.instruments import FISH_SCALE, JOINT_ENCODER, TAPE_M

HIP_ANGLES = (0.1, 0.2, 0.3, 0.4, 0.5)  # rad: the range in which the hip works [A 7.3]
ANKLE_ANGLES = (0.05, 0.1, 0.15, 0.2, 0.25, 0.3)  # rad. Chosen by us: to 4 N m, which the gearbox carries
ANKLE_ARM_M = 0.15  # from the ankle to the pulled point of the foot. Chosen by us: the end of its toe
HIP_ARM_M = 0.96  # the leg's length [A 7.3]
REPEATS = 2
HAND_rad = 0.005  # error of a hand about its intended angle. Chosen by us
# An encoder that was set to zero at parallel legs, or where the cable carries no load.
ZEROED = dataclasses.replace(JOINT_ENCODER, offset=0.001)


def hip_spring(
    body: BodyParameters | None = None,
    seed: int = 1,
    motor: MotorParameters = HIP_MOTOR,
    terms: BenchTerms = NOTHING,
) -> Dataset:
    """Pulls to either side, out and back in."""
    terms = terms.of_bench("hip-spring")
    body = body or BodyParameters()
    arm = HIP_ARM_M + TAPE_M * float(generator(seed, "hip-spring: tape").standard_normal())
    steps = [(angle, 1.0) for angle in HIP_ANGLES] + [(angle, 0.0) for angle in HIP_ANGLES[::-1]]
    rows = np.array([(side * a, side, out) for side in (1.0, -1.0) for _ in range(REPEATS) for a, out in steps])
    rows[:, 0] += HAND_rad * generator(seed, "hip-spring: hand").standard_normal(len(rows))
    spring = np.array([hip_spring_torque_Nm(body, float(angle)) for angle in rows[:, 0]])
    spring -= np.array([terms.torque_Nm("hip_joint", float(angle), 0.0) for angle in rows[:, 0]])
    torque = rows[:, 1] * spring + np.where(rows[:, 2] > 0.0, 1.0, -1.0) * motor.constant_friction_Nm
    return readings(
        "hip-spring",
        seed,
        {
            "angle_rad": (rows[:, 0], ZEROED),
            "force_N": (torque / arm, FISH_SCALE),
            "side": (rows[:, 1], None),
            "outward": (rows[:, 2], None),
        },
    )


def ankle_spring(body: BodyParameters | None = None, seed: int = 1, terms: BenchTerms = NOTHING) -> Dataset:
    """Pulls of the foot to either side; the motor holds its angle, so the cable's stretch is the foot's angle."""
    terms = terms.of_bench("ankle-spring")
    body = body or BodyParameters()
    arm = ANKLE_ARM_M + TAPE_M * float(generator(seed, "ankle-spring: tape").standard_normal())
    rows = np.array([(side * a, side) for side in (1.0, -1.0) for _ in range(2 * REPEATS) for a in ANKLE_ANGLES])
    rows[:, 0] += HAND_rad * generator(seed, "ankle-spring: hand").standard_normal(len(rows))
    more = np.array(
        [
            terms.torque_Nm("inner_ankle", angle, 0.0) + terms.torque_Nm("inner_cable", -angle, 0.0)
            for angle in rows[:, 0].tolist()
        ]
    )
    stiffness = body.ankle_spring_Nm_per_rad + body.ankle_return_Nm_per_rad
    return readings(
        "ankle-spring",
        seed,
        {
            "angle_rad": (rows[:, 0], ZEROED),
            "force_N": ((stiffness * rows[:, 0] - more) * rows[:, 1] / arm, FISH_SCALE),
            "side": (rows[:, 1], None),
        },
    )
