"""Winding, bridge, losses, friction and heat of a motor: known answers, a fine numerical integration, balances."""

import dataclasses
import math

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, HIP_MOTOR, STEERING_MOTOR, MotorParameters
from ranger_sim.plant.electrics.motor_unit import MotorUnit

STEP = 125_000  # ns; the formulas are exact for any step
COUNTS = 600


def driven(unit, mr2, mr6=0, time=0):
    """The unit with its bridge powered and the two leads set."""
    unit.drive.watchdog_edge(time)
    unit.drive.write_pwm(time, mr2, mr6, COUNTS)
    return unit


def run(unit, steps, rate=0.0, battery=26.0, start=0, feed=True):
    """`steps` plant steps; the watchdog is fed at the start of each."""
    for k in range(start, start + steps):
        if feed:
            unit.drive.watchdog_edge(k * STEP)
        unit.step_electrical(k * STEP, (k + 1) * STEP, rate, battery)


def balance_error(unit):
    """Battery energy less everything it became, J."""
    return unit.battery_J() - (
        unit.mechanical_J
        + unit.winding_J
        + unit.series_J
        + unit.contact_J
        + unit.ripple_J
        + unit.gate_J
        + unit.diode_J
        + unit.magnetic_J()
    )


def test_a_stalled_motor_draws_the_voltage_less_the_contact_drop_over_the_resistance():
    unit = driven(MotorUnit("m"), 300)
    run(unit, 40, battery=24.0)
    assert unit.current_A == pytest.approx((12.0 - 0.7) / (1.3 + 0.04 + 0.018), rel=1e-12)
    assert unit.mean_current_A == pytest.approx(unit.current_A, rel=1e-12)


def test_the_stalled_bench_motor_gives_the_measured_line_of_voltage_against_current():
    # appendix 8.3.1: V = 1.3 I + 0.7, without inductor and bridge
    bench = dataclasses.replace(HIP_MOTOR, series_resistance_ohm=0.0, bridge_resistance_ohm=0.0)
    for amps in (0.5, 1.0, 2.0, 4.0):
        unit = driven(MotorUnit("m", bench), 600)
        run(unit, 80, battery=1.3 * amps + 0.7)
        assert unit.current_A == pytest.approx(amps, rel=1e-12)


def test_no_load_speed_at_12_volts_is_about_6300_rpm():
    # The catalogue's no-load speed of a 12 V winding: at 6300 rpm of the rotor the back-EMF is 11.9 V, so the
    # contact drop holds the current at zero from 5995 to 6737 rpm.
    unit = driven(MotorUnit("m"), 600)
    rpm = 2.0 * math.pi / 60.0
    run(unit, 40, rate=6300.0 * rpm / 66.0, battery=12.0)
    assert unit.current_A == 0.0
    run(unit, 40, rate=5990.0 * rpm / 66.0, battery=12.0, start=40)
    assert unit.current_A > 0.0
    run(unit, 40, rate=6745.0 * rpm / 66.0, battery=12.0, start=80)
    assert unit.current_A < 0.0


def test_the_current_rises_with_a_time_constant_of_50_us():
    unit = driven(MotorUnit("m"), 300)
    tau_ns = 67e-6 / 1.358 * 1e9
    assert 48e3 < tau_ns < 51e3
    unit.step_electrical(0, round(tau_ns), 0.0, 24.0)
    assert unit.current_A == pytest.approx(11.3 / 1.358 * (1.0 - math.exp(-1.0)), rel=1e-5)


def test_the_contact_drop_holds_the_current_at_zero():
    unit = driven(MotorUnit("m"), 15)  # 0.65 V of 26 V
    run(unit, 100)
    assert unit.current_A == 0.0 and unit.mean_current_A == 0.0
    unit = driven(MotorUnit("m"), 17)  # 0.737 V
    run(unit, 100)
    assert unit.current_A == pytest.approx((26.0 * 17 / 600 - 0.7) / 1.358)


def fine_integration(p, current, V, emf, seconds, steps):
    """Explicit midpoint on the winding with the exact sign rule of the contact drop; returns I and its integrals."""
    R, L, Vc = p.loop_resistance_ohm, p.inductance_H(p.settling_frequency_hz), p.contact_drop_V
    h = seconds / steps
    charge = square = 0.0

    def slope(amps):
        return (V - emf - R * amps - math.copysign(Vc, amps)) / L

    for _ in range(steps):
        before = current
        if current == 0.0:
            x = V - emf
            if abs(x) <= Vc:
                break
            current = (x - math.copysign(Vc, x)) / L * h * (1.0 - 0.5 * h * R / L)
        else:
            middle = current + 0.5 * h * slope(current)
            current += h * slope(middle if middle * current > 0.0 else current)
            if current * before < 0.0:
                current = 0.0
        charge += 0.5 * h * (before + current)
        square += 0.5 * h * (before * before + current * current)
    return current, charge, square


@pytest.mark.parametrize("start, V, emf", [(3.0, -4.0, 1.0), (-2.0, 6.0, -3.0), (1.0, 0.3, 0.2), (0.0, 5.0, 2.0)])
def test_the_closed_form_agrees_with_a_fine_numerical_integration(start, V, emf):
    # 200 000 steps of 0.6 ns; the crossing of zero is off by up to one of them, that is by 7 A x 0.6 ns = 4e-9 A s
    p = MotorParameters()
    unit = driven(MotorUnit("m", p), 0)
    unit.bridge_current_A = start
    unit.drive.write_pwm(0, max(0, round(V * 20)), max(0, round(-V * 20)), COUNTS)  # 600 counts are 30 V
    unit.step_electrical(0, STEP, emf / (p.torque_constant_Nm_per_A * p.gear), 30.0)
    amps, charge, square = fine_integration(p, start, V, emf, 125e-6, 200_000)
    assert unit.current_A == pytest.approx(amps, abs=1e-4)
    assert unit.mean_current_A * 125e-6 == pytest.approx(charge, abs=5e-9)
    assert unit.winding_J == pytest.approx(1.3 * square, rel=1e-4)


def test_a_current_that_crosses_zero_inside_a_step_is_the_same_in_one_step_and_in_a_hundred():
    one = driven(MotorUnit("m"), 0, 200)
    many = driven(MotorUnit("m"), 0, 200)
    one.bridge_current_A = many.bridge_current_A = 4.0
    one.step_electrical(0, STEP, 0.5, 26.0)
    charge = 0.0
    for k in range(100):
        many.step_electrical(k * 1250, (k + 1) * 1250, 0.5, 26.0)
        charge += many.mean_current_A * 1250e-9
    assert one.current_A < 0.0
    assert many.current_A == pytest.approx(one.current_A, rel=1e-11)
    assert charge == pytest.approx(one.mean_current_A * 125e-6, rel=1e-11)


def test_a_pwm_write_takes_effect_at_its_stamp_inside_a_step():
    inside = driven(MotorUnit("m"), 200)
    split = driven(MotorUnit("m"), 200)
    inside.drive.write_pwm(40_000, 0, 100, COUNTS)
    inside.step_electrical(0, STEP, 0.0, 26.0)
    split.step_electrical(0, 40_000, 0.0, 26.0)
    split.drive.write_pwm(40_000, 0, 100, COUNTS)
    split.step_electrical(40_000, STEP, 0.0, 26.0)
    assert inside.current_A == pytest.approx(split.current_A, rel=1e-12)
    assert inside.battery_J() == pytest.approx(split.battery_J(), rel=1e-12)


def test_energy_from_the_battery_becomes_losses_and_mechanical_work_to_1e_9():
    # random duties, speeds, voltages, open bridges, starving watchdogs, dead time: the sum holds in all of them
    for seed, p in enumerate((HIP_MOTOR, ANKLE_MOTOR, dataclasses.replace(ANKLE_MOTOR, dead_time_fraction=0.02))):
        stream = RandomStream(seed, "balance")
        unit = MotorUnit("m", p, 1 if seed != 1 else -1)
        unit.drive.watchdog_edge(0)
        for k in range(4000):
            if k % 7 == 0:
                time = k * STEP + stream.integer(STEP)
                unit.drive.write_pwm(time, stream.integer(601), stream.integer(601), COUNTS)
            if k % 5 == 0 and not 1000 < k < 1400:
                unit.drive.watchdog_edge(k * STEP + stream.integer(STEP))
            if k % 97 == 0:
                unit.drive.low_side(k * STEP, k % 2 == 0, True)
            unit.step_electrical(k * STEP, (k + 1) * STEP, 8.0 * stream.normal(), 22.0 + 6.0 * stream.uniform())
        scale = unit.drawn_J + unit.returned_J
        assert unit.drawn_J > 1.0 and unit.returned_J > 0.05 and unit.diode_J > 0.0 and unit.drive.power_losses > 0
        assert abs(balance_error(unit)) < 1e-9 * scale


def test_power_at_the_battery_is_the_sum_of_losses_and_mechanical_power_in_steady_state():
    unit = driven(MotorUnit("m"), 240)
    run(unit, 200, rate=5.0, battery=26.0)
    amps = unit.current_A
    ripple = (26.0 * 0.4 * 0.6 / (67e-6 * 100e3)) ** 2 / 12.0 * 1.358
    gate = 0.3 * 26.0 / 30.0
    total = 1.358 * amps**2 + 0.7 * amps + 66.0 * 0.018 * 5.0 * amps + ripple + gate
    assert 26.0 * unit.battery_current_A == pytest.approx(total, rel=1e-12)


# a ripple of 8 % with 7 periods per turn, and one of 3 % with 22
RIPPLES = ((0.08, 7.0, 0.4), (0.03, 22.0, -1.1))


def rippling(parameters=ANKLE_MOTOR, mounting=1):
    unit = MotorUnit("m", parameters, mounting)
    for each in RIPPLES:
        unit.add_ripple(*each)
    return unit


def linked_flux(unit, angle_rad):
    """Flux that the winding links, V s, where the rotor stands: its slope over the rotor's angle is K."""
    rotor = unit.gear * angle_rad
    return unit.K * (rotor - sum(f / n * math.cos(n * rotor + phase) for f, n, phase in RIPPLES))


@pytest.mark.parametrize("rate", [6.0, -6.0, 0.3, 1e-6])
def test_a_rippling_constant_makes_the_voltage_of_the_linked_flux(rate):
    """Faraday's law over a step, for which K itself is not asked: up to 0.5 rad of the faster ripple."""
    unit = rippling()
    h = STEP * 1e-9
    for angle in (0.0, 0.1, 1.234):
        unit.turn(angle, rate, h)
        voltage = unit.gear * unit.K * unit.angle_factor * rate
        flux = linked_flux(unit, angle + rate * h) - linked_flux(unit, angle)
        # the difference of two fluxes of 1 V s loses 1e-16 V s; a step at the lowest rate makes 8e-11 V s
        assert voltage * h == pytest.approx(flux, rel=1e-9, abs=1e-15)


def test_a_rippling_constant_takes_from_the_winding_what_the_shaft_gets():
    """Battery less losses, against torque times speed as the body is given them; both ways of turning, both mountings.

    A ripple of the torque alone, which the voltage does not know, misses by some per cent.
    """
    h = STEP * 1e-9
    for seed, mounting in ((1, 1), (2, -1)):
        stream = RandomStream(seed, "rippling balance")
        unit = rippling(mounting=mounting)
        unit.drive.watchdog_edge(0)
        angle = work = size = one_sided = 0.0
        for k in range(3000):
            unit.drive.watchdog_edge(k * STEP)
            if k % 40 == 0:
                unit.drive.write_pwm(k * STEP, stream.integer(601), stream.integer(601), COUNTS)
                rate = 4.0 * stream.normal()
            unit.turn(angle, rate, h)
            unit.step_electrical(k * STEP, (k + 1) * STEP, rate, 26.0)
            angle += rate * h
            work += unit.drive_Nm * rate * h
            size += abs(unit.drive_Nm * rate) * h
            one_sided += unit.drive_Nm * rate * h * (1.0 / unit.angle_factor - 1.0)
        losses = unit.winding_J + unit.series_J + unit.contact_J + unit.ripple_J + unit.gate_J + unit.diode_J
        assert unit.battery_J() - losses - unit.magnetic_J() == pytest.approx(work, abs=1e-9 * size)
        assert abs(one_sided) > 1e-4 * size  # what the test would see: the ripple does not average out


def test_the_current_of_a_rippling_motor_agrees_with_a_fine_numerical_integration():
    """Explicit midpoint of 0.5 us on the winding while the rotor turns at 100 rad/s, 20 ms: over two periods of 7."""
    p, speed, V, fine = ANKLE_MOTOR, 100.0, 10.0, 0.5e-6
    unit = driven(rippling(p), 200)  # a third of 30 V
    R, L = p.loop_resistance_ohm, p.inductance_H(p.settling_frequency_hz)

    def constant(t):
        return p.torque_constant_Nm_per_A * (1.0 + sum(f * math.sin(n * speed * t + phase) for f, n, phase in RIPPLES))

    def slope(t, amps):
        return (V - constant(t) * speed - R * amps - p.contact_drop_V) / L

    amps, parts = 0.0, round(STEP * 1e-9 / fine)
    worst, ends = 0.0, []
    for k in range(160):
        unit.drive.watchdog_edge(k * STEP)
        unit.turn(k * STEP * 1e-9 * speed / p.gear, speed / p.gear, STEP * 1e-9)
        unit.step_electrical(k * STEP, (k + 1) * STEP, speed / p.gear, 30.0)
        for number in range(parts):
            t = k * STEP * 1e-9 + number * fine
            amps += fine * slope(t + 0.5 * fine, amps + 0.5 * fine * slope(t, amps))
        worst = max(worst, abs(unit.current_A - amps))
        ends.append(amps)
    settled = ends[8:]
    assert max(settled) - min(settled) > 0.15  # the ripple of the back-EMF, 0.2 V, over 1.36 ohm and both ways
    # K stands still for a step of 0.125 ms, in which the faster ripple of 0.054 V goes on by 0.14 rad
    assert worst < 0.01


def test_a_motor_without_ripple_keeps_its_constant_at_any_angle():
    unit = MotorUnit("m", HIP_MOTOR)
    unit.turn(0.3, 5.0, 1e-3)
    assert unit.angle_factor == 1.0


def test_a_driven_motor_feeds_the_battery():
    unit = driven(MotorUnit("m"), 100)  # 4.3 V against 11.9 V of back-EMF
    run(unit, 100, rate=10.0)
    assert unit.current_A < 0.0
    assert unit.battery_current_A < 0.0
    assert unit.returned_J > 0.0
    assert balance_error(unit) == pytest.approx(0.0, abs=1e-12)


def test_ripple_loss_is_that_of_the_triangular_current():
    # the ripple of one period, integrated point by point
    L, f, V, R = 67e-6, 100e3, 26.0, 1.358
    for counts in (60, 150, 300, 540):
        duty = counts / COUNTS
        swing = V * duty * (1.0 - duty) / (L * f)
        points = [swing * ((i + 0.5) / 20000 - 0.5) for i in range(20000)]  # both flanks run through the same values
        loss = R * sum(x * x for x in points) / len(points)
        unit = driven(MotorUnit("m"), counts)
        run(unit, 8, battery=V)
        assert unit.ripple_J / 1e-3 == pytest.approx(loss, rel=1e-6)


def test_the_added_inductor_takes_most_of_the_ripple_loss_away():
    # appendix 3.9: 47 uH in series made the losses drop; (67 / 20)^2 = 11 times less at 100 kHz
    bare = driven(MotorUnit("m", dataclasses.replace(HIP_MOTOR, series_inductance_H=0.0)), 200)
    with_inductor = driven(MotorUnit("m"), 200)
    run(bare, 80)
    run(with_inductor, 80)
    assert bare.ripple_J / with_inductor.ripple_J == pytest.approx((67.0 / 20.0) ** 2, rel=1e-9)


def test_the_inductance_falls_with_frequency_as_measured():
    for hz, henry in ((1e3, 94e-6), (20e3, 35e-6), (100e3, 20e-6), (200e3, 16e-6)):
        assert HIP_MOTOR.winding_inductance_H(hz) == pytest.approx(henry)
    assert HIP_MOTOR.inductance_H(100e3) == pytest.approx(67e-6)
    assert HIP_MOTOR.winding_inductance_H(100.0) == 94e-6
    assert HIP_MOTOR.winding_inductance_H(1e6) == 16e-6
    assert 20e-6 < HIP_MOTOR.winding_inductance_H(50e3) < 35e-6


def test_the_gate_drive_takes_300_mW_at_30_volts_while_a_lead_switches():
    for mr2, mr6 in ((1, 0), (0, 300), (300, 200)):
        unit = driven(MotorUnit("m"), mr2, mr6)
        run(unit, 8, battery=30.0)
        assert unit.gate_J / 1e-3 == pytest.approx(0.3)
    for mr2, mr6 in ((0, 0), (600, 600), (600, 0)):
        still = driven(MotorUnit("m"), mr2, mr6)
        run(still, 8, battery=30.0)
        assert still.gate_J == 0.0


def test_a_gate_drive_that_goes_with_the_bridges_power_takes_it_at_rest_too():
    gates = dataclasses.replace(HIP_MOTOR, gate_power_W=0.14, gate_scheme="powered")
    resting, driving, unpowered = (
        driven(MotorUnit("m", gates), 0),
        driven(MotorUnit("m", gates), 1),
        MotorUnit("m", gates),
    )
    for unit in (resting, driving):
        run(unit, 8, battery=24.0)
        assert unit.gate_J / 1e-3 == pytest.approx(0.14 * 24.0 / 30.0)
    assert resting.battery_current_A == pytest.approx(0.14 / 30.0)
    assert resting.drawn_J == pytest.approx(resting.gate_J)
    run(unpowered, 8, battery=24.0, feed=False)
    assert unpowered.gate_J == unpowered.battery_current_A == 0.0
    # the watchdog, 10 ms later, takes the power away and the gates' with it
    run(resting, 160, battery=24.0, start=8, feed=False)
    assert resting.gate_J == pytest.approx(0.14 * 24.0 / 30.0 * (7 * STEP * 1e-9 + 10e-3))
    assert resting.battery_current_A == 0.0


def test_an_unknown_gate_scheme_is_refused():
    with pytest.raises(UserError, match="unknown gate_scheme 'sometimes'.*switching, powered"):
        MotorParameters(gate_scheme="sometimes")


def test_alternating_leads_give_the_same_duty_and_move_the_switching_lead():
    # robot.md N4.4 without its offset of 14 counts: u = 120 in pattern 0 and in pattern 1
    first = driven(MotorUnit("m"), 120, 0)
    second = driven(MotorUnit("m"), 600, 480)
    run(first, 40)
    run(second, 40)
    assert first.current_A == second.current_A
    assert first.drive.sensed_lead_switches and not second.drive.sensed_lead_switches
    assert first.drive.switching_leads == second.drive.switching_leads == 1


def test_power_is_lost_10_ms_after_the_last_watchdog_edge_and_comes_back_with_the_next():
    unit = driven(MotorUnit("m"), 300)
    unit.step_electrical(0, 9_999_000, 0.0, 24.0)
    assert unit.drive.powered and unit.current_A > 8.0
    unit.step_electrical(9_999_000, 10_000_500, 0.0, 24.0)
    assert not unit.drive.powered and unit.drive.power_losses == 1
    # 0.5 us of freewheeling into 24 + 0.7 + 1.4 V have taken some current off already
    assert unit.current_A < 8.2
    unit.step_electrical(10_000_500, 12_000_000, 0.0, 24.0)
    assert unit.current_A == 0.0
    unit.drive.watchdog_edge(12_000_000)
    unit.step_electrical(12_000_000, 13_000_000, 0.0, 24.0)
    assert unit.drive.powered and unit.current_A > 8.0


def test_edges_that_keep_coming_keep_the_power_on():
    unit = driven(MotorUnit("m"), 300)
    for k in range(20):
        unit.drive.watchdog_edge(k * 9_999_999)
        unit.step_electrical(k * 9_999_999, (k + 1) * 9_999_999, 0.0, 24.0)
    assert unit.drive.powered and unit.drive.power_losses == 0


def test_nothing_moves_before_the_first_watchdog_edge():
    unit = MotorUnit("m")
    unit.drive.write_pwm(0, 300, 0, COUNTS)
    unit.step_electrical(0, STEP, 0.0, 26.0)
    assert unit.current_A == 0.0 and unit.battery_current_A == 0.0


def test_an_opened_bridge_returns_the_winding_energy_through_the_diodes():
    unit = driven(MotorUnit("m"), 300)
    run(unit, 40, battery=24.0)
    amps, stored = unit.current_A, unit.magnetic_J()
    unit.drive.low_side(40 * STEP, False, False)
    before = unit.battery_J()
    run(unit, 1, battery=24.0, start=40)
    assert unit.current_A == 0.0
    assert 0.5 * stored < before - unit.battery_J() < stored
    # zero is reached after tau ln(1 + R I / (V_b + 2 V_d + V_c)), here about 18 us
    time = 67e-6 / 1.358 * math.log(1.0 + 1.358 * amps / (24.0 + 1.4 + 0.7))
    other = driven(MotorUnit("m"), 300)
    run(other, 40, battery=24.0)
    other.drive.low_side(40 * STEP, False, True)
    other.step_electrical(40 * STEP, 40 * STEP + int(time * 1e9) - 20, 0.0, 24.0)
    assert 0.0 < other.current_A < 0.02
    other.step_electrical(40 * STEP + int(time * 1e9) - 20, 40 * STEP + int(time * 1e9) + 20, 0.0, 24.0)
    assert other.current_A == 0.0


def test_a_mirrored_motor_does_the_same_at_the_joint_for_the_opposite_bridge_voltage():
    straight = driven(MotorUnit("m", ANKLE_MOTOR, 1), 200, 0)
    mirrored = driven(MotorUnit("m", ANKLE_MOTOR, -1), 0, 200)
    run(straight, 40, rate=3.0)
    run(mirrored, 40, rate=3.0)
    assert mirrored.current_A == straight.current_A
    assert mirrored.bridge_current_A == -straight.bridge_current_A
    assert mirrored.battery_current_A == straight.battery_current_A
    assert mirrored.drive_Nm == straight.drive_Nm > 0.0


def test_hip_torque_of_6_Nm_needs_about_5_6_A_with_friction():
    # robot.md P5
    unit = MotorUnit("hip")
    amps = 5.6
    assert unit.torque_Nm(amps, 1.0) == pytest.approx(66 * 0.018 * amps * 0.9 - 0.1 - 0.01, rel=1e-9)
    assert unit.torque_Nm(amps, 1.0) == pytest.approx(6.0, abs=0.2)


def test_the_three_torque_numbers_for_the_body_are_the_torque_law():
    unit = MotorUnit("ankle", ANKLE_MOTOR)
    for amps in (-1.0, 0.0, 0.4, 6.0):
        for rate in (-3.0, -0.02, 0.0, 0.01, 5.0):
            unit.load(amps)
            parts = unit.drive_Nm - unit.coulomb_Nm * math.tanh(rate / 0.05) - unit.viscous_Nms * rate
            assert unit.torque_Nm(amps, rate) == pytest.approx(parts, abs=1e-15)


def test_friction_smoothing_lets_a_held_joint_creep_as_documented():
    # a load of half the friction moves the joint with epsilon atanh(1/2): the effect of the smoothing
    for epsilon, rate in ((0.05, 0.0275), (0.01, 0.0055)):
        unit = MotorUnit("m", dataclasses.replace(ANKLE_MOTOR, friction_smoothing_rad_s=epsilon))
        creep = epsilon * math.atanh(0.5)
        assert creep == pytest.approx(rate, rel=0.01)
        assert unit.torque_Nm(0.0, creep) == pytest.approx(-0.05 - 0.01 * creep, rel=1e-9)


def test_the_rotor_warms_to_power_times_resistance_with_its_two_time_constants():
    unit = MotorUnit("m")
    unit.heat_W = 5.0
    for _ in range(200):  # 20 s, one time constant of the winding
        unit._warm(0.1)
    inner = (unit.rotor_temperature_C - unit.housing_temperature_C) / (5.0 * 2.0)
    assert 0.55 < inner < 0.65  # 1 - 1/e, a little less because the housing follows
    for _ in range(60_000):  # 100 min
        unit._warm(0.1)
    assert unit.rotor_temperature_C == pytest.approx(25.0 + 5.0 * 12.0, abs=0.1)
    assert unit.housing_temperature_C == pytest.approx(25.0 + 5.0 * 10.0, abs=0.1)


def test_a_hot_winding_has_more_resistance_only_when_the_term_is_on():
    plain = driven(MotorUnit("m"), 300)
    copper = driven(MotorUnit("m", dataclasses.replace(HIP_MOTOR, resistance_per_K=0.0039)), 300)
    for unit in (plain, copper):
        unit.rotor_temperature_C = 85.0
        run(unit, 80, battery=24.0)
    assert plain.winding_ohm == 1.3
    assert copper.winding_ohm == pytest.approx(1.3 * (1.0 + 0.0039 * 60.0), rel=1e-3)
    assert copper.current_A < plain.current_A


def test_the_steering_motor_reaches_its_current_limit_only_near_full_battery_voltage():
    unit = driven(MotorUnit("s", STEERING_MOTOR), 200)  # the duty clip of the steering board
    run(unit, 80, battery=26.0)
    assert 0.2 < unit.current_A < 0.25


@pytest.mark.parametrize(
    "field, value",
    [("gear", 0.0), ("resistance_ohm", -1.0), ("load_friction", -0.1), ("contact_drop_V", math.nan)],
)
def test_impossible_motor_numbers_are_refused_by_name(field, value):
    with pytest.raises(UserError, match=field):
        dataclasses.replace(HIP_MOTOR, **{field: value})


def test_an_inductance_table_that_does_not_rise_in_frequency_is_refused():
    with pytest.raises(UserError, match="rise in frequency"):
        dataclasses.replace(HIP_MOTOR, inductance_table=((2e3, 1e-6), (1e3, 1e-6)))


def test_many_writes_between_two_steps_are_all_kept_in_order():
    unit = driven(MotorUnit("m"), 0)
    for k in range(100, 0, -1):
        unit.drive.write_pwm(k * 1000, k, 0, COUNTS)
    assert unit.drive.capacity >= unit.drive.count
    unit.step_electrical(0, STEP, 0.0, 26.0)
    assert unit.drive.mr2 == 100 and unit.drive.count == 0


@pytest.mark.parametrize(
    ("mr2", "mr6", "rate", "battery"),
    [(300, 0, 0.0, 26.0), (0, 450, 2.0, 26.0), (250, 90, -6.0, 26.0), (30, 0, 9.0, 26.0), (0, 0, 9.0, 1.0)],
)
def test_a_step_cut_in_two_books_what_a_whole_one_does(mr2, mr6, rate, battery):
    """The usual step is one straight piece; a command that repeats the present one makes it go piece by piece.

    The windings' exponentials are exact for any piece, so only rounding differs: 1e-11 of a sum of 400 terms. From step
    280 on the watchdog has opened the bridge; with 1 V the motor, turned fast, drives a current through the diodes.
    """
    motor = dataclasses.replace(HIP_MOTOR, dead_time_fraction=0.02)
    whole, pieces = driven(MotorUnit("m", motor), mr2, mr6), driven(MotorUnit("m", motor), mr2, mr6)
    for k in range(400):
        for unit in (whole, pieces):
            if k < 200:
                unit.drive.watchdog_edge(k * STEP)
        pieces.drive.write_pwm(k * STEP + 40_000, mr2, mr6, COUNTS)
        for unit in (whole, pieces):
            unit.step_electrical(k * STEP, (k + 1) * STEP, rate, battery)
        assert pieces.current_A == pytest.approx(whole.current_A, rel=1e-11, abs=1e-12)
        assert pieces.battery_current_A == pytest.approx(whole.battery_current_A, rel=1e-11, abs=1e-12)
    for books in ("winding_J", "series_J", "contact_J", "ripple_J", "gate_J", "diode_J", "drawn_J", "returned_J"):
        assert getattr(pieces, books) == pytest.approx(getattr(whole, books), rel=1e-11, abs=1e-12), books
    assert whole.drive.is_open and whole.winding_J > 0.0
    assert battery > 1.0 or abs(whole.current_A) > 0.1
