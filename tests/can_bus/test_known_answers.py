"""Trains of releases, limits of messages and bit rates, the benchmark's tally: worked out by hand."""

import dataclasses
from fractions import Fraction
from types import SimpleNamespace as Made

import can
import pytest

from ranger_sim.can_bus import bounds, rewiring
from ranger_sim.can_bus.bounds import Message, level_of, utilisation
from ranger_sim.can_bus.edge.benchmark import Tally, numbered
from ranger_sim.foundation.user_error import UserError


def reported(name="A", key=1, bits=100, period=10, **more):
    return Message(name, key, bits, period, period, **more)


def train(clock_ppm=0, bit_rate=1, **more):
    """Releases at 0 and 3 of every 10 ns, of keys 1 and 5."""
    members = [
        reported(queue="q", offset_ns=0, jitter_ns=2, pause_ns=4, **more),
        reported("B", 5, 120, queue="q", offset_ns=13, jitter_ns=1, pause_ns=6),
    ]
    return bounds._Train(members, 5, bounds.Rates(bit_rate), clock_ppm)


def test_a_train_has_its_longest_frame_jitter_and_pause_over_one_cycle():
    one = train(bit_rate=2)
    assert (one.cycle, one.length, one.jitter, one.pause) == (20, 120 * 10**9, 4, 12)
    assert [(at, message.name) for at, message in one.entries] == [(0, "A"), (6, "B")]
    assert (one.queue, one.level, one.held) == ("q", 5, 0)


@pytest.mark.parametrize(
    "window, releases", [(-1, 0), (0, 0), (1, 1), (3, 1), (4, 2), (10, 2), (11, 3), (13, 3), (14, 4), (20, 4), (24, 6)]
)
def test_a_window_holds_the_releases_at_0_and_3_of_every_10(window, releases):
    assert train().most(None, window) == releases
    assert train().most(5, window) == releases


@pytest.mark.parametrize("window, releases", [(0, 0), (1, 1), (10, 1), (11, 2), (30, 3), (31, 4)])
def test_of_a_higher_level_the_window_holds_only_its_own_releases(window, releases):
    assert train().most(1, window) == releases
    assert train().most(0, window) == 0


def test_distances_between_releases_go_on_over_the_cycle_s_end():
    one = train()
    assert one.spans(None) == [0, 3] and one.spans(1) == [0] and one.spans(0) == []
    assert [one.distance(0, last) for last in range(5)] == [0, 3, 10, 13, 20]
    assert [one.distance(1, last) for last in range(1, 5)] == [0, 7, 10, 17]


def test_a_clock_that_is_fast_releases_more_and_a_slow_one_brings_releases_nearer():
    one = train(clock_ppm=100)
    assert one.by_its_clock(1_000_000) == 1_000_100 and one.by_its_clock(1) == 2
    assert train().by_its_clock(1) == 1
    assert one.distance(0, 200_000) == 1_000_000 - 100
    assert one.distance(0, 1) == 2
    assert one.most(None, 3) == 2  # 4 on its clock


def test_periods_without_a_short_common_multiple_are_refused():
    members = [reported(period=997, queue="q", offset_ns=0), reported("B", 2, period=1009, queue="q", offset_ns=0)]
    with pytest.raises(ValueError, match="queue q: periods have no common multiple of at most 2000 frames"):
        bounds._Train(members, 2, bounds.Rates(1), 0)
    bounds._Train(
        [reported(period=1999, queue="q", offset_ns=0), reported("B", 2, period=1, queue="q", offset_ns=0)],
        2,
        bounds.Rates(1),
        0,
    )


@pytest.mark.parametrize(
    "field, least", [("bits", 1), ("period_ns", 1), ("deadline_ns", 1), ("jitter_ns", 0), ("pause_ns", 0)]
)
def test_each_number_of_a_message_has_its_least_value(field, least):
    assert getattr(dataclasses.replace(reported(), **{field: least}), field) == least
    with pytest.raises(ValueError, match="message A: bits"):
        dataclasses.replace(reported(), **{field: least - 1})


def test_a_message_s_deadline_is_its_period_unless_given():
    plain = bounds.message("A", 5, 1000)
    assert (plain.deadline_ns, plain.jitter_ns, plain.queue, plain.offset_ns) == (1000, 0, "", None)
    assert (plain.bits, plain.pause_ns, plain.last_key) == (135, 0, -1)
    assert bounds.message("A", 5, 1000, deadline_ns=400).deadline_ns == 400


def test_a_message_counts_with_the_lowest_priority_of_its_queue():
    alone, turns = reported(key=3), reported(key=3, last_key=8)
    members = [reported("A", 3, queue="q"), reported("B", 7, queue="q", last_key=9), reported("C", 20, queue="other")]
    assert (level_of(alone, []), level_of(turns, [])) == (3, 8)
    assert [level_of(one, members) for one in members] == [9, 9, 20]


def test_utilisation_is_exact():
    assert utilisation(
        [reported(bits=100, period=1_000_000), reported(bits=50, period=2_000_000)], 1_000_000
    ) == Fraction(1, 8)
    assert utilisation([], 1_000_000) == 0


def test_a_busy_bus_that_is_exactly_full_has_an_end_only_without_blocking():
    full = [reported("A", 1, 50, 100_000), reported("B", 2, 50, 100_000)]
    assert [one.response_ns for one in bounds.response_times(full, 1_000_000)] == [100_000, 100_000]
    late = [dataclasses.replace(full[0], jitter_ns=1), full[1]]
    assert bounds.response_times(late, 1_000_000)[1].response_ns is None
    more = [dataclasses.replace(full[0], bits=51), full[1]]
    assert bounds.response_times(more, 1_000_000)[1].response_ns is None
    assert not bounds.response_times(more, 1_000_000)[1].met


def test_a_frame_s_own_jitter_lengthens_its_busy_period():
    # 60 us of every 100 us, queued up to 50 us late: the second instance may come 50 us after the first
    (bound,) = bounds.response_times([reported("A", 1, 60, 100_000, jitter_ns=50_000)], 1_000_000)
    assert (bound.busy_ns, bound.instances) == (120_000, 2)
    assert (bound.response_ns, bound.instance) == (110_000, 0)


# ---- bit rates that are wrong -------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate", [1_020_000, 980_000, 8_000_000, 125_000])
def test_a_rate_from_two_percent_off_up_to_eight_times_off_is_wrong_enough(rate):
    rewiring.check_rate(Made(bitrate=1_000_000), rate, "here")


@pytest.mark.parametrize("rate", [1_000_000, 1_019_999, 980_001, 8_000_001, 124_999])
def test_a_rate_that_is_made_up_for_or_too_far_off_is_refused(rate):
    with pytest.raises(UserError, match=f"^here: {rate} bit/s must be 2% off 1000000 at least.* 8 times off at most$"):
        rewiring.check_rate(Made(bitrate=1_000_000), rate, "here")


# ---- the benchmark's tally ----------------------------------------------------------------------------------------


def test_senders_have_sixteen_identifiers_each_with_running_numbers():
    first, second = numbered(0, 0), numbered(2, 37)
    assert (first.arbitration_id, bytes(first.data)) == (0, bytes(8))
    assert (second.arbitration_id, bytes(second.data)) == (128 + 5, b"\x02" + bytes(7))
    assert not first.is_extended_id and len(first.data) == 8


def test_a_tally_counts_frames_of_others_and_those_out_of_order():
    tally = Tally(own=1)
    for sender, number in ((0, 0), (1, 0), (0, 1), (0, 32), (0, 16), (0, 48), (2, 16)):
        tally.take(numbered(sender, number))
    assert (tally.received, tally.reordered) == (6, 1)
    assert tally.expected == {0: 4, 1: 1, 128: 2}
    everybody = Tally()
    everybody.take(numbered(1, 0))
    everybody.take(can.Message(arbitration_id=0, data=b"\x00", is_extended_id=False))
    everybody.take(can.Message(arbitration_id=0, data=b"\x00", is_extended_id=False))
    assert (everybody.received, everybody.reordered) == (3, 1)
