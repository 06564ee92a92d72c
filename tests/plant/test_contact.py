"""Holding, letting go, touching, brushing, lifting off, falling: what the body does at its events."""

import math

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import handling, motion
from ranger_sim.plant.air import in_air
from ranger_sim.plant.body import DOUBLE, FALLEN, FLIGHT, HELD, INNER, OUTER, SINGLE, Body
from ranger_sim.plant.floor import Floor
from ranger_sim.plant.impact import impact
from ranger_sim.plant.parameters import BodyParameters
from ranger_sim.plant.ranger import STEP_NS
from ranger_sim.plant.stance import on_feet
from ranger_sim.plant.watch import keep_forces
from tests.plant.test_body_equations import closed_posture
from tests.plant.walking import STEP_S, PaperGait, Walker, mid_stance_start


def advance(body, seconds):
    for _ in range(round(seconds / STEP_S)):
        body.step_start_ns += STEP_NS
        motion.advance(body, STEP_S)


def test_a_held_robot_keeps_its_legs_while_its_feet_follow_their_motors():
    body = Body()
    handling.place(body, 0.09, 0.35)
    handling.hold_both(body, 0.09, 0.35)
    body.inner_drive, body.inner_coulomb = -0.5, 0.1
    # A rotor pulled with the net torque T drags the foot by the cable k: the stretch swings between 0 and twice
    # T/J_A / (k (1/J_A + 1/J_f)), which is 14.8 mrad; 1 mrad for the friction's smoothing while it starts.
    p = body.parameters
    middle = 0.4 / body.JA / (p.ankle_spring_Nm_per_rad * (1.0 / body.JA + 1.0 / p.foot_inertia_kg_m2))
    stretches = []
    for _ in range(100):  # 0.1 s: before the foot meets its stop
        advance(body, 0.001)
        stretches.append(body.foot_inner - body.leg_inner - body.motor_inner)
    assert body.mode == HELD
    assert (body.leg_outer, body.leg_inner) == (0.09, 0.09 - 0.35)
    assert body.motor_inner < -0.5  # pulled up by its motor
    assert min(stretches) == pytest.approx(0.0, abs=1e-3)
    assert max(stretches) == pytest.approx(2.0 * middle, abs=1e-3)


@pytest.mark.parametrize("stance", [OUTER, INNER])
def test_a_standing_hold_settles_where_ankle_and_weight_balance(stance):
    body = Body()
    handling.place(body, 0.0, 0.0)
    handling.hold_standing(body, 0.05, 0.0, stance)
    for _ in range(16000):
        # a position loop on each ankle motor, as the boards' start states are
        body.outer_drive = -18.0 * body.motor_outer - 0.2 * body.motor_outer_rate
        body.inner_drive = -18.0 * body.motor_inner - 0.2 * body.motor_inner_rate
        motion.advance(body, STEP_S)
    foot = body.foot_outer if stance == OUTER else body.foot_inner
    motor = body.motor_outer if stance == OUTER else body.motor_inner
    p = body.parameters
    cable = p.ankle_spring_Nm_per_rad * (motor - (foot - 0.05))
    # moment of the weight about the contact point: M g d sin F
    assert cable == pytest.approx(p.total_mass_kg * 9.81 * p.ankle_offset_m * math.sin(foot), abs=2e-3)
    assert abs(cable) > 0.05
    force = body.outer_Fy if stance == OUTER else body.inner_Fy
    assert force == pytest.approx(p.total_mass_kg * 9.81)


def test_letting_go_starts_a_walk_with_the_rates_given():
    body = Body()
    handling.place(body, 0.09, 0.35)
    handling.hold_standing(body, 0.09, 0.35)
    handling.release(body, 0.7, OUTER, 0.7, 0.1)
    assert body.mode == SINGLE and body.stance == OUTER
    assert (body.leg_outer_rate, body.foot_outer_rate) == (0.7, 0.7)
    assert body.hip_rate() == pytest.approx(0.1)
    # hip over a rolling foot: e dF + l cos(th) dth
    e = 0.2 - 0.11 * math.cos(body.foot_outer)
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
    body.leg_inner = -0.3
    body.foot_inner = 0.1
    body.motor_inner = 0.4
    body.foot_inner_rate = 0.0
    body.leg_inner_rate = 0.6
    handling.begin_walk(body)
    assert body.record.steps == 0
    Walker(body, _Nothing()).run(1, 1.0)
    record = body.record
    assert record.steps == 1 and record.strike_leg == INNER
    assert record.step_length_m > 0.2
    assert body.mode in (SINGLE, DOUBLE)
    body.last_strike_leg = INNER
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
        for name in ("leg_outer", "leg_inner", "foot_outer", "foot_inner"):
            setattr(body, name + "_rate", stream.normal())
        body.mode = SINGLE
        body.update_hip_rates()

        def momentum(b):
            Ao, Bo = b.mc_outer * math.cos(b.leg_outer), b.mc_outer * math.sin(b.leg_outer)
            Ai, Bi = b.mc_inner * math.cos(b.leg_inner), b.mc_inner * math.sin(b.leg_inner)
            return (
                b.M * b.hip_vx - Ao * b.leg_outer_rate - Ai * b.leg_inner_rate,
                b.M * b.hip_vy + Bo * b.leg_outer_rate + Bi * b.leg_inner_rate,
            )

        before = momentum(body)
        impact(body, True, True)
        after = momentum(body)
        # solution of a 10 x 10 system: rounding 1e-16 times condition 1e6 times 10 N s
        assert after[0] - before[0] == pytest.approx(body.P_stance_x + body.P_swing_x, abs=1e-9)
        assert after[1] - before[1] == pytest.approx(body.P_stance_y + body.P_swing_y, abs=1e-9)


def test_the_trailing_foot_leaves_when_its_force_reaches_zero():
    body = Body()
    mid_stance_start(body)
    walker = Walker(body, PaperGait())
    walker.run(3)
    assert body.mode == DOUBLE and body.last_strike_leg == body.stance
    trailing = 1 - body.stance
    forces = []
    while body.mode == DOUBLE:
        forces.append(body.outer_Fy if trailing == OUTER else body.inner_Fy)
        walker.run(1000, walker.seconds + 0.5 * STEP_S)
    assert body.mode == SINGLE and body.stance == 1 - trailing
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
    body.leg_inner = 0.02  # behind the stance leg, as long as it: the sole is in the floor by a fraction of a mm
    body.leg_outer = 0.0
    body.foot_inner = -0.05
    body.motor_inner = -0.07
    body.update_pose()
    body.height_inner = body.hip_y - body.chain_y(body.foot_inner, body.leg_inner) + 5e-4
    body.foothold_due = False
    body.update_pose()
    assert body.gap_inner == pytest.approx(-5e-4)
    body.brush = True
    on_feet(body, 0.0, 1)
    assert body.inner_Fy > 5.0
    # sliding friction opposes the foot's forward motion with mu times the normal force at most
    assert -0.9 * body.inner_Fy * 1.0000001 <= body.inner_Fx < 0.0
    motion.advance(body, STEP_S)
    assert body.record.scuffs == 1
    assert body.brush_s > 0.0


def test_energy_only_falls_while_a_foot_brushes():
    body = Body(BodyParameters(outer_rolling_friction_Nms=0.0, inner_rolling_friction_Nms=0.0))
    mid_stance_start(body, leg_rate=0.5, hip_rate=1.0, swing_ankle=0.0)
    body.foot_inner = body.motor_inner = 0.0
    body.update_pose()
    body.height_inner = 2e-4
    body.brush = True
    energies = []
    for _ in range(40):
        body.update_pose()
        # the sole's own spring holds k gap^2 / 2
        sole = 0.5 * body.sole_k * min(0.0, body.gap_inner) ** 2
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
        highest = max(highest, body.gap_outer)
    assert body.mode in (SINGLE, DOUBLE)
    # v^2 / 2 g = 2 mm for a stiff robot; its legs and feet turn meanwhile
    assert 0.0005 < highest < 0.01


def test_oddities_are_counted_not_ignored():
    body = Body()
    body.outer_Fx, body.outer_Fy, body.inner_Fy = 60.0, 50.0, -3.0
    body.mode = SINGLE
    keep_forces(body, STEP_S)
    assert body.friction_ratio_max == pytest.approx(1.2)
    assert body.slip_s == STEP_S
    assert body.pull_s == STEP_S
    assert body.normal_force_min == -3.0


@pytest.mark.parametrize(
    ("changes", "cause"),
    [
        ({"leg_outer": 0.7}, "fell forward"),
        ({"leg_outer": -0.7, "leg_inner": -0.1}, "fell backward"),
        ({"leg_outer": 0.5, "leg_inner": -0.8}, "legs split"),
    ],
)
def test_each_fall_has_its_cause(changes, cause):
    body = Body()
    mid_stance_start(body)
    for name, value in changes.items():
        setattr(body, name, value)
    body.height_inner = -1.0  # a hole for the swing foot: only the fall ends this
    motion.advance(body, STEP_S)
    assert body.mode == FALLEN and body.cause == cause


def test_a_robot_that_takes_no_step_has_stalled():
    body = Body()
    mid_stance_start(body)
    body.stall_s = 2 * STEP_S
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
    body.leg_inner = -slope
    body.foot_inner = body.leg_inner
    in_air(body, 0.0, 1)
    assert abs(body.leg_inner_acc) < 1e-12
    body.leg_inner = 0.0
    body.foot_inner = 0.0
    in_air(body, 0.0, 1)
    assert body.leg_inner_acc < -0.1
