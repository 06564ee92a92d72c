"""Holding, letting go, touching, brushing, lifting off, falling: what the body does at its events."""

import math

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant.mechanics.air import in_air
from ranger_sim.plant.mechanics.body import DOUBLE, FALLEN, FLIGHT, HELD, SINGLE, Body
from ranger_sim.plant.mechanics.floor import Floor
from ranger_sim.plant.mechanics.leg import INNER, OUTER
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.plant.mechanics.stance import on_feet
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.walking import handling, motion
from ranger_sim.plant.walking.impact import impact
from ranger_sim.plant.walking.watch import keep_forces
from tests.plant.mechanics.test_body_equations import closed_posture, set_random_rates
from tests.plant.walking.small_controllers import STEP_S, PaperGait, Walker, mid_stance_start


def advance(body, seconds):
    for _ in range(round(seconds / STEP_S)):
        body.step_start_ns += STEP_NS
        motion.advance(body, STEP_S)


def test_a_held_robot_keeps_its_legs_while_its_feet_follow_their_motors():
    body = Body()
    handling.place(body, 0.09, 0.35)
    handling.hold_both(body, 0.09, 0.35)
    body.inner.drive, body.inner.coulomb = -0.5, 0.1
    # A rotor pulled with the net torque T drags the foot by the cable k: the stretch swings between 0 and twice
    # T/J_A / (k (1/J_A + 1/J_f)), which is 14.8 mrad; 1 mrad for the friction's smoothing while it starts.
    p = body.parameters
    middle = 0.4 / body.ankle.J / (p.ankle_spring_Nm_per_rad * (1.0 / body.ankle.J + 1.0 / p.foot_inertia_kg_m2))
    stretches = []
    for _ in range(100):  # 0.1 s: before the foot meets its stop
        advance(body, 0.001)
        stretches.append(body.inner.foot_angle - body.inner.angle - body.inner.motor_angle)
    assert body.mode == HELD
    assert (body.outer.angle, body.inner.angle) == (0.09, 0.09 - 0.35)
    assert body.inner.motor_angle < -0.5  # pulled up by its motor
    assert min(stretches) == pytest.approx(0.0, abs=1e-3)
    assert max(stretches) == pytest.approx(2.0 * middle, abs=1e-3)


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_a_standing_hold_settles_where_ankle_and_weight_balance(stance):
    body = Body()
    handling.place(body, 0.0, 0.0)
    handling.hold_standing(body, 0.05, 0.0, stance)
    for _ in range(16000):
        # a position loop on each ankle motor, as the boards' start states are
        body.outer.drive = -18.0 * body.outer.motor_angle - 0.2 * body.outer.motor_rate
        body.inner.drive = -18.0 * body.inner.motor_angle - 0.2 * body.inner.motor_rate
        motion.advance(body, STEP_S)
    foot, motor = body.stance.foot_angle, body.stance.motor_angle
    p = body.parameters
    cable = p.ankle_spring_Nm_per_rad * (motor - (foot - 0.05))
    # moment of the weight about the contact point: M g d sin F
    assert cable == pytest.approx(p.total_mass_kg * 9.81 * p.outer_ankle_offset_m * math.sin(foot), abs=2e-3)
    assert abs(cable) > 0.05
    assert body.stance.side == stance
    assert body.stance.Fy == pytest.approx(p.total_mass_kg * 9.81)


def test_letting_go_starts_a_walk_with_the_rates_given():
    body = Body()
    handling.place(body, 0.09, 0.35)
    handling.hold_standing(body, 0.09, 0.35)
    handling.release(body, 0.7, OUTER, 0.7, 0.1)
    assert body.mode == SINGLE and body.stance is body.outer and body.swing is body.inner
    assert (body.outer.rate, body.outer.foot_rate) == (0.7, 0.7)
    assert body.hip_rate() == pytest.approx(0.1)
    # hip over a rolling foot: e dF + l cos(th) dth
    e = 0.2 - 0.11 * math.cos(body.outer.foot_angle)
    assert body.hip_vx == pytest.approx(e * 0.7 + 0.96 * math.cos(0.09) * 0.7)


def test_letting_go_with_the_other_foot_in_the_floor_ends_the_walk_with_that_cause():
    body = Body()
    handling.place(body, 0.3, 0.3)  # the inner leg is upright and reaches deeper than the leaning outer one
    handling.release(body, 0.5)
    assert body.mode == FALLEN
    assert body.cause == "put down with the swing foot in the floor"
    assert body.record.fell


def test_a_strike_ahead_counts_as_a_step_and_a_bounce_does_not():
    body = Body()
    mid_stance_start(body)
    body.inner.angle = -0.3
    body.inner.foot_angle = 0.1
    body.inner.motor_angle = 0.4
    body.inner.foot_rate = 0.0
    body.inner.rate = 0.6
    handling.begin_walk(body)
    assert body.record.steps == 0
    Walker(body, _Nothing()).run(1, 1.0)
    record = body.record
    assert record.steps == 1 and record.strike_leg == INNER
    assert record.step_length_m > 0.2
    assert body.mode in (SINGLE, DOUBLE)
    body.last_strike = body.inner
    before = record.steps
    record.touch(record.strike_time_ns + 5_000_000, INNER, False, 0.3, 0.3, 0.0, (0, 0, 0, 0), 0.0, True, 0.1, 0.0)
    assert record.steps == before and record.bounces == 1


class _Nothing:
    def tick(self, walker):
        walker.set_currents(0.0, 0.0, 0.0)


def test_impulses_of_a_strike_balance_the_momentum():
    """Sum of the impulses is the change of the robot's momentum, found from hip and leg rates."""
    stream = RandomStream(5, "impulses")
    for _ in range(20):
        body = Body()
        closed_posture(body, stream, OUTER)
        set_random_rates(body, stream)
        body.mode = SINGLE
        body.update_hip_rates()

        def momentum(b):
            Ao, Bo = b.outer.mc * math.cos(b.outer.angle), b.outer.mc * math.sin(b.outer.angle)
            Ai, Bi = b.inner.mc * math.cos(b.inner.angle), b.inner.mc * math.sin(b.inner.angle)
            return (
                b.M * b.hip_vx - Ao * b.outer.rate - Ai * b.inner.rate,
                b.M * b.hip_vy + Bo * b.outer.rate + Bi * b.inner.rate,
            )

        before = momentum(body)
        impact(body, True, True)
        after = momentum(body)
        # solution of a 10 x 10 system: rounding 1e-16 times condition 1e6 times 10 N s
        assert after[0] - before[0] == pytest.approx(body.stance.impulse_x + body.swing.impulse_x, abs=1e-9)
        assert after[1] - before[1] == pytest.approx(body.stance.impulse_y + body.swing.impulse_y, abs=1e-9)


def test_the_trailing_foot_leaves_when_its_force_reaches_zero():
    body = Body()
    mid_stance_start(body)
    walker = Walker(body, PaperGait())
    walker.run(3)
    assert body.mode == DOUBLE and body.last_strike is body.stance
    trailing, leading = body.swing, body.stance
    forces = []
    while body.mode == DOUBLE:
        forces.append(trailing.Fy)
        walker.run(1000, walker.seconds + 0.5 * STEP_S)
    assert body.mode == SINGLE and body.stance is leading
    # the force fell towards zero and did not jump to it: at most some steps' fall is left, and no step pulled
    assert 0.0 <= forces[-1] < 0.2 * max(forces)
    assert len(forces) * STEP_S > 0.010
    record = body.record
    assert record.double_stance_ns == record.lift_off_time_ns - record.strike_time_ns
    # strike and lift-off both lie inside a step
    assert abs(len(forces) * STEP_NS - record.double_stance_ns) < STEP_NS


def test_a_brushing_foot_is_pushed_up_and_slowed_down():
    body = Body()
    mid_stance_start(body, leg_rate=0.5, hip_rate=1.0, swing_ankle=0.0)
    body.inner.angle = 0.02  # behind the stance leg, as long as it: the sole is in the floor by a fraction of a mm
    body.outer.angle = 0.0
    body.inner.foot_angle = -0.05
    body.inner.motor_angle = -0.07
    body.update_pose()
    body.inner.height = body.hip_y - body.inner.chain_y(body.inner.foot_angle, body.inner.angle) + 5e-4
    body.seen.foothold_due = False
    body.update_pose()
    assert body.inner.gap == pytest.approx(-5e-4)
    body.brush = True
    on_feet(body, 0.0, 1)
    assert body.inner.Fy > 5.0
    # sliding friction opposes the foot's forward motion with mu times the normal force at most
    assert -0.9 * body.inner.Fy * 1.0000001 <= body.inner.Fx < 0.0
    motion.advance(body, STEP_S)
    assert body.record.scuffs == 1
    assert body.seen.brush_s > 0.0


def test_energy_only_falls_while_a_foot_brushes():
    body = Body(BodyParameters(outer_rolling_friction_Nms=0.0, inner_rolling_friction_Nms=0.0))
    mid_stance_start(body, leg_rate=0.5, hip_rate=1.0, swing_ankle=0.0)
    body.inner.foot_angle = body.inner.motor_angle = 0.0
    body.update_pose()
    body.inner.height = 2e-4
    body.brush = True
    energies = []
    for _ in range(40):
        body.update_pose()
        # the sole's own spring holds k gap^2 / 2
        sole = 0.5 * body.sole.k * min(0.0, body.inner.gap) ** 2
        energies.append(body.energy_J() + sole)
        on_feet(body, STEP_S, 4)
    # the damper's force jumps as the sole comes off: one step of it, 130 N s/m x 0.1 m/s over 1e-5 m
    assert all(b <= a + 1e-4 for a, b in zip(energies, energies[1:], strict=False))
    assert energies[-1] < energies[0] - 1e-4


def test_a_jump_is_a_flight_that_ends_with_a_touch():
    body = Body()
    mid_stance_start(body)
    body.mode = FLIGHT
    body.hip_vy = 0.2
    body.update_pose()
    highest = 0.0
    for _ in range(4000):
        motion.advance(body, STEP_S)
        if body.mode != FLIGHT:
            break
        highest = max(highest, body.outer.gap)
    assert body.mode in (SINGLE, DOUBLE)
    # v^2 / 2 g = 2 mm for a stiff robot; its legs and feet turn meanwhile
    assert 0.0005 < highest < 0.01


def test_oddities_are_counted_not_ignored():
    body = Body()
    body.outer.Fx, body.outer.Fy, body.inner.Fy = 60.0, 50.0, -3.0
    body.mode = DOUBLE
    keep_forces(body, STEP_S)
    assert body.seen.friction_ratio_max == pytest.approx(1.2)
    assert body.seen.slip_s == STEP_S
    assert body.seen.pull_s == STEP_S
    assert body.seen.normal_force_min == -3.0


@pytest.mark.parametrize(
    ("leans", "cause"),
    [
        ({"outer": 0.7}, "fell forward"),
        ({"outer": -0.7, "inner": -0.1}, "fell backward"),
        ({"outer": 0.5, "inner": -0.8}, "legs split"),
    ],
)
def test_each_fall_has_its_cause(leans, cause):
    body = Body()
    mid_stance_start(body)
    for name, lean in leans.items():
        getattr(body, name).angle = lean
    body.inner.height = -1.0  # a hole for the swing foot: only the fall ends this
    motion.advance(body, STEP_S)
    assert body.mode == FALLEN and body.cause == cause


def test_a_robot_that_takes_no_step_has_stalled():
    body = Body()
    mid_stance_start(body)
    body.seen.stall_s = 2 * STEP_S
    advance(body, 4 * STEP_S)
    assert body.cause == "stalled"


# ---- the floor ------------------------------------------------------------------------------------------------


def test_footholds_are_seeded_and_have_their_deviation():
    heights = [Floor(roughness_m=0.001, seed=7) for _ in range(2)]
    first = [heights[0].next_height() for _ in range(4000)]
    assert first == [heights[1].next_height() for _ in range(4000)]
    deviation = math.sqrt(sum(x * x for x in first) / len(first))
    assert deviation == pytest.approx(0.001, rel=5 / math.sqrt(2 * 4000))  # five standard errors
    assert Floor(roughness_m=0.001, seed=8).next_height() != first[0]


def test_a_step_in_the_floor_begins_at_its_foothold():
    floor = Floor(step_at=3, step_m=-0.005)
    assert [floor.next_height() for _ in range(5)] == [0.0, 0.0, -0.005, -0.005, -0.005]
    assert floor.first_height() == 0.0 and floor.foothold == 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"roughness_m": -1.0}, "roughness"),
        ({"slope_rad": 1.0}, "slope"),
        ({"step_m": 1.0}, "step"),
        ({"step_at": 0}, "foothold"),
    ],
)
def test_an_impossible_floor_is_a_user_error(arguments, words):
    with pytest.raises(UserError, match=words):
        Floor(**arguments)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"leg_length_m": 0.0}, "leg_length_m"),
        ({"foot_inertia_kg_m2": -1.0}, "foot_inertia"),
        ({"gravity_m_per_s2": math.nan}, "gravity"),
        ({"arc_heel_rad": 0.1}, "arc"),
        ({"slope_rad": 2.0}, "slope"),
        ({"exact_hip_spring": True, "hip_spring_arm_a_m": 0.85}, "arms"),
    ],
)
def test_impossible_parameters_are_user_errors(arguments, words):
    with pytest.raises(UserError, match=words):
        BodyParameters(**arguments)


def test_a_slope_pulls_the_held_leg_by_its_angle():
    """On a slope of gamma a hanging leg is in balance at th = -gamma of the floor's normal: m c g sin."""
    slope = 0.05
    body = Body(BodyParameters(slope_rad=slope, hip_spring_Nm_per_rad=0.0), Floor(slope))
    handling.place(body, 0.0, 0.0)
    body.inner.angle = -slope
    body.inner.foot_angle = body.inner.angle
    in_air(body, 0.0, 1)
    assert abs(body.inner.acc) < 1e-12
    body.inner.angle = 0.0
    body.inner.foot_angle = 0.0
    in_air(body, 0.0, 1)
    assert body.inner.acc < -0.1
