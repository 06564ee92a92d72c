"""A late torque sensor, a friction that changes and a sensor that slips are named by a balance, with size and time.

The joint moves by a sum of sines and its current is written down for it, so that a late one is that of an earlier time.
"""

import numpy as np
import pytest

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import HeavyJoint

STEP_s, SECONDS, FINER = 0.004, 16.0, 20
INERTIA, VISCOUS, COULOMB, WEIGHT = 0.25, 0.6, 0.5, 3.0
TURN_per_s = np.array([0.9, 2.3, 4.1, 6.7])


def _joint(seed, late_s=0.0, smooth_s=0.0, dry=lambda t: COULOMB, offset=lambda t: 0.0, slow=0.0):
    """A recording. late_s, smooth_s: of the current's sensor; dry(t): Coulomb friction; slow: more of it near rest."""
    draw = generator(seed, "joint with a late sensor")
    sizes, phases = draw.uniform(0.15, 0.4, len(TURN_per_s)), draw.uniform(0.0, 6.28, len(TURN_per_s))

    def moves(t):
        turned = np.outer(t, TURN_per_s) + phases
        return (
            np.sin(turned) @ sizes,
            np.cos(turned) @ (sizes * TURN_per_s),
            -np.sin(turned) @ (sizes * TURN_per_s**2),
        )

    def current(t):
        angle, rate, acceleration = moves(t)
        friction = (dry(t) + slow * np.exp(-((rate / 0.4) ** 2))) * np.tanh(rate / 0.02)
        return INERTIA * acceleration + VISCOUS * rate + friction + WEIGHT * np.cos(angle)

    time_s = np.arange(0.0, SECONDS, STEP_s)
    shown = current(time_s - late_s)
    if smooth_s:
        fine_s = np.arange(-8.0 * smooth_s, SECONDS, STEP_s / FINER)
        real, behind = current(fine_s), np.empty(len(fine_s))
        behind[0] = real[0]
        kept = np.exp(-STEP_s / FINER / smooth_s)
        for row in range(1, len(fine_s)):
            behind[row] = kept * behind[row - 1] + (1.0 - kept) * 0.5 * (real[row] + real[row - 1])
        shown = np.interp(time_s, fine_s, behind)
    angle, rate, _ = moves(time_s)
    noises = draw.normal(size=(3, len(time_s)))
    values = {
        "angle_rad": angle + 1e-5 * noises[0],
        "rate_rad_per_s": rate + 5e-4 * noises[1],
        "current_A": shown + offset(time_s) + 0.02 * noises[2],
    }
    return Table(time_s, values, (slice(0, len(time_s)),), f"joint {seed}")


def _causes(held_out=None, seed=1, **hidden):
    other = hidden if held_out is None else held_out
    return diagnose(HeavyJoint(), [_joint(seed, **hidden)], [_joint(seed + 100, **other)]).result.causes


def _holds(cause, coefficient, true):
    low, high = cause.parameters[coefficient].ci95
    return low < true < high


def test_a_current_that_is_shown_late_is_named_with_its_delay_and_alone():
    """By two samples and by 25; the score grows with the lag."""
    scores = []
    for late_s in (0.008, 0.1):
        causes = _causes(late_s=late_s)
        assert [(each.name, each.at) for each in causes] == [("sensor_lag", "current_A")], late_s
        assert _holds(causes[0], "lag_s", late_s)
        scores.append(causes[0].evidence.chi2)
    assert causes[0].form == "delay" and _holds(causes[0], "delay_s", 0.1)
    assert scores[0] < scores[1]


def test_a_current_behind_a_low_pass_is_named_with_its_time_constant():
    causes = _causes(smooth_s=0.05, seed=3)
    assert [(each.name, each.form) for each in causes] == [("sensor_lag", "filter")]
    assert _holds(causes[0], "lag_s", 0.05)


def test_a_joint_whose_sensors_are_in_time_has_no_cause():
    assert not _causes()


def test_a_friction_that_warms_up_settles_with_its_time_constant():
    causes = _causes(dry=lambda t: COULOMB * (1.0 + 0.4 * np.exp(-t / 4.0)))
    assert [(each.name, each.at, each.form) for each in causes] == [("parameter_drift", "coulomb_A", "settling")]
    assert _holds(causes[0], "change", -0.4 * COULOMB) and _holds(causes[0], "tau_s", 4.0)


def test_a_friction_that_jumps_is_named_with_its_time_though_another_run_has_it_not():
    causes = _causes({}, dry=lambda t: np.where(t < 5.3, COULOMB, 1.3 * COULOMB))
    assert [(each.name, each.at, each.form) for each in causes] == [("parameter_drift", "coulomb_A", "jump")]
    assert _holds(causes[0], "change", 0.3 * COULOMB) and _holds(causes[0], "at_s", 5.3)


@pytest.mark.parametrize("change", [0.1, 2.0])
def test_a_sensor_that_slips_is_named_with_its_time(change):
    """The larger one is two thirds of the weight."""
    causes = _causes({}, offset=lambda t: np.where(t < 9.1, 0.0, change))
    assert [(each.name, each.at, each.form) for each in causes] == [("sensor_drift", "current_A", "jump")]
    assert _holds(causes[0], "change", change) and _holds(causes[0], "at_s", 9.1)


def test_a_friction_that_is_smaller_at_low_speed_is_not_one_that_is_larger_there():
    assert "stribeck" not in [each.name for each in _causes(slow=-0.15)]


def test_a_balance_has_the_forms_of_a_simulated_machine():
    joint = HeavyJoint()
    found = {(each.cause, each.at, each.form) for each in joint.effects([joint.prepare(_joint(3))])}
    assert {form for cause, _, form in found if cause == "sensor_lag"} == {"delay", "filter"}
    assert {form for cause, _, form in found if cause == "sensor_drift"} == {"", "jump"}
    for name in ("inertia_As2_per_rad", "viscous_As_per_rad", "coulomb_A", "cosine_A", "sine_A"):
        assert {form for _, at, form in found if at == name} == {"ramp", "settling", "jump"}
