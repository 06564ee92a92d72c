"""An external board that behaves is not blamed; one that does not is named with variable, kind and count."""

import contextlib
import dataclasses
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim import datatable
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, NEVER
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import profile, rest_bus, supervision
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from tests.examples import examples

TABLE = datatable.load()
MS = 1_000_000
ANGLE, SYNC, STATUS = (TABLE.variable(name).id for name in ("MCH_ANGLE", "TIMESTAMP", "MCH_STATUS"))
BOARDS = ("MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR")


def having(base=None, **boards):
    """A profile with some boards external or absent; the buses stay inside, as for a test bench."""
    base = base if base is not None else profile.default()
    return dataclasses.replace(base, boards={**base.boards, **boards})


def hip(until_ms=200, *, every=2, skip=(), value=0.1, stamp=lambda ms: ms, watch=None):
    """A watch on the hip board that receives the time every ms and the angle every `every` ms."""
    watch = watch or supervision.Watch(having(MCH="external"))
    for ms in range(until_ms):
        watch.frame(ms * MS, "can1", SYNC, 8, ms, ms)
        if ms % every == 0 and ms not in skip:
            watch.frame(ms * MS + 100_000, "can1", ANGLE, 8, word_of_value("f32", value), stamp(ms) & 0xFFFFFFFF)
        if ms % 10 == 0:
            watch.check(ms * MS)
    return watch


def of_angle(watch):
    """Faults of MCH_ANGLE by kind."""
    return next((one["faults"] for one in watch.report()["MCH"]["variables"] if one["variable"] == "MCH_ANGLE"), {})


@pytest.fixture(scope="module", params=[None, "hil-1mbit"], ids=["robot", "hil-1mbit"])
def frames(request):
    """The profile, and every frame of two seconds of the robot with it."""
    chosen = profile.default() if request.param is None else profile.load(request.param)
    with contextlib.closing(Ranger(Scenario(), log="full", profile=chosen)) as robot:
        robot.run_for(2.0)
        found = robot.logbook.frames()
    columns = [found[name].tolist() for name in ("time_ns", "bus", "identifier", "flags", "word0", "word1")]
    return chosen, list(zip(*columns, strict=True))


def test_the_emulated_boards_pass_their_own_supervision(frames):
    chosen, seen = frames
    watch = supervision.Watch(having(chosen, **dict.fromkeys(BOARDS, "external")), start_ns=5 * MS)
    for time, bus, *frame in seen:
        watch.frame(time, f"can{bus + 1}", *frame)
        watch.check(time)
    assert watch.faults == 0, watch.lines()
    for name, board in watch.report().items():
        assert board["seen"] == board["expected"] > 0, name
        assert board["frames"] > 300


def test_a_board_that_falls_silent_is_missing_with_every_variable(frames):
    chosen, seen = frames
    watch = supervision.Watch(having(chosen, MCFI="external"), start_ns=5 * MS)
    own = {variable.id for variable in TABLE.published_by("MCFI")}
    for time, bus, *frame in seen:
        if not (frame[0] in own and time > 1_000 * MS):
            watch.frame(time, f"can{bus + 1}", *frame)
        watch.check(time)
    report = watch.report()["MCFI"]
    assert report["missing_now"] == report["expected"] == report["faults"]["missing"]
    assert set(report["faults"]) == {"missing"}


def test_a_schedule_that_is_kept_on_one_side_only_is_noticed(frames):
    """The board sends as its firmware does, the profile expects fewer frames, or the other way round."""
    chosen, seen = frames
    other = profile.load("hil-1mbit") if chosen.name == "default" else profile.default()
    watch = supervision.Watch(having(other, MCH="external"), start_ns=5 * MS)
    for time, bus, *frame in seen:
        watch.frame(time, f"can{bus + 1}", *frame)
        watch.check(time)
    if chosen.name == "default":  # twice and five times as often as expected
        assert watch.report()["MCH"]["faults"]["doubled"] > 10
    else:  # 10 ms where 2 are expected
        assert any(one["variable"] == "MCH_BATT_POWER" for one in watch.report()["MCH"]["variables"])


def test_regular_frames_are_not_a_fault():
    assert of_angle(hip()) == {}


def test_a_gap_is_late_once():
    assert of_angle(hip(skip=range(100, 110))) == {"late": 1}


def test_a_longer_gap_is_missing_and_not_late_as_well():
    watch = hip(skip=range(100, 150))
    assert of_angle(watch) == {"missing": 1}
    last = next(one for one in watch.report()["MCH"]["variables"] if one["variable"] == "MCH_ANGLE")
    assert not last["missing_now"] and last["longest_gap_ms"] == pytest.approx(52.0)


def test_a_board_that_never_came_is_never_seen():
    watch = supervision.Watch(having(MCH="external"), start_ns=0)
    watch.check(10 * MS)
    assert watch.faults == 0
    watch.check(1_000 * MS)
    assert watch.report()["MCH"]["missing_now"] == watch.report()["MCH"]["expected"] == 11
    assert any("never seen" in line for line in watch.lines())


@pytest.mark.parametrize(
    ("value", "blamed"), [(6.4, False), (-6.4, False), (6.6, True), (-7.0, True), (math.nan, True), (math.inf, True)]
)
def test_a_value_outside_the_tables_range_is_blamed(value, blamed):
    assert of_angle(hip(20, value=value)) == ({"out of range": 10} if blamed else {})


@pytest.mark.parametrize(("lag_ms", "blamed"), [(0, False), (15, False), (25, True), (-2, False)])
def test_an_old_stamp_is_blamed_and_one_from_just_ahead_is_not(lag_ms, blamed):
    faults = of_angle(hip(200, stamp=lambda ms: ms - lag_ms if ms >= 100 else ms))
    assert faults == ({"stale stamp": 50} if blamed else {})


def test_a_frozen_clock_is_a_stale_stamp():
    assert of_angle(hip(200, stamp=lambda ms: min(ms, 100)))["stale stamp"] > 30


def test_two_boards_of_one_name_are_doubled():
    assert of_angle(hip(every=1))["doubled"] > 3


@pytest.mark.parametrize("flags", [7, 0, FLAG_REMOTE | 8])
def test_a_frame_of_another_form_is_malformed(flags):
    watch = hip(20)
    watch.frame(20 * MS, "can1", ANGLE, flags, 0, 20)
    assert of_angle(watch) == {"malformed": 1}


@pytest.mark.parametrize("flags", [8 | FLAG_EXTENDED, FLAG_ERROR])
def test_what_is_not_the_boards_is_not_its_fault(flags):
    watch = hip(20)
    watch.frame(20 * MS, "can1", ANGLE, flags, 0, 0)
    watch.frame(20 * MS, "can2", ANGLE, 8, 0, 0)
    assert watch.faults == 0


def test_what_the_schedule_never_sends_is_unexpected_once():
    watch = hip(20)
    for ms in (20, 21):
        watch.frame(ms * MS, "can1", TABLE.variable("MCH_EMPTY_RX1").id, 8, 0, 20)
    assert watch.report()["MCH"]["faults"] == {"unexpected": 1}


def test_the_report_names_board_variable_kind_and_count():
    lines = hip(200, value=7.0).lines()
    assert lines[0].startswith("MCH: 1 of 11 variables, 100 frames; missing 10, out of range 100")
    angle = next(line for line in lines if "MCH_ANGLE" in line)
    assert "MCH_ANGLE on can1: out of range 100" in angle and "-6.5 ... 6.5 rad" in angle


@settings(max_examples=examples(60))
@given(
    st.lists(
        st.tuples(
            st.integers(0, 10**9),
            st.sampled_from(["can1", "can4", "can9", ""]),
            st.integers(0, 2**29 - 1) | st.sampled_from([ANGLE, SYNC, STATUS]),
            st.integers(0, 255),
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**32 - 1),
        ),
        max_size=40,
    )
)
def test_whatever_comes_is_judged_without_a_traceback(frames):
    watch = supervision.Watch(having(**dict.fromkeys(BOARDS, "external")))
    for frame in frames:
        watch.frame(*frame)
        watch.check(frame[0])
    assert watch.faults == sum(sum(board["faults"].values()) for board in watch.report().values())
    assert len(watch.lines()) >= len(BOARDS)


# ---- rest-bus


def test_without_absent_boards_nothing_is_sent():
    rest = rest_bus.RestBus(profile.default())
    assert rest.next_time == NEVER and rest.due(10**12) == []


def test_an_absent_boards_variables_come_at_their_periods():
    rest = rest_bus.RestBus(having(MCFO="absent"), start_ns=3 * MS)
    frames = rest.due(3 * MS + 9 * 1_000 * MS - 1)
    assert [frame[0] for frame in frames] == sorted(frame[0] for frame in frames)
    assert {frame[1] for frame in frames} == {"can3"}
    times = [frame[0] for frame in frames if frame[2] == TABLE.variable("MCFO_LEFT_HS").id]
    assert len(times) == 2000 and {b - a for a, b in zip(times, times[1:], strict=False)} == {4_500_000}


def test_an_emulated_rest_receives_an_absent_board_as_if_it_were_there():
    """The generator passes the supervision that the board itself would have to pass."""
    watch = supervision.Watch(having(MCFO="external"))
    rest = rest_bus.RestBus(having(MCFO="absent"))
    while rest.next_time < 3_000 * MS:
        for frame in rest.due(rest.next_time):
            watch.frame(*frame)
        watch.check(rest.next_time)
    assert watch.faults == 0, watch.lines()
    assert watch.report()["MCFO"]["seen"] == 18


def test_without_the_router_time_and_commands_come_from_the_generator():
    rest = rest_bus.RestBus(having(CSR="absent", MB="absent"))
    frames = rest.due(1_000 * MS - 1)
    for bus in profile.BUSES:
        times = [frame for frame in frames if frame[1] == bus and frame[2] == SYNC]
        assert len(times) == 1000 and all(lo == hi == time // MS for time, _, _, _, lo, hi in times)
    by_name = {}
    for frame in frames:
        by_name.setdefault(TABLE.variable(str(frame[2])).name, []).append(frame)
    assert len(by_name["MCH_COMMAND_CURRENT"]) == 500  # every slot of the main brain
    assert len(by_name["MCH_SHUTDOWN"]) == 1  # now and then
    assert "MCSO_EMPTY_TX1" not in by_name  # nobody there who hears it


def test_a_value_that_is_set_is_sent_from_then_on():
    rest = rest_bus.RestBus(having(MCH="absent"))
    rest.set("MCH_ANGLE", 0.25)
    word = next(frame[4] for frame in rest.due(10 * MS) if frame[2] == ANGLE)
    assert word == word_of_value("f32", 0.25)


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("MCFI_STATUS", 1.0, "MCFI_STATUS is not sent from here"),
        ("MCH_ANGLE", 9.0, "-6.5 to 6.5 rad"),
        ("MCH_ANGLE", math.nan, "nan"),
        ("NO_SUCH", 1.0, "NO_SUCH"),
    ],
)
def test_a_value_that_cannot_be_sent_is_refused(name, value, words):
    with pytest.raises(UserError, match=words):
        rest_bus.RestBus(having(MCH="absent")).set(name, value)
