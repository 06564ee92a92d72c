"""Heel strike, angle integration and reset, heights, distance, energy, fall; and the switches of 2016."""

import math

import pytest

from ranger_sim.boards.main_brain.estimator import EnergyMeter
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors
from tests.boards.main_brain_bench import Bench

FLAT_FEET = {"MCFO_RIGHT_ANKLE_ANGLE": 1.68 + 0.2, "MCFI_MID_ANKLE_ANGLE": 1.68 + 0.2}


def walking(quirks=None):
    """A bench in walk mode with a level gyro."""
    bench = Bench(quirks=quirks)
    bench.tick(UI_ANG_RATE_X=-0.004)
    bench.press(1)
    bench.tick(UI_ANG_RATE_X=-0.004)
    assert bench.states()[0] == "walk"
    return bench


def swing_inner_and_strike(bench, left=3000.0, right=300.0, ticks=2):
    """Inner legs come forward with the foot up, flip it down, and touch for `ticks` slots."""
    quiet = {"MCFI_LEFT_HEEL_SENSE": 300.0, "MCFI_RIGHT_HEEL_SENSE": 300.0}
    bench.tick(MCH_ANGLE=0.1, MCFI_MID_ANKLE_ANGLE=0.3, **quiet)
    for _ in range(20):
        bench.tick()
    bench.tick(MCH_ANGLE=0.4, MCFI_MID_ANKLE_ANGLE=1.88, MCFO_RIGHT_ANKLE_ANGLE=1.88)
    for _ in range(ticks):
        bench.tick(MCFI_LEFT_HEEL_SENSE=left, MCFI_RIGHT_HEEL_SENSE=right)


# --- rates and angle ------------------------------------------------------------------------------


def test_leg_rates_come_from_gyro_and_hip_with_the_signs_of_the_robot():
    bench = Bench()
    for _ in range(300):
        bench.tick(UI_ANG_RATE_X=-0.504, MCH_ANG_RATE=2.0)
    # outer rate = -(gyro - bias), inner rate = outer rate - hip rate; settled, single precision
    assert bench.get("E_LO_RATE") == pytest.approx(0.5, abs=1e-5)
    assert bench.get("E_LI_RATE") == pytest.approx(-1.5, abs=1e-5)
    assert bench.get("E_MCH_ANG_RATE") == pytest.approx(2.0, abs=1e-5)


def test_the_outer_angle_is_the_trapezoid_of_the_unfiltered_gyro():
    bench = walking()
    before = bench.estimator.outer_angle
    rates = [0.1, -0.3, 0.5, 0.7, 0.2]
    for rate in rates:
        bench.tick(UI_ANG_RATE_X=-0.004 - rate)
    expected = sum(0.001 * (a + b) for a, b in zip([0.0, *rates], rates, strict=False))
    # gyro and bias are single-precision words: 5 slots of 2 ms, 1e-8 rad/s each
    assert bench.estimator.outer_angle - before == pytest.approx(expected, abs=1e-9)
    assert bench.get("E_LI_ANGLE") == pytest.approx(bench.get("E_LO_ANGLE") - bench.get("MCH_ANGLE"), abs=1e-7)


def test_the_gyro_is_integrated_over_its_own_stamps():
    bench = walking()
    bench.tick(UI_ANG_RATE_X=-1.004)
    before = bench.estimator.outer_angle
    for _ in range(5):
        bench.time_passes()  # slots without a new gyro word
        bench.estimator.update()
    assert bench.estimator.outer_angle == before
    bench.tick(UI_ANG_RATE_X=-1.004)
    assert bench.estimator.outer_angle - before == pytest.approx(0.012, abs=1e-8)


def test_a_lost_stretch_of_gyro_data_is_integrated_as_one_trapezoid():
    bench = walking()
    bench.tick(UI_ANG_RATE_X=-0.104)
    before = bench.estimator.outer_angle
    bench.ms += 498
    bench.tick(UI_ANG_RATE_X=-0.304)
    assert bench.estimator.outer_angle - before == pytest.approx(0.5 * 0.5 * (0.1 + 0.3), abs=1e-8)


def test_a_walk_begins_at_angle_zero_with_the_inner_legs_swinging_whatever_was_before():
    bench = Bench()
    for _ in range(50):
        bench.tick(UI_ANG_RATE_X=-1.004)
    assert bench.estimator.outer_angle == pytest.approx(0.098, abs=1e-6)  # outside of walking the gyro is summed too
    bench.estimator.swing_leg = 0
    bench.estimator.front_foot = 0.3
    bench.estimator.steps = 12
    bench.estimator.distance_m = 4.5
    bench.tick(UI_BUTTONS=2, UI_ANG_RATE_X=-1.004)
    assert bench.states()[0] == "walk"
    bench.tick(UI_BUTTONS=0, UI_ANG_RATE_X=-1.004)
    assert bench.get("E_SWING_LEG") == 1
    assert bench.get("E_LO_ANGLE") == pytest.approx(0.002, abs=1e-7)  # this slot's share
    assert (bench.get("E_STEP_COUNT"), bench.get("E_DISTANCE")) == (0, 0.0)
    assert (bench.estimator.steps, bench.estimator.distance_m, bench.estimator.front_foot) == (0, 0.0, 0.0)
    bench.tick(UI_ANG_RATE_X=-1.004)
    assert bench.get("E_LO_ANGLE") == pytest.approx(0.004, abs=1e-7)  # once only


def test_published_foot_angles_carry_the_offset_of_the_robot():
    bench = walking()
    bench.tick(MCFO_RIGHT_ANKLE_ANGLE=1.68 + 0.3, MCFI_MID_ANKLE_ANGLE=1.68 - 0.1, MCH_ANGLE=0.2)
    assert bench.get("E_FO_ABSANG") == pytest.approx(bench.get("E_LO_ANGLE") + 0.3 + 1.75, abs=1e-6)
    assert bench.get("E_FI_ABSANG") == pytest.approx(bench.get("E_LI_ANGLE") - 0.1 + 1.75, abs=1e-6)


def test_the_swing_ankle_height_follows_the_swinging_leg():
    bench = walking()
    bench.estimator.outer_angle = 0.1
    bench.tick(MCH_ANGLE=0.4)
    rise = 0.96 * (math.cos(bench.get("E_LO_ANGLE")) - math.cos(bench.get("E_LI_ANGLE")))
    assert bench.get("E_ANKLE_HEIGHT") == pytest.approx(rise, abs=1e-7)
    bench.estimator.swing_leg = 0
    bench.tick()
    assert bench.get("E_ANKLE_HEIGHT") == pytest.approx(-rise, abs=1e-6)


# --- heel strike ------------------------------------------------------------------------------------


def test_two_slots_above_the_threshold_are_a_heel_strike():
    bench = walking()
    swing_inner_and_strike(bench, ticks=1)
    assert bench.get("E_SWING_LEG") == 1
    bench.tick()
    assert bench.get("E_SWING_LEG") == 0
    assert bench.get("E_STEP_COUNT") == 1
    assert bench.get("E_T_AFTER_HS") == 0


def test_one_slot_above_the_threshold_is_not():
    bench = walking()
    swing_inner_and_strike(bench, ticks=1)
    bench.tick(MCFI_LEFT_HEEL_SENSE=300.0)
    bench.tick(MCFI_LEFT_HEEL_SENSE=3000.0)
    assert bench.get("E_SWING_LEG") == 1


@pytest.mark.parametrize("raw, strikes", [(2299.0, False), (2300.0, True)])
def test_the_threshold_is_2000_counts_above_the_baseline(raw, strikes):
    bench = walking()
    swing_inner_and_strike(bench, left=raw)
    assert (bench.get("E_SWING_LEG") == 0) is strikes


@pytest.mark.parametrize("left, right", [(3000.0, 300.0), (300.0, 3000.0), (3000.0, 3000.0)])
def test_either_foot_of_the_pair_is_enough(left, right):
    bench = walking()
    swing_inner_and_strike(bench, left, right)
    assert bench.get("E_SWING_LEG") == 0


def test_a_sensor_with_a_high_baseline_is_ignored_for_the_step():
    bench = walking()
    quiet = {"MCFI_LEFT_HEEL_SENSE": 6000.0, "MCFI_RIGHT_HEEL_SENSE": 300.0}
    bench.tick(MCH_ANGLE=0.1, MCFI_MID_ANKLE_ANGLE=0.3, **quiet)
    bench.tick(MCH_ANGLE=0.4, MCFI_MID_ANKLE_ANGLE=1.88)
    assert bench.get("E_HEEL_BASE_LEFT") == 6000.0
    for _ in range(5):
        bench.tick(MCFI_LEFT_HEEL_SENSE=9000.0)
    assert bench.get("E_SWING_LEG") == 1
    for _ in range(2):
        bench.tick(MCFI_RIGHT_HEEL_SENSE=2300.0)
    assert bench.get("E_SWING_LEG") == 0


def test_the_baseline_is_an_average_frozen_when_the_foot_flips_down():
    bench = walking()
    bench.tick(MCH_ANGLE=0.1, MCFI_MID_ANKLE_ANGLE=0.3, MCFI_LEFT_HEEL_SENSE=100.0, MCFI_RIGHT_HEEL_SENSE=0.0)
    expected = 100.0
    for raw in (200.0, 150.0, 400.0):
        expected = 0.9 * expected + 0.1 * raw
        bench.tick(MCFI_LEFT_HEEL_SENSE=raw)
    # the slot in which the foot passes 0.8 rad still counts
    expected = 0.9 * expected + 0.1 * 500.0
    bench.tick(MCFI_MID_ANKLE_ANGLE=0.81, MCFI_LEFT_HEEL_SENSE=500.0)
    assert bench.get("E_HEEL_BASE_LEFT") == pytest.approx(expected, abs=1e-4)
    assert bench.get("E_HEEL_STAGE") == 2
    bench.tick(MCFI_LEFT_HEEL_SENSE=5000.0)
    assert bench.get("E_HEEL_BASE_LEFT") == pytest.approx(expected, abs=1e-4)


def test_a_slot_takes_one_stage_of_the_detector_so_a_foot_that_is_down_already_is_watched_from_the_third_on():
    bench = walking()
    quiet = {"MCFI_LEFT_HEEL_SENSE": 300.0, "MCFI_RIGHT_HEEL_SENSE": 300.0}
    stages = []
    for _ in range(2):
        bench.tick(MCH_ANGLE=0.4, MCFI_MID_ANKLE_ANGLE=1.88, **quiet)
        stages.append(bench.get("E_HEEL_STAGE"))
    assert stages == [1, 2]
    swings = []
    for _ in range(2):
        bench.tick(MCFI_RIGHT_HEEL_SENSE=3000.0)
        swings.append(bench.get("E_SWING_LEG"))
    assert swings == [1, 0]


@pytest.mark.parametrize(
    "inner_swings, hip, begins",
    [(True, 0.006, True), (True, 0.004, False), (False, 0.0001, False), (False, -0.0001, True)],
)
def test_the_means_begin_5_mrad_ahead_for_the_inner_feet_and_at_once_for_the_outer_ones(inner_swings, hip, begins):
    bench = walking()
    bench.estimator.swing_leg = 1 if inner_swings else 0
    bench.tick(MCH_ANGLE=hip)
    assert bench.get("E_HEEL_STAGE") == int(begins)


def test_contact_before_the_foot_flips_down_is_not_a_strike():
    bench = walking()
    bench.tick(MCH_ANGLE=0.1, MCFI_MID_ANKLE_ANGLE=0.3)
    for _ in range(10):
        bench.tick(MCFI_LEFT_HEEL_SENSE=8000.0)
    assert bench.get("E_SWING_LEG") == 1


def test_a_swing_leg_still_behind_is_not_watched():
    bench = walking()
    for _ in range(10):
        bench.tick(MCH_ANGLE=-0.3, MCFI_MID_ANKLE_ANGLE=1.88, MCFI_LEFT_HEEL_SENSE=8000.0)
    assert bench.get("E_SWING_LEG") == 1


def test_after_the_inner_strike_the_outer_feet_are_watched():
    bench = walking()
    swing_inner_and_strike(bench)
    bench.tick(MCH_ANGLE=-0.1, MCFO_RIGHT_ANKLE_ANGLE=0.3, MCFO_LEFT_HEEL_SENSE=200.0, MCFO_RIGHT_HEEL_SENSE=200.0)
    bench.tick(MCH_ANGLE=-0.4, MCFO_RIGHT_ANKLE_ANGLE=1.88)
    for _ in range(2):
        bench.tick(MCFO_RIGHT_HEEL_SENSE=2500.0)
    assert bench.get("E_SWING_LEG") == 1
    assert bench.get("E_STEP_COUNT") == 2


# --- reset, distance ----------------------------------------------------------------------------------


def test_the_first_strike_resets_the_angle_fully_and_later_ones_by_a_tenth():
    bench = walking()
    swing_inner_and_strike(bench)
    # equal feet, both ankles at 1.88, legs 0.4 apart: the pose is symmetric in height
    geometric = bench.estimator.floor.rear_leg
    assert bench.get("E_LO_ANGLE") == pytest.approx(geometric, abs=1e-7)
    bench.estimator.outer_angle += 0.05
    bench.tick(MCH_ANGLE=-0.1, MCFO_RIGHT_ANKLE_ANGLE=0.3)
    bench.tick(MCH_ANGLE=-0.4, MCFO_RIGHT_ANKLE_ANGLE=1.88)
    before = bench.estimator.outer_angle
    for _ in range(2):
        bench.tick(MCFO_RIGHT_HEEL_SENSE=2500.0)
    error = before - bench.estimator.floor.front_leg
    assert bench.get("E_LO_ERROR") == pytest.approx(error, abs=1e-5)
    assert bench.estimator.outer_angle == pytest.approx(before - 0.1 * error, abs=1e-5)


def test_the_first_reset_is_a_tenth_as_well_when_the_switch_says_so():
    bench = walking(Quirks(first_step_full_reset=False))
    swing_inner_and_strike(bench)
    assert bench.get("E_LO_ANGLE") == pytest.approx(0.1 * bench.estimator.floor.rear_leg, abs=1e-5)


def rear_foot_of_equal_feet(hip, ankle):
    """Angle to the floor at which both feet (d 0.146 m, legs of 0.96 m) touch it, both ankles alike; by bisection."""

    def rise(front_leg):  # hip above the floor by the rear leg less that by the front leg
        rear_leg = front_leg + hip
        return 0.96 * (math.cos(rear_leg) - math.cos(front_leg)) - 0.146 * (
            math.cos(rear_leg + ankle) - math.cos(front_leg + ankle)
        )

    low, high = -hip, 0.0
    assert rise(low) > 0.0 > rise(high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rise(middle) > 0.0 else (low, middle)
    return low + hip + ankle


def test_distance_adds_the_ankle_distance_and_the_rolling_of_the_foot():
    bench = walking()
    swing_inner_and_strike(bench)
    # the first step takes the rear foot for one that began on its sweet spot
    first = 1.92 * math.sin(0.2) + 0.054 * rear_foot_of_equal_feet(0.4, 0.2)
    assert bench.get("E_DISTANCE") == pytest.approx(first, abs=1e-4)
    rolled_from = bench.estimator.front_foot
    bench.tick(MCH_ANGLE=-0.1, MCFO_RIGHT_ANKLE_ANGLE=0.3)
    bench.tick(MCH_ANGLE=-0.3, MCFO_RIGHT_ANKLE_ANGLE=1.9, MCFI_MID_ANKLE_ANGLE=2.2)
    for _ in range(2):
        bench.tick(MCFO_RIGHT_HEEL_SENSE=2500.0)
    second = 1.92 * math.sin(0.15) + 0.054 * (bench.estimator.floor.rear_foot - rolled_from)
    assert bench.get("EST_LAST_STEP_LENGTH") == pytest.approx(second, abs=1e-4)
    assert bench.get("E_DISTANCE") == pytest.approx(first + second, abs=1e-4)


@pytest.mark.parametrize(
    ("feet", "inner", "outer"),
    [
        ("ranger", (0.2, 0.146), (0.2, 0.146)),
        ("appendix", (0.2, 0.11), (0.2, 0.11)),
        ("robot", (0.23, 0.176), (0.168, 0.114)),
    ],
)
def test_the_feet_that_the_estimator_knows_can_be_chosen(feet, inner, outer):
    estimator = Bench(quirks=Quirks(estimator_feet=feet)).estimator
    floor = estimator.floor
    assert (floor.inner_radius_m, floor.inner_ankle_m) == inner
    assert (floor.outer_radius_m, floor.outer_ankle_m) == outer
    for radius, ankle in (inner, outer):
        assert estimator.sweet_spot_m == pytest.approx(radius - ankle)


def test_the_estimator_has_the_feet_of_the_default_body_unless_set_otherwise():
    floor = Bench().estimator.floor
    assert (floor.inner_radius_m, floor.inner_ankle_m, floor.outer_radius_m, floor.outer_ankle_m) == (
        0.2,
        0.146,
        0.2,
        0.146,
    )


def test_time_after_heel_strike_counts_across_the_wrap_of_the_network_time():
    bench = Bench()
    bench.ms = 2**32 - 140
    bench.set(UI_ANG_RATE_X=-0.004)
    bench.tick()
    bench.press(1)
    swing_inner_and_strike(bench)
    struck = bench.ms
    for _ in range(60):
        bench.time_passes()
        bench.store.set_word(0, bench.ms & 0xFFFFFFFF, bench.ms & 0xFFFFFFFF)
        bench.estimator.update()
    assert bench.ms > 2**32 > struck
    assert bench.get("E_T_AFTER_HS") == bench.ms - struck == 120


# --- energy, fall, errors -------------------------------------------------------------------------------


def test_energy_is_the_trapezoid_of_each_boards_power():
    bench = Bench()
    bench.tick(MCH_BATT_POWER=10.0, MCFO_BATT_POWER=0.0)
    for _ in range(500):
        bench.tick(MCH_BATT_POWER=20.0)
    # half of the first 2 ms at 10 W
    assert bench.get("EST_ENERGY_MCH") == pytest.approx(20.0 - 0.01, abs=1e-4)
    assert bench.get("EST_ENERGY_MCFO") == 0.0
    assert bench.get("EST_TOTAL_BATT_POWER") == 20.0


def test_a_leg_beyond_45_degrees_is_reported_once_as_a_fall_and_stops_the_motors():
    bench = walking()
    swing_inner_and_strike(bench)
    bench.estimator.outer_angle = 0.8
    for _ in range(5):
        bench.tick()
    assert bench.errors.count(errors.EST_ROBOT_FALL) == 1
    assert bench.states()[0] == "stop"
    assert bench.command("MCH") == (0.0, 0.0, 0.0)


def test_no_fall_is_judged_before_the_first_strike():
    bench = walking()
    bench.estimator.outer_angle = 1.5
    bench.tick()
    assert bench.errors == []


def test_time_stamps_that_run_back_are_an_error_and_a_leap_is_none():
    bench = Bench()
    bench.tick(MCH_ANG_RATE=1.0)
    bench.ms += 5000
    bench.tick(MCH_ANG_RATE=1.0)
    assert bench.errors == []
    bench.ms -= 10
    bench.tick(MCH_ANG_RATE=1.0)
    assert bench.errors == [errors.EST_FILTER_TIME_VIOLATION]


def test_a_step_of_less_than_a_quarter_second_is_reported_as_stutter():
    bench = walking()
    swing_inner_and_strike(bench)
    bench.tick(MCH_ANGLE=-0.1, MCFO_RIGHT_ANKLE_ANGLE=0.3)
    bench.tick(MCH_ANGLE=-0.4, MCFO_RIGHT_ANKLE_ANGLE=1.88)
    for _ in range(2):
        bench.tick(MCFO_RIGHT_HEEL_SENSE=2500.0)
    assert bench.errors == [errors.EST_STUTTER_STEP]


# --- the estimator of 2016, by switches ---------------------------------------------------------------------


def test_by_switch_rates_pass_20_hz_filters_once_per_slot():
    bench = Bench(quirks=Quirks(rate_filter="20_hz"))
    bench.tick(MCH_ANG_RATE=0.0)
    bench.tick(MCH_ANG_RATE=1.0)
    assert bench.get("E_MCH_ANG_RATE") == pytest.approx(0.013359200, abs=1e-8)


def test_by_switch_the_leg_angle_is_the_imus_roll():
    bench = Bench(quirks=Quirks(leg_angle="imu_roll"))
    for _ in range(200):
        bench.tick(UI_ROLL=0.179)
    # roll is positive with the foot ahead; bias -0.021
    assert bench.get("E_LO_ANGLE") == pytest.approx(-0.2, abs=1e-6)


@pytest.mark.parametrize(
    ("sensor", "leg"),
    [
        ("MCFO_LEFT_HEEL_SENSE", "OUTER"),
        ("MCFO_RIGHT_HEEL_SENSE", "OUTER"),
        ("MCFI_LEFT_HEEL_SENSE", "INNER"),
        ("MCFI_RIGHT_HEEL_SENSE", "INNER"),
    ],
)
def test_each_heel_sensor_counts_for_its_own_leg_alone(sensor, leg):
    bench = walking(Quirks(heel_strike="filtered_sum"))
    for _ in range(200):  # a second: 10 Hz filters have settled
        bench.tick(**{sensor: 500.0})
    other = {"OUTER": "INNER", "INNER": "OUTER"}[leg]
    assert bench.get(f"EST_CONTACT_{leg}") == pytest.approx(500.0, rel=1e-3)
    assert bench.get(f"EST_CONTACT_{other}") == 0.0


def test_by_switch_contact_is_a_filtered_sum_above_1700_counts():
    """The robot's 850 counts are for a sum of 700 in swing; the emulated sensors have 700 each."""
    bench = walking(Quirks(heel_strike="filtered_sum"))
    bench.tick(MCH_ANGLE=0.1, MCFI_MID_ANKLE_ANGLE=0.3, MCFI_LEFT_HEEL_SENSE=700.0, MCFI_RIGHT_HEEL_SENSE=700.0)
    for _ in range(100):
        bench.tick()
    bench.tick(MCH_ANGLE=0.4, MCFI_MID_ANKLE_ANGLE=1.88)
    slots = 0
    while bench.get("E_SWING_LEG") == 1 and slots < 100:
        bench.tick(MCFI_LEFT_HEEL_SENSE=7000.0, MCFI_RIGHT_HEEL_SENSE=7000.0)
        slots += 1
    # 1400 -> 14000 counts: 1700 is 2.4 % of the rise; the filter's step response is 0.36, 1.75, 4.3 %
    assert slots == 3
    assert bench.get("EST_CONTACT_INNER") > 1700.0


@pytest.mark.parametrize(("gap_ms", "energy_J"), [(1, 0.003), (1000, 3.0), (1001, 0.0)])
def test_energy_is_the_trapezoid_of_power_over_its_stamps_and_nothing_across_more_than_a_second(gap_ms, energy_J):
    meter = EnergyMeter()
    assert meter.update(2.0, 2**32 - 1)  # stamps wrap
    assert meter.update(4.0, gap_ms - 1)
    assert meter.energy_J == pytest.approx(energy_J, rel=1e-12)
    assert not meter.update(9.0, gap_ms - 1)  # the same datum once more
    assert meter.update(6.0, gap_ms + 99)  # and it goes on from there
    assert meter.energy_J == pytest.approx(energy_J + 0.5, rel=1e-12)
