"""The program "reflex": its currents against the gait that the plant's tests walk with, and its states by hand.

`tests/plant/walking/small_controllers.py` has the same gait on the body's own angles, in the appendix's signs; no code
is shared. What both make of one scripted walk, in the joints' sense and in ampere, has to agree.
"""

import dataclasses
import math
import types

import pytest

from ranger_sim.foundation.random_stream import RandomStream
from tests.boards.bare_body import BareRobot
from tests.boards.main_brain_bench import Bench
from tests.plant.walking.small_controllers import PaperGait

ZERO = 1.68
STEP_TICKS = 300  # 0.6 s


@pytest.fixture
def bench():
    bench = Bench("reflex")
    bench.tick()
    bench.press(1)
    assert bench.states()[0] == "walk"
    return bench


class Script:
    """Legs that walk by a formula: rows (tick, stance 0 outer 1 inner, angles and rates of legs and ankle motors)."""

    def __init__(self, seed) -> None:
        self.random = RandomStream(seed, "scripted walk")

    def between(self, low, high):
        return low + (high - low) * self.random.uniform()

    def rows(self, steps):
        for step in range(steps):
            stance = step % 2
            reach = self.between(0.17, 0.23)
            slower = self.between(0.7, 1.5)
            for tick in range(STEP_TICKS):
                # stance leg from leaning back to leaning forward, slow in between; swing leg ahead of it at the end
                x = tick / STEP_TICKS
                lean = reach * (2.0 * x - 1.0)
                rate = reach * 2.0 / 0.6 * slower
                ahead = -2.0 * reach * math.cos(math.pi * x)
                ahead_rate = 2.0 * reach * math.pi / 0.6 * math.sin(math.pi * x)
                motors = [self.between(*each) for each in ((-0.3, 0.09), (-4, 4), (-1.4, 0.09), (-4, 4))]
                yield tick, stance, lean, rate, lean - ahead, rate - ahead_rate, motors


class Oracle:
    """PaperGait with given positions of the legs; `amperes`: hip, outer, inner, before any limit."""

    def __init__(self) -> None:
        self.gait = PaperGait({**PaperGait.ROBUST, "push_s": 0.019})  # it leaves when more has passed: at 20 ms
        legs = types.SimpleNamespace
        self.body = legs(outer=legs(), inner=legs(), record=legs(steps=0, strike_time_ns=-(10**12)))
        self.seconds = 0.0
        self.amperes = (0.0, 0.0, 0.0)

    def set_currents(self, *amperes) -> None:
        self.amperes = amperes

    def tick(self, pose) -> None:
        for side, (angle, rate, motor, motor_rate) in zip((self.body.outer, self.body.inner), pose, strict=True):
            side.angle, side.rate, side.motor_angle, side.motor_rate = angle, rate, motor, motor_rate
        self.delay_s = 0.0
        self.gait.tick(self)
        self.seconds += 0.002


def ampere(command, angle, rate):
    constant, stiffness, dampness = command
    return constant - stiffness * angle - dampness * rate


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_currents_are_those_of_the_gait_on_the_bodys_own_angles(bench, seed):
    oracle = Oracle()
    compared = 0
    seen = set()
    for row, (tick, stance, lean, rate, swing_lean, swing_rate, motors) in enumerate(Script(seed).rows(8)):
        step = row // STEP_TICKS
        oracle.body.record.steps = step
        pose = [(lean, rate, *motors[:2]), (swing_lean, swing_rate, *motors[2:])]
        if stance == 1:
            pose.reverse()
        (lo, lo_rate, p, p_rate), (li, li_rate, n, n_rate) = pose
        oracle.tick(pose)
        bench.machines_only(
            E_LO_ANGLE=lo,
            E_LI_ANGLE=li,
            E_LO_RATE=lo_rate,
            E_LI_RATE=li_rate,
            MCH_ANGLE=lo - li,
            E_SWING_LEG=1 - stance,
            MCFO_MOTOR_POSITION=ZERO + p,
            MCFI_MOTOR_POSITION=ZERO + n,
        )
        # it begins in mid-stance, and its first push is no push here: from the third step on both have the same past
        if step < 2:
            continue
        ours = (
            ampere(bench.command("MCH"), lo - li, lo_rate - li_rate),
            ampere(bench.command("MCFO"), ZERO + p, p_rate),
            ampere(bench.command("MCFI"), ZERO + n, n_rate),
        )
        # the table's words are single precision: 6e-8 of the largest part of a sum, 40 A
        assert ours == pytest.approx(oracle.amperes, abs=1e-5), (step, tick, bench.states())
        compared += 1
        seen |= set(bench.states())
    assert compared == 6 * STEP_TICKS
    for state in ("HO_swing", "HO_place", "HI_swing", "HI_place", "prepush", "push", "flipup", "flipdown", "stance"):
        assert state in seen, state


@pytest.mark.parametrize(("forward", "dw"), [(0.5652, -0.1), (0.3652, 0.1), (2.0, -0.4), (0.0, 0.4)])
def test_the_deviation_of_mid_stance_is_clipped_on_both_sides(bench, forward, dw):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.1, E_LI_RATE=forward)
    assert bench.states()[1] == "LI_premid" and bench.get("E_R_DW") == 0.0
    bench.machines_only(E_LI_ANGLE=0.001)
    assert bench.states()[1] == "LI_aftermid"
    assert bench.get("E_R_DW") == pytest.approx(dw, abs=1e-6)  # single precision
    bench.machines_only(E_LI_ANGLE=0.1, E_LI_RATE=9.0)
    assert bench.get("E_R_DW") == pytest.approx(dw, abs=1e-6)  # once per step


def test_a_heel_strike_before_mid_stance_leaves_the_deviation_of_the_step_before(bench):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.1)
    bench.machines_only(E_LI_ANGLE=0.001, E_LI_RATE=0.5652)
    bench.machines_only(E_SWING_LEG=1, E_LO_ANGLE=-0.1, E_LO_RATE=0.1)
    assert bench.states()[1] == "LO_premid"
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2)
    assert bench.states()[1] == "LI_premid"
    assert bench.get("E_R_DW") == pytest.approx(-0.1, abs=1e-6)


def test_the_start_is_held_until_the_inner_feet_strike(bench):
    assert bench.states()[1:5] == ("start", "HI_starthold", "start", "start")
    assert bench.command("MCH") == pytest.approx((30 * 0.35, 30.0, 3.0))
    bench.machines_only(MCH_ANGLE=0.35)
    assert bench.command("MCFO") == pytest.approx((30 * (2.0 - 0.175), 30.0, 0.3))
    assert ampere(bench.command("MCFI"), ZERO + 3.494 / 13.21, 0.0) == pytest.approx(0.0, abs=1e-5)
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2)
    assert bench.states()[1:5] == ("LI_premid", "HO_swing", "stance", "flipup")


def test_a_push_ends_by_its_angle_or_by_its_time_and_says_how_long_it_was_prepared(bench):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2)
    for _ in range(5):
        bench.machines_only(E_LI_ANGLE=0.15)
    assert bench.states()[3] == "prepush"  # five ticks of it
    bench.machines_only(E_SWING_LEG=1)
    assert bench.states()[3] == "push" and bench.get("E_FI_PP2HS_TIME") == 10
    for _ in range(9):
        bench.machines_only(MCFI_MOTOR_POSITION=ZERO + 0.09)
    assert bench.states()[3] == "push"
    bench.machines_only()
    assert bench.states()[3] == "flipup"  # 20 ms
    assert bench.get("E_FI_PP_MISSED") == 0


def test_a_push_beyond_its_angle_ends_at_once(bench):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2)
    bench.machines_only(E_SWING_LEG=1)  # before its leg leaned far enough: not prepared
    assert bench.states()[3] == "push" and bench.get("E_FI_PP_MISSED") == 1
    bench.machines_only(MCFI_MOTOR_POSITION=ZERO + 0.11)
    assert bench.states()[3] == "flipup"


@pytest.mark.parametrize(("lean", "ahead", "down"), [(0.06, 0.01, True), (0.05, 0.01, False), (0.06, 0.007, False)])
def test_the_foot_comes_down_when_the_stance_leg_and_the_hip_are_far_enough(bench, lean, ahead, down):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2, MCH_ANGLE=0.3)
    bench.machines_only(E_LI_ANGLE=lean, MCH_ANGLE=-ahead)
    assert bench.states()[4] == ("flipdown" if down else "flipup")


def test_leaving_the_walk_puts_every_machine_to_its_start(bench):
    bench.machines_only(E_SWING_LEG=0, E_LI_ANGLE=-0.2)
    bench.machines_only(E_LI_ANGLE=0.001)
    bench.press(2)
    assert bench.states()[:5] == ("standby", "start", "HI_starthold", "start", "start")
    assert bench.command("MCH") == bench.command("MCFO") == bench.command("MCFI") == (0.0, 0.0, 0.0)


def test_it_walks_on_a_body_with_ideal_motors():
    """P4's gait on the bare body: 0.351 m and 0.598 s with the appendix's massless feet."""
    robot = BareRobot("reflex")
    # the set's own start is for the body `ranger`; this one starts like the record walk
    operator = dataclasses.replace(robot.controller.operator, lean_rad=0.09, release_rate_rad_per_s=0.8)
    robot = BareRobot(dataclasses.replace(robot.controller, operator=operator))
    robot.start()
    assert robot.walk(40, 40.0), robot.body.record.fall_cause
    record = robot.body.record
    assert record.mean_step_length_m() == pytest.approx(0.35, rel=0.2)
    assert record.mean_step_time_s() == pytest.approx(0.60, rel=0.1)
