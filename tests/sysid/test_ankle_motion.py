"""The ankle's free simulation against another integrator, on the equations of its module's text written once more.

Every term is large here, so that none hides behind another; steps of 0.2 ms, for the current is one of first order.
"""

import importlib.util
from importlib.machinery import SourceFileLoader
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.machines import ankle_motion
from ranger_sim.sysid.machines.ankle_motion import PARAMETERS, Drive, REST_rad, simulated

T = np.arange(0.0, 0.8, 0.0002)
VALUES = {
    "inertia_kg_m2": 0.02,
    "return_stiffness_Nm_per_rad": 1.3,
    "return_torque_Nm": 0.15,
    "coulomb_friction_Nm": 0.12,
    "viscous_friction_Nms": 0.03,
    "load_friction": 0.08,
    "cable_stiffness_Nm_per_rad": 9.0,
    "rotor_inertia_kg_m2": 0.004,
    "joint_zero_rad": 0.05,
    "law_lag_s": 0.006,
    "target_late_s": 0.01,
    "motor_spring_Nm_per_rad": 0.9,
    "torque_constant_Nm_per_A": 0.7,
    "friction_width_rad_s": 0.3,
}
START = (0.4, 0.5, 0.42, -0.3)
K, D = 3.0, 0.12


def command(t):
    return 1.2 + 2.0 * np.sin(11.0 * t) + 0.7 * np.cos(23.0 * t)


def another_integrator(values, filter_s, at_motor, at_foot, start=START):
    """p, u, a, w, I at T."""
    v = {**VALUES, **values}

    def rates(t, y):
        p, u, a, w, r, current = y
        seen = r if filter_s else u
        late = max(t - v["target_late_s"], 0.0)
        asked = command(late) - K * p - D * seen
        constant = v["torque_constant_Nm_per_A"]
        slip = np.tanh(u / v["friction_width_rad_s"])
        motor = constant * current - v["viscous_friction_Nms"] * u
        motor -= (v["coulomb_friction_Nm"] + v["load_friction"] * abs(constant * current)) * slip
        cable = v["cable_stiffness_Nm_per_rad"] * (p + v["joint_zero_rad"] - a)
        foot = cable - v["return_stiffness_Nm_per_rad"] * (a - REST_rad) + v["return_torque_Nm"]
        return (
            u,
            (motor - cable - v["motor_spring_Nm_per_rad"] * p + at_motor(p, u, a)) / v["rotor_inertia_kg_m2"],
            w,
            (foot + at_foot(p, u, a)) / v["inertia_kg_m2"],
            (u - r) / filter_s if filter_s else 0.0,
            (asked - current) / v["law_lag_s"],
        )

    p, u, _, _ = start
    begin = (*start, u, command(0.0) - K * p - D * u)
    done = solve_ivp(rates, (0.0, T[-1]), begin, t_eval=T, rtol=1e-8, atol=1e-10, max_step=0.001)
    return done.y[[0, 1, 2, 3, 5]]


def none(p, u, a):
    return 0.0 * p


CASES = {
    "unchanged": ({}, 0.0),
    "behind a filter": ({}, 0.02),
    "behind the board's filter": ({}, ankle_motion.RATE_FILTER_S),
    "no load friction": ({"load_friction": 0.0}, 0.0),
    "no springs": ({"return_stiffness_Nm_per_rad": 0.0, "motor_spring_Nm_per_rad": 0.0}, 0.0),
    "on time": ({"target_late_s": 0.0}, 0.0),
}


@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("pushed", [False, True])
def test_a_motion_is_that_of_another_integrator(case, pushed):
    values, filter_s = CASES[case]
    at_motor, at_foot = none, none
    torques = None
    if pushed:

        def at_motor(p, u, a):
            return 0.2 * np.sin(3.0 * p)

        def at_foot(p, u, a):
            return -0.5 * a**2

        def torques(m):
            return at_motor(m.p, m.u, m.a), at_foot(m.p, m.u, m.a)

    found = simulated(Drive(T, command(T), K, D, filter_s), {**VALUES, **values}, START, torques)
    wanted = another_integrator(values, filter_s, at_motor, at_foot)
    assert found.rows == slice(None, None, 1) and len(found.p) == len(T)
    for name, course in zip("puawI", wanted, strict=True):
        # the current's step of first order errs by half of 0.2 ms of its rate, some part in a thousand of the motion
        assert np.abs(getattr(found, name) - course).max() < 4e-3 * np.ptp(course), name
    assert found.twist == pytest.approx(found.p + 0.05 - found.a) and found.cable == pytest.approx(9.0 * found.twist)
    # rates of the states are those that the states have
    inside = slice(5, -5)
    for state, slope in ((found.p, found.slopes[0]), (found.a, found.slopes[2]), (found.w, found.slopes[3])):
        assert np.abs(np.gradient(state, 0.0002) - slope)[inside].max() < 5e-3 * np.ptp(slope)
    assert np.abs(np.gradient(found.u, 0.0002) - found.slopes[1])[inside].max() < 0.03 * np.ptp(found.slopes[1])


def test_a_log_of_longer_steps_is_simulated_between_its_rows():
    """Steps of 10 ms are cut into five, so that what is simulated is nearly that of short ones."""
    every = 50
    coarse = simulated(Drive(T[::every], command(T[::every]), K, D), VALUES, START)
    assert coarse.rows == slice(None, None, 5)
    assert coarse.time_s[coarse.rows] == pytest.approx(T[::every], abs=1e-9)
    fine = simulated(Drive(T, command(T), K, D), VALUES, START)
    assert np.abs(coarse.p[coarse.rows] - fine.p[::every]).max() < 0.05 * np.ptp(fine.p)


def test_small_torques_and_changes_of_the_current_answer_as_whole_simulations_do():
    drive = Drive(T, command(T), K, D, 0.02)
    base = simulated(drive, VALUES, START)
    motor, foot = 1e-4 * np.sin(9.0 * T), 1e-4 * np.cos(5.0 * T)
    answer = base.answer(np.column_stack((motor, 0.0 * T)), np.column_stack((0.0 * T, foot)))
    for number, (m, f) in enumerate(((motor, 0.0 * T), (0.0 * T, foot))):
        moved = simulated(drive, VALUES, START, lambda _, m=m, f=f: (m, f))
        change = moved.states - base.states
        for state in range(6):
            size = np.abs(change[state]).max()
            assert np.abs(answer[:, state, number] - change[state]).max() < 5e-3 * size, state


def test_what_no_machine_does_is_refused_with_its_values():
    with pytest.raises(UserError, match="cannot be simulated with .*rotor_inertia_kg_m2"):
        simulated(Drive(T, 1e9 + 0.0 * T, 0.0, 0.0), {**VALUES, "rotor_inertia_kg_m2": 1e-5}, START)
    assert set(VALUES) == set(PARAMETERS)


def stepped(dry_Nm, width_rad_s=0.0):
    """p after steps of the command, with another scheme: explicit steps of 10 us, friction that stops or is smoothed.

    A motor alone in effect: the foot is light and its cable soft.
    """
    h, p, u, current, out = 1e-5, START[0], START[1], 0.0, []
    v = VALUES
    a, w = START[2], START[3]
    for at in range(round(T[-1] / h) + 1):
        if at % 20 == 0:
            out.append((p, u))
        asked = jumps(at * h) - K * p - D * u
        current += h / v["law_lag_s"] * (asked - current)
        constant = v["torque_constant_Nm_per_A"]
        cable = v["cable_stiffness_Nm_per_rad"] * (p + v["joint_zero_rad"] - a)
        push = constant * current - v["viscous_friction_Nms"] * u - cable - v["motor_spring_Nm_per_rad"] * p
        limit = dry_Nm + v["load_friction"] * abs(constant * current)
        if width_rad_s:
            u += h / v["rotor_inertia_kg_m2"] * (push - limit * np.tanh(u / width_rad_s))
        else:
            free, most = u + h / v["rotor_inertia_kg_m2"] * push, h / v["rotor_inertia_kg_m2"] * limit
            u = 0.0 if abs(free) <= most else free - np.copysign(most, free)
        foot = cable - v["return_stiffness_Nm_per_rad"] * (a - REST_rad) + v["return_torque_Nm"]
        w += h / v["inertia_kg_m2"] * foot
        p, a = p + h * u, a + h * w
    return np.array(out).T


def jumps(t):
    return 1.2 + 0.8 * (t > 0.2001) - 1.1 * (t > 0.5001)


DRY = 0.6  # N m, at which the motor stands for some hundredths of a second at each reversal of the foot


@pytest.fixture(scope="module")
def dry():
    values = {**VALUES, "coulomb_friction_Nm": DRY, "target_late_s": 0.0}
    return simulated(Drive(T, jumps(T), K, D), values, START, dry=True), values


def test_a_dry_motor_stands_where_another_scheme_has_it_stand(dry):
    found, _ = dry
    p, u = stepped(DRY)
    # commands jump between two rows here and are straight lines there: half a row, 0.1 ms, of the fastest motion
    assert np.abs(found.p - p[: len(T)]).max() < 2e-4 * np.abs(u).max() + 2e-3 * np.ptp(p)
    stands = u[: len(T)] == 0.0
    assert 0.1 < np.mean(stands) < 0.9
    assert np.mean(found.standing == stands) > 0.98
    assert np.all(found.u[found.standing] == 0.0) and np.max(np.abs(found.sliding)) < 1.0 + 1e-9
    # what holds it is below the limit, and where it slips it is the limit
    assert np.min(np.abs(found.sliding[~found.standing][5:])) > 1.0 - 1e-9
    assert np.all(found.slopes[1][found.standing] == 0.0)


def test_friction_whose_sign_is_narrow_creeps_where_dry_friction_stands(dry):
    found, values = dry
    narrow = simulated(Drive(T, jumps(T), K, D), {**values, "friction_width_rad_s": 0.003}, START)
    assert np.abs(narrow.p - found.p).max() < 3e-3 * np.ptp(found.p)
    assert not np.any(narrow.standing) and np.all(narrow.u[100:] != 0.0)


def test_sensitivities_are_those_of_whole_simulations_also_of_a_motor_that_stands(dry):
    """By every parameter that a step of it moves, dry or with a wide sign."""
    for is_dry in (True, False):
        _, values = dry
        drive = Drive(T, command(T), K, D)
        base = simulated(drive, values, START, dry=is_dry)
        slopes = ankle_motion.sensitivities(base)
        for number, name in enumerate(PARAMETERS):
            step = 1e-5 if name == "target_late_s" else 1e-4 * max(abs(values[name]), 0.05)
            ends = [simulated(drive, {**values, name: values[name] + way * step}, START, dry=is_dry) for way in (1, -1)]
            change = (ends[0].p - ends[1].p) / (2.0 * step)
            size = np.abs(change).max()
            # a motor that comes to stand does so at a whole step of 0.2 ms: by that its derivative is not smooth
            assert np.sqrt(np.mean((slopes[:, 0, number] - change) ** 2)) < 0.05 * size + 1e-9, (name, is_dry)


@pytest.mark.parametrize("width", [0.0, 0.05])
def test_the_loop_over_time_is_the_same_interpreted(width, monkeypatch):
    source = str(Path(ankle_motion.__file__).with_name("ankle_steps.py"))
    spec = importlib.util.spec_from_loader(
        "ankle_steps_interpreted", SourceFileLoader("ankle_steps_interpreted", source)
    )
    plain = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(plain)
    values = {**VALUES, "friction_width_rad_s": width or 0.3}
    compiled = simulated(Drive(T, jumps(T), K, D), values, START, dry=not width)
    monkeypatch.setattr(ankle_motion.ankle_steps, "walk", plain.walk)
    interpreted = simulated(Drive(T, jumps(T), K, D), values, START, dry=not width)
    assert compiled.states.tobytes() == interpreted.states.tobytes()
    assert compiled.sliding.tobytes() == interpreted.sliding.tobytes()


def test_a_command_is_a_cubic_where_it_is_bent_and_a_straight_line_elsewhere():
    time_s = np.arange(0.0, 1.0, 0.01)
    values = {"target_late_s": 0.004}
    fine_s = np.arange(0.1, 0.9, 0.001)
    true = np.sin(19.0 * (fine_s - 0.004))
    bent = Drive(time_s, np.sin(19.0 * time_s), K, D, bent=True).command(fine_s, values)
    straight = Drive(time_s, np.sin(19.0 * time_s), K, D).command(fine_s, values)
    # a chord is below its arc by (19 h)^2 / 8, a cubic by some (19 h)^4 / 384
    assert np.abs(bent - true).max() < 1e-5 < 4e-3 < np.abs(straight - true).max() < 5e-3


def test_a_command_jumps_between_its_rows_where_its_time_says():
    """Its mean over each step: the part of the step after the jump."""
    time_s = np.arange(0.0, 0.1, 0.01)
    drive = Drive(time_s, np.where(time_s > 0.045, 3.0, 1.0), K, D, jumps={"first": 5})
    fine_s = np.arange(0.0, 0.09, 0.002)
    for offset_s, late_s in ((0.0, 0.0), (-0.0031, 0.0), (0.0042, 0.0), (0.0007, 0.003)):
        values = {"target_late_s": late_s, "first": offset_s}
        at_s = 0.045 + offset_s + late_s
        after = np.clip(fine_s - at_s, 0.0, 0.002) / 0.002
        assert drive.command(fine_s, values) == pytest.approx(1.0 + 2.0 * after, abs=1e-9)
        # by a jump later by 1 s: what a step has less, and in all two for 2 ms
        moved = drive.command(fine_s, {**values, "first": offset_s + 1e-6})
        change = (moved - drive.command(fine_s, values)) / 1e-6
        assert drive.by_jumps(fine_s, values)[:, 0] == pytest.approx(change, rel=1e-6, abs=1e-6)
        assert np.sum(change) * 0.002 == pytest.approx(-2.0, rel=1e-6)


def test_the_time_of_a_jump_moves_a_simulation_as_its_sensitivity_says():
    time_s = np.arange(0.0, 0.8, 0.01)
    drive = Drive(time_s, np.where(time_s > 0.2, 2.5, 1.2), K, D, jumps={"jump": 21})
    base = simulated(drive, {**VALUES, "jump": 0.001}, START)
    slopes = ankle_motion.sensitivities(base)
    assert slopes.shape[2] == len(PARAMETERS) + 1
    ends = [simulated(drive, {**VALUES, "jump": 0.001 + way * 2e-5}, START) for way in (1.0, -1.0)]
    change = (ends[0].a - ends[1].a) / 4e-5
    assert np.abs(slopes[:, 2, -1] - change).max() < 0.02 * np.abs(change).max()
