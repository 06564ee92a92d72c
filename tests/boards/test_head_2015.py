"""The controller of August 2015: its machine and laws against answers by hand from robot.md C2.2 and C6.3 C.

Gains as logged: hip 16/3, push 20/3, hold and flip 7/1 (N m); c = 1.188 N m/A at the hip, 0.612 at the ankles.
"""

import contextlib
import dataclasses

import pytest

from ranger_sim.boards.main_brain import controllers, head_walk, programs
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from tests.boards.main_brain_bench import Bench

STANDS, HANGS = 14_000.0, 1_400.0  # a pair's contact sum on the floor and in the air
ON_OUTER = {"EST_CONTACT_OUTER": STANDS, "EST_CONTACT_INNER": HANGS}
ON_INNER = {"EST_CONTACT_OUTER": HANGS, "EST_CONTACT_INNER": STANDS}
ON_BOTH = {"EST_CONTACT_OUTER": STANDS, "EST_CONTACT_INNER": STANDS}
IN_THE_AIR = {"EST_CONTACT_OUTER": HANGS, "EST_CONTACT_INNER": HANGS}
HIP_K, HIP_D = (16.0 - 8.045) / 1.188, 3.0 / 1.188
HOLD_K, HOLD_D = (7.0 - 0.134) / 0.612, 1.0 / 0.612
PUSH_K, PUSH_D = (20.0 - 0.134) / 0.612, 3.0 / 0.612
SINGLE = 2e-6  # the table's words are single precision, 6e-8 of 35 A


@pytest.fixture
def bench():
    """In inner_swing, its commands already those of that state."""
    bench = Bench("head-2015")
    bench.set(HD_SETUP_TIME=0.0)
    bench.tick()
    bench.press(1)
    for _ in range(3):
        bench.machines_only(E_LO_ANGLE=0.0, E_LI_ANGLE=0.0, E_LO_RATE=0.0, E_LI_RATE=0.0, **ON_OUTER)
    assert bench.states()[:2] == ("walk", "inner_swing")
    return bench


def go(bench, state):
    """Walk the bench on to a state, two ticks in."""
    way = (
        ("outer_push", {"E_LO_ANGLE": 0.081, **ON_OUTER}),
        ("outer_swing", {"E_LO_ANGLE": 0.2, **ON_BOTH}),
        ("inner_push", {"E_LO_ANGLE": -0.081, **ON_INNER}),
        ("inner_swing", {"E_LO_ANGLE": -0.15, **ON_BOTH}),
    )
    for name, values in way:
        if bench.states()[1] == state:
            break
        bench.machines_only(**values)
        assert bench.states()[1] == name
    bench.machines_only()


def test_a_stride_takes_the_logs_states_in_the_logs_order(bench):
    seen = []
    for values in (
        {"E_LO_ANGLE": 0.0799},
        {"E_LO_ANGLE": 0.0801},
        {"E_LO_ANGLE": 0.2},
        ON_BOTH,
        {"E_LO_ANGLE": -0.0799, **ON_INNER},
        {"E_LO_ANGLE": -0.0801},
        {"E_LO_ANGLE": -0.15},
        ON_BOTH,
    ):
        bench.machines_only(**values)
        seen.append(bench.modes.leg.machine.current.number)
    assert seen == [1, 2, 2, 3, 3, 4, 4, 1]
    assert (head_walk.SETUP, head_walk.FLIGHT) == (0, 5)


def test_both_pushes_begin_by_the_lean_of_the_outer_leg_alone(bench):
    bench.machines_only(E_LI_ANGLE=0.3)
    assert bench.states()[1] == "inner_swing"
    go(bench, "outer_swing")
    bench.machines_only(E_LI_ANGLE=0.3, E_LO_ANGLE=0.0, **ON_INNER)
    assert bench.states()[1] == "outer_swing"


@pytest.mark.parametrize(("counts", "stands"), [(1_699.0, False), (1_701.0, True)])
def test_feet_are_on_the_floor_above_the_contact_sum(bench, counts, stands):
    go(bench, "outer_push")
    bench.machines_only(EST_CONTACT_INNER=counts)
    assert bench.states()[1] == ("outer_swing" if stands else "outer_push")


@pytest.mark.parametrize("state", ["inner_swing", "outer_push", "outer_swing", "inner_push"])
def test_flight_is_detected_after_200_ticks_without_contact_and_ends_on_the_outer_feet(bench, state):
    go(bench, state)
    leans = {"E_LO_ANGLE": 0.0}
    for _ in range(200):
        bench.machines_only(**IN_THE_AIR, **leans)
    assert bench.states()[1] == state
    bench.machines_only()
    assert bench.states()[1] == "flight"
    bench.machines_only()
    assert bench.command("MCH") == (0.0, 0.0, 0.0)
    # the outer foot holds, the inner one is flipped up: 1.8 - 1.55 = 0.25 rad with an upright leg
    assert bench.command("MCFO") == pytest.approx((HOLD_K * 1.8, HOLD_K, HOLD_D), rel=SINGLE)
    bench.machines_only(E_LI_ANGLE=0.0, E_LI_RATE=0.0)
    assert bench.command("MCFI") == pytest.approx((HOLD_K * 0.25, HOLD_K, HOLD_D), rel=SINGLE)
    bench.machines_only(**ON_INNER)
    assert bench.states()[1] == "flight"
    bench.machines_only(**ON_OUTER)
    assert bench.states()[1] == "inner_swing"


def test_a_tick_of_contact_begins_the_count_to_flight_anew(bench):
    for contact in (IN_THE_AIR, ON_OUTER, IN_THE_AIR):
        for _ in range(199 if contact is IN_THE_AIR else 1):
            bench.machines_only(**contact)
    assert bench.states()[1] == "inner_swing"


def test_commands_are_those_of_the_state_at_the_ticks_start(bench):
    before = bench.command("MCFO")
    bench.machines_only(E_LO_ANGLE=0.081, E_LO_RATE=0.0)
    assert bench.states()[1] == "outer_push"
    assert bench.command("MCFO")[1:] == before[1:]  # gains of the hold still
    bench.machines_only()
    assert bench.command("MCFO")[1:] == pytest.approx((PUSH_K, PUSH_D), rel=SINGLE)


def test_the_hip_scissors_about_the_standing_leg(bench):
    bench.machines_only(E_LO_ANGLE=0.05, E_LO_RATE=0.4)
    # h_ref = 0.1 + 2.3 x 0.05 = 0.215 rad, its rate 2.3 x 0.4 = 0.92 rad/s
    assert bench.command("MCH") == pytest.approx(((16 * 0.215 + 3 * 0.92) / 1.188, HIP_K, HIP_D), rel=SINGLE)
    go(bench, "outer_swing")
    bench.machines_only(E_LO_ANGLE=0.0, E_LI_ANGLE=0.1, E_LI_RATE=0.5)
    # h_ref = -0.1 - 2.3 x 0.1 = -0.33 rad, its rate -1.15 rad/s
    assert bench.command("MCH") == pytest.approx(((-16 * 0.33 - 3 * 1.15) / 1.188, HIP_K, HIP_D), rel=SINGLE)


@pytest.mark.parametrize(("state", "side"), [("outer_push", 1.0), ("inner_push", -1.0)])
def test_the_hip_holds_its_angle_while_a_foot_pushes(bench, state, side):
    go(bench, state)
    assert bench.command("MCH") == pytest.approx((side * 16 * 0.2 / 1.188, HIP_K, HIP_D), rel=SINGLE)


@pytest.mark.parametrize(
    ("state", "lean", "more"), [("inner_swing", "E_LI_ANGLE", 1.0), ("outer_swing", "E_LO_ANGLE", -1.0)]
)
def test_the_swing_legs_weight_is_made_up_for_if_asked(bench, state, lean, more):
    """A leg whose foot is ahead of the hip leans back, and its weight pulls it back."""
    go(bench, state)
    bench.machines_only(E_LO_ANGLE=0.0, E_LI_ANGLE=0.0, E_LO_RATE=0.0, E_LI_RATE=0.0)
    bench.machines_only(**{lean: -0.05})
    without = bench.command("MCH")[0]
    bench.set(HD_H_GRAVITY=7.0)
    bench.machines_only()
    # 7 sin 0.05 = 0.349854 N m, forward for that leg
    assert bench.command("MCH")[0] - without == pytest.approx(more * 0.349854 / 1.188, abs=2e-6)


@pytest.mark.parametrize(
    ("state", "board", "lean", "rate", "K", "D", "upright"),
    [
        ("inner_swing", "MCFO", "E_LO_ANGLE", "E_LO_RATE", HOLD_K, HOLD_D, 1.8),
        ("inner_swing", "MCFI", "E_LI_ANGLE", "E_LI_RATE", HOLD_K, HOLD_D, 0.25),
        ("outer_push", "MCFO", "E_LO_ANGLE", "E_LO_RATE", PUSH_K, PUSH_D, 2.7),
        ("outer_push", "MCFI", "E_LI_ANGLE", "E_LI_RATE", HOLD_K, HOLD_D, 1.8),
        ("outer_swing", "MCFO", "E_LO_ANGLE", "E_LO_RATE", HOLD_K, HOLD_D, 0.25),
        ("outer_swing", "MCFI", "E_LI_ANGLE", "E_LI_RATE", HOLD_K, HOLD_D, 1.8),
        ("inner_push", "MCFO", "E_LO_ANGLE", "E_LO_RATE", HOLD_K, HOLD_D, 1.8),
        ("inner_push", "MCFI", "E_LI_ANGLE", "E_LI_RATE", PUSH_K, PUSH_D, 2.7),
    ],
)
def test_an_ankle_tracks_its_foots_angle_against_the_floor(bench, state, board, lean, rate, K, D, upright):
    go(bench, state)
    bench.machines_only(**{lean: 0.05, rate: 0.4})
    # the ankle gives way as the leg leans: 0.05 rad less, at -0.4 rad/s
    assert bench.command(board) == pytest.approx((K * (upright - 0.05) - D * 0.4, K, D), rel=SINGLE)


def test_gains_at_the_board_are_those_that_were_logged_in_the_same_week(bench):
    """Sweep of 18 August 2015, kp 7, kd 1: K 11.21896, D 1.63399 (robot.md C6.3 A): the hold's gains here."""
    assert bench.command("MCFO")[1:] == pytest.approx((11.21896, 1.63399), rel=2e-6)


def test_leaving_the_walk_puts_everything_to_its_start(bench):
    go(bench, "outer_push")
    bench.press(2)
    assert bench.states()[:5] == ("standby", "setup", "reset", "reset", "reset")
    assert bench.command("MCH") == bench.command("MCFO") == bench.command("MCFI") == (0.0, 0.0, 0.0)


def test_setup_holds_the_legs_side_by_side_for_its_time():
    bench = Bench("head-2015")
    bench.tick()
    bench.press(1)
    ticks = 2  # of the key
    while bench.states()[1] == "setup":
        bench.machines_only(E_LO_ANGLE=0.0, **ON_BOTH)
        assert bench.command("MCH")[0] == 0.0
        ticks += 1
    assert 2 * ticks == pytest.approx(bench.get("HD_SETUP_TIME"), abs=4.0)


def test_the_program_brings_the_estimator_of_2016_to_the_main_brain_alone_and_to_the_whole_robot():
    own = programs.program("head-2015").quirks
    board = MainBrainBoard(Crystal(13_000_000), Quirks(), controller="head-2015")
    assert board.estimator.use_imu_roll and board.estimator.use_filtered_sum and board.estimator.per_tick_filter
    with contextlib.closing(Ranger(Scenario(controller="head-2015"))) as robot:
        assert {name: getattr(robot.quirks, name) for name in own} == own
        assert dataclasses.replace(robot.quirks, **{name: getattr(Quirks(), name) for name in own}) == Quirks()
    with contextlib.closing(Ranger(Scenario())) as robot:
        assert robot.quirks == Quirks()


def test_gains_of_the_set_are_the_logs():
    values = controllers.load("head-2015").values
    logged = {
        "CTRL_HIP": (16, 3),
        "CTRL_ANK_SWING": (7, 1),
        "CTRL_ANK_PUSH": (20, 3),
        "CTRL_ANK_STANCE": (7, 1),
    }
    for name, gains in logged.items():
        assert (values[f"{name}_KP"], values[f"{name}_KD"]) == gains
    assert (values["HD_H_HOLD"], values["HD_TRANS_ANG"], values["HD_F_ZERO"]) == (0.2, 0.08, 1.8)
    assert (values["HD_F_HOLD"], values["HD_F_PUSH"], values["HD_F_FLIP"]) == (0.0, -0.9, 1.55)
    assert (values["CTRL_WALK_SCISSOR_GAIN"], values["CTRL_WALK_SCISSOR_OFFSET"]) == (1.3, 0.1)


@pytest.mark.parametrize("seed", [1, 2])
def test_it_walks(seed):
    """On the body `ranger`; ten steps, because the first four are still those of the start."""
    with contextlib.closing(Ranger(Scenario(controller="head-2015", seed=seed))) as robot:
        robot.run(StopRule(steps=10, time_s=15.0), 15.0)
        assert not robot.ended, robot.ended
        assert robot.steps == 10
