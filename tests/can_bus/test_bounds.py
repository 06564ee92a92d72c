"""No frame of the bus answers later than its bound says, and the bound is no later than it has to be."""

import dataclasses
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus import bound_check
from ranger_sim.can_bus.bound_check import Sender, critical_releases, longest_content, play
from ranger_sim.can_bus.bounds import Message, level_of, message, most_waiting, response_times, utilisation
from ranger_sim.can_bus.fd_frame import fd_worst_case_phases
from ranger_sim.can_bus.frame import frame_bits, worst_case_bits
from ranger_sim.foundation.events import FLAG_BRS, FLAG_EXTENDED, FLAG_FD
from ranger_sim.foundation.random_stream import RandomStream
from tests.examples import examples

MS = 1_000_000


def three(deadline_ms=3.25):
    """The counter-example: 125 kbit/s, frames of 1 ms (seven bytes with all stuff bits), priorities A, B, C."""
    deadline = int(deadline_ms * MS)
    return [
        message("A", 1, 2_500_000, flags=7),
        message("B", 2, 3_500_000, flags=7, deadline_ns=deadline),
        message("C", 3, 3_500_000, flags=7, deadline_ns=deadline),
    ]


# ---- known answers


def test_the_second_instance_of_c_misses_its_deadline():
    """Davis, Burns, Bril, Lukkien 2007, section 3.1: the first instance needs 3.0 ms, the second 3.5 ms."""
    assert [m.bits for m in three()] == [125, 125, 125]  # 1 ms each at 125 kbit/s
    a, b, c = response_times(three(), 125_000)
    assert (a.response_ns, a.met) == (2 * MS, True)
    assert (b.response_ns, b.met) == (3 * MS, True)
    assert (c.response_ns, c.instance, c.instances, c.met) == (3_500_000, 1, 2, False)
    assert c.busy_ns == 7 * MS  # as the paper finds it


def test_the_older_analysis_would_have_passed_it():
    """Only the first instance: 3.0 ms. With a longer period of A there is no second instance in the busy period."""
    relaxed = [dataclasses.replace(three()[0], period_ns=3_500_000), *three()[1:]]
    assert response_times(relaxed, 125_000)[2].response_ns == 3 * MS


def test_a_frame_alone_needs_its_own_length():
    (bound,) = response_times([message("A", 5, 10 * MS)], 1_000_000)
    assert bound.response_ns == 135_000  # 132 bits and intermission
    assert (bound.blocking_ns, bound.instances, bound.met) == (0, 1, True)


def test_the_highest_waits_for_the_longest_of_the_others_and_the_jitter_counts():
    messages = [
        message("A", 1, 10 * MS, flags=0, jitter_ns=70_000),
        message("B", 9, 50 * MS),
        message("C", 8, 50 * MS, 4),
    ]
    bound = response_times(messages, 1_000_000)[0]
    assert bound.blocking_ns == 135_000
    assert bound.response_ns == 70_000 + 135_000 + (44 + 33 // 4 + 3) * 1000


def test_lengths_are_those_of_the_frames():
    assert message("A", 1, MS).bits == 135
    assert message("A", 1, MS, flags=8 | FLAG_EXTENDED).bits == worst_case_bits(8 | FLAG_EXTENDED) + 3 == 160


def test_times_at_three_megabits_are_rounded_up():
    assert response_times([message("A", 1, MS, flags=0)], 3_000_000)[0].response_ns == 18_334  # 55 bits of 333 1/3 ns


def test_a_bus_with_too_much_to_do_has_no_bound():
    messages = [message("A", 1, 200_000), message("B", 2, 400_000)]  # 67.5 + 33.75 %
    a, b = response_times(messages, 1_000_000)
    assert utilisation(messages, 1_000_000) > 1
    assert a.response_ns == 270_000 and not a.met
    assert b.response_ns is None and not b.met and most_waiting([a, b], "", 1_000_000) is None


def test_a_bus_filled_to_the_last_bit_has_a_bound_only_without_blocking_and_jitter():
    full = [Message("A", 1, 100, 200_000, 200_000), Message("B", 2, 100, 200_000, 200_000)]
    assert [bound.response_ns for bound in response_times(full, 1_000_000)] == [200_000, 200_000]
    late = [full[0], dataclasses.replace(full[1], jitter_ns=1)]
    assert response_times(late, 1_000_000)[1].response_ns is None


def test_a_busy_period_without_visible_end_is_given_up():
    nearly = [
        Message("A", 1, 10**6, 10**9, 10**9),
        Message("B", 2, 1, 10**9 + 1, 10**9),
        Message("C", 3, 999, 10**15, 1),
    ]
    assert response_times(nearly, 1_000_000)[1].response_ns is None


# ---- queues


def test_a_frame_in_a_queue_has_the_level_of_its_last_and_waits_for_all_of_them():
    own = [message("high", 1, 10 * MS, queue="node"), message("low", 9, 10 * MS, queue="node")]
    between = message("between", 5, 10 * MS)
    assert level_of(own[0], own) == own[1].key
    high, low, middle = response_times([*own, between], 1_000_000)
    assert high.response_ns == low.response_ns == 3 * 135_000
    # `high` delays it as one of higher priority, `low` as the one that has just started
    assert middle.response_ns == 3 * 135_000


def test_time_in_a_queue_is_jitter_for_those_above_it():
    slow = [message("high", 1, MS, queue="node"), *(message(f"low{n}", 100 + n, MS, queue="node") for n in range(4))]
    above = message("above", 50, 5 * MS)
    plain = [dataclasses.replace(one, queue="") for one in slow]
    assert (
        response_times([*slow, above], 1_000_000)[-1].response_ns
        > response_times([*plain, above], 1_000_000)[-1].response_ns
    )


def test_a_queue_that_pauses_is_later_by_that():
    one = message("A", 1, 10 * MS, queue="node")
    paused = dataclasses.replace(one, pause_ns=500_000)
    assert response_times([paused], 1_000_000)[0].response_ns == 635_000


def train(count=4, slot_ns=500_000, **more):
    """A board with a frame in each of `count` slots, one after the other."""
    return [
        message(f"m{n}", 10 + n, count * slot_ns, queue="board", offset_ns=n * slot_ns, **more) for n in range(count)
    ]


def test_frames_of_a_train_do_not_come_all_at_once():
    """Four slots of 0.5 ms at 1 Mbit/s: alone on the bus each frame finds it free; without offsets all four collide."""
    assert [bound.response_ns for bound in response_times(train(), 1_000_000)] == [135_000] * 4
    loose = [dataclasses.replace(one, offset_ns=None) for one in train()]
    assert [bound.response_ns for bound in response_times(loose, 1_000_000)] == [4 * 135_000] * 4


def test_another_frame_meets_as_many_of_a_train_as_fit_its_window():
    """Level below the train: w = 135 us for one frame; the next comes 500 us later, when the other has been sent."""
    below = message("below", 100, 10 * MS)
    assert response_times([*train(), below], 1_000_000)[-1].response_ns == 2 * 135_000
    assert response_times([*train(slot_ns=150_000), below], 1_000_000)[-1].response_ns == 2 * 135_000  # slips in


def test_jitter_lets_frames_of_a_train_catch_up_with_each_other():
    late = train(jitter_ns=500_000)
    below = message("below", 100, 10 * MS)
    assert response_times([*late, below], 1_000_000)[-1].response_ns == 3 * 135_000
    assert max(bound.response_ns for bound in response_times(late, 1_000_000)) == 500_000 + 2 * 135_000


def test_a_fast_clock_brings_a_trains_frames_closer():
    edge = [message("a", 1, MS, queue="q", offset_ns=0), message("b", 2, MS, queue="q", offset_ns=135_500)]
    below = message("below", 100, 10 * MS)
    assert response_times([*edge, below], 1_000_000)[-1].response_ns == 3 * 135_000  # within the bit that counts
    wide = [edge[0], dataclasses.replace(edge[1], offset_ns=137_000)]
    assert response_times([*wide, below], 1_000_000)[-1].response_ns == 2 * 135_000
    assert response_times([*wide, below], 1_000_000, clock_ppm=10_000)[-1].response_ns == 3 * 135_000


def test_a_train_whose_cycle_is_endless_is_refused():
    odd = [message(f"m{n}", n, MS + n, queue="q", offset_ns=0) for n in range(3)]
    with pytest.raises(ValueError, match="queue q: periods have no common multiple"):
        response_times(odd, 1_000_000)


def test_frames_waiting_in_a_queue_are_counted():
    bounds = response_times([message(f"m{n}", n, MS, queue="node") for n in range(3)], 1_000_000)
    assert most_waiting(bounds, "node", 1_000_000) == 3
    assert most_waiting(bounds, "other", 1_000_000) == 0


@pytest.mark.parametrize("field", ["bits", "period_ns", "deadline_ns", "jitter_ns", "pause_ns"])
def test_times_that_cannot_be_are_refused(field):
    with pytest.raises(ValueError, match=r"message A: .*above 0"):
        dataclasses.replace(message("A", 1, MS), **{field: -1})


# ---- against the bus


def as_senders(messages, identifiers, flags):
    return [
        Sender(one, identifier, flag, *longest_content(identifier, flag))
        for one, identifier, flag in zip(messages, identifiers, flags, strict=True)
    ]


def content_of_length(identifier, bits):
    """Words that make a frame of seven bytes take so many bits, intermission included."""
    for lo in range(100_000):
        if frame_bits(identifier, 7, lo, 0x5A5A5A) + 3 == bits:
            return lo, 0x5A5A5A
    raise AssertionError(f"no content of {bits} bits")


def test_the_counter_example_happens_on_the_bus_as_well():
    """Three frames of 110 bits; A's third comes just before C's second would start, so that one is the late one."""
    bits, bit_ns = 110, 8_000
    periods = ((5 * bits // 2 - 2) * bit_ns, 7 * bits // 2 * bit_ns, 7 * bits // 2 * bit_ns)
    messages = [
        Message(name, n << 21, bits, period, period)
        for n, (name, period) in enumerate(zip("ABC", periods, strict=True))
    ]
    senders = [Sender(one, n, 7, *content_of_length(n, bits)) for n, one in enumerate(messages)]
    bound = response_times(messages, 125_000)[2]
    assert (bound.instance, bound.response_ns) == (1, periods[2])
    releases = critical_releases(senders, 2, 125_000, bound.busy_ns)
    first = play(senders, 125_000, [*releases[:2], releases[2][:1]])[2]
    both = play(senders, 125_000, releases)[2]
    assert first <= 3 * bits * bit_ns < both <= bound.response_ns
    assert both == bound.response_ns - (3 - 1) * bit_ns  # without the intermission, with one bit until the first edge


def test_the_bound_is_reached_to_90_percent_by_every_frame_of_a_full_bus():
    """Twelve streams of eight bytes at 81 % load: the worst that the bus does is next to the worst that is allowed."""
    identifiers = [0x0A5 + 0x51 * n for n in range(12)]
    messages = [message(f"m{n}", identifier, 4 * MS) for n, identifier in enumerate(identifiers)]
    senders = as_senders(messages, identifiers, [8] * 12)
    bounds = response_times(messages, 500_000)
    assert utilisation(messages, 500_000) > 0.8
    for place, bound in enumerate(bounds):
        worst = play(senders, 500_000, critical_releases(senders, place, 500_000, bound.busy_ns))[place]
        assert 0.9 * bound.response_ns <= worst <= bound.response_ns, f"{bound.message.name}: {worst} {bound}"


def test_no_answer_exceeds_its_bound_over_random_sets():
    """`ranger-sim bench bounds` in small."""
    figures = bound_check.random_sets(120, seed=7)
    assert figures["sets"] == 120 and figures["exceeded"] == 0 and figures["unbounded"] == 0
    assert figures["worst_in_a_later_instance"] > 0  # else the corrected part of the analysis was not asked
    assert figures["reached_as_sent_90_percent"] > 0.99
    for shares in ("reached", "reached_as_sent"):  # of the bounds, which nothing exceeds
        assert 0.3 < figures[f"{shares}_min"] <= figures[f"{shares}_median"] <= 1.0
    assert 2 * 120 <= figures["messages"] <= 12 * 120 and 0.2 < figures["load_mean"] < 0.95
    assert figures["reached_90_percent"] > 0.8  # short frames cannot have all the stuff bits that they are allowed


@settings(max_examples=examples(25))
@given(st.integers(0, 2**32))
def test_no_answer_exceeds_its_bound_whatever_is_drawn(seed):
    stream = RandomStream(seed, "bounds")
    senders, bit_rate = bound_check.random_set(stream)
    figures = bound_check.Figures()
    bound_check.check_set(senders, bit_rate, stream, figures)
    assert figures.exceeded == 0


def test_the_check_would_notice_a_bound_that_is_too_low(monkeypatch):
    def low(messages, bit_rate, data_bit_rate):
        bounds = response_times(messages, bit_rate, data_bit_rate=data_bit_rate)
        return [dataclasses.replace(b, response_ns=b.response_ns * 3 // 4) for b in bounds]

    monkeypatch.setattr(bound_check, "response_times", low)
    assert bound_check.random_sets(5)["exceeded"] > 0
    assert bound_check.random_sets(5, fd=True)["exceeded"] > 0


# ---- two bit rates


def test_the_longest_frame_with_two_rates_is_that_of_its_phases_with_all_stuff_bits():
    """64 bytes, base identifier, by hand. Nominal: 17 bits up to BRS with 3 stuff bits, ACK slot, its delimiter and end
    of frame (9), intermission (3). Data: ESI and length code (5), 512, the rest of the stuff bits, the CRC field of 25
    bits with 7 fixed stuff bits, the CRC delimiter."""
    one = message("A", 1, MS, flags=FLAG_FD | FLAG_BRS | 15)
    stuff = (17 + 5 + 512 - 2) // 4
    assert (one.bits, one.data_bits) == (17 + 3 + 9 + 3, 5 + 512 + (stuff - 3) + 25 + 7 + 1)
    assert message("A", 1, MS, flags=FLAG_FD | 15).bits == one.bits + one.data_bits
    [bound] = response_times([one], 500_000, data_bit_rate=2_000_000)
    assert bound.response_ns == one.bits * 2000 + one.data_bits * 500
    with pytest.raises(ValueError, match="message A: has bits at a data rate, and the bus has no data bit rate"):
        response_times([one], 500_000)


def test_frames_of_two_rates_wait_for_each_other():
    """Three equal frames at 500 kbit/s and 2 Mbit/s, as the example of the classic bus: the lowest one waits for both
    others, the highest for one."""
    three = [message(f"m{n}", n, 10 * MS, flags=FLAG_FD | FLAG_BRS | 8) for n in range(3)]
    length = three[0].bits * 2000 + three[0].data_bits * 500
    bounds = response_times(three, 500_000, data_bit_rate=2_000_000)
    assert [bound.response_ns for bound in bounds] == [2 * length, 3 * length, 3 * length]
    assert utilisation(three, 500_000, 2_000_000) == Fraction(3 * length, 10 * MS)


def test_the_most_nominal_bits_before_and_after_a_fast_phase():
    """Up to BRS a frame has 17 bits, or 36 with 29 bits of identifier; a stuff bit comes behind bit 5 and each fourth
    further one but the last; behind the CRC delimiter are nine: ACK, its delimiter and the end of frame.
    """
    assert fd_worst_case_phases(FLAG_FD | FLAG_BRS | 8)[0] == 17 + len([5, 9, 13]) + 9
    extended = fd_worst_case_phases(FLAG_FD | FLAG_BRS | FLAG_EXTENDED | 8)[0]
    assert extended == 36 + len([5, 9, 13, 17, 21, 25, 29, 33]) + 9


@pytest.mark.parametrize("flags", [FLAG_FD | code for code in (0, 1, 8, 9, 12, 15)])
@pytest.mark.parametrize("more", [0, FLAG_BRS, FLAG_EXTENDED, FLAG_BRS | FLAG_EXTENDED])
def test_no_frame_lasts_longer_than_its_bound_counts(flags, more):
    """Also not those that are made to be long; they come close."""
    flags |= more
    nominal, data = fd_worst_case_phases(flags)
    for identifier in (0, 0x78, 0x7FF):
        found = bound_check.bits_of(identifier, flags, *longest_content(identifier, flags))
        assert found[0] <= nominal and sum(found) <= nominal + data
        assert found[0] * 4 + found[1] >= 0.9 * (nominal * 4 + data)


def test_no_answer_exceeds_its_bound_over_random_sets_with_two_rates():
    figures = bound_check.random_sets(60, seed=7, fd=True)
    assert figures["sets"] == 60 and figures["exceeded"] == 0 and figures["unbounded"] == 0
    assert figures["worst_in_a_later_instance"] > 0
    assert figures["reached_as_sent_90_percent"] > 0.99
    assert figures["reached_90_percent"] > 0.5
    assert 0.2 < figures["load_mean"] < 0.95


@given(st.integers(0, 0x7FF), st.integers(0, 8))
def test_the_longest_content_is_nearly_as_long_as_stuffing_can_make_it(identifier, length):
    lo, hi = longest_content(identifier, length)
    lacking = worst_case_bits(length) - frame_bits(identifier, length, lo, hi)
    # identifier, length code and CRC have no choice: 33 bits that may lack all their stuff bits but a few
    assert 0 <= lacking <= 9
