"""Conditions, ends of a walk and noticed strikes, on machines made by hand."""

import contextlib
import math
import pathlib
from types import SimpleNamespace as Made

import pytest

from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import waiting
from ranger_sim.harness.names import Names
from ranger_sim.harness.processes import kernel
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.records.strike_watch import StrikeWatch
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.plant.ranger import RangerPlant

MS = 1_000_000


class Machine:
    """Time, a body with two quantities, and the errors of two boards."""

    def __init__(self):
        self.start_ns = 5 * MS
        self.loop = Made(time=5 * MS, board=lambda name: self.boards[name], stop_wanted=False)
        self.angle, self.rate = 0.0, 0.0
        self.plant = Made(fell=0, fill_sample=self.fill)
        self.noted = {"A": [0, 0], "B": [0, 0]}
        # B is in another process: it has counters alone
        self.boards = {
            "A": Made(errors=Made(totals=self.noted["A"])),
            "B": Made(counters=lambda: Made(errors=self.noted["B"])),
        }

    def fill(self, row):
        row[0], row[1] = self.angle, self.rate


def condition(text, machine=None):
    names = Names.__new__(Names)
    object.__setattr__(names, "codes", {"LATE": 1})
    made = waiting.condition(text, {"angle_rad": "rad", "rate": ""}, names, ("A", "B"))
    if machine is not None:
        made.begin(machine)
    return made


@pytest.mark.parametrize(
    ("text", "ns"), [("0 s", 0), ("12.5 ms", 12_500_000), ("1 us", 1000), ("2s", 2_000_000_000), ("3 ns", 3)]
)
def test_an_instant_is_met_from_its_nanosecond_on(text, ns):
    machine = Machine()
    made = condition(text, machine)
    machine.loop.time = machine.start_ns + ns - 1
    assert not made.met()
    machine.loop.time += 1
    assert made.met()


@pytest.mark.parametrize("text", ["12", "-1 s", "soon", "1 m", "angle_rad = 1", "angle_rad", ""])
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(UserError, match="it reads like 12.3 s, angle_rad > 0.3, error LATE, or ended"):
        condition(text)
    with pytest.raises(UserError, match="it reads like 12.3 s, angle_rad > 0.3, or ended"):
        waiting.condition("soon", {})


@pytest.mark.parametrize(
    ("sign", "met"),
    [
        ("<", [True, False, False]),
        ("<=", [True, True, False]),
        ("==", [False, True, False]),
        ("!=", [True, False, True]),
        (">=", [False, True, True]),
        (">", [False, False, True]),
    ],
)
def test_a_quantity_is_compared_as_it_says(sign, met):
    machine = Machine()
    made = condition(f"rate {sign} -0.5", machine)
    machine.angle = 77.0
    found = []
    for machine.rate in (-0.6, -0.5, -0.4):
        found.append(made.met())
    assert found == met


def test_the_nearest_value_that_a_quantity_had_is_told_with_its_unit():
    machine = Machine()
    made = condition("angle_rad > 2", machine)
    for machine.angle in (-3.0, 1.25, 0.5):
        assert not made.met()
    assert made.nearest() == "the nearest value of angle_rad was 1.25 rad"
    machine.angle = 9.0
    made.met()
    assert made.nearest() == "the nearest value of angle_rad was 1.25 rad"
    made.begin(machine)
    made.met()
    assert made.nearest() == "the nearest value of angle_rad was 9 rad"
    other = condition("rate > 2", machine)
    machine.rate = 1.0
    other.met()
    assert other.nearest() == "the nearest value of rate was 1"
    with pytest.raises(UserError, match="unknown quantity of the body 'angel_rad' \\(available: angle_rad, rate"):
        condition("angel_rad > 1")


def test_an_error_is_noted_when_the_count_of_its_board_has_grown():
    machine = Machine()
    any_board, of_b = condition("error LATE", machine), condition("error LATE from B", machine)
    assert not any_board.met() and not of_b.met()
    machine.noted["A"][0] += 1
    assert not any_board.met()
    machine.noted["A"][1] += 1
    assert any_board.met() and any_board.met() and not of_b.met()
    machine.noted["B"][1] += 2
    assert of_b.met()
    assert (any_board.nearest(), of_b.nearest()) == ("A, B noted no LATE", "B noted no LATE")
    begun = condition("error LATE", machine)
    machine.noted["A"][1] = 0  # a board that begins anew counts anew
    assert not begun.met()
    machine.noted["A"][1] = 1
    assert begun.met()
    machine.noted["B"].clear()
    assert condition("error LATE from B", machine).counts() == [0]
    for text, told in (
        ("error LATER", "unknown error 'LATER'"),
        ("error LATE from C", "unknown board 'C' .available: A, B."),
    ):
        with pytest.raises(UserError, match=told):
            condition(text)


def test_an_end_and_a_function_are_conditions_too():
    machine = Machine()
    ended, function = condition("ended", machine), condition(lambda robot: robot.angle, machine)
    assert not ended.met() and not function.met()
    machine.plant.fell, machine.angle = 1, 2.0
    assert ended.met() and function.met() is True
    assert condition(ended) is ended and ended.nearest() == "it goes on"
    watch = waiting.Waiting(machine, condition("ended"))
    machine.plant.fell = 0
    watch.before_step(0)
    assert not watch.met and not machine.loop.stop_wanted
    machine.plant.fell = 1
    watch.before_step(0)
    assert watch.met and machine.loop.stop_wanted


@pytest.mark.parametrize(("name", "most"), [("steps", 10**9), ("time_s", 1e9), ("distance_m", 1e9)])
def test_a_walk_ends_by_one_number_above_nothing_and_up_to_the_most(name, most):
    assert getattr(StopRule(**{name: most}), name) == most
    for wrong in (0, -1, most * 2, most + 1, math.nan):
        with pytest.raises(UserError, match=f"{name} is {wrong!r}, it must be above 0 and at most 1e"):
            StopRule(**{name: wrong})
    with pytest.raises(UserError, match="a walk needs an end"):
        StopRule()


class Brain(Board):
    """A main brain of which nothing else is known than the swing leg and its latest slot."""

    leg = slot = 0

    def watched(self):
        return self.leg

    def latest_slot(self):
        return self.slot


def strikes(*rows):
    """Statistics after (steps of the body, its last strike, swing leg of the main brain, its slot), all in ms."""
    plant, brain = RangerPlant(seed=1), Brain("MB")
    watch = StrikeWatch(plant, brain)
    for steps, strike_ms, leg, slot_ms in rows:
        plant.steps, plant.strike_time_ns = steps, strike_ms * MS
        brain.leg, brain.slot = leg, slot_ms * MS
        watch.look()
    return watch.statistics()


def test_a_strike_is_noticed_with_the_flip_of_the_swing_leg():
    nothing = {"mean": None, "std": None, "count": 0, "unmatched": 0, "missed": 0}
    assert strikes((0, -1, 1, 5)) == nothing  # the reset on entering the walk
    assert strikes((1, 10, 0, 20)) == nothing
    one = strikes((1, 10, 1, 24))
    assert (one["mean"], one["std"], one["count"]) == (14.0, 0.0, 1)
    two = strikes((1, 10, 1, 24), (2, 600, 0, 610), (2, 600, 1, 700))
    assert (two["count"], two["unmatched"], two["missed"]) == (2, 1, 0)
    assert (two["mean"], two["std"]) == (12.0, pytest.approx(2.0))
    missed = strikes((3, 10, 1, 24), (5, 99, 0, 99))
    assert (missed["missed"], missed["count"]) == (3, 2)


def test_a_run_says_whether_it_is_over():
    with contextlib.closing(Ranger()) as robot:
        assert robot.run(StopRule(time_s=0.004), 0.001) is False and robot.time_s == pytest.approx(0.001)
        assert robot.run(StopRule(time_s=0.004), 1.0) is True and robot.time_s == pytest.approx(0.004)
        assert robot.run(StopRule(time_s=0.004), 1.0) is True and robot.time_s == pytest.approx(0.004)
        assert robot.run(StopRule(time_s=0.005, steps=9), 0.0005) is False
        robot.ended = "forward"
        assert robot.run(StopRule(time_s=1.0), 0.001) is True and robot.time_s == pytest.approx(0.0045)


def test_a_process_is_shown_by_its_name_of_at_most_fifteen_bytes():
    comm = pathlib.Path("/proc/self/comm")
    before = comm.read_text(encoding="ascii").strip()
    try:
        for name in ("ranger MCH", "a-name-that-is-too-long"):
            kernel.name_process(name)
            assert comm.read_text(encoding="ascii").strip() == name[:15]
    finally:
        kernel.name_process(before)
