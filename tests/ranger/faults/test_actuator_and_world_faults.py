"""Faults of bridges, windings, cables, joints and the floor, on the plant alone: known answers, and their end."""

import math

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.plant import wiring_points as point
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from tests.harness.faults.bench import PlantBench

MOTORS = {"MCH": point.HIP, "MCFO": point.OUTER_ANKLE, "MCFI": point.INNER_ANKLE, "MCSI": point.STEERING}
BOARDS = pytest.mark.parametrize("board", MOTORS)


class Driven(PlantBench):
    """A robot in the operator's hands whose motors have one duty all the time, legs locked."""

    def __init__(self, mr2=300, mr6=0, **parameters):
        self.registers = (mr2, mr6)
        super().__init__(**parameters)
        self.plant.body.lock_hip = True

    def move(self, start_ns, end_ns):
        if start_ns == 0:
            self.drive(0, *self.registers)
        for motor in self.plant.motors:
            motor.drive.watchdog_edge(start_ns)
        self.plant.step()

    def after_the_step(self):
        pass


def motor_of(bench, board):
    return bench.plant.motors[MOTORS[board]]


@BOARDS
def test_no_current_flows_in_an_open_winding_and_it_is_back_at_the_end(board):
    bench, healthy = Driven(), Driven()
    fault = bench.inject(f"{board}.motor", "open_winding", "20 ms", "40 ms")
    for each in (bench, healthy):
        each.step(80)
    assert motor_of(bench, board).current_A == motor_of(healthy, board).current_A != 0.0
    flowed_A = motor_of(healthy, board).current_A
    torque_Nm = motor_of(healthy, board).drive_Nm
    bench.step()
    assert motor_of(bench, board).current_A == 0.0
    assert abs(motor_of(bench, board).drive_Nm) < 0.05 * abs(torque_Nm)  # the mean over a step that begins with an arc
    # the current is within a few of its time constants of 50 us of where voltage and rate lead it
    assert fault.largest_difference == pytest.approx(-flowed_A, rel=0.1)
    assert fault.acted_ns == 20_000_000
    for _ in range(79):
        bench.step()
        assert motor_of(bench, board).current_A == motor_of(bench, board).drive_Nm == 0.0
    assert fault.active
    bench.step(2)
    assert motor_of(bench, board).current_A != 0.0
    assert fault.cleared_ns == 40_250_000


@pytest.mark.parametrize("registers", [(300, 0), (0, 300)])
def test_half_of_the_turns_shorted_is_half_of_the_resistance_and_of_the_torque_constant(registers):
    bench = Driven(*registers)
    motor = motor_of(bench, "MCH")
    before = motor.winding_ohm, motor.K, motor.inductance_H
    fault = bench.inject("MCH.motor", "short", "20 ms", "40 ms", share=0.5)
    bench.step(120)
    assert (motor.winding_ohm, motor.K, motor.inductance_H) == (before[0] / 2, before[1] / 2, before[2] / 4)
    # the hip is held: no back-EMF; ten milliseconds are hundreds of the loop's time constants
    volts = bench.plant.battery_V * 0.5 - motor.contact_drop_V
    way = 1 if registers[0] else -1
    assert motor.current_A == pytest.approx(way * volts / (before[0] / 2 + motor.series_ohm), rel=0.02)
    bench.step(200)
    assert (motor.winding_ohm, motor.K, motor.inductance_H) == before
    volts = bench.plant.battery_V * 0.5 - motor.contact_drop_V
    assert motor.current_A == pytest.approx(way * volts / (before[0] + motor.series_ohm), rel=0.02)
    assert fault.cleared_ns == 40_250_000
    assert fault.largest_difference * way > 0.0


@BOARDS
@pytest.mark.parametrize("share", [0.5, 1.2])
def test_a_weak_motor_gives_its_share_of_the_torque_for_the_same_current(board, share):
    bench = Driven()
    motor = motor_of(bench, board)
    usual = motor.K
    fault = bench.inject(f"{board}.motor", "weak_motor", "20 ms", "40 ms", share=share)
    bench.step(120)
    assert motor.K == usual * share
    assert motor.torque_Nm(1.0, 0.0) == pytest.approx(motor.gear * usual * share)
    assert fault.unit == "N m"
    assert fault.largest_difference * motor.mounting * (share - 1.0) > 0.0
    bench.step(200)
    assert motor.K == usual
    assert fault.cleared_ns == 40_250_000


def test_a_motor_at_rest_without_current_is_weak_without_acting():
    bench = Driven(0, 0)
    fault = bench.inject("MCH.motor", "weak_motor", "20 ms", "40 ms")
    bench.step(200)
    assert not fault.acted
    assert fault.cleared_ns == 40_250_000


@pytest.mark.parametrize(
    ("leg", "state", "registers", "duty"),
    [
        (2, 0, (450, 150), 0.0),  # open: nothing is driven
        (2, 1, (450, 150), -0.25),  # held low: what leg 6 does alone
        (2, 2, (450, 150), 0.75),
        (6, 0, (450, 150), 0.0),
        (6, 1, (450, 150), 0.75),
        (6, 2, (450, 150), -0.25),
        (6, 1, (450, 0), 0.75),  # leg 6 was low all the time
    ],
)
def test_a_leg_that_does_not_follow_leaves_the_duty_to_the_other_one(leg, state, registers, duty):
    bench = Driven(*registers)
    drive = motor_of(bench, "MCH").drive
    fault = bench.inject("MCH.bridge", "one_leg", "20 ms", "40 ms", leg=leg, state=state)
    bench.step(120)
    usual = (registers[0] - registers[1]) / 600
    assert drive.duty == duty
    assert drive.is_open == (state == 0)
    assert (drive.healthy_duty, drive.healthy_open) == (usual, False)
    assert fault.acted == (state == 0 or duty != usual)
    assert fault.largest_difference == pytest.approx(duty - usual)
    bench.step(200)
    assert drive.duty == usual
    assert not drive.is_open
    assert fault.cleared_ns == 40_250_000


def test_a_held_leg_stays_held_when_the_firmware_writes_another_duty_and_without_power_nothing_drives():
    bench = Driven(300, 0)
    drive = motor_of(bench, "MCH").drive
    bench.inject("MCH.bridge", "one_leg", leg=2, state=2)
    bench.step(8)
    drive.write_pwm(bench.loop.time, 0, 120, 600)
    bench.step()
    assert drive.duty == pytest.approx(1.0 - 0.2)
    drive.low_side(bench.loop.time, False, True)
    bench.step()
    assert drive.is_open
    assert drive.duty == 0.0


def test_a_leg_that_is_neither_2_nor_6_is_refused():
    with pytest.raises(UserError, match="leg is 4, there are 2 and 6"):
        Driven().inject("MCH.bridge", "one_leg", leg=4)


@pytest.mark.parametrize("registers", [(300, 0), (0, 300)])
@pytest.mark.parametrize(("board", "side"), [("MCFO", "outer"), ("MCFI", "inner")])
def test_a_jammed_ankle_stays_where_it_was_against_its_motor_and_moves_again_at_the_end(board, side, registers):
    bench = Driven(*registers)
    leg = getattr(bench.plant.body, side)
    bench.plant.hold(lifted=True)  # both feet hang free
    bench.step(8)
    fault = bench.inject(f"{board}.joint", "jammed", "2 ms", "40 ms")
    bench.step(1)
    caught = leg.foot_angle - leg.angle
    bench.step(140)
    assert fault.active
    # the motor pulls with 3 N m at most on 400 N m/rad, and the foot had some speed when it was caught
    assert leg.foot_angle - leg.angle == pytest.approx(caught, abs=0.02)
    assert abs(fault.largest_difference) > 0.1
    bench.step(20)
    assert fault.cleared_ns == 40_250_000
    assert bench.plant.body.terms is None
    assert (leg.extra_ankle, leg.extra_motor) == (0.0, 0.0)
    bench.step(200)
    assert abs(leg.foot_angle - leg.angle - caught) > 0.05


def test_a_jammed_hip_stays_where_it_was_while_its_legs_swing_and_swings_again():
    bench = Driven(0, 0)
    bench.plant.body.lock_hip = False  # the inner legs swing from 0.3 rad towards the spring's rest at 0
    fault = bench.inject("MCH.joint", "jammed", "100 ms", "300 ms")
    bench.step(401)
    caught = bench.plant.body.hip_angle()
    assert abs(bench.plant.body.hip_rate()) > 0.2
    bench.step(798)
    assert fault.active
    # spring and weight pull with 4 N m on 2000 N m/rad, and the legs had some speed when they were caught
    assert bench.plant.body.hip_angle() == pytest.approx(caught, abs=0.01)
    assert fault.largest_difference > 1.0  # against what pulls to 0
    bench.step(400)
    assert fault.cleared_ns == 300_250_000
    assert bench.plant.body.hip_angle() < caught - 0.03


def test_a_jammed_steering_creeps_at_most():
    healthy, bench = Driven(), Driven()
    fault = bench.inject("MCSI.joint", "jammed", "2 ms", "40 ms")
    for each in (healthy, bench):
        each.plant.hold(lifted=True)
        each.step(40)
    assert abs(bench.plant.steering.twist) < 0.25 * abs(healthy.plant.steering.twist)
    assert fault.acted
    bench.step(160)
    assert fault.cleared_ns == 40_250_000
    assert bench.plant.steering.damping == healthy.plant.steering.damping


@pytest.mark.parametrize("angle", [0.2, -0.2])
@pytest.mark.parametrize(("board", "side"), [("MCFO", "outer"), ("MCFI", "inner")])
def test_a_slipped_cable_pulls_as_if_it_were_stretched_by_less(board, side, angle):
    bench = Driven(0, 0)
    bench.plant.hold(lifted=True)
    leg = getattr(bench.plant.body, side)
    fault = bench.inject(f"{board}.cable", "cable_slip", "2 ms", "500 ms", angle=angle)
    bench.step(10)
    k = bench.plant.body.ankle.k
    assert leg.extra_ankle == pytest.approx(-k * angle)
    assert leg.extra_motor == pytest.approx(k * angle)
    bench.step(1600)
    # at rest the cable is as good as unstretched, at the new angle between motor and joint; friction of the motor, 0.1
    # N m, leaves it up to 0.1 / k beside that
    assert leg.stretch() == pytest.approx(angle, abs=0.11 / k + 0.02)
    assert fault.largest_difference == pytest.approx(-k * angle)
    bench.step(2400)
    assert fault.cleared_ns == 500_250_000
    assert leg.stretch() == pytest.approx(0.0, abs=0.11 / k + 0.02)


def test_terms_of_a_model_file_stay_when_a_fault_of_a_joint_comes_and_goes():
    bench = Driven(0, 0)
    body = bench.plant.body
    healthy = bench.inject("MCFI.joint", "jammed", "2 ms")
    fault = bench.inject("MCFO.joint", "jammed", "4 ms", "6 ms")
    bench.step(20)
    assert body.terms.count == 4
    bench.step(20)
    assert fault.cleared_ns > 0
    assert body.terms.count == 2
    assert list(body.terms.sides) == [healthy.side] * 2


# --- the world ------------------------------------------------------------------------------------------------


def released(**parameters):
    """On its way, without motors."""
    bench = Driven(0, 0, **parameters)
    bench.plant.release(0.7)
    return bench


@pytest.mark.parametrize("force", [30.0, -30.0])
def test_a_push_is_an_acceleration_of_force_over_mass_and_ends_by_itself(force):
    bench, healthy = released(), released()
    fault = bench.inject("world.robot", "push", "5 ms", force=force, length_ms=10)
    body = bench.plant.body
    for each in (bench, healthy):
        each.step(40)
    assert body.gx == pytest.approx(force / body.M)
    assert fault.acted_ns == 5_000_000
    for each in (bench, healthy):
        each.step(60)
    assert body.gx == 0.0
    assert fault.ended_ns == 15_000_000
    assert fault.cleared_ns == 15_250_000
    assert fault.acted_count == 40
    # pushed for 10 ms by 30 N, 10 kg over a foot go some 25 mm/s faster, the legs more slowly
    way = body.hip_x - healthy.plant.body.hip_x
    assert math.copysign(1.0, way) == math.copysign(1.0, force)


def test_a_push_that_is_ended_before_its_length_is_over_is_over():
    bench = released()
    fault = bench.inject("world.robot", "push", "5 ms", "8 ms", length_ms=1000)
    bench.step(60)
    assert fault.ended_ns == 8_000_000
    assert bench.plant.body.gx == 0.0


@pytest.mark.parametrize("angle", [0.05, -0.05])
def test_a_slope_turns_gravity_and_turns_it_back(angle):
    bench = released()
    fault = bench.inject("world.floor", "slope", "5 ms", "10 ms", angle=angle)
    bench.step(30)
    body = bench.plant.body
    assert (body.gx, body.gy) == pytest.approx((9.81 * math.sin(angle), -9.81 * math.cos(angle)))
    bench.step(30)
    assert (body.gx, body.gy) == (0.0, -9.81)
    assert fault.cleared_ns == 10_250_000
    assert fault.largest_difference == angle


def test_a_push_on_a_slope_that_comes_and_goes_keeps_its_force():
    bench = released()
    bench.inject("world.robot", "push", "2 ms", force=10.0, length_ms=18)
    bench.inject("world.floor", "slope", "5 ms", "10 ms", angle=0.05)
    body = bench.plant.body
    bench.step(30)
    assert body.gx == pytest.approx(9.81 * math.sin(0.05) + 10.0 / body.M)
    bench.step(20)
    assert body.gx == pytest.approx(10.0 / body.M)
    bench.step(50)
    assert body.gx == 0.0


@pytest.mark.parametrize("height", [0.01, -0.01])
def test_a_step_in_the_floor_lifts_the_footholds_from_the_next_one_on_and_ends_with_the_next_after_it(height):
    bench = Driven(0, 0)
    floor = bench.plant.floor
    assert floor.next_height() == 0.0
    fault = bench.inject("world.floor", "step", "1 ms", "3 ms", height=height)
    bench.step(6)
    assert not fault.acted
    assert [floor.next_height(), floor.next_height()] == [height, height]
    bench.step(10)
    assert fault.acted
    assert fault.largest_difference == height
    assert fault.cleared_ns == -1  # the robot still stands up there
    assert floor.next_height() == 0.0
    bench.step(1)
    assert fault.cleared_ns > 3_000_000


def test_a_step_where_no_foot_goes_has_not_acted():
    bench = Driven(0, 0)
    fault = bench.inject("world.floor", "step", "1 ms", "3 ms")
    bench.step(20)
    assert not fault.acted
    assert fault.cleared_ns == 3_250_000


def test_a_slippery_floor_has_less_friction_until_its_end_and_needs_a_body_that_can_slide():
    body = body_files.load("ranger")
    bench = released(parameters=body.parameters)
    sole = bench.plant.body.sole
    fault = bench.inject("world.floor", "slippery", "5 ms", "10 ms", friction=0.1)
    bench.step(30)
    assert sole.mu == 0.1
    bench.step(30)
    assert sole.mu == 0.9
    assert fault.cleared_ns == 10_250_000
    # of the weight of 97 N and more, as the robot falls on: eight tenths
    assert -100.0 < fault.largest_difference < -40.0
    with pytest.raises(UserError, match="with the body's contact 'sticking' feet never slide"):
        Driven(parameters=body_files.load("appendix").parameters).inject("world.floor", "slippery")


def test_every_place_of_actuators_and_world_has_a_mode():
    CATALOGUE.load()
    for place in CATALOGUE.places.values():
        assert CATALOGUE.modes_of(place), place.name
