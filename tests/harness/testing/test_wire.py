"""Periods and latencies of frames: known answers on frames written by hand, then the robot's own."""

import pytest

from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.numbers import word_of_float
from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.scenario import Scenario
from ranger_sim.harness.testing.figures import Observed
from ranger_sim.harness.testing.frames import FrameKeeper
from ranger_sim.harness.testing.wire import Wire

MS = 1_000_000
ANGLE, CURRENT, HEEL = (
    all_variables.ID_OF[name] for name in ("MCH_ANGLE", "MCH_COMMAND_CURRENT", "MCFO_RIGHT_HEEL_SENSE")
)


class Recording:
    """Buses can1 and can3 on which the test writes frames."""

    def __init__(self):
        self.streams = {"can1": FrameStream(0), "can3": FrameStream(2)}
        self.observed = Observed(FrameKeeper(self.streams, RANGER))

    def add(self, name, identifier, *times_ns, value=0.5):
        for time_ns in times_ns:
            self.streams[name].add(time_ns, identifier, 8, word_of_float(value), time_ns // MS)

    def wire(self, name="can1", now_s=1.0):
        return Wire(self.observed, name, 0.0, now_s)


@pytest.fixture
def recording():
    return Recording()


def test_intervals_of_a_variable_are_those_between_its_own_frames(recording):
    recording.add("can1", ANGLE, 2 * MS, 4 * MS)
    recording.add("can1", CURRENT, 5 * MS)
    recording.add("can1", ANGLE, 6 * MS + 30_000, 8 * MS)
    found = recording.wire().period("MCH_ANGLE")
    assert found.each == [2 * MS, 2 * MS + 30_000, 2 * MS - 30_000]
    assert (found.count, found.min, found.max, found.mean, found.jitter) == (3, 1_970_000, 2_030_000, 2e6, 30_000)


def test_a_period_holds_to_its_jitter_on_both_sides_and_not_beyond(recording):
    recording.add("can1", ANGLE, 0, 2 * MS + 30_000, 4 * MS)
    wire = recording.wire()
    wire.assert_period("MCH_ANGLE", "2 ms", jitter="30 us")
    with pytest.raises(AssertionError) as late:
        wire.assert_period("MCH_ANGLE", "2 ms", jitter="29.999 us")
    assert str(late.value).splitlines() == [
        "MCH_ANGLE on can1: allowed is 2 ms +- 29.999 us, 2 of 2 are outside "
        "(2 intervals, least 1.97 ms, mean 2 ms, most 2.03 ms)",
        "      0.000000 s  can1  00E MCH_ANGLE 0.5 (stamp 0)",
        "      0.002030 s  can1  00E MCH_ANGLE 0.5 (stamp 2)   after 2.03 ms",
        "      0.002030 s  can1  00E MCH_ANGLE 0.5 (stamp 2)",
        "      0.004000 s  can1  00E MCH_ANGLE 0.5 (stamp 4)   after 1.97 ms",
    ]


def test_the_worst_interval_is_always_among_those_that_are_shown(recording):
    recording.add("can1", ANGLE, *(each * 3 * MS for each in range(9)), 9 * 3 * MS + 7 * MS)
    with pytest.raises(AssertionError, match=r"9 of 9 are outside(?s:.*)after 10 ms"):
        recording.wire().assert_period("MCH_ANGLE", "2 ms")


def test_a_period_of_fewer_than_two_frames_is_a_failure_and_no_period(recording):
    recording.add("can1", ANGLE, MS)
    with pytest.raises(AssertionError, match=r"^MCH_ANGLE on can1: 1 frames, a period needs two\n +0.001000 s"):
        recording.wire().assert_period("MCH_ANGLE", "2 ms")


def test_latency_is_from_each_cause_to_the_first_effect_after_it(recording):
    recording.add("can3", HEEL, 10 * MS, 20 * MS, 21 * MS)
    recording.add("can1", CURRENT, 10 * MS, 14 * MS, 15 * MS, 24 * MS)
    found = recording.wire("can3").latency("MCFO_RIGHT_HEEL_SENSE", "can1:MCH_COMMAND_CURRENT")
    assert found.each == [4 * MS, 4 * MS, 3 * MS]  # what comes at the instant of its cause is no effect of it
    recording.wire("can3").assert_latency("MCFO_RIGHT_HEEL_SENSE", "can1:MCH_COMMAND_CURRENT", at_most="4 ms")
    with pytest.raises(AssertionError, match="allowed is at most 3.9 ms, 2 of 3 are outside"):
        recording.wire("can3").assert_latency("MCFO_RIGHT_HEEL_SENSE", "can1:MCH_COMMAND_CURRENT", at_most="3.9 ms")


def test_a_cause_without_effect_is_a_miss_once_its_time_is_over(recording):
    recording.add("can1", ANGLE, 10 * MS)
    recording.add("can1", CURRENT, 11 * MS)
    recording.add("can1", ANGLE, 20 * MS)
    recording.wire(now_s=0.022).assert_latency("MCH_ANGLE", "MCH_COMMAND_CURRENT", at_most="2 ms")
    with pytest.raises(AssertionError, match=r"no effect for 2.001 ms, allowed is at most 2 ms\n +0.020000 s"):
        recording.wire(now_s=0.022001).assert_latency("MCH_ANGLE", "MCH_COMMAND_CURRENT", at_most="2 ms")
    with pytest.raises(AssertionError, match="no effect after any cause"):
        recording.wire().latency("MCH_COMMAND_CURRENT", "MCFO_RIGHT_HEEL_SENSE")


def test_only_frames_that_matter_are_causes(recording):
    recording.add("can1", ANGLE, 10 * MS, value=0.1)
    recording.add("can1", ANGLE, 20 * MS, value=0.4)
    recording.add("can1", CURRENT, 21 * MS)
    found = recording.wire().latency("MCH_ANGLE", "MCH_COMMAND_CURRENT", cause_if=lambda frame: frame.value > 0.3)
    assert found.each == [1 * MS]


def test_execution_times_are_those_that_the_board_has_sent(recording):
    identifier = all_variables.ID_OF["MCH_EXECUTION_TIME"]
    recording.add("can1", identifier, MS, value=2.5e-4)
    recording.add("can1", identifier, 2 * MS, value=1e-4)
    assert recording.wire().assert_execution_time("MCH", at_most="251 us") == pytest.approx(2.5e-4)
    with pytest.raises(AssertionError, match="MCH measured a slot of 250 us, allowed is at most 249 us"):
        recording.wire().assert_execution_time("MCH", at_most="249 us")
    with pytest.raises(AssertionError, match="MCFO_EXECUTION_TIME and MCFO_MAX_EXECUTION_TIME on can1: no frame"):
        recording.wire().assert_execution_time("MCFO", at_most="249 us")


def test_what_was_measured_is_kept_with_its_limit(recording):
    recording.add("can1", ANGLE, 0, 2 * MS)
    recording.wire().assert_period("MCH_ANGLE", "2 ms", jitter="1 us")
    [figure] = recording.observed.figures
    assert figure.name == "period of MCH_ANGLE on can1"
    assert figure.text() == "1 intervals, least 2 ms, mean 2 ms, most 2 ms (limit 2 ms +- 1 us)"


def test_what_is_not_there_is_told_with_what_is_near(recording):
    with pytest.raises(UserError, match="unknown bus 'can9' .available: can1, can3"):
        recording.wire("can9")
    with pytest.raises(UserError, match="unknown frame 'MCH_ANGEL'; did you mean 'MCH_ANGLE'"):
        recording.wire().period("MCH_ANGEL")
    with pytest.raises(UserError, match="jitter '3': a time from 0 on is needed"):
        recording.wire().assert_period("MCH_ANGLE", "2 ms", jitter="3")


def test_of_more_frames_than_fit_the_last_ones_are_kept():
    stream = FrameStream(0)
    keeper = FrameKeeper({"can1": stream}, RANGER, window_s=0.1)
    for number in range(4000):
        stream.add(number * MS, ANGLE, 8, 0, 0)
    kept = [frame.time_ns for frame in keeper.frames("can1")]
    # blocks of 512 frames go as a whole, so up to one more block than the window holds is there
    assert kept[-1] == 3999 * MS and kept == list(range(kept[0], 4000 * MS, MS))
    assert 100 <= len(kept) <= 100 + 2 * 512
    assert [frame.time_ns for frame in keeper.latest(3)] == [3997 * MS, 3998 * MS, 3999 * MS]


@pytest.mark.parametrize(("log", "kept"), [("full", True), ("window", True), ("none", False)])
def test_frames_from_before_they_were_asked_for_come_from_the_log_or_are_refused(log, kept):
    watched, late = Ranger(Scenario(seed=3)), Ranger(Scenario(seed=3), log)
    watched.wire()
    for robot in (watched, late):
        robot.run_for(0.05)
    if kept:
        assert late.wire().frames() == watched.wire().frames()
    else:
        with pytest.raises(UserError, match=r"^bus can1: frames before .* s .* are not kept; .* log='full'$"):
            late.wire().frames()
        with pytest.raises(UserError, match="are not kept"):
            late.wire().period("MCH_ANGLE")
    for robot in (watched, late):
        robot.run_for(0.05)
    assert late.wire("can1", since_s=0.05).frames() == watched.wire("can1", since_s=0.05).frames()
    assert late.wire().frames() == (watched if kept else late).wire("can1", since_s=0.0 if kept else 0.05).frames()
    if not kept:
        with pytest.raises(UserError, match="are not kept"):
            late.wire("can1", since_s=0.01).frames()
    late.close()


def test_frames_that_are_too_old_to_be_kept_are_refused():
    stream = FrameStream(0)
    keeper = FrameKeeper({"can1": stream}, RANGER, window_s=0.1)
    for number in range(4000):
        stream.add(number * MS, ANGLE, 8, 0, 0)
    recorded = Observed(keeper)
    assert Wire(recorded, "can1").frames() and Wire(recorded, "can1", since_s=3.95).frames()
    with pytest.raises(UserError, match=r"^bus can1: frames before 3\.\d+ s .* are not kept; kept are the last 0\.1 s"):
        Wire(recorded, "can1", since_s=1.0).frames()
    with pytest.raises(UserError, match="unknown bus 'can9'"):
        Wire(recorded, "can9", since_s=1.0)


def test_the_robot_publishes_at_the_rates_of_its_table():
    robot = Ranger(Scenario(seed=3))
    robot.wire()
    digest = Ranger(Scenario(seed=3))
    robot.run_for(0.3)
    digest.run_for(0.3)
    assert robot.trace_digest() == digest.trace_digest()  # to be looked at changes nothing
    # 500 Hz (robot.md N3.2), by a crystal that is off by some ppm; the very first interval is shorter, as the first
    # slot has no frame before it that it could queue behind
    robot.wire("can1", since_s=0.02).assert_period("MCH_ANGLE", "2 ms", jitter="30 us")
    assert robot.wire("can1").frames("MCH_ANGLE")[-1].value == pytest.approx(robot.variable("MCH_ANGLE"), abs=1e-3)
    assert robot.observed.figures
