"""A watched variable frame by frame: both sides of every rule, and the report of it whole."""

import math
from fractions import Fraction
from types import SimpleNamespace as Made

import pytest

from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.harness.outside.supervision import Watch, Watched, expected_periods

MS = 1_000_000
SYNC, ANGLE = 9, 14


def variable(publisher="A", kind="f32", low=-1.0, high=2.0, unit="rad", is_error_word=False, name="ANGLE"):
    return Made(
        id=ANGLE, name=name, publisher=publisher, type=kind, minimum=low, maximum=high, unit=unit,
        is_error_word=is_error_word,
    )  # fmt: skip


def watching(period_ms=2.0, start_ns=0, **of_variable):
    watch = Watch.__new__(Watch)
    watch.start_ns = watch.now_ns = start_ns
    watch.faults, watch.boards, watch.watched, watch.sync_id, watch.sync_ms = 0, {"A": []}, {}, SYNC, {}
    watch._watch("A", variable(**of_variable), "can1", round(period_ms * MS))
    return watch, watch.boards["A"][0]


def say(watch, time_ns, value=0.5, stamp=0, flags=8, bus="can1"):
    watch.frame(round(time_ns), bus, ANGLE, flags, word_of_value("f32", value), stamp)


def test_a_gap_may_be_a_period_and_five_milliseconds():
    watch, one = watching()
    for time_ms in (0, 2, 9, 16.0, 23.000001, 25):
        say(watch, time_ms * MS)
    assert one.faults == {"late": 1} and one.longest_gap_ns == 7_000_001
    assert one.last_fault == "late: 7.0 ms after the one before, period 2 ms"
    assert (one.seen, one.last_ns, watch.faults, watch.now_ns) == (6, 25 * MS, 1, 25 * MS)


def test_a_variable_is_missing_after_three_periods_and_five_milliseconds_and_reported_once():
    watch, one = watching(start_ns=100 * MS)
    watch.check(111 * MS)
    assert not one.missing
    watch.check(111 * MS + 1)
    assert one.missing and one.last_fault == "missing: never seen, period 2 ms"
    watch.check(200 * MS)
    assert one.faults == {"missing": 1}
    say(watch, 201 * MS)
    assert not one.missing and one.faults == {"missing": 1}
    watch.check(212 * MS)
    assert not one.missing
    watch.check(212.5 * MS)
    assert one.missing and one.last_fault == "missing: not for 11.5 ms, period 2 ms"
    say(watch, 300 * MS)  # it has been told already that it was late
    assert one.faults == {"missing": 2} and watch.faults == 2
    watch.check(5)
    assert watch.now_ns == 300 * MS


@pytest.mark.parametrize(("step_us", "doubled"), [(1500, 0), (1499, 1)])
def test_nineteen_frames_come_within_three_quarters_of_their_time_only_when_they_are_doubled(step_us, doubled):
    watch, one = watching()
    for number in range(18):
        say(watch, number * step_us * 1000)
    assert one.faults == {}
    say(watch, 18 * step_us * 1000)
    assert one.faults.get("doubled", 0) == doubled
    if doubled:
        assert one.last_fault == "doubled: 19 frames in 27.0 ms"
        for number in range(19, 37):
            say(watch, number * step_us * 1000)
        assert one.faults == {"doubled": 1}  # counted anew
        say(watch, 37 * step_us * 1000)
        assert one.faults == {"doubled": 2}


@pytest.mark.parametrize(
    ("value", "reported"),
    [
        (-1.0, None),
        (2.0, None),
        (-1.0001, "out of range: -1.0001 is outside -1 ... 2 rad"),
        (2.001, "out of range: 2.001 is outside -1 ... 2 rad"),
        (math.inf, "out of range: inf is not a number"),
        (math.nan, "out of range: nan is not a number"),
    ],
)
def test_a_value_may_be_its_limit(value, reported):
    watch, one = watching()
    say(watch, 0, value)
    assert one.faults == ({} if reported is None else {"out of range": 1}) and one.last_fault == (reported or "")


def test_a_variable_with_one_limit_or_none_is_held_against_what_it_has():
    for low, high, value, reported in (
        (None, 2.0, -99.0, ""),
        (None, 2.0, 3.0, "out of range: 3 is outside any ... 2"),
        (-1.0, None, 99.0, ""),
        (-1.0, None, -2.0, "out of range: -2 is outside -1 ... any"),
        (None, None, 99.0, ""),
    ):
        watch, one = watching(low=low, high=high, unit="")
        say(watch, 0, value)
        assert one.last_fault == reported


@pytest.mark.parametrize(
    ("sync", "stamp", "stale"),
    [
        (100, 80, False),
        (100, 79, True),
        (100, 101, False),  # the board has the time that comes with this very frame
        (5, 0xFFFFFFF1, False),  # over the wrap of 32 bits: 20 ms
        (5, 0xFFFFFFF0, True),
        (0x7FFFFFFF, 0, True),
        (0x80000000, 0, False),  # that is no past any more
    ],
)
def test_a_stamp_may_be_twenty_milliseconds_old(sync, stamp, stale):
    watch, one = watching()
    watch.frame(0, "can1", SYNC, 8, 7, sync)
    say(watch, 0, stamp=stamp)
    assert ("stale stamp" in one.faults) is stale
    if stale:
        assert one.last_fault == f"stale stamp: stamped {stamp} ms at {sync} ms"


def test_a_stamp_is_held_against_the_time_of_its_own_bus_and_of_own_variables_alone():
    watch, one = watching()
    say(watch, 0, stamp=0)
    watch.frame(0, "can2", SYNC, 8, 7, 100)
    watch.frame(0, "can1", SYNC, 8 | FLAG_REMOTE, 7, 100)
    watch.frame(0, "can1", SYNC, 8 | FLAG_EXTENDED, 7, 100)
    say(watch, MS, stamp=0)
    assert one.faults == {}
    for of_variable in ({"is_error_word": True}, {"publisher": "MB"}):
        watch, one = watching(**of_variable)
        watch.frame(0, "can1", SYNC, 8, 7, 100)
        say(watch, 0, stamp=0)
        assert one.faults == {}


def test_a_frame_other_than_a_data_frame_of_eight_bytes_is_malformed_and_counts_for_nothing_else():
    watch, one = watching()
    say(watch, 0, flags=7)
    assert one.last_fault == "malformed: 7 bytes instead of 8"
    say(watch, 0, flags=8 | FLAG_REMOTE)
    assert one.last_fault == "malformed: remote frame instead of 8"
    assert (one.faults, one.seen, len(one.recent)) == ({"malformed": 2}, 0, 0)
    for flags in (8 | FLAG_ERROR, 8 | FLAG_EXTENDED):
        say(watch, 3 * MS, flags=flags)
    say(watch, 3 * MS, bus="can2")
    assert one.faults == {"malformed": 2} and one.seen == 0 and watch.now_ns == 3 * MS


def test_what_the_schedule_never_sends_is_unexpected_once():
    watch, one = watching(period_ms=0)
    say(watch, 0)
    say(watch, 90 * MS)
    watch.check(1000 * MS)
    assert one.faults == {"unexpected": 1} and one.seen == 2 and not one.missing
    for of_variable in ({"is_error_word": True}, {"publisher": "MB"}):
        watch, one = watching(period_ms=0, **of_variable)
        say(watch, 0)
        assert one.faults == {}


def test_a_report_has_counts_by_kind_and_every_variable_with_a_fault():
    watch, one = watching()
    watch.boards["A"].append(Watched(variable(name="QUIET"), "can1", 5 * MS))
    watch.boards["A"].append(Watched(variable(name="ASKED"), "can1", 0, seen=3))
    say(watch, 0, 5.0)
    say(watch, 8 * MS, 5.0)
    one.missing = True
    assert watch.report() == {
        "A": {
            "frames": 5,
            "expected": 2,
            "seen": 1,
            "missing_now": 1,
            "faults": {"late": 1, "out of range": 2},
            "variables": [
                {
                    "variable": "ANGLE",
                    "bus": "can1",
                    "seen": 2,
                    "period_ms": 2.0,
                    "longest_gap_ms": 8.0,
                    "missing_now": True,
                    "faults": {"out of range": 2, "late": 1},
                    "last": "out of range: 5 is outside -1 ... 2 rad",
                }
            ],
        }
    }
    assert watch.lines() == [
        "A: 1 of 2 variables, 5 frames; late 1, out of range 2",
        "  ANGLE on can1: out of range 2, late 1; last out of range: 5 is outside -1 ... 2 rad",
    ]
    one.faults.clear()
    assert watch.lines() == ["A: 1 of 2 variables, 5 frames; no faults"]


def test_a_variable_comes_as_often_as_all_its_places_together():
    board = Made(
        name="A", slot_us=500, every=["e", "(nothing)"], rows=[["r", "both"], ["r"], []], occasional=["both", "o"]
    )
    schedule = Made(turns=lambda name: {"e": 4}.get(name, 1), occasional={"A": 2})
    turn = Fraction(3, 2)
    # the list's two entries and its pause: three turns of every second one
    assert expected_periods(board, schedule) == {
        "e": (Fraction(2), Fraction(2)),
        "r": (turn / 2, turn),
        "both": (1 / (1 / turn + 1 / (6 * turn)), turn),
        "o": (6 * turn, 6 * turn),
    }
    assert expected_periods(board, Made(turns=lambda name: 1, occasional={}))["o"] == (3 * turn, 3 * turn)
