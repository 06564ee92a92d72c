"""Virtual benches: what they show is what the textbook says of the machine behind them, and their instruments err as
they say."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import ellipk

from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid import instruments
from ranger_sim.sysid.benches import leg, motor, pulley, springs

EXACT = dataclasses.replace(instruments.VOLTMETER, noise=0.0, resolution=0.0, offset=0.0, gain=0.0)
M = motor.BENCH_MOTOR
R, V_C, GK = M.loop_resistance_ohm, M.contact_drop_V, M.gear * M.torque_constant_Nm_per_A


def test_an_instrument_without_errors_shows_the_truth():
    truth = np.array([-3.0, 0.0, 1e-3, 9.0])
    assert EXACT.read(truth, 1, "here").tolist() == truth.tolist()


def test_an_instrument_errs_as_it_says():
    made = dataclasses.replace(EXACT, noise=0.02, resolution=0.05, offset=0.5, gain=0.1, low=-1000.0, high=1000.0)
    truth = np.linspace(1.0, 2.0, 4000)
    shown = made.read(truth, 7, "here")
    offset, gain = made.errors(7, "here")
    left = shown - (1.0 + gain) * truth - offset
    # 4000 samples: a standard deviation is known to 1.1 %, a mean to sigma / 63
    assert left.std() == pytest.approx(made.sigma, rel=0.06)
    assert abs(left.mean()) < 5.0 * made.sigma / 63.0
    assert np.allclose(shown / 0.05, np.round(shown / 0.05), atol=1e-9)
    drawn = np.array([made.errors(seed, "here") for seed in range(400)])
    assert drawn.std(axis=0) == pytest.approx([0.5, 0.1], rel=0.2)  # known to 3.5 %
    assert made.errors(7, "there") != made.errors(7, "here")


def test_an_instrument_ends_at_both_ends_of_its_range():
    ends = dataclasses.replace(EXACT, low=-1.0, high=2.0)
    assert ends.read(np.array([-5.0, 0.5, 5.0]), 1, "here").tolist() == [-1.0, 0.5, 2.0]


def test_the_same_seed_records_the_same_and_another_seed_another():
    first, again, other = motor.stall(M, 3), motor.stall(M, 3), motor.stall(M, 4)
    assert np.array_equal(first["current_A"].value, again["current_A"].value)
    assert not np.array_equal(first["current_A"].value, other["current_A"].value)


@pytest.mark.parametrize("voltage", [-3.0, -0.9, -0.3, 0.0, 0.5, 1.0, 3.0])
def test_a_stalled_motor_carries_what_is_left_above_the_contact_drop_by_its_resistance(voltage):
    current, torque = motor.SuppliedMotor(M).settle(voltage, 0.0)
    expected = math.copysign(max(abs(voltage) - V_C, 0.0) / R, voltage)
    assert current == pytest.approx(expected, abs=1e-12)
    assert torque == pytest.approx(GK * expected, abs=1e-12)  # at rest the plant's smoothed friction is none


@pytest.mark.parametrize("load", [0.3, -0.3])
@pytest.mark.parametrize("voltage", [6.0, -4.0, 0.0])
def test_a_turning_motor_keeps_the_appendix_s_two_equations(voltage, load):
    # eq. 32 and 33, 35 with sharp signs; at these speeds the plant's tanh is 1 within 1e-9, and the speed is found to
    # 1e-7 rad/s, through which the torque changes by 0.05 N m s/rad
    supplied = motor.SuppliedMotor(M)
    w = supplied.steady_speed(voltage, load)
    I, T = supplied.settle(voltage, w)  # noqa: E741  the paper's letters
    assert abs(w) > 0.6 and abs(I) > 0.1
    assert voltage == pytest.approx(R * I + V_C * np.sign(I) + GK * w, abs=1e-9)
    friction = (M.load_friction * GK * abs(I) + M.constant_friction_Nm) * np.sign(w) + M.viscous_friction_Nms * w
    assert load == pytest.approx(GK * I - friction, abs=1e-7)
    assert load == pytest.approx(T, abs=1e-7)


def test_the_cantilever_runs_all_four_quadrants_braking_up_and_down():
    data = motor.cantilever()
    voltage, speed, torque = (data[name].value for name in ("voltage_V", "speed_rad_per_s", "torque_Nm"))
    for level in (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0, 6.0):
        assert np.count_nonzero(np.abs(voltage - level) < 0.1) == 2 * motor.BRAKE_STEPS
    quadrants = {(np.sign(w), np.sign(T)) for w, T in zip(speed, torque, strict=True) if abs(w) > 1.0 and abs(T) > 0.05}
    assert quadrants == {(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)}
    first = torque[: 2 * motor.BRAKE_STEPS]
    assert np.all(np.diff(first[: motor.BRAKE_STEPS]) > 0.0) and np.all(np.diff(first[motor.BRAKE_STEPS :]) < 0.0)


def test_true_stick_holds_up_to_the_static_friction_and_no_further():
    friction = pulley.StickFriction(C0s=0.02, C0d=0.01, mu_s=0.2, mu_d=0.1, C1=0.004)
    for sign in (1.0, -1.0):
        assert friction.holds(sign * 0.02, 0.0) and not friction.holds(sign * 0.0201, 0.0)
        assert friction.holds(sign * 0.12, 0.5) and not friction.holds(sign * 0.1201, -0.5)
        assert friction.moves(sign * 0.0101, 0.0) and not friction.moves(sign * 0.0099, 0.0)
        assert friction.speed(sign * 0.05, 0.0) == pytest.approx(sign * 0.04 / 0.004)
        assert friction.speed(sign * 0.009, 0.0) == 0.0


def test_the_appendix_s_masses_begin_to_move_at_40_and_45_grams():
    # 8.4.1: about 40 g tapped, 8.4.2: about 45 g untapped, both called 0.01 N m: 40.8 g g r is exactly 0.01 N m. With
    # 0.00975 (39.8 g) in motion and 0.0108 (44.0 g) at rest the first masses are the appendix's.
    friction = pulley.StickFriction(C0s=0.0108, C0d=0.00975)
    assert pulley.first_mass_kg(friction, 0.0, 1.0, tapped=True) == pytest.approx(0.040)
    assert pulley.first_mass_kg(friction, 0.0, 1.0, tapped=False) == pytest.approx(0.045)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_driven_pulley_s_first_mass_is_the_step_beyond_eq_38(side):
    friction = pulley.StickFriction(C0s=0.01, C0d=0.01, mu_s=0.1, mu_d=0.1)
    for drive in (0.2, -0.3):
        threshold = (abs(drive) + side * (0.1 * abs(drive) + 0.01)) / (pulley.GRAVITY * pulley.RADIUS_M)
        mass = pulley.first_mass_kg(friction, drive, side, tapped=True)
        assert 0.0 <= (mass - threshold) * side <= pulley.MASS_STEP_KG + 1e-12


def test_a_leg_held_level_pulls_by_its_moment_over_the_arm():
    # m c g / l = 0.72 x 9.81 / 0.96 N; offset w m counts by the tangent of what the hand misses
    assert leg.level_force_N(0.72, 0.0, np.array([0.3]), 0.96) == pytest.approx(7.3575)
    assert leg.level_force_N(0.72, 0.04, np.array([0.0]), 0.96) == pytest.approx(7.3575)
    body = BodyParameters(inner_mass_moment_kg_m=0.36)
    data = leg.level(body, 2)
    inner = data["inner"].value == 1.0
    # 2 sd of offset and gain, a fifth of a percent of the tape: together 0.1 N
    assert data["force_N"].value[~inner].mean() == pytest.approx(7.3575, abs=0.1)
    assert data["force_N"].value[inner].mean() == pytest.approx(3.67875, abs=0.1)


def test_a_leg_with_40_g_m_ahead_hangs_3_2_degrees_off():
    body = BodyParameters(outer_mass_offset_kg_m=0.04, inner_mass_offset_kg_m=-0.04)
    angle = leg.hang(body, 1)["angle_rad"].value
    # the level's offset is 0.05 degrees, the bearings hold within 0.03
    assert np.degrees(angle[: leg.HANG_READINGS].mean()) == pytest.approx(3.18, abs=0.2)
    assert np.degrees(angle[leg.HANG_READINGS :].mean()) == pytest.approx(-3.18, abs=0.2)


@pytest.mark.parametrize("amplitude", [0.05, 1.0])
def test_a_swing_without_friction_has_the_elliptic_integral_s_period(amplitude):
    one = leg.Leg(0.72, 0.04, 0.55)
    s = math.hypot(one.cm_kg_m, one.wm_kg_m)
    period = 4.0 * math.sqrt(one.J_hip_kg_m2 / (leg.GRAVITY * s)) * ellipk(math.sin(amplitude / 2.0) ** 2)
    times = np.array([0.0, 0.25, 0.5, 1.0, 3.0]) * period
    angle = leg.swing(one, one.rest_rad + amplitude, times, 0.0, 0.0) - one.rest_rad
    # integrated with rtol 1e-9
    assert angle == pytest.approx([amplitude, 0.0, -amplitude, amplitude, amplitude], abs=1e-7)


def test_viscous_bearings_shrink_a_small_swing_by_their_decay():
    one = leg.Leg(0.72, 0.0, 0.55)
    rate = math.sqrt(leg.GRAVITY * 0.72 / 0.55)
    decay = 0.01 / (2.0 * 0.55)
    times = np.linspace(0.0, 10.0, 200)
    damped = math.sqrt(rate**2 - decay**2)
    expected = np.exp(-decay * times) * (np.cos(damped * times) + decay / damped * np.sin(damped * times))
    # linear at an amplitude of 1e-4: the sine's cubic is 1e-9 of it
    assert leg.swing(one, 1e-4, times, 0.0, 0.01) / 1e-4 == pytest.approx(expected, abs=1e-4)


def test_dry_bearings_take_the_same_from_every_half_swing():
    one = leg.Leg(0.72, 0.0, 0.55)
    period = 2.0 * math.pi * math.sqrt(0.55 / (leg.GRAVITY * 0.72))
    angle = leg.swing(one, 0.1, np.array([0.0, 0.5, 1.0, 1.5]) * period, 0.004, 0.0)
    # 2 T_b / (m g c) each; the sign is smoothed over 0.01 rad/s of swings of 0.35 rad/s, and an amplitude of 0.1 rad
    # lengthens the period by 6e-4, which changes nothing where the swing turns
    lost = 2.0 * 0.004 / (leg.GRAVITY * 0.72)
    assert np.diff(np.abs(angle)) == pytest.approx(-lost, rel=0.05)


def test_the_hip_spring_shows_its_gearbox_out_and_in():
    data = springs.hip_spring(BodyParameters(), 1)
    angle, force, side, out = (data[name].value for name in ("angle_rad", "force_N", "side", "outward"))
    torque = force * springs.HIP_ARM_M - 7.6 * angle * side
    # 0.1 N m against 0.03 N m of a reading's noise, 20 of each, and 0.03 N m of offset that both share
    assert torque[out == 1.0].mean() - torque[out == 0.0].mean() == pytest.approx(0.2, abs=0.06)


def test_the_ankle_s_pull_measures_cable_and_return_spring_together():
    body = BodyParameters(ankle_return_Nm_per_rad=0.33)
    data = springs.ankle_spring(body, 1)
    angle, force, side = (data[name].value for name in ("angle_rad", "force_N", "side"))
    slope = np.sum(force * springs.ANKLE_ARM_M * angle * side) / np.sum(angle**2)
    assert slope == pytest.approx(14.33, rel=0.02)
