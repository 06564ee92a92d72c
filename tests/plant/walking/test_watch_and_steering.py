"""What is noticed once per step, the operator's hands, one step of the steering, the noise: worked out by hand."""

import math

import pytest

from ranger_sim.plant import terms
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, FLIGHT, HELD, SINGLE, Body
from ranger_sim.plant.mechanics.observed import Observed
from ranger_sim.plant.mechanics.steering import Steering
from ranger_sim.plant.mechanics.term_torques import (
    ANKLE_CABLE,
    BACKLASH,
    CABLE_DAMPING,
    COGGING,
    DIRECTION,
    DRAG,
    HIP_JOINT,
    HIP_MOTOR,
    SLACK,
    SPRING,
    STIFFENING,
    TURN,
    TermTorques,
)
from ranger_sim.plant.sensors.noise import BLOCK, TABLE_SIZE, NoiseSource, quantile_table
from ranger_sim.plant.walking import handling, watch


def walking():
    """A body in single stance upright, both feet's forces those of standing."""
    body = Body()
    handling.place(body, 0.0, 0.4)
    handling.release(body, 0.0)
    body.stance.Fx, body.stance.Fy = 0.0, 95.0
    return body


# ---- forces -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("along", [20.0, -20.0])
def test_the_worst_friction_ratio_is_kept_for_both_directions(along):
    body = walking()
    body.stance.Fx, body.stance.Fy = along, 100.0
    watch.keep_forces(body, 0.001)
    assert body.seen.friction_ratio_max == pytest.approx(0.2)
    body.stance.Fx = 0.5 * along
    watch.keep_forces(body, 0.001)
    assert body.seen.friction_ratio_max == pytest.approx(0.2)
    assert body.seen.slip_s == 0.0 and body.seen.pull_s == 0.0


def test_more_than_the_floor_s_friction_counts_as_slipping_while_it_lasts():
    body = walking()
    mu = body.sole.mu
    body.stance.Fy, body.stance.Fx = 100.0, 100.0 * mu * 1.01
    watch.keep_forces(body, 0.002)
    watch.keep_forces(body, 0.002)
    body.stance.Fx = 100.0 * mu * 0.99
    watch.keep_forces(body, 0.002)
    assert body.seen.slip_s == pytest.approx(0.004)
    assert body.seen.friction_ratio_max == pytest.approx(1.01 * mu)


def test_below_five_newton_a_friction_ratio_says_nothing():
    body = walking()
    body.stance.Fy, body.stance.Fx = 5.0, 50.0
    watch.keep_forces(body, 0.001)
    assert body.seen.friction_ratio_max == 0.0 and body.seen.slip_s == 0.0
    body.stance.Fy = 5.1
    watch.keep_forces(body, 0.001)
    assert body.seen.friction_ratio_max == pytest.approx(50.0 / 5.1) and body.seen.slip_s == 0.001


def test_a_foot_that_slides_has_the_sole_s_friction():
    body = walking()
    body.stance.slide = -1
    watch.keep_forces(body, 0.001)
    assert body.seen.slip_s == 0.001 and body.seen.friction_ratio_max == body.sole.mu


def test_a_pull_of_more_than_one_newton_is_timed_and_the_least_force_kept():
    body = walking()
    for force in (30.0, -1.0, -1.5, 40.0):
        body.stance.Fy = force
        watch.keep_forces(body, 0.01)
    assert body.seen.normal_force_min == -1.5
    assert body.seen.pull_s == pytest.approx(0.01)


def test_in_double_stance_the_lesser_of_both_feet_counts_and_in_flight_none():
    body = walking()
    body.stance.Fy, body.swing.Fy = 60.0, 20.0
    watch.keep_forces(body, 0.01)
    assert body.seen.normal_force_min == 60.0  # the swing foot stands in double stance only
    body.mode = DOUBLE
    watch.keep_forces(body, 0.01)
    assert body.seen.normal_force_min == 20.0
    body.stance.Fy, body.mode = -50.0, FLIGHT
    watch.keep_forces(body, 0.01)
    assert body.seen.normal_force_min == 20.0 and body.seen.pull_s == 0.0


# ---- falls ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "stance, swing, cause",
    [
        (0.59, 0.0, ""),
        (-0.59, 0.0, ""),
        (0.61, 0.0, "fell forward"),
        (-0.61, 0.0, "fell backward"),
        (0.58, -0.61, ""),
        (0.59, -0.62, "legs split"),
        (-0.59, 0.62, "legs split"),
    ],
)
def test_leaning_beyond_0_6_rad_or_splitting_beyond_1_2_rad_is_a_fall(stance, swing, cause):
    body = walking()
    body.stance.angle, body.swing.angle = stance, swing
    body.hip_y = 0.9
    watch.watch(body, 0.0)
    assert body.cause == cause
    assert (body.mode == FALLEN) == bool(cause)


@pytest.mark.parametrize("share, cause", [(0.66, ""), (0.64, "fell forward")])
def test_a_hip_below_65_percent_of_the_leg_is_a_fall(share, cause):
    body = walking()
    body.seen.foothold_due = False  # a foothold that is drawn would compute the pose anew
    body.stance.angle = 0.1
    body.hip_y = share * body.stance.el
    watch.watch(body, 0.0)
    assert body.cause == cause


@pytest.mark.parametrize("since, cause", [(0.49, "tripped"), (0.51, "fell forward")])
def test_a_fall_within_half_a_second_of_a_scuff_is_a_trip(since, cause):
    body = walking()
    body.time_s = 10.0
    body.seen.released_s = 9.0
    body.seen.scuff_time_s = 10.0 - since
    body.stance.angle, body.hip_y = 0.7, 0.9
    watch.watch(body, 0.0)
    assert body.cause == cause


def test_a_walk_without_a_step_for_three_seconds_has_stalled():
    body = walking()
    body.hip_y = 0.9
    body.time_s = body.seen.released_s + 2.99
    watch.watch(body, 0.0)
    assert body.cause == ""
    body.time_s = body.seen.released_s + 3.01
    watch.watch(body, 0.0)
    assert body.cause == "stalled" and body.mode == FALLEN
    assert (body.hip_vx, body.hip_vy, body.outer.rate, body.inner.rate) == (0.0, 0.0, 0.0, 0.0)


def test_what_is_noticed_begins_anew_when_the_robot_is_let_go():
    seen = Observed()
    assert (seen.fall_lean, seen.fall_height, seen.fall_split, seen.stall_s) == (0.6, 0.65, 1.2, 3.0)  # EQUATIONS 16
    fresh = (False, 0.0, -1.0, 1.0, 0.0, 0.0, math.inf, 0.0)

    def shown():
        return (
            *(seen.brushing, seen.brush_s, seen.scuff_time_s, seen.passing_gap),
            *(seen.friction_ratio_max, seen.slip_s, seen.normal_force_min, seen.pull_s),
        )

    assert shown() == fresh and not seen.foothold_due and seen.released_s == 0.0
    seen.brushing, seen.brush_s, seen.scuff_time_s, seen.passing_gap = True, 2.0, 3.0, 0.1
    seen.friction_ratio_max, seen.slip_s, seen.normal_force_min, seen.pull_s = 0.5, 1.0, -3.0, 2.0
    seen.begin(7.5)
    assert shown() == fresh and seen.foothold_due and seen.released_s == 7.5


# ---- the operator's hands -----------------------------------------------------------------------------------------


def test_a_robot_that_is_taken_up_has_nothing_left_of_its_walk():
    body = walking()
    body.stand_on(body.inner)
    body.outer.rate, body.hip_vx, body.hip_vy = 1.0, 2.0, 3.0
    body.lock_hip = body.standing = body.sliding = body.floating = True
    body.cause = "fell forward"
    for leg in (body.outer, body.inner):
        leg.Fx, leg.Fy, leg.slide = 4.0, 5.0, 1
    handling.hold(body, -0.15)
    assert body.mode == HELD and body.stance is body.outer and body.last_strike is None and body.cause == ""
    assert (body.outer.angle, body.outer.rate, body.hip_vx, body.hip_vy) == (-0.15, 0.0, 0.0, 0.0)
    assert not (body.lock_hip or body.standing or body.sliding or body.floating)
    assert [(leg.Fx, leg.Fy, leg.slide) for leg in (body.outer, body.inner)] == [(0.0, 0.0, 0)] * 2


def test_both_legs_are_held_at_the_hip_s_angle_and_standing_locks_it():
    body = walking()
    body.inner.rate = 1.0
    handling.hold_both(body, 0.1, 0.3)
    assert body.inner.angle == pytest.approx(-0.2) and body.inner.rate == 0.0 and body.lock_hip
    handling.hold_standing(body, 0.05, -0.1)
    assert body.standing and body.mode == HELD and body.stance is body.outer
    assert (body.outer.height, body.inner.height) == (0.0, 0.0)
    assert body.inner.angle == pytest.approx(0.15)


def test_release_gives_the_rates_that_were_asked_for():
    body = Body()
    handling.place(body, 0.0, 0.4)
    assert body.inner.angle == pytest.approx(-0.4) and body.inner.foot_angle == body.inner.angle
    handling.release(body, -0.5, stance_foot_rate=0.25, hip_rate=1.5)
    assert body.mode == SINGLE and body.stance is body.outer and body.last_strike is body.outer
    assert (body.outer.rate, body.inner.rate) == (-0.5, -2.0)
    assert not (body.standing or body.brush) and body.cause == ""
    assert (body.outer.anchor, body.inner.anchor) == (0.0, 0.0)


# ---- steering: J dw/dt = T - k twist - c w, semi-implicit -------------------------------------------------------


def test_a_new_steering_is_at_rest_and_has_the_numbers_that_were_chosen():
    s = Steering()
    assert (s.twist, s.rate, s.yaw, s.path_x, s.path_y, s.hip_x) == (0.0,) * 6
    assert (s.known_yaw, s.sin_yaw, s.cos_yaw) == (0.0, 0.0, 1.0)
    assert (s.swing_inertia, s.stance_inertia, s.stiffness, s.damping, s.stop) == (0.01, 0.2, 1.5, 0.1, 0.0436)
    assert s.rotor_inertia == pytest.approx(7.056e-4)  # 84^2 x 1e-7


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("inner, inertia", [(False, 0.0107056), (True, 0.2007056)])
def test_one_step_of_the_steering_from_a_moving_state(sense, inner, inertia):
    s = Steering()
    s.rate, s.twist = 0.4 * sense, 0.01 * sense
    s.advance(1e-3, 0.3 * sense, 0.02, 0.05, 20.0, False, inner, 0.0)
    # 0.3 - 0.02 tanh-like(8) - (0.05 + 0.1) x 0.4 - 1.5 x 0.01; the smoothed sign of 8 is within 1e-2 of 1
    rate = 0.4 + 1e-3 * (0.3 - 0.02 - 0.06 - 0.015) / inertia
    assert s.rate == pytest.approx(sense * rate, abs=1e-3 * 2e-4 / inertia + 1e-9)
    assert s.twist == pytest.approx(sense * 0.01 + 1e-3 * s.rate, abs=1e-15)
    assert s.yaw == pytest.approx(-1e-3 * s.rate if inner else 0.0, abs=1e-15)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_stop_ends_twist_and_rate_on_both_sides(sense):
    s = Steering()
    s.rate, s.twist = 5.0 * sense, 0.043 * sense
    s.advance(1e-3, 0.0, 0.0, 0.0, 20.0, False, True, 0.0)
    assert (s.twist, s.rate) == (0.0436 * sense, 0.0)
    assert s.yaw == pytest.approx(-0.0006 * sense)


def test_both_feet_on_the_floor_stop_a_twist_where_it_is_and_a_twisted_foot_without_drive_moves():
    s = Steering()
    s.rate, s.twist = 1.0, 0.02
    s.advance(1e-3, 0.3, 0.0, 0.0, 20.0, True, True, 0.0)
    assert (s.rate, s.twist, s.yaw) == (0.0, 0.02, 0.0)
    s.advance(1e-3, 0.0, 0.0, 0.0, 20.0, True, False, 0.0)
    assert s.rate == pytest.approx(-1e-3 * 1.5 * 0.02 / 0.0107056)


def test_a_path_begins_where_the_robot_is_put_down_and_follows_each_new_heading():
    s = Steering()
    s.path_x = s.path_y = s.yaw = 3.0
    s.begin(2.0)
    assert (s.path_x, s.path_y, s.yaw, s.hip_x) == (0.0, 0.0, 0.0, 2.0)
    s.yaw = 0.3
    s.advance(1e-3, 0.0, 0.0, 0.0, 20.0, True, False, 2.5)
    s.advance(1e-3, 0.0, 0.0, 0.0, 20.0, True, False, 2.4)
    assert (s.path_x, s.path_y) == pytest.approx((0.4 * math.cos(0.3), 0.4 * math.sin(0.3)))
    assert s.hip_x == 2.4


# ---- noise --------------------------------------------------------------------------------------------------------


def test_values_are_those_at_the_places_that_a_block_would_give_in_their_order():
    values, places = NoiseSource(7, "here"), NoiseSource(7, "here")
    assert [values.normal() for _ in range(150)] == [places.table[places.block()] for _ in range(150)]


def test_the_table_has_variance_one_and_the_normal_distribution_s_quantiles():
    table = quantile_table()
    assert len(table) == TABLE_SIZE == 4096 and table == sorted(table)
    assert sum(table) == pytest.approx(0.0, abs=1e-9)
    assert sum(each * each for each in table) / 4096 == pytest.approx(1.0)
    assert table[-1] == -table[0] == pytest.approx(3.67, abs=0.005)
    assert sum(abs(each) < 1.0 for each in table) / 4096 == pytest.approx(0.6827, abs=1e-3)


def test_a_shuffled_table_has_every_value_once_and_its_first_ones_again_behind_it():
    noise = NoiseSource(1, "there")
    assert sorted(noise.table[:TABLE_SIZE]) == quantile_table()
    assert len(noise.table) == TABLE_SIZE + BLOCK == 4160
    assert list(noise.table[TABLE_SIZE:]) == list(noise.table[:BLOCK])
    assert list(noise.table[:64]) != list(NoiseSource(2, "there").table[:64])
    assert all(0 <= noise.block() < 4096 for _ in range(200))


# ---- additional torques -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "form, numbers, q, w, expected",
    [
        (SLACK, (14.0,), -0.01, 0.0, 0.14),
        (SLACK, (14.0,), 0.01, 0.0, 0.0),
        (BACKLASH, (0.02, 14.0), 0.01, 0.0, -0.14),
        (BACKLASH, (0.02, 14.0), -0.01, 0.0, 0.14),
        (BACKLASH, (0.02, 14.0), 0.5, 0.0, -0.28),
        (BACKLASH, (0.02, 14.0), -0.5, 0.0, 0.28),
        (STIFFENING, (50.0,), 0.2, 0.0, 0.4),
        (STIFFENING, (50.0,), -0.2, 0.0, -0.4),
        (CABLE_DAMPING, (0.3,), 5.0, 2.0, 0.6),
        (SPRING, (2.0, 3.0, 4.0, 0.1), 0.6, 9.0, -(1.0 + 0.75 + 0.5)),
        (SPRING, (2.0, 3.0, 4.0, 0.1), -0.4, 9.0, -(-1.0 + 0.75 - 0.5)),
        (DRAG, (0.5,), 0.0, 3.0, -4.5),
        (DRAG, (0.5,), 0.0, -3.0, 4.5),
        (DIRECTION, (0.1, 0.2), 0.0, 8.0, -0.1 - 1.6),
        (DIRECTION, (0.1, 0.2), 0.0, -8.0, -0.1 - 1.6),
        (TURN, (0.5, 3.0, 0.4), 0.2, 0.0, 0.5 * math.sin(1.0)),
        (COGGING, (0.5, 3.0, 0.4), 0.2, 0.0, 0.5 * math.sin(3.0 * 10.0 * 0.2 + 0.4)),
    ],
)
def test_each_form_s_torque_at_a_state_on_either_side(form, numbers, q, w, expected):
    rows = TermTorques(1.68, 10.0, 34.0, 0.05)
    rows.add(form, HIP_JOINT, 0, (9.0, 9.0, 9.0, 9.0))  # another row's numbers are not taken
    rows.add(form, ANKLE_CABLE, 0, list(numbers))
    rows.add(form, HIP_MOTOR, 0, list(numbers))
    own = TermTorques(1.68, 10.0, 34.0, 0.05)
    own.add(form, HIP_MOTOR, 0, list(numbers))
    assert own.count == 1 and rows.count == 3
    assert own.torque_on_hip(q, w) == pytest.approx(expected, abs=1e-6)
    both = TermTorques(1.68, 10.0, 34.0, 0.05)
    both.add(form, HIP_JOINT, 0, list(numbers))
    both.add(form, HIP_MOTOR, 0, list(numbers))
    other = 0.5 * math.sin(1.0) if form == COGGING else expected  # at a joint there is no gear
    assert both.torque_on_hip(q, w) == pytest.approx(expected + other, abs=1e-6)


# name: {parameter: (low, high, default)}; a torque of 10 N m is more than any motor has, phases are a turn either way
LIMITS = {
    "stribeck": {"excess_Nm": (0.0, 10.0, None), "speed_rad_s": (0.001, 100.0, None)},
    "coulomb_friction": {"change_Nm": (-0.1, 10.0, None)},
    "viscous_friction": {"change_Nms": (-0.01, 10.0, None)},
    "direction_friction": {"coulomb_Nm": (-10.0, 10.0, 0.0), "viscous_Nms": (-10.0, 10.0, 0.0)},
    "drag": {"quadratic_Nms2": (0.0, 10.0, None)},
    "cable_backlash": {"gap_rad": (0.0, 0.5, None), "stiffness_Nm_per_rad": (0.0, 100.0, 14.0)},
    "cable_slack": {"stiffness_Nm_per_rad": (0.0, 100.0, 14.0)},
    "cable_damping": {"damping_Nms": (0.0, 1.0, None)},
    "resistance_temperature": {"per_K": (-0.01, 0.02, None)},
    "torque_constant_temperature": {"per_K": (-0.02, 0.01, None)},
    "resistance_change": {"change_ohm": (-1.0, 100.0, None)},
    "torque_constant_change": {"factor": (0.5, 2.0, None)},
    "contact_drop_change": {"change_V": (-0.7, 10.0, None)},  # the base model's own drop is 0.7 V
    "dead_time": {"fraction": (0.0, 0.2, None)},
    "sensor_scale": {"factor": (0.1, 10.0, None)},
    "sensor_offset": {"value": (-100.0, 100.0, None)},
    "sensor_lag": {"time_constant_s": (0.0, 10.0, None)},
    "sensor_noise": {"deviation": (0.0, 100.0, None)},
    "edge_jitter": {"edges": (0.0, 0.4, None)},
    "disc_error": {"line_edges": (0.0, 0.1, 0.0), "duty_edges": (-0.4, 0.4, 0.0)},
    "bit_flip": {"probability": (0.0, 1.0, None)},
    "gyro_misalignment": {"yaw_rad": (-0.5, 0.5, None)},
    "cable_stiffening": {"cubic_Nm_per_rad3": (-1000.0, 10000.0, None)},
    "spring": {
        "linear_Nm_per_rad": (-100.0, 100.0, 0.0),
        "square_Nm_per_rad2": (-100.0, 100.0, 0.0),
        "cubic_Nm_per_rad3": (-1000.0, 1000.0, 0.0),
        "rest_rad": (-4.0, 4.0, 0.0),
    },
    "cogging": {
        "amplitude_Nm": (0.0, 5.0, None),
        "periods_per_turn": (1.0, 1000.0, None),
        "phase_rad": (-math.tau, math.tau, 0.0),
    },
    "commutation_ripple": {
        "fraction": (0.0, 0.5, None),
        "periods_per_turn": (1.0, 1000.0, None),
        "phase_rad": (-math.tau, math.tau, 0.0),
    },
    "once_per_turn": {
        "amplitude_Nm": (0.0, 5.0, None),
        "periods_per_turn": (1.0, 100.0, 1.0),
        "phase_rad": (-math.tau, math.tau, 0.0),
    },
    "eccentricity": {
        "once_rad": (-0.2, 0.2, None),
        "once_phase_rad": (-math.tau, math.tau, 0.0),
        "twice_rad": (-0.2, 0.2, 0.0),
        "twice_phase_rad": (-math.tau, math.tau, 0.0),
    },
}


def test_each_form_has_the_limits_and_defaults_that_model_files_rely_on():
    assert set(terms.FORMS) == set(LIMITS)
    for name, form in terms.FORMS.items():
        assert {p.name: (p.low, p.high, p.default) for p in form.parameters} == LIMITS[name], name
