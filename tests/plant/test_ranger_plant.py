"""The assembled physical robot: its parts agree with each other, step by step; steering and the path."""

import array
import math
import os
import pathlib
import subprocess
import sys

import pytest

from ranger_sim.plant import wiring_points as point
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.steering import Steering
from ranger_sim.plant.mechanics.walk_record import RING, WalkRecord
from ranger_sim.plant.ranger import SAMPLES, STEP_NS, RangerPlant
from tests.plant.walking.small_controllers import ElectricWalker, RecordGait, electric_start

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


def walking_plant(seed=1, seconds=4.0):
    plant = RangerPlant(seed=seed)
    walker = ElectricWalker(plant, RecordGait(RecordGait.ROBUST))
    electric_start(plant, walker)
    walker.run(10**6, seconds)
    return plant, walker


def test_the_body_feels_the_torque_law_of_its_motors():
    plant = RangerPlant()
    plant.hold()
    for current, rate in ((0.0, 0.3), (2.5, -4.0), (-1.0, 0.001), (5.0, 12.0)):
        for motor, name in ((plant.hip, "hip"), (plant.outer_ankle, "outer"), (plant.inner_ankle, "inner")):
            motor.load(current)
            law = motor.drive_Nm - motor.coulomb_Nm * math.tanh(rate / 0.05) - motor.viscous_Nms * rate
            assert law == pytest.approx(motor.torque_Nm(current, rate), rel=1e-14), name


def test_motors_and_body_agree_about_gears_rotors_and_smoothing():
    plant = RangerPlant()
    body = plant.body
    assert plant.hip.parameters.reflected_inertia_kg_m2 == pytest.approx(body.hip.J, rel=1e-15)
    for ankle in (plant.outer_ankle, plant.inner_ankle):
        assert ankle.parameters.reflected_inertia_kg_m2 == pytest.approx(body.ankle.J, rel=1e-15)
        assert ankle.inverse_smoothing == body.inverse_smoothing
    assert plant.hip.inverse_smoothing == body.inverse_smoothing


def test_a_step_is_250_us_and_starts_where_the_last_one_ended():
    plant = RangerPlant(start_ns=7_000)
    plant.hold()
    for n in range(1, 4):
        plant.step()
        assert plant.time_ns == 7_000 + n * 250_000 == 7_000 + n * STEP_NS


def test_encoders_and_words_show_the_body():
    plant, _ = walking_plant()
    body = plant.body
    ankle = body.outer.foot_angle - body.outer.angle + 1.68
    # cells: edges below the present position, pi / (lines gear) rad each
    for encoder, angle, per_edge in (
        (point.HIP_JOINT_EDGES, body.hip_angle(), math.pi / 2048),
        (point.HIP_MOTOR_EDGES, body.hip_angle(), math.pi / (192 * 66)),
        (point.OUTER_MOTOR_EDGES, -(body.outer.motor_angle + 1.68), math.pi / (512 * 34)),
        (point.OUTER_ANKLE_EDGES, -ankle, math.pi / 2048),
        (point.INNER_MOTOR_EDGES, body.inner.motor_angle + 1.68, math.pi / (512 * 34)),
    ):
        cell = plant.encoders[encoder].cell
        assert cell <= angle / per_edge <= cell + 1, encoder
    # noise of 0.3 counts and rounding: within two counts
    assert abs(plant.words[0] - (4590 + body.hip_angle() * 8192 / (2 * math.pi))) < 2.0
    assert abs(plant.words[1] - (6562 - ankle * 8192 / (2 * math.pi))) % 8192 < 2.0


def test_edges_lie_in_their_step_in_order():
    plant, _ = walking_plant(seconds=2.0)
    seen = 0
    for _ in range(2000):
        start = plant.time_ns
        plant.step()
        for encoder in plant.encoders:
            times = [encoder.edges.edge(i)[0] for i in range(encoder.edges.count)]
            assert times == sorted(times)
            assert all(start <= t < plant.time_ns for t in times)
            seen += len(times)
    assert seen > 1000


def test_foot_sensors_rise_in_stance():
    plant = RangerPlant()
    plant.hold("outer", 0.05, 0.3)
    for _ in range(800):
        plant.step()
    # standing: about 7000 of 8192 counts at 2.5 V; hanging: 700
    assert plant.analog_end[point.OUTER_FOOT_LEFT] == pytest.approx(7000 * 2.5 / 8192, rel=0.02)
    assert plant.analog_end[point.INNER_FOOT_LEFT] == pytest.approx(700 * 2.5 / 8192, rel=0.1)


def test_the_gyro_sends_the_outer_legs_rate():
    plant, _ = walking_plant(seconds=2.0)
    for byte in (0xC4, 0xC1, 0x29, 0xC2):
        plant.imu.receive_byte(plant.time_ns, byte)
    for _ in range(1_000_000 // STEP_NS):
        plant.step()
    a_millisecond_ago = plant.body.outer.rate
    for _ in range(1_000_000 // STEP_NS):
        plant.step()
    rate = plant.body.outer.rate
    # bias -0.004 rad/s; the newest sample is at most 1 ms old and has noise of 4 mrad/s, of which four sigma
    tolerance = abs(rate - a_millisecond_ago) + 4 * 0.004
    assert tolerance < 0.03 < abs(rate)
    assert plant.imu.rate_x == pytest.approx(-0.004 - rate, abs=tolerance)


def test_power_drawn_since_letting_go_is_kept_separately():
    plant, walker = walking_plant()
    for motor in plant.motors[:3]:
        assert 0.0 <= motor.drawn_before_J < motor.drawn_J
    assert plant.outer_ankle.drawn_before_J > 0.0  # it held the ankle while standing


def test_the_same_seed_gives_the_same_robot_and_another_seed_other_noise():
    one, _ = walking_plant(seed=5, seconds=2.5)
    two, _ = walking_plant(seed=5, seconds=2.5)
    three, _ = walking_plant(seed=6, seconds=2.5)
    assert list(one.analog_end) == list(two.analog_end)
    assert one.body.inner.rate == two.body.inner.rate
    assert list(one.analog_end) != list(three.analog_end)


def walk_in_bits(seconds=2.6):
    """Every state of the body, all voltages and edge counts after a walk, exactly."""
    plant, _ = walking_plant(seed=3, seconds=seconds)
    body = plant.body
    o, i = body.outer, body.inner
    numbers = [o.angle, i.angle, o.foot_angle, i.foot_angle, body.hip_x, plant.battery_V]
    numbers += [o.rate, i.foot_rate, plant.steering.path_x, *plant.analog_end]
    return " ".join([*(x.hex() for x in numbers), *(str(e.total) for e in plant.encoders), str(plant.strike_time_ns)])


def test_interpreted_and_compiled_walk_alike_to_the_last_bit():
    program = "from tests.plant.test_ranger_plant import walk_in_bits; print(walk_in_bits())"
    environment = dict(os.environ, RANGER_SIM_INTERPRETED="1")
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == walk_in_bits()


def test_a_sample_holds_what_its_names_say():
    plant, _ = walking_plant(seconds=2.5)
    row = array.array("d", [0.0]) * 64
    plant.fill_sample(row)
    values = dict(zip(SAMPLES, row, strict=False))
    body = plant.body
    assert values["hip_rad"] == body.hip_angle()
    assert values["ankle_inner_rad"] == body.inner.foot_angle - body.inner.angle + 1.68
    assert values["battery_V"] == plant.battery_V
    assert values["steps"] == plant.steps
    assert values["path_x_m"] == plant.steering.path_x
    assert len(SAMPLES) == 36 and row[len(SAMPLES)] == 0.0


def test_recent_steps_and_footholds_are_those_of_the_record():
    plant, _ = walking_plant(seconds=6.0)
    number, length, seconds, outer = plant.recent_steps()
    assert list(number) == list(range(1, plant.steps + 1))
    assert sum(length) == pytest.approx(plant.distance_m)
    assert all(outer[k] != outer[k + 1] for k in range(len(outer) - 1))
    assert seconds[1:].min() > 0.3
    footholds = plant.recent_footholds()
    assert len(footholds) == plant.steps
    assert footholds[-1]["x"] - footholds[-2]["x"] == pytest.approx(length[-1])


def test_the_record_does_not_grow():
    record = WalkRecord()
    for n in range(RING + 10):
        record.touch(n * 10**9, n % 2, True, 0.3, 0.4 * n, 0.0, (0.0, 0.1, 0.0, 1.0), 1.0, True, 0.02, 0.0)
    assert record.steps == RING + 10
    assert len(record.strike_times_ns) == RING
    assert record.strike_times_ns[9] == (RING + 9) * 10**9
    assert record.mean_step_length_m() == pytest.approx(0.4)
    assert record.step_length_deviation_m() == pytest.approx(0.0, abs=1e-6)


def test_a_drawing_gets_connected_points():
    plant, _ = walking_plant(seconds=2.0)
    picture = plant.body.snapshot()
    p = BodyParameters()
    for side in ("outer", "inner"):
        assert math.dist(picture["hip"], picture[side]["ankle"]) == pytest.approx(p.leg_length_m)
        assert math.dist(picture[side]["ankle"], picture[side]["foot_centre"]) == pytest.approx(p.outer_ankle_offset_m)


def test_a_hold_takes_the_pose_asked_for():
    plant = RangerPlant()
    plant.hold("inner", 0.05, -0.3, 1.7, 2.1)
    body = plant.body
    assert body.inner.angle == pytest.approx(0.05) and body.hip_angle() == pytest.approx(-0.3)
    assert body.inner.foot_angle - body.inner.angle + 1.68 == pytest.approx(2.1)
    assert body.outer.motor_angle + 1.68 == pytest.approx(1.7)
    plant.release(0.6)
    assert body.inner.rate == 0.6 and body.stance is body.inner


# ---- steering -------------------------------------------------------------------------------------------------


def turn(steering, drive, outer, inner, steps=4000, hip_step=0.0):
    x = steering.hip_x
    for _ in range(steps):
        x += hip_step
        steering.advance(STEP_NS * 1e-9, drive, 0.02, 0.001, 20.0, outer, inner, x)


def test_a_full_twist_in_inner_stance_turns_the_robot_by_five_degrees():
    steering = Steering()
    turn(steering, 0.3, True, False)  # inner feet in the air: they turn, the robot does not
    assert steering.twist == pytest.approx(0.0436) and steering.yaw == 0.0
    turn(steering, -0.3, False, True)  # on the floor: the robot turns the other way
    assert steering.twist == pytest.approx(-0.0436)
    assert math.degrees(steering.yaw) == pytest.approx(5.0, rel=0.01)


def test_feet_on_the_floor_together_block_the_twist():
    steering = Steering()
    turn(steering, 0.3, True, True)
    assert (steering.twist, steering.yaw, steering.rate) == (0.0, 0.0, 0.0)


def test_the_path_follows_the_heading():
    steering = Steering()
    steering.begin(1.0)
    turn(steering, 0.0, True, False, 100, 0.001)
    assert (steering.path_x, steering.path_y) == pytest.approx((0.1, 0.0))
    steering.yaw = math.pi / 2
    turn(steering, 0.0, True, False, 100, 0.001)
    assert (steering.path_x, steering.path_y) == pytest.approx((0.1, 0.1))


def test_a_twisted_foot_springs_back_without_current():
    steering = Steering()
    turn(steering, 0.3, True, False)
    turn(steering, 0.0, True, False, 40000)
    # friction of 0.02 N m holds up to 0.02 / 1.5 rad; smoothing lets it creep further
    assert abs(steering.twist) < 0.02 / 1.5
