"""A fault from being armed until its place is clear, step by step, and what two faults may do at the same time."""

import math
from types import SimpleNamespace as Made

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults import proof
from ranger_sim.harness.faults.fault import Fault, Lasting, Parameter, Place, WholeNumber, end_condition
from ranger_sim.harness.waiting import condition

MS = 1_000_000


class Wrong(Fault):
    """Notes what is done to it; clear when the test says so."""

    mode = "wrong"
    kinds = ("thing",)
    parameters = (
        Parameter("size", "V", 2.0, -1.0, 5.0, "m", "s"),
        WholeNumber("times", "1", 1.0, 1.0, 3.0, "m", "s"),
        Parameter("level", "V", math.nan, 0.0, 9.0, "m", "s"),
    )
    unit = "V"

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.done, self.clear = [], True
        self.others = (self.place.name,)

    def claims(self):
        return self.others

    def begin(self, now_ns):
        self.done.append(("begin", now_ns))

    def before(self, now_ns):
        self.done.append(("before", now_ns))

    def after(self, start_ns, end_ns):
        self.done.append(("after", end_ns))

    def finish(self, now_ns):
        self.done.append(("finish", now_ns))

    def is_clear(self, start_ns, end_ns):
        self.done.append(("clear?", end_ns))
        return self.clear


class Robot:
    """Steps of a millisecond."""

    def __init__(self):
        self.seed, self.start_ns = 1, 10 * MS
        self.loop = Made(time=10 * MS, watchers=[])
        self.faults = []
        self.held = False

    def inject(self, start=None, end=None, name="A.x", **values):
        def made(wanted):
            return condition(wanted, {})

        fault = Wrong.asked(Place(name, "thing", "a thing"), start, end, values, made)
        fault.arm(self)
        self.faults.append(fault)
        return fault

    def step(self, count=1):
        for _ in range(count):
            now = self.loop.time
            for each in list(self.loop.watchers):
                each.before_step(now)
            for each in list(self.loop.watchers):
                each.after_step(now, now + MS)
            self.loop.time += MS


def stamps(fault):
    return (fault.armed_ns, fault.activated_ns, fault.ended_ns, fault.cleared_ns)


def test_a_fault_without_start_and_end_works_from_the_next_step_on_for_good():
    robot = Robot()
    fault = robot.inject()
    assert stamps(fault) == (10 * MS, -1, -1, -1) and not fault.active and not fault.over
    robot.step(2)
    assert stamps(fault) == (10 * MS, 10 * MS, -1, -1) and fault.active
    assert fault.done == [
        ("begin", 10 * MS),
        ("before", 10 * MS),
        ("after", 11 * MS),
        ("before", 11 * MS),
        ("after", 12 * MS),
    ]


def test_a_fault_with_an_end_is_watched_until_its_place_is_clear():
    robot = Robot()
    fault = robot.inject("2 ms", "4 ms")
    fault.clear = False
    robot.step(5)
    assert stamps(fault) == (10 * MS, 12 * MS, 14 * MS, -1) and not fault.active
    assert fault.done[0] == ("begin", 12 * MS) and fault.done[-2:] == [("finish", 14 * MS), ("clear?", 15 * MS)]
    assert fault in robot.loop.watchers and not fault.over
    fault.clear = True
    robot.step(2)
    assert fault.cleared_ns == 16 * MS and fault.over and robot.loop.watchers == []
    assert sum(each[0] == "clear?" for each in fault.done) == 2


def test_a_length_counts_from_the_begin_and_an_end_that_holds_at_once_lets_nothing_happen():
    robot = Robot()
    fault = robot.inject("2 ms", "+3 ms")
    robot.step(10)
    assert stamps(fault) == (10 * MS, 12 * MS, 15 * MS, 16 * MS)
    short = Robot()
    fault = short.inject("2 ms", "0 s")
    short.step(5)
    assert fault.done == [("begin", 12 * MS), ("finish", 12 * MS), ("clear?", 13 * MS)]


def test_a_fault_is_stopped_with_the_next_step_and_never_begins_when_it_had_not():
    robot = Robot()
    working, waiting = robot.inject(), robot.inject("9 ms", name="B.x")
    robot.step()
    working.stop()
    waiting.stop()
    assert waiting.over and not working.over
    robot.step()
    assert stamps(working) == (10 * MS, 10 * MS, 11 * MS, 12 * MS) and stamps(waiting)[1:] == (-1, -1, -1)
    assert robot.loop.watchers == [] and waiting.done == []


def test_a_length_is_reported_while_it_lasts():
    lasting = end_condition("+ 3 ms", None)
    assert isinstance(lasting, Lasting) and lasting.length_ns == 3 * MS
    assert lasting.nearest() == "it has not begun" and not lasting.met()
    lasting.robot, lasting.since_ns = Robot(), 8 * MS
    assert lasting.nearest() == "it has not lasted so long" and not lasting.met()
    lasting.since_ns = 7 * MS
    assert lasting.met()
    lasting.since_ns = 0
    assert lasting.met()
    assert end_condition(None, None) is None and end_condition("x", lambda text: text * 2) == "xx"


def test_what_a_fault_did_is_kept_with_its_first_time_and_largest_difference():
    fault = Robot().inject()
    assert not fault.acted
    for time, difference in ((5, 1.0), (6, -3.0), (7, 2.0), (8, 3.0)):
        fault.note(time, difference)
    assert (fault.acted, fault.acted_ns, fault.acted_count, fault.largest_difference) == (True, 5, 4, -3.0)


# ---- two of them


def two(**more):
    robot = Robot()
    first, second = robot.inject(), robot.inject("3 ms", name="B.x")
    for name, (one, other) in more.items():
        setattr(first, name, one)
        setattr(second, name, other)
    robot.step(2)
    return robot, first, second


def refused(robot):
    with pytest.raises(UserError) as mistake:
        robot.step(3)
    return str(mistake.value)


def test_two_faults_share_no_place_until_the_first_is_clear():
    robot, first, _ = two(others=(("a", "b"), ("c", "b")))
    assert "A.x:wrong still works at b; one fault at a time" in refused(robot)
    robot, first, second = two(others=(("a", "b"), ("c", "b")))
    first.stop()
    robot.step(3)
    assert second.activated_ns == 13 * MS
    robot, first, second = two(others=(("a",), ("c",)))
    robot.step(3)
    assert second.active and first.active
    robot, first, second = two(others=(("a", "b"), ("c", "b")))
    first.clear = False
    first.stop()
    assert "still works at b" in refused(robot)  # it has ended and its place is not clear


@pytest.mark.parametrize(
    ("first", "second", "reported"),
    [
        ({"restarts": "MCH"}, {"inside": "MCH"}, "MCH, which is not back yet"),
        ({"restarts": "MCH"}, {"restarts": "MCH"}, "MCH, which is not back yet"),
        ({"restarts": "MCH"}, {"inside": "MB"}, ""),
        ({"inside": "MCH"}, {"restarts": "MCH"}, "MCH, which would be taken away under it"),
        ({"inside": "MCH"}, {"inside": "MCH"}, ""),
        ({"inside": "MB"}, {"restarts": "MCH"}, ""),
    ],
)
def test_a_board_is_not_taken_away_under_a_fault_nor_reached_into_while_it_is_gone(first, second, reported):
    robot, one, other = two()
    vars(one).update(first)
    vars(other).update(second)
    if reported:
        assert f"still works at {reported}" in refused(robot)
    else:
        robot.step(3)
        assert other.active


def test_a_restart_may_cure_a_fault_that_has_ended():
    robot, one, other = two()
    one.inside, other.restarts, one.clear = "MCH", "MCH", False
    one.stop()
    robot.step(3)
    assert other.active


# ---- how it is told


def test_a_fault_is_typed_with_what_is_not_usual_and_every_digit():
    robot = Robot()
    texts = {
        "A.x:wrong": {},
        "A.x:wrong,size=0.1": {"size": 0.1},
        "A.x:wrong,size=-1,times=3": {"size": "-1", "times": 3},
        "A.x:wrong,level=0.1234567890123": {"level": 0.1234567890123},
        "A.x:wrong@2 ms": {"start": "2 ms"},
        "A.x:wrong@0 s..4 ms": {"end": "4 ms"},
        "A.x:wrong,times=2@2 ms..+4 ms": {"start": "2 ms", "end": "+4 ms", "times": 2},
    }
    assert {robot.inject(**given).text(): given for given in texts.values()} == texts
    assert (Wrong.default("size"), Wrong.default("times")) == (2.0, 1.0)


def test_a_summary_has_seconds_since_power_up():
    robot = Robot()
    fault = robot.inject("2 ms", "4 ms")
    robot.step(3)
    fault.note(13 * MS, -0.5)
    assert fault.summary() == {
        "fault": "A.x:wrong@2 ms..4 ms",
        "armed_s": 0.0,
        "activated_s": 0.002,
        "acted_s": 0.003,
        "ended_s": None,
        "cleared_s": None,
        "acted": True,
        "acted_count": 1,
        "largest_difference": -0.5,
        "unit": "V",
        "permanent": None,
        "gave_way_s": None,
        "gave_way_to": None,
        "proof": None,
    }
    fault.permanent = "a reset"
    robot.step(3)
    assert (fault.summary()["ended_s"], fault.summary()["cleared_s"]) == (0.004, 0.005)
    assert fault.summary()["permanent"] == "a reset"
    with pytest.raises(UserError, match="it has no golden run"):
        fault.proof()


@pytest.mark.parametrize("number", [1, 2.0, "3"])
def test_a_whole_number_is_one(number):
    assert Wrong.parameters[1].checked(number, "here") == float(number)
    for wrong in (1.5, 0, 4, "x", None, math.nan):
        with pytest.raises(UserError, match="^here: times is "):
            Wrong.parameters[1].checked(wrong, "here")
    with pytest.raises(UserError, match=r"allowed are -1 to 5 V$"):
        Wrong.parameters[0].checked(5.1, "here")
    with pytest.raises(UserError, match=r"fault A.x:wrong: unknown parameter 'y' \(available: size, times, level"):
        Robot().inject(y=1)


def test_faults_of_one_golden_run_are_held_against_it_together(monkeypatch):
    robot = Robot()
    first, second, third, alone = (
        robot.inject(start, name=name) for name, start in zip("ABCD", ("2 ms", "4 ms", "9 s", "1 ms"), strict=True)
    )
    twin = Made(records=lambda: ("golden", "faulty"))
    first.twin = second.twin = third.twin = twin
    alone.twin = Made(records=lambda: ("golden", "own"))
    robot.step(6)
    second.note(0, 1.0)
    asked = []
    monkeypatch.setattr(proof, "prove", lambda *found: asked.append(found) or Made(summary=lambda: {"detected": None}))
    assert first.summary()["proof"] == {"detected": None, "of_faults": 2}
    alone.proof()
    assert third.summary()["proof"] is None
    third.proof()
    assert asked == [
        ("golden", "faulty", 12 * MS, True),
        ("golden", "own", 11 * MS, False),
        ("golden", "faulty", 12 * MS, True),
    ]
