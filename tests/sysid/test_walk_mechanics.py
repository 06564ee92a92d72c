"""The walk's balances on motions of the plant's body: what they leave over is what moves it, and else nothing.

The body's accelerations come from Lagrange's equations in closed form (plant/mechanics/stance_equations.py), which
other tests compare with two further derivations; the balances here are sums of moments.
"""

import dataclasses

import numpy as np
import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.mechanics.body import SINGLE, Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.sysid.machines.walk import mechanics
from ranger_sim.sysid.machines.walk.mechanics import Motion, Numbers
from tests.plant.mechanics.test_body_equations import (
    INERTIAL,
    closed_posture,
    random_posture,
    set_motors,
    set_state,
    torque,
)

ROWS = 40
NUMBERS = dataclasses.replace(Numbers.of(INERTIAL), slope_rad=INERTIAL.slope_rad)
FEET = {"heel end": -0.5, "arc": 0.1, "toe end": 1.1}


def moving(stance, foot):
    """(Motion of ROWS states in single stance, torque of the hip's motor on h in each)."""
    stream = RandomStream(stance, f"mechanics {foot}")
    rows, torques = [], []
    while len(rows) < ROWS:
        body = Body(INERTIAL, Floor(INERTIAL.slope_rad))
        laws = set_motors(body, stream)
        x, v = random_posture(stream), np.array([stream.normal() for _ in range(6)])
        x[0 if stance == OUTER else 3] = FEET[foot] + 0.02 * stream.normal()
        set_state(body, x, v)
        joints = [leg.foot_angle - leg.angle for leg in (body.outer, body.inner)]
        if not all(body.ankle.low < joint < body.ankle.high for joint in joints):
            continue  # in its stop
        body.mode = SINGLE
        body.stand_on(body.leg(stance))
        body.update_pose()
        on_feet(body, 0.0, 1)
        rows.append([of_leg(body.outer), of_leg(body.inner)])
        torques.append(torque(laws["hip"], body.hip_rate()))
    found = np.array(rows)  # rows, legs, (leg, joint, motor), (angle, rate, acceleration)

    def course(values):
        return (*values.T, np.zeros(ROWS))

    outer, inner = found[:, 0], found[:, 1]
    return (
        Motion(
            course(outer[:, 0] - inner[:, 0]),
            course(outer[:, 0]),
            (course(outer[:, 1]), course(inner[:, 1])),
            (course(outer[:, 2]), course(inner[:, 2])),
            np.zeros(ROWS),
        ),
        np.array(torques),
    )


def of_leg(leg):
    return [
        (leg.angle, leg.rate, leg.acc),
        (leg.foot_angle - leg.angle, leg.foot_rate - leg.rate, leg.foot_acc - leg.acc),
        (leg.motor_angle, leg.motor_rate, leg.motor_acc),
    ]


def nothing(size=1.0):
    """Moments of some ten N m, of accelerations up to 1e3 rad/s^2 worked out in systems of condition 1e5."""
    return pytest.approx(np.zeros(ROWS), abs=1e-9 * size)


@pytest.mark.parametrize("stance", [OUTER, INNER])
@pytest.mark.parametrize("foot", list(FEET))
def test_single_stance_leaves_the_hip_motor_s_torque_and_nothing_else(stance, foot):
    motion, hip_torque = moving(stance, foot)
    left = mechanics.stance(NUMBERS, motion, int(stance))
    size = np.abs(motion.hip[2]).max() + np.abs(motion.leg[2]).max()
    assert left.floor == nothing(size)
    assert left.legs == nothing(size)
    assert left.hip_torque == pytest.approx(hip_torque, abs=1e-9 * size)
    assert mechanics.swing_foot(NUMBERS, motion, 1 - int(stance)) == nothing(size)


def test_a_cubic_spring_at_the_hip_adds_its_torque():
    motion, hip_torque = moving(OUTER, "arc")
    cubic = dataclasses.replace(NUMBERS, hip_spring_cubic_Nm_per_rad3=3.0)
    added = mechanics.stance(cubic, motion, 0).hip_torque - mechanics.stance(NUMBERS, motion, 0).hip_torque
    assert added == pytest.approx(3.0 * motion.hip[0] ** 3, abs=1e-12)


def test_both_soles_are_at_one_height_while_both_feet_stand():
    for stance in (OUTER, INNER):
        for seed in range(20):
            body = Body(INERTIAL)
            closed_posture(body, RandomStream(seed, "height"), stance)
            zero = (np.zeros(1),) * 4

            def at(value):
                return (np.array([value]), *(np.zeros(1) for _ in range(3)))

            joints = tuple(at(leg.foot_angle - leg.angle) for leg in (body.outer, body.inner))
            motion = Motion(at(body.hip_angle()), at(body.outer.angle), joints, (zero, zero), np.zeros(1))
            assert mechanics.height_difference(NUMBERS, motion) == pytest.approx([0.0], abs=1e-12)
            higher = dataclasses.replace(NUMBERS, ankle_offset_inner_m=NUMBERS.ankle_offset_inner_m - 0.01)
            cosine = np.cos(body.inner.foot_angle)
            assert mechanics.height_difference(higher, motion) == pytest.approx([0.01 * cosine], abs=1e-12)


@pytest.mark.parametrize(
    ("numbers", "shown"),
    [
        (
            dict(hip_scale=1.1, hip_zero_rad=0.03),
            lambda m: dataclasses.replace(m, hip=scaled(m.hip, 1.1, 0.03)),
        ),
        (
            dict(leg_scale=0.9, leg_zero_rad=-0.02),
            lambda m: dataclasses.replace(m, leg=scaled(m.leg, 0.9, -0.02)),
        ),
        (
            dict(ankle_zero_outer_rad=0.05, ankle_zero_inner_rad=-0.04),
            lambda m: dataclasses.replace(m, ankle=(scaled(m.ankle[0], 1.0, 0.05), scaled(m.ankle[1], 1.0, -0.04))),
        ),
        (
            dict(motor_zero_outer_rad=0.05, motor_zero_inner_rad=-0.04),
            lambda m: dataclasses.replace(m, motor=(scaled(m.motor[0], 1.0, 0.05), scaled(m.motor[1], 1.0, -0.04))),
        ),
        (
            dict(motor_lag_outer_s=0.01, motor_lag_inner_s=0.02),
            lambda m: dataclasses.replace(m, motor=(late(m.motor[0], 0.01), late(m.motor[1], 0.02))),
        ),
    ],
)
@pytest.mark.parametrize("stance", [0, 1])
def test_what_a_sensor_shows_wrongly_is_put_right_by_its_numbers(numbers, shown, stance):
    """Scaled and shifted; of a lag the angle by its rate, to first order, as a motor's is used."""
    motion, _ = moving(stance, "arc")
    wanted = mechanics.stance(NUMBERS, motion, stance)
    found = mechanics.stance(dataclasses.replace(NUMBERS, **numbers), shown(motion), stance)
    for name in ("floor", "legs", "hip_torque"):
        assert getattr(found, name) == pytest.approx(getattr(wanted, name), abs=1e-8)
    other = mechanics.swing_foot(dataclasses.replace(NUMBERS, **numbers), shown(motion), 1 - stance)
    assert other == pytest.approx(mechanics.swing_foot(NUMBERS, motion, 1 - stance), abs=1e-8)


def scaled(course, scale, zero):
    x, v, a, j = course
    return scale * x + zero, scale * v, scale * a, j


def late(course, lag_s):
    x, v, a, j = course
    return x - lag_s * v, v, a, j


def test_a_lag_of_leg_or_hip_is_put_right_to_first_order_and_may_grow_along_the_recording():
    """Of motions without a change of acceleration, by each one's next derivative."""
    motion, _ = moving(OUTER, "arc")
    along = np.linspace(-1.0, 1.0, ROWS)
    for numbers, lags in (
        (dict(hip_lag_s=0.01), dict(hip=0.01)),
        (dict(leg_lag_s=0.01), dict(leg=0.01)),
        (dict(leg_lag_s=0.01, leg_lag_drift_s=0.004), dict(leg=0.01 + 0.004 * along)),
    ):
        steady = dataclasses.replace(motion, along=along)
        wanted = mechanics.height_difference(NUMBERS, steady)
        for name, lag in lags.items():
            x, v, a, j = getattr(steady, name)
            steady = dataclasses.replace(steady, **{name: (x - lag * v, v, a, j)})
        found = mechanics.height_difference(dataclasses.replace(NUMBERS, **numbers), steady)
        assert found == pytest.approx(wanted, abs=1e-12)
        assert mechanics.height_difference(NUMBERS, steady) != pytest.approx(wanted, abs=1e-4)


def test_rows_are_taken_from_every_course_and_missing_ones_stay_missing():
    motion, _ = moving(OUTER, "arc")
    rows = np.array([3, 7])
    found = dataclasses.replace(motion, motor=(None, motion.motor[1])).part(rows)
    assert np.array_equal(found.hip[0], motion.hip[0][rows]) and np.array_equal(found.leg[3], motion.leg[3][rows])
    assert np.array_equal(found.ankle[0][1], motion.ankle[0][1][rows]) and found.motor[0] is None
    assert np.array_equal(found.motor[1][2], motion.motor[1][2][rows]) and len(found.along) == 2
    left = mechanics.stance(NUMBERS, found, 0)
    assert left.floor is None and left.legs is None and len(left.hip_torque) == 2
