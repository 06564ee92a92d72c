"""Rows of every block of the identification, worked out once more; simulations in them against another integrator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR
from ranger_sim.sysid import plausibility
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification import ankle, blocks, legs, motor
from ranger_sim.sysid.instruments import Instrument
from ranger_sim.sysid.machine import Known

RNG = generator(12, "rows")
VOLT, AMPERE = math.hypot(0.004, 20.0 / 2**14 / math.sqrt(12.0)), math.hypot(0.004, 10.0 / 2**14 / math.sqrt(12.0))
TORQUE, SPEED = math.hypot(0.002, 0.0005 / math.sqrt(12.0)), math.hypot(0.03, 0.001 / math.sqrt(12.0))


def data(name, **columns):
    time_s = 2.0 * np.arange(len(next(iter(columns.values()))))
    return Dataset(name, {key: Channel(key, "1", time_s, np.asarray(column, float)) for key, column in columns.items()})


def test_a_stall_s_rows_are_what_its_voltage_misses():
    current = np.array([-2.0, -1.0, -0.03, 0.029, 0.5, 1.5, 2.5])
    volts = 1.4 * current + 0.6 * np.sign(current) + 0.01 * np.arange(7)
    made = motor.stalled_block(data("s", voltage_V=volts, current_A=current))
    sure = np.abs(current) > 0.03
    assert made.count == 5 and [each.name for each in made.parameters] == ["R", "V_c"]
    known = {each.name: each.uncertainty for each in made.nuisances}
    assert known == {"stall.voltmeter_offset": 0.002, "stall.voltmeter_gain": 0.0005,
                     "stall.current_sensor_offset": 0.003, "stall.current_sensor_gain": 0.003}  # fmt: skip
    V, I = volts[sure], current[sure]  # noqa: E741
    rough = np.linalg.lstsq(np.column_stack([I, np.sign(I)]), V, rcond=None)[0][0]
    sigma = math.hypot(VOLT, rough * AMPERE)
    values = {"R": 1.3, "V_c": 0.7, "stall.voltmeter_offset": 0.02, "stall.voltmeter_gain": 0.01,
              "stall.current_sensor_offset": -0.03, "stall.current_sensor_gain": 0.02}  # fmt: skip
    wanted = ((V - 0.02) / 1.01 - 1.3 * (I + 0.03) / 1.02 - 0.7 * np.sign(I)) / sigma
    assert made.residual(values) == pytest.approx(wanted)
    one_way = data("s", voltage_V=np.abs(volts), current_A=np.abs(current))
    with pytest.raises(UserError, match="s: stall needs readings with current in both directions, it has 5 in all"):
        motor.stalled_block(one_way)


def cantilever():
    current, speed = RNG.uniform(0.1, 3.0, 24), RNG.uniform(0.5, 20.0, 24)
    current[::2] *= -1.0
    speed[::3] *= -1.0
    current[0], speed[1], speed[2], current[3] = 0.03, 0.3, -0.31, -0.031
    volts = 1.3 * current + 0.7 * np.sign(current) + 0.25 * speed + 0.01 * RNG.normal(size=24)
    torque = 0.25 * current + 0.01 * RNG.normal(size=24)
    return volts, current, speed, torque


def test_a_cantilever_s_rows_are_both_balances_made_independent():
    V, I, w, T = cantilever()  # noqa: E741
    readings = data("c", voltage_V=V, current_A=I, speed_rad_per_s=w, torque_Nm=T)
    assert motor.turning(readings).left_out == 2
    V, I, w, T = (each[2:] for each in (V, I, w, T))  # noqa: E741
    sign = np.sign(I)
    values = {"R": 1.2, "V_c": 0.8, "K": 0.02, "C_1": 0.004, "C_0": 0.02, "mu": 0.07}
    power = motor.power_block(readings, 14.0)
    assert [each.name for each in power.parameters] == ["R", "V_c", "K"] and power.count == 22
    rough = np.linalg.lstsq(np.column_stack([I, sign, 14.0 * w]), V, rcond=None)[0]
    sigma = math.sqrt(VOLT**2 + (rough[0] * AMPERE) ** 2 + (14.0 * rough[2] * SPEED) ** 2)
    E = V - 1.2 * I - 0.8 * sign - 0.28 * w
    assert power.residual(values) == pytest.approx(E / sigma)
    both = motor.cantilever_block(readings, 14.0)
    assert [each.name for each in both.parameters] == ["R", "V_c", "K", "C_1", "C_0", "mu"] and both.count == 44
    assert len(both.nuisances) == 6
    M = T - 0.28 * I + (0.07 * 0.28 * np.abs(I) + 0.02) * np.sign(w) + 0.004 * w
    # whitened: rows' squares are those by the inverse of the covariance of a reading's two rows
    GK = 14.0 * rough[2]
    spread = np.array([
        [VOLT**2 + (rough[0] * AMPERE) ** 2 + (GK * SPEED) ** 2, rough[0] * GK * AMPERE**2],
        [rough[0] * GK * AMPERE**2, TORQUE**2 + (GK * AMPERE) ** 2],
    ])  # fmt: skip
    rows = both.residual(values).reshape(-1, 2)
    together = np.stack((E, M), axis=1)
    assert np.sum(rows**2, axis=1) == pytest.approx(np.einsum("ni,ij,nj->n", together, np.linalg.inv(spread), together))
    assert rows[:, 0] == pytest.approx(E / math.sqrt(spread[0, 0]))
    few = data("c", voltage_V=V[:9], current_A=I[:9], speed_rad_per_s=w[:9], torque_Nm=T[:9])
    with pytest.raises(UserError, match="c: cantilever needs 10 readings above 0.03 A and 0.3 rad/s, it has 9"):
        motor.turning(few)


@pytest.mark.parametrize("apart", [False, True])
def test_a_pulley_s_rows_are_loads_against_motor_and_friction(apart):
    current = np.array([0.0, 0.6, -0.6, 0.9, 0.02, 0.0, 0.0])
    mass = np.array([0.045, 0.7, 0.5, 0.9, 0.05, 0.1, 0.3])
    side = np.array([1.0, 1.0, -1.0, -1.0, 1.0, 1.0, 1.0])
    tapped = np.array([1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0])
    speed = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 17.0])
    readings = data("p", current_A=current, mass_kg=mass, side=side, tapped=tapped, speed_rad_per_s=speed)
    made = motor.pulley_block(readings, 14.0, apart)
    names = ["C_0d", "C_0s", "mu_d", "mu_s"] if apart else ["C_0", "mu"]
    assert [each.name for each in made.parameters] == ["K", "C_1", *names] and made.count == 7
    radius = made.nuisances[-1]
    assert (radius.name, radius.value, radius.uncertainty) == ("pulley.radius_m", 0.025, 0.00005)
    assert (radius.low, radius.high) == (pytest.approx(0.0025), pytest.approx(0.25))
    values = {"K": 0.02, "C_1": 0.004, "C_0": 0.012, "mu": 0.09, "C_0d": 0.01, "C_0s": 0.015, "mu_d": 0.08,
              "mu_s": 0.12,
              "pulley.radius_m": 0.026}  # fmt: skip
    found = made.residual(values)
    for k in range(7):
        driven, onset = abs(current[k]) > 5.0 * AMPERE + 0.003, speed[k] == 0.0
        GKI = 14.0 * 0.02 * abs(current[k]) if driven else 0.0
        static = apart and not tapped[k] and onset
        C_0 = (0.015 if static else 0.01) if apart else 0.012
        mu = (0.12 if static else 0.08) if apart else 0.09
        # motion began between the last two masses, 5 g apart
        load = (mass[k] - (0.0025 * side[k] if onset else 0.0)) * 9.81 * 0.026
        planned = 14.0 * 0.018 * abs(current[k]) if driven else 0.0
        sigma = math.sqrt(
            (0.005 * 9.81 * 0.025 / math.sqrt(12.0) if onset else 0.0) ** 2
            + (0.05 * (0.01 + 0.1 * planned)) ** 2
            + (14.0 * 0.018 * AMPERE if driven else 0.0) ** 2
            + (0.0 if onset else 0.0033 * SPEED) ** 2
        )
        assert found[k] == pytest.approx((load - GKI - side[k] * (C_0 + mu * GKI) - 0.004 * speed[k]) / sigma), k


# --- legs -------------------------------------------------------------------------------------------------------------


def test_a_level_leg_s_rows_are_forces_against_its_moment():
    force, inner = RNG.uniform(5.0, 9.0, 6), np.array([0.0, 1.0, 0.0, 1.0, 1.0, 0.0])
    made = legs.level_block(data("l", force_N=force, inner=inner), 0.96)
    assert [each.name for each in made.parameters] == ["outer_cm", "inner_cm"] and made.count == 6
    assert (made.nuisances[-1].name, made.nuisances[-1].uncertainty) == ("level.arm_m", 0.0005)
    sigma = math.hypot(0.03, 0.05 / math.sqrt(12.0))
    moments = np.where(inner > 0.0, 0.8, 0.7)
    values = {"outer_cm": 0.7, "inner_cm": 0.8, "level.arm_m": 0.97, "level.fish_scale_offset": 0.1}
    assert made.residual(values) == pytest.approx((force - 0.1 - 9.81 * moments / 0.97) / sigma)
    alone = legs.level_block(data("l", force_N=force))
    assert [each.name for each in alone.parameters] == ["outer_cm"]


def test_a_hanging_leg_s_rows_are_angles_against_where_its_centre_hangs():
    angle, inner = RNG.uniform(-0.1, 0.1, 6), np.array([0.0, 1.0, 0.0, 1.0, 1.0, 0.0])
    made = legs.hang_block(data("h", angle_rad=angle, inner=inner))
    assert [each.name for each in made.parameters] == ["outer_cm", "outer_wm", "inner_cm", "inner_wm"]
    values = {"outer_cm": 0.7, "outer_wm": 0.05, "inner_cm": 0.8, "inner_wm": -0.03, "hang.inclinometer_offset": 0.002}
    rest = np.where(inner > 0.0, math.atan(-0.03 / 0.8), math.atan(0.05 / 0.7))
    # noise, counts of 0.05 degrees, and bearings of 4 mN m that hold a leg of 0.7 kg m anywhere: uniform
    sigma = math.hypot(math.hypot(0.0005, math.radians(0.05) / math.sqrt(12.0)), 0.004 / (9.81 * 0.7) / math.sqrt(3.0))
    assert made.residual(values) == pytest.approx((angle - 0.002 - rest) / sigma)


ENCODER = math.hypot(0.0002, 2.0 * math.pi / 8192 / math.sqrt(12.0))


def swing(leg="inner"):
    t = 0.02 * np.arange(400)
    return legs.Swing(leg, t, 0.03 + 0.1 * np.exp(-0.05 * t) * np.cos(3.6 * t))


def test_a_swing_s_period_is_twice_the_mean_distance_of_its_crossings():
    one = swing()
    assert one.period_s == pytest.approx(2.0 * math.pi / 3.6, rel=0.01)
    middle = np.mean(one.angle_rad)
    crossings = [
        one.time_s[k + 1] for k in range(399) if (one.angle_rad[k] > middle) != (one.angle_rad[k + 1] > middle)
    ]
    assert one.period_s == pytest.approx(2.0 * (crossings[-1] - crossings[0]) / (len(crossings) - 1))
    few = legs.Swing("outer", one.time_s[:150], np.cos(math.pi * 3.4 / 3.0 * one.time_s[:150]))
    with pytest.raises(UserError, match="pendulum: the outer leg swings less than two periods"):
        assert few.period_s


def test_a_small_swing_s_rows_are_a_damped_cosine_that_gets_faster_as_it_dies_away():
    one = swing()
    made = legs.period_block(one)
    starts = {each.name: each.value for each in made.parameters}
    middle = float(np.mean(one.angle_rad))
    assert starts["inner_swing.middle_rad"] == middle and starts["inner_cm"] == 0.7
    assert starts["inner_swing.amplitude_rad"] == pytest.approx(one.angle_rad[0] - middle)
    assert starts["inner_J_hip"] == pytest.approx((one.period_s / 2.0 / math.pi) ** 2 * 0.7 * 9.81)
    assert made.series and made.count == 400 and made.nuisances == ()
    for decay in (0.05, 0.0):
        values = {"inner_cm": 0.72, "inner_wm": 0.1, "inner_J_hip": 0.56, "inner_swing.amplitude_rad": 0.3,
                  "inner_swing.decay_per_s": decay, "inner_swing.phase_rad": 0.2,
                  "inner_swing.middle_rad": 0.02}  # fmt: skip
        rate = math.sqrt(9.81 * math.hypot(0.72, 0.1) / 0.56)
        turned = [0.2]
        for k in range(399):  # by trapezoids over a hundred parts of a sample
            s = np.linspace(one.time_s[k], one.time_s[k + 1], 101)
            speed = rate * (1.0 - 0.3**2 / 16.0 * np.exp(-2.0 * decay * s))
            turned.append(turned[-1] + float(np.sum(0.5 * (speed[1:] + speed[:-1])) * (s[1] - s[0])))
        wanted = (one.angle_rad - 0.02 - 0.3 * np.exp(-decay * one.time_s) * np.cos(turned)) / ENCODER
        assert made.residual(values) == pytest.approx(wanted, abs=1e-4)


def test_a_swing_s_simulation_is_that_of_another_integrator():
    t = np.sort(RNG.uniform(0.0, 5.0, 80))
    found = legs.simulated(6.9, 0.04, 0.56, 0.02, 0.03, 0.25, t)

    def rates(_, y):
        return y[1], -(6.9 * math.sin(y[0]) + 0.02 * y[1] + 0.03 * math.tanh(y[1] / 0.01)) / 0.56

    done = solve_ivp(rates, (0.0, 5.0), (0.25, 0.0), "DOP853", t, rtol=1e-9, atol=1e-11)
    # dry friction turns its sign within a step of 20 ms: some 1e-5 rad each time
    assert found == pytest.approx(0.04 + done.y[0], abs=2e-4)
    smooth = legs.simulated(6.9, 0.0, 0.56, 0.02, 0.0, 0.25, t)
    done = solve_ivp(lambda _, y: (y[1], -(6.9 * math.sin(y[0]) + 0.02 * y[1]) / 0.56), (0.0, 5.0), (0.25, 0.0),
                     "DOP853", t, rtol=1e-10, atol=1e-12)  # fmt: skip
    assert smooth == pytest.approx(done.y[0], abs=1e-6)


def test_between_steps_a_cubic_goes_through_values_and_slopes():
    values, slopes = RNG.normal(size=6), RNG.normal(size=6)
    t = np.array([0.0, 0.003, 0.02, 0.05, 0.0999, 0.1])
    wanted = CubicHermiteSpline(0.02 * np.arange(6), values, slopes)(t)
    assert legs._hermite(values, slopes, 0.02, t) == pytest.approx(wanted)


def test_a_simulated_swing_s_rows_are_angles_less_the_encoder_s_zero():
    one = swing("outer")
    made = legs.swing_block(one)
    starts = {each.name: each.value for each in made.parameters}
    assert starts["outer_swing.release_rad"] == pytest.approx(one.angle_rad[0] - np.mean(one.angle_rad))
    assert list(starts)[:3] == ["outer_cm", "outer_wm", "outer_J_hip"] and made.series and made.count == 400
    (zero,) = made.nuisances
    assert (zero.name, zero.uncertainty, zero.value) == ("pendulum.joint_encoder_zero", 0.005, 0.0)
    values = {"outer_cm": 0.7, "outer_wm": 0.05, "outer_J_hip": 0.55, "outer_swing.release_rad": 0.1,
              "outer_swing.bearing_Nms": 0.01, "outer_swing.bearing_Nm": 0.0, zero.name: 0.004}  # fmt: skip
    motion = legs.simulated(9.81 * math.hypot(0.7, 0.05), math.atan(0.05 / 0.7), 0.55, 0.01, 0.0, 0.1, one.time_s)
    for _ in range(2):  # the second time from what was kept
        assert made.residual(values) == pytest.approx((one.angle_rad - 0.004 - motion) / ENCODER)
    assert made.residual(values | {"outer_J_hip": 0.6}) != pytest.approx((one.angle_rad - 0.004 - motion) / ENCODER)


def test_legs_are_in_a_recording_by_its_column_and_need_fifty_samples_each():
    t = 0.02 * np.arange(120)
    shown = np.concatenate((np.cos(3.6 * t[:60]), np.sin(3.6 * t[60:])))
    inner = (np.arange(120) >= 60).astype(float)
    channels = {
        "angle_rad": Channel("angle_rad", "rad", 1.0 + t, shown),
        "inner": Channel("inner", "1", 1.0 + t, inner),
    }
    first, second = legs.swings(Dataset("p", channels))
    assert (first.leg, second.leg) == ("outer", "inner")
    assert first.time_s == pytest.approx(t[:60]) and second.time_s == pytest.approx(t[:60], abs=1e-9)
    assert np.array_equal(second.angle_rad, shown[60:])
    for rows in (50, 49):
        one = Dataset("p", {"angle_rad": Channel("angle_rad", "rad", t[:rows], shown[:rows])})
        if rows == 50:
            assert len(legs.swings(one)) == 1
        else:
            with pytest.raises(UserError, match="p: pendulum needs 50 samples with rising stamps of each leg"):
                legs.swings(one)
    still = t.copy()
    still[7] = still[6]
    with pytest.raises(UserError, match="p: pendulum needs 50 samples with rising stamps"):
        legs.swings(Dataset("p", {"angle_rad": Channel("angle_rad", "rad", still, shown)}))


def a_fit(names, values, covariance):
    errors = np.sqrt(np.diag(covariance))
    told = dict(zip(names, values, strict=True))
    return Fit(tuple(names), dict.fromkeys(names, "kg m"), told, dict(zip(names, errors, strict=True)), {}, covariance,
               np.zeros(3), 0.0, 1.0, 0.0, 3.0, None, told)  # fmt: skip


def test_legs_balance_when_their_difference_is_within_its_own_error():
    names = ("outer_J_hip", "inner_J_hip", "outer_cm", "inner_cm", "outer_wm", "inner_wm")
    covariance = np.diag([4.0, 9.0, 1.0, 1.0, 1.0, 1.0])
    covariance[0, 1] = covariance[1, 0] = 5.0  # what both share cancels
    found = legs.balance(a_fit(names, (10.0, 7.0, 5.0, 3.0, 1.0, 4.0), covariance))
    assert [each.name for each in found] == ["J_hip", "cm", "wm"]
    assert [each.difference for each in found] == [3.0, 2.0, -3.0]
    assert [each.standard_error for each in found] == pytest.approx([math.sqrt(3.0), math.sqrt(2.0), math.sqrt(2.0)])
    assert [each.balanced for each in found] == [True, True, False] and (found[0].outer, found[0].inner) == (10.0, 7.0)


# --- ankle ------------------------------------------------------------------------------------------------------------


def test_the_sine_s_simulation_is_that_of_another_integrator():
    v = {"J_foot": 0.004, "k_r": 0.5, "return_Nm": 0.6, "ankle_C_0": 0.08, "ankle.mu": 0.12, "ankle.k_s": 13.0}
    t = 3.0 + 0.004 * np.arange(150)
    target, rate = 1.0 + 0.5 * np.sin(6.0 * (t - 3.0)), 3.0 * np.cos(6.0 * (t - 3.0))
    p, a = ankle.simulated(v, t, target, rate, (1.02, 1.0, 2.5))
    m = ANKLE_MOTOR
    GK, J_A = m.gear * m.torque_constant_Nm_per_A, m.reflected_inertia_kg_m2

    def rates(s, y):
        goal, speed = np.interp(s, t - 3.0, target), np.interp(s, t - 3.0, rate)
        drive = GK * (11.219 * (goal - y[0]) + 1.634 * (speed - y[2]))
        rubs = (0.12 * abs(drive) + 0.08) * math.tanh(y[2] / m.friction_smoothing_rad_s) + m.viscous_friction_Nms * y[2]
        cable = 13.0 * (y[0] - y[1])
        return y[2], y[3], (drive - rubs - cable) / J_A, (cable - 0.5 * y[1] + 0.6) / 0.004

    done = solve_ivp(
        rates, (0.0, t[-1] - 3.0), (1.02, 1.0, 2.5, 2.5), "LSODA", t - 3.0, rtol=1e-8, atol=1e-10, max_step=0.002
    )
    assert p == pytest.approx(done.y[0], abs=2e-4) and a == pytest.approx(done.y[1], abs=2e-4)


def test_stretches_of_a_sine_are_compared_after_three_tenths_of_a_second():
    """Three runs: of 0.9 s, of 49 rows, and one of 1.2 s that is left."""
    parts = [0.01 * np.arange(90), 5.0 + 0.03 * np.arange(49), 9.0 + 0.01 * np.arange(121)]
    t = np.concatenate(parts)
    columns = {name: RNG.normal(size=len(t)) * 0.01 + 1.0 for name in ankle.COLUMNS}
    channels = {name: Channel(name, "rad", t, column) for name, column in columns.items()}
    (one,) = ankle.sine_blocks(Dataset("s", channels))
    assert one.series and [each.name for each in one.parameters] == ["J_foot", "k_r", "return_Nm", "ankle_C_0"]
    assert {each.name: each.uncertainty for each in one.nuisances} == {"ankle.mu": 0.01, "ankle.k_s": 0.2}
    run = slice(90 + 49, None)
    v = {"J_foot": 0.002, "k_r": 0.1, "return_Nm": 0.05, "ankle_C_0": 0.05, "ankle.mu": 0.1, "ankle.k_s": 14.0}
    motor_angle, joint, rate, goal, goal_rate = (columns[name][run] for name in ankle.COLUMNS)
    p, a = ankle.simulated(v, t[run], goal, goal_rate, (motor_angle[0], joint[0], rate[0]))
    later = t[run] - t[run][0] >= 0.3
    sigma = math.hypot(0.0002, 2.0 * math.pi / 8192 / math.sqrt(12.0))
    wanted = np.concatenate(((motor_angle - p)[later], (joint - a)[later])) / sigma
    assert one.residual(v) == pytest.approx(wanted) and one.count == len(wanted)


# --- what all have in common ------------------------------------------------------------------------------------------


def test_an_instrument_s_errors_are_unknowns_as_far_as_it_has_them():
    shown = np.array([1.0, 2.0])
    both = Instrument("some thing's", "V", 0.1, 0.0, 0.02, 0.01, "source")
    correction, errors = blocks.corrected("bench", shown, both)
    assert [(each.name, each.unit, each.uncertainty, each.value) for each in errors] == [
        ("bench.some_things_offset", "V", 0.02, 0.0), ("bench.some_things_gain", "1", 0.01, 0.0),
    ]  # fmt: skip
    assert correction({"bench.some_things_offset": 0.5, "bench.some_things_gain": 0.25}) == pytest.approx([0.4, 1.2])
    assert correction({}) == pytest.approx(shown)
    assert blocks.corrected("bench", shown, Instrument("a", "V", 0.1, 0.0, 0.0, 0.0, ""))[1] == ()


def test_columns_are_there_finite_and_of_one_length_or_that_is_reported():
    made = data("d", a=[1.0, 2.0], b=[1.0, math.nan])
    assert blocks.column(made, "a", "bench").tolist() == [1.0, 2.0]
    assert blocks.column(made, "c", "bench", 0.5).tolist() == [0.5, 0.5]
    with pytest.raises(UserError, match="d: bench needs the channel c; there are a, b"):
        blocks.column(made, "c", "bench")
    with pytest.raises(UserError, match="d: b has 1 values that are not numbers"):
        blocks.column(made, "b", "bench")
    blocks.same_rows(made, "bench", np.zeros(2), np.ones(2))
    with pytest.raises(UserError, match=r"d: the channels of bench must have the same rows, they have \[2, 3\]"):
        blocks.same_rows(made, "bench", np.zeros(2), np.ones(3))


def test_what_cannot_be_negative_is_refused_beyond_two_errors():
    covariance = np.diag([0.01, 0.01, 0.01])
    for value, refused in ((-0.19, False), (-0.21, True)):
        found = blocks.refused_if_negative(a_fit(("R", "outer_wm", "zeta"), (value, -9.0, -9.0), covariance))
        assert bool(found.refused) is refused and (found.values == {}) is refused
        assert "outer_wm" not in found.refused
    told = blocks.refused_if_negative(a_fit(("R", "k_r", "zeta"), (-1.0, -2.0, 1.0), covariance)).refused
    assert told == "R is -1 kg m, it cannot be negative; k_r is -2 kg m, it cannot be negative"


def test_a_start_is_where_an_earlier_fit_ended_within_the_limits():
    earlier = a_fit(("a", "b", "c"), (3.0, 50.0, 0.1), np.eye(3))
    asked = [Parameter("a", "1", 2.0, 0.0, 10.0), Parameter("b", "1", 1.0, 0.0, 10.0),
             Parameter("c", "1", 0.0, -1.0, 1.0, uncertainty=0.5), Parameter("d", "1", 4.0)]  # fmt: skip
    a, b, c, d = blocks.start_at(earlier, asked)
    assert (a.value, a.scale) == (3.0, 2.0) and b is asked[1] and c is asked[2] and d is asked[3]


# --- whether a number can be a machine's ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "error", "wanted"),
    [
        (11.0, 0.1, True), (10.6, 0.1, True), (10.4, 0.1, False), (9.0, 1.0, False),
        (-0.4, 0.0, False), (-0.6, 0.0, True), (-0.6, 0.01, True), (-0.6, 0.03, False), (0.5, 0.0, False),
    ],
)  # fmt: skip
def test_a_number_is_absurd_surely_beyond_its_limits_or_half_of_itself_below_zero(value, error, wanted):
    """Five errors count as surely; known is 1, limits are 0 and 10."""
    assert plausibility.absurd(Known("k", "", 1.0, 0.0, 10.0, ""), value, error) is wanted


def test_below_a_limit_that_is_negative_itself_a_number_is_absurd_at_once():
    known = Known("k", "", 1.0, -2.0, 10.0, "")
    assert plausibility.absurd(known, -2.6, 0.1) and not plausibility.absurd(known, -2.4, 0.1)
    zero = Known("k", "", 0.0, 0.0, 10.0, "")
    assert plausibility.absurd(zero, -0.6, 0.1) and not plausibility.absurd(zero, -0.4, 0.1)
