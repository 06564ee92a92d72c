"""What a fault of a motor notes: currents and torques worked out by hand from EQUATIONS 10.2."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.plant import wiring_points as point
from ranger_sim.ranger.faults import actuators


def fault(kind=actuators.WeakMotor, number=point.HIP, duty=0.5, is_open=False, outer_rate=3.0):
    made = kind.__new__(kind)
    made.number = number
    made.motor = Made(
        mounting=-1.0, gear=10.0, K=0.02, angle_factor=1.1, contact_drop_V=0.7, diode_drop_V=0.8,
        dead_time_fraction=0.05, winding_ohm=1.2, series_ohm=0.3, inductance_H=0.001, ripple_per_ohm2=2.0,
        parameters=None, known_s=1.0, current_A=4.0,
        drive=Made(is_open=is_open, duty=duty),
    )  # fmt: skip
    body = Made(outer=Made(rate=outer_rate, motor_rate=5.0), inner=Made(rate=1.0, motor_rate=7.0))
    made.robot = Made(plant=Made(electrics=Made(battery=Made(voltage_V=24.0)), body=body, steering=Made(rate=9.0)))
    made.values = {"share": 0.7}
    made.usual = {name: getattr(made.motor, name) for name in made.fields}
    return made


@pytest.mark.parametrize(
    "number, rate", [(point.HIP, 2.0), (point.OUTER_ANKLE, 5.0), (point.INNER_ANKLE, 7.0), (point.STEERING, 9.0)]
)
def test_the_rate_of_each_motor_is_its_joint_s_or_its_own(number, rate):
    assert fault(number=number).rate_rad_s() == rate


@pytest.mark.parametrize(
    "duty, is_open, outer_rate, current",
    [
        # back-EMF -1 x 10 x 0.02 x 1.1 x rate; drop 0.7 + 0.05 x 24 driven, 0.7 + 24 + 2 x 0.8 open; loop 1.5 ohm
        (0.5, False, 3.0, -(12.44 - 1.9) / 1.5),
        (-0.5, False, 3.0, (11.56 - 1.9) / 1.5),
        (0.5, False, -1.0, -(11.56 - 1.9) / 1.5),
        (0.05, False, 3.0, 0.0),
        (-0.05, False, 3.0, 0.0),
        (0.5, True, 3.0, 0.0),
        (0.5, True, 201.0, -(44.0 - 26.3) / 1.5),
        (0.5, True, -199.0, (44.0 - 26.3) / 1.5),
    ],
)
def test_a_current_settles_at_what_is_left_above_the_drops_by_the_loop_s_resistance(duty, is_open, outer_rate, current):
    made = fault(duty=duty, is_open=is_open, outer_rate=outer_rate)
    assert made.settled_A() == pytest.approx(current, abs=1e-12)


def test_shorted_turns_take_resistance_and_constant_in_proportion_and_inductance_with_the_square():
    made = fault(actuators.ShortedTurns)
    made.values = {"share": 0.2}
    made.change()
    motor = made.motor
    assert (motor.winding_ohm, motor.K, motor.inductance_H) == pytest.approx((0.96, 0.016, 0.00064))
    assert motor.known_s == 0.0
    made.finish(0)
    assert (motor.winding_ohm, motor.K, motor.inductance_H) == (1.2, 0.02, 0.001)


def test_a_weak_motor_misses_its_share_of_the_torque():
    made, noted = fault(), []
    made.note = lambda now_ns, difference: noted.append((now_ns, difference))
    made.before(5)
    # 0.3 of 0.02 N m/A x 10 x 4 A is not there
    assert noted == [(5, pytest.approx(-0.24))] and made.motor.K == pytest.approx(0.014)
    made.motor.current_A = 0.0
    made.before(6)
    assert len(noted) == 1


def test_an_open_winding_lets_nothing_flow_and_notes_the_current_that_is_missing():
    made = fault(actuators.OpenWinding)
    assert made.usual == {"contact_drop_V": 0.7, "ripple_per_ohm2": 2.0}
    noted = []
    made.note = lambda now_ns, difference: noted.append(difference)
    made.before(0)
    assert noted == [pytest.approx((12.44 - 1.9) / 1.5)]  # 0 instead of -7.03 A
    assert (made.motor.contact_drop_V, made.motor.ripple_per_ohm2) == (100.0, 0.0)
    assert made.settled_A() == 0.0


def test_a_motor_is_clear_of_its_fault_when_it_has_its_own_numbers_or_those_of_its_temperature():
    made = fault()
    made.motor.heat_matters = False
    assert made.is_clear(0, 1)
    made.motor.K = 0.019
    assert not made.is_clear(0, 1)
    motor = made.motor
    motor.heat_matters, motor.parameters = True, Made(resistance_ohm=1.0, torque_constant_Nm_per_A=0.02)
    motor.resistance_per_K, motor.torque_constant_per_K = 0.004, -0.002
    motor.rotor_temperature_C, motor.housing_temperature_C = 75.0, 35.0
    motor.winding_ohm, motor.K = 1.2, 0.0196
    assert made.is_clear(0, 1)
    motor.winding_ohm = 1.21
    assert not made.is_clear(0, 1)
    motor.winding_ohm, motor.K = 1.2, 0.0197
    assert not made.is_clear(0, 1)
