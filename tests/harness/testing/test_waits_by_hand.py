"""Frames as tests read them, assertions on their times, and the instants of a bench: on rows and buses made by hand."""

from types import SimpleNamespace as Made

import pytest

from ranger_sim.can_bus.frame import frame_bits
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.conditions import ConditionNotMetError
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.testing.bench import AHEAD_BITS, BusAlone
from ranger_sim.harness.testing.frames import frame_type
from ranger_sim.harness.testing.wire import Intervals, Wire

US = 1000
FRAME = frame_type(RANGER)
ANGLE, RATE = all_variables.ID_OF["MCH_ANGLE"], all_variables.ID_OF["MCH_ANG_RATE"]


def frame(time_us, identifier=ANGLE, lo=0, bus="can1", flags=8):
    return FRAME(round(time_us * US), bus, identifier, flags, lo, 7)


def wire(*frames, now_us=0.0, since_us=0.0):
    """A wire that has these frames, of whatever bus, and what it noted."""
    noted = []

    def kept(bus, identifiers=None, since_ns=0):
        return [
            each
            for each in frames
            if each.bus == bus and each.time_ns >= since_ns and (identifiers is None or each.identifier in identifiers)
        ]

    observed = Made(
        keeper=Made(frames=kept, names=RANGER, check=lambda bus, since_ns: None),
        note=lambda *figure: noted.append(figure),
    )
    return Wire(observed, "can1", since_us * 1e-6, now_us * 1e-6), noted


def test_intervals_have_their_least_mean_most_and_jitter():
    frames = [frame(each) for each in (0, 100, 250, 270)]
    found = Intervals("x", list(zip(frames, frames[1:], strict=False)))
    assert (found.each, found.count) == ([100 * US, 150 * US, 20 * US], 3)
    assert (found.min, found.mean, found.max, found.jitter) == (20 * US, 90 * US, 150 * US, 70 * US)
    assert Intervals("x", [(frames[0], frames[1]), (frames[0], frames[2])]).jitter == 75 * US
    assert found.text() == "3 intervals, least 20 us, mean 90 us, most 150 us"


def test_a_period_may_be_off_by_its_jitter_to_either_side():
    made, noted = wire(*(frame(each) for each in (0, 90, 200, 300)), frame(5, RATE))
    found = made.assert_period("MCH_ANGLE", "100 us", jitter="10 us")
    assert found.each == [90 * US, 110 * US, 100 * US]
    assert noted == [("period of MCH_ANGLE on can1", found.text(), "100 us +- 10 us")]
    for frames in ((0, 89.999, 190), (0, 110.001, 210)):
        with pytest.raises(AssertionError, match=r"allowed is 100 us \+- 10 us, 1 of 2 are outside"):
            wire(*(frame(each) for each in frames))[0].assert_period("MCH_ANGLE", "100 us", jitter="10 us")
    with pytest.raises(AssertionError, match="MCH_ANGLE on can1: 1 frames, a period needs two"):
        wire(frame(0))[0].period("MCH_ANGLE")
    assert wire(frame(0), frame(1))[0].period(ANGLE).count == 1


def test_the_first_offences_are_shown_and_the_worst_in_any_case():
    times = [0, 200, 400, 600, 900, 1100]
    with pytest.raises(AssertionError) as failure:
        wire(*(frame(each) for each in times))[0].assert_period("MCH_ANGLE", "100 us")
    lines = str(failure.value).splitlines()
    assert "5 of 5 are outside" in lines[0] and len(lines) == 1 + 2 * 3
    assert [line.rsplit("after ", 1)[1] for line in lines[2::2]] == ["200 us", "200 us", "300 us"]
    with pytest.raises(AssertionError) as failure:
        wire(*(frame(each) for each in (0, 300, 500, 700, 900)))[0].assert_period("MCH_ANGLE", "100 us")
    assert [line.rsplit("after ", 1)[1] for line in str(failure.value).splitlines()[2::2]] == [
        "300 us",
        "200 us",
        "200 us",
    ]


def test_a_latency_is_to_the_first_effect_behind_its_cause():
    made, noted = wire(
        frame(0),
        frame(0, RATE),
        frame(30, RATE),
        frame(100),
        frame(110),
        frame(150, RATE, lo=1),
        frame(200),
        now_us=230,
    )
    assert made.latency("MCH_ANGLE", "MCH_ANG_RATE").each == [30 * US, 50 * US, 40 * US]
    assert made.latency("MCH_ANGLE", "MCH_ANG_RATE", effect_if=lambda each: each.lo == 1).each == [
        150 * US,
        50 * US,
        40 * US,
    ]
    assert made.latency("MCH_ANGLE", "MCH_ANG_RATE", cause_if=lambda each: each.time_ns == 110 * US).each == [40 * US]
    assert made.assert_latency("MCH_ANGLE", "MCH_ANG_RATE", "50 us").count == 3
    assert noted[0][0] == "latency of MCH_ANGLE to MCH_ANG_RATE on can1" and noted[0][2] == "50 us"
    with pytest.raises(AssertionError, match="allowed is at most 49 us, 1 of 3 are outside"):
        made.assert_latency("MCH_ANGLE", "MCH_ANG_RATE", "49 us")
    with pytest.raises(AssertionError, match=r"no effect after any cause \(4 frames of MCH_ANGLE, 0 of MCH_STATUS\)"):
        made.latency("MCH_ANGLE", "MCH_STATUS")
    with pytest.raises(AssertionError, match="no effect after any cause"):
        wire(frame(5), frame(5, RATE))[0].latency("MCH_ANGLE", "MCH_ANG_RATE")


@pytest.mark.parametrize(("now_us", "missed"), [(250, False), (250.001, True)])
def test_a_cause_without_an_effect_is_missed_when_its_time_has_passed(now_us, missed):
    made, _ = wire(frame(100), frame(150, RATE), frame(200), now_us=now_us)
    if missed:
        with pytest.raises(AssertionError, match="no effect for 50"):
            made.assert_latency("MCH_ANGLE", "MCH_ANG_RATE", "50 us")
        made.assert_latency("MCH_ANGLE", "MCH_ANG_RATE", "50 us", cause_if=lambda each: each.time_ns < 200 * US)
    else:
        made.assert_latency("MCH_ANGLE", "MCH_ANG_RATE", "50 us")


def test_a_frame_on_another_bus_is_named_with_it_and_what_was_before_does_not_count():
    made, _ = wire(frame(0), frame(10, RATE, bus="can3"), frame(50), frame(90, RATE, bus="can3"), since_us=40)
    assert made.latency("MCH_ANGLE", "can3:MCH_ANG_RATE").each == [40 * US]
    assert [each.time_ns for each in made.frames()] == [50 * US] and made.frames("MCH_ANG_RATE") == []


def test_an_execution_time_is_the_longest_that_the_board_sent():
    own = all_variables.ID_OF["MCH_EXECUTION_TIME"]
    most = all_variables.ID_OF["MCH_MAX_EXECUTION_TIME"]

    def sent(time_us, identifier, seconds):
        return frame(time_us, identifier, word_of_value(all_variables.TYPES[identifier], seconds))

    made, noted = wire(sent(0, own, 0.0001), sent(1, most, 0.0003), sent(2, own, 0.0002))
    assert made.assert_execution_time("MCH", "301 us") == pytest.approx(0.0003)
    assert noted[0][0] == "execution time of MCH" and noted[0][2] == "301 us"
    with pytest.raises(AssertionError, match="MCH measured a slot of 300 us, allowed is at most 299 us"):
        made.assert_execution_time("MCH", "299 us")
    with pytest.raises(AssertionError, match="MCH_EXECUTION_TIME and MCH_MAX_EXECUTION_TIME on can1: no frame"):
        wire()[0].assert_execution_time("MCH", "299 us")


# ---- a bench


def test_functions_are_called_at_their_instants_and_in_the_order_in_which_they_were_given():
    bus, called = BusAlone(), []
    bus.call_at(5 * US, lambda time_s: called.append(("b", round(time_s * 1e9))))
    bus.call_at(5 * US, lambda time_s: called.append(("c", round(time_s * 1e9))))
    bus.call_at(3 * US, lambda time_s: called.append(("a", round(time_s * 1e9))), 4 * US)
    bus.run_for("11 us")
    assert called == [("a", 3000), ("b", 5000), ("c", 5000), ("a", 7000)] and bus.now == 11 * US
    bus.run_for("1 us")
    assert called[4:] == [("a", 11_000)]
    bus.every("2 us", lambda time_s: called.append(("e", round(time_s * 1e9))))
    bus.run_for("3 us")
    assert called[5:] == [("e", 12_000), ("e", 14_000)] and bus.time_s == pytest.approx(15e-6)


def test_waiting_looks_at_its_condition_in_windows_of_36_bits_and_not_beyond_its_time():
    bus = BusAlone(bit_rate=1_000_000)
    window_ns = AHEAD_BITS * 1_000_000_000 // 3_000_000  # as of the robot's own buses, which are faster
    assert AHEAD_BITS == 36 and bus.window_ns == window_ns == 12_000
    looked = []
    assert bus.until(lambda: looked.append(bus.now) or len(looked) == 3) == pytest.approx(24e-6)
    assert looked == [0, 12_000, 24_000]
    with pytest.raises(ConditionNotMetError, match="hope: not within 20 us"):
        bus.until(lambda: False, "20 us", "hope")
    assert bus.now == 44_000
    with pytest.raises(ConditionNotMetError, match="never: not within 1 us"):

        def never():
            return False

        bus.until(never, "1 us")


def test_a_node_sends_what_it_was_given_in_order_of_its_instants_and_numbers():
    bus = BusAlone()
    one, other = bus.node("one"), bus.node("other")
    one.send(0x100, b"ab", at="20 us")
    one.send(0x200, b"\x01\x02\x03\x04\x05", at="10 us", extended=True)
    one.send("MCH_ANGLE", 0.5, at="1500 us")
    bus.run_for("1 ms")
    found = other.received()
    assert [(each.identifier, each.flags, each.lo, each.hi) for each in found] == [
        (0x200, 5 | FLAG_EXTENDED, 0x04030201, 5),
        (0x100, 2, 0x6261, 0),
    ]
    other.forget()
    last = other.wait_for("MCH_ANGLE", within="1 ms")
    assert (last.value, last.stamp_ms) == (0.5, 1) and other.received("MCH_STATUS") == []
    # asked for at bit 4500, it begins with the next one, and is heard a bit before its end
    bits = frame_bits(ANGLE, 8, last.lo, 1)
    assert last.time_ns == pytest.approx((4501 + bits - 1) * 1e9 / 3e6, abs=1)
    with pytest.raises(ConditionNotMetError, match="a frame MCH_ANGLE on can1: not within 1 ms"):
        other.wait_for("MCH_ANGLE", within="1 ms")


def test_a_frame_is_told_in_a_line():
    assert frame(1500, lo=0x3F000000).text() == f"    0.001500 s  can1  {ANGLE:03X} MCH_ANGLE 0.5 (stamp 7)"
    assert frame(1500, flags=FLAG_ERROR).text() == "    0.001500 s  can1  error frame"
    assert frame(0, flags=FLAG_ERROR).is_error and not frame(0).is_error
    with pytest.raises(UserError, match="unknown bus 'can9' .available: can1"):
        BusAlone().wire("can9")
