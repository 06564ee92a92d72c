"""The check of the bounds checked: sets, releases, what is played and what is counted, by hand-made answers."""

import dataclasses
import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus import bound_check
from ranger_sim.can_bus.bound_check import (
    Figures,
    Sender,
    check_set,
    critical_releases,
    lanes_of,
    lengths_as_sent,
    longest_content,
    play,
    random_releases,
    random_set,
    random_sets,
)
from ranger_sim.can_bus.bounds import Bound, message, response_times, utilisation
from ranger_sim.foundation.events import FLAG_EXTENDED
from ranger_sim.foundation.random_stream import RandomStream
from tests.examples import examples

from . import bit_oracle as oracle

MS, SECOND = 1_000_000, 1_000_000_000
RATE = 1_000_000  # a bit is 1000 ns


def length(identifier, count, lo=0, hi=0, extended=False):
    """Bits of a frame without intermission, by the oracle."""
    data = (hi << 32 | lo).to_bytes(8, "little")[:count]
    return len(oracle.stuffed(oracle.Frame(identifier, data, extended=extended))[0]) + 10


def sender(name, identifier, period=MS, flags=0, lo=0, hi=0, **more):
    return Sender(message(name, identifier, period, flags, **more), identifier, flags, lo, hi)


# ---- contents


@pytest.mark.parametrize("identifier", [0x000, 0x01F, 0x123, 0x555, 0x7E0])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_of_all_contents_of_a_short_frame_none_is_longer_by_more_than_a_bit(identifier, count):
    """Every content of up to two bytes is tried; the patterns miss at most one bit, and two with two bytes."""
    best = max(
        length(identifier, count, int.from_bytes(bytes(content), "little"))
        for content in itertools.product(range(0, 256, 1 if count < 2 else 5), repeat=count)
    )
    lo, hi = longest_content(identifier, count)
    assert best - count <= length(identifier, count, lo, hi)


@settings(max_examples=examples(15))
@given(st.integers(0, 0x7FF), st.integers(3, 8), st.sampled_from([False, True]), st.integers(0, 2**32 - 1))
def test_no_pattern_of_equal_bytes_between_two_others_is_longer(identifier, count, extended, seed):
    """The contents of which it is the longest: eight turns of 00001111, first bytes with one edge, some last ones."""
    flags = count | (FLAG_EXTENDED if extended else 0)
    found = length(identifier, count, *longest_content(identifier, flags), extended=extended)
    region = (54 if extended else 34) + 8 * count
    most = region + 10 + (region - 1) // 4
    assert found <= most
    edges = [255 >> n for n in range(9)] + [255 << n & 255 for n in range(1, 8)]
    turns = [0x0F, 0x87, 0xC3, 0xE1, 0xF0, 0x78, 0x3C, 0x1E]
    stream = RandomStream(seed, "contents")
    for _ in range(40):
        turn = turns[stream.integer(8)]
        first = (edges + [turn])[stream.integer(len(edges) + 1)]
        last = (turn, 0, 255, 0x3C, 0xC3, 0x78, 0x87)[stream.integer(7)]
        whole = bytes([first] + [turn] * 6 + [last])
        words = int.from_bytes(whole[:4], "little"), int.from_bytes(whole[4:], "little")
        # the search ends with the first turn that has all the stuff bits there can be
        assert length(identifier, count, *words, extended=extended) <= found or found == most


# ---- lanes


def test_messages_alone_have_three_buffers_of_a_node_and_a_queue_has_two_buffers():
    messages = [
        message(f"m{n}", n, MS, queue=queue) for n, queue in enumerate(["", "a", "", "b", "a", "", "", "b", ""])
    ]
    lanes, nodes = lanes_of(messages)
    places = [(lane.node, list(lane.free)) for lane in lanes]
    assert places == [
        (0, [1]), (1, [1, 2]), (0, [2]), (2, [1, 2]), (1, [1, 2]), (0, [3]), (3, [1]), (2, [1, 2]), (3, [2]),
    ]  # fmt: skip
    assert nodes == 4 and lanes[1] is lanes[4] and lanes[3] is lanes[7] and not lanes[0].waiting
    assert lanes_of([]) == ([], 0)
    assert lanes_of(messages[:1])[1] == lanes_of(messages[1:2])[1] == 1


# ---- playing


def test_a_frame_alone_answers_after_the_edge_it_waits_for_and_its_bits():
    one = sender("a", 0x123)
    bits = length(0x123, 0)
    assert play([one], RATE, [[(0, 0)]]) == [1000 + bits * 1000]
    assert play([one], RATE, [[(500, 999)]]) == [1000 + bits * 1000 - 500]
    assert play([one], RATE, [[]]) == [0]
    assert play([one], 125_000, [[(0, 0)]]) == [8000 + bits * 8000]
    # each from its own release, the longest counts: the second begins right behind the first
    assert play([one], RATE, [[(0, 0), (10_000, 10_000)]]) == [(1 + 2 * bits + 3) * 1000 - 10_000]


def test_frames_answer_in_the_order_of_their_identifiers_with_the_intermission_between_them():
    senders = [sender("c", 0x300), sender("a", 0x100), sender("b", 0x200)]
    lengths = {each.identifier: length(each.identifier, 0) for each in senders}
    worst = play(senders, RATE, [[(0, 0)]] * 3)
    end, expected = 1, {}
    for identifier in sorted(lengths):
        end += lengths[identifier]
        expected[identifier] = end * 1000
        end += 3
    assert worst == [expected[each.identifier] for each in senders]


def test_a_queue_sends_two_at_once_by_priority_and_the_rest_in_its_order():
    """Four of one queue at one time, last priority first: two buffers take two, of which the better wins."""
    senders = [sender(f"m{n}", 0x400 - n * 0x100, queue="q") for n in range(4)]
    bits = [length(each.identifier, 0) for each in senders]
    worst = play(senders, RATE, [[(0, 0)]] * 4)
    # buffers: 0 and 1; 1 goes; then 0 and 2; 2 goes; then 0 and 3; 3 goes; 0 is the last
    ends, end = {}, 1
    for place in (1, 2, 3, 0):
        end += bits[place]
        ends[place] = end * 1000
        end += 3
    assert worst == [ends[place] for place in range(4)]


def test_instances_of_one_message_follow_in_order_and_the_longest_response_is_kept():
    fast, slow = sender("fast", 0x100, lo=1), sender("slow", 0x200, flags=8)
    one, other = length(0x100, 0), length(0x200, 8)
    worst = play([fast, slow], RATE, [[(20_000, 20_000), (900_000, 900_000)], [(0, 0)]])
    assert worst == [(1 + other + 3 + one) * 1000 - 20_000, (1 + other) * 1000]


def test_contents_are_asked_for_each_frame_by_its_place():
    asked = []

    def contents(index):
        asked.append(index)
        return (0, 0) if len(asked) == 1 else (0x55555555, 0x55555555)

    one = sender("a", 0x2AA, flags=8, lo=7, hi=7)
    long, short = length(0x2AA, 8), length(0x2AA, 8, 0x55555555, 0x55555555)
    worst = play([one, sender("b", 0x7FF)], RATE, [[(0, 0), (MS, MS)], []], contents)
    assert asked == [0, 0] and long > short and worst == [(1 + long) * 1000, 0]


# ---- the critical instant


def test_at_the_critical_instant_a_longer_frame_of_lower_priority_has_just_begun():
    senders = [
        sender("high", 0x100, 700_000, jitter_ns=30_000),
        sender("own", 0x200, 2 * MS),
        sender("short", 0x300, MS, flags=0),
        sender("long", 0x400, MS, flags=8),
    ]
    start = 100_000  # a hundred bits, so that all of them have a time before
    found = critical_releases(senders, 1, RATE, 1_500_000)
    assert found == [
        [(70_000, start), (770_000, 770_000), (1_470_000, 1_470_000)],
        [(start, start)],
        [],
        [(start - 1, start - 1)],
    ]
    # where nothing is lower, nothing blocks; the instant is rounded up to a whole ns
    found = critical_releases(senders, 3, 3_000_000, 600_000)
    assert found == [
        [(33_334 - 30_000, 33_334)],
        [(33_334, 33_334)],
        [(33_334, 33_334)],
        [(33_334, 33_334)],
    ]


def test_releases_of_the_critical_instant_go_on_to_the_end_of_the_busy_period():
    for busy, count in ((699_999, 1), (700_000, 2), (700_001, 2)):
        found = critical_releases([sender("a", 1, 700_000)], 0, RATE, busy)
        assert found == [[(100_000 + n * 700_000, 100_000 + n * 700_000) for n in range(count)]]


def test_a_train_begins_with_the_message_or_with_its_first_priority():
    """Offsets 0, 100 and 300 us in a cycle of 1 ms."""
    train = [
        sender(name, identifier, MS, queue="t", offset_ns=offset)
        for name, identifier, offset in (("a", 0x300, 0), ("b", 0x100, 100_000), ("c", 0x200, 300_000))
    ]
    below = sender("below", 0x7F0, 5 * MS)
    start = 100_000

    def firsts(place):
        return [instants[0] for instants in critical_releases([*train, below], place, RATE, 2 * MS)]

    at = lambda offset: (start + offset, start + offset)  # noqa: E731
    assert firsts(0)[:3] == [at(0), at(100_000), at(300_000)]
    assert firsts(2)[:3] == [at(700_000), at(800_000), at(0)]
    assert firsts(3) == [at(900_000), at(0), at(200_000), at(0)]
    assert firsts(0)[3] == (start - 1, start - 1)
    assert [len(each) for each in critical_releases([*train, below], 3, RATE, 2 * MS)] == [2, 3, 2, 1]


# ---- drawn sets


@pytest.fixture
def quick(monkeypatch):
    """Contents are not searched for, which takes most of the time: those that a set asks for can be given."""
    monkeypatch.setattr(bound_check, "longest_content", lambda identifier, flags: (identifier & 0xFFFF, flags))


@pytest.mark.usefixtures("quick")
def test_drawn_sets_are_as_many_different_ones_as_reported():
    """100 sets, of which each kind has its share: limits hold in all, and both ends of a range are met."""
    counts, rates, loads, jitters, queues, trains, extended = [], set(), [], 0, 0, 0, 0
    for number in range(100):
        senders, rate = random_set(RandomStream(5, f"set {number}"))
        messages = [each.message for each in senders]
        counts.append(len(senders))
        rates.add(rate)
        loads.append(float(utilisation(messages, rate)))
        assert len({each.identifier for each in senders}) == len(senders)
        assert [each.name for each in messages] == [f"m{n}" for n in range(len(senders))]
        for each in senders:
            code = each.flags & 15
            assert each.flags & ~15 in (0, FLAG_EXTENDED) and 0 <= code <= 8
            assert 0 <= each.identifier < (1 << 29 if each.flags & FLAG_EXTENDED else 0x800)
            region = (54 if each.flags & FLAG_EXTENDED else 34) + 8 * code
            assert each.message.bits == region + 10 + (region - 1) // 4 + 3
            assert (each.lo, each.hi) == (each.identifier & 0xFFFF, each.flags)
            assert 0 <= each.message.jitter_ns <= each.message.period_ns == each.message.deadline_ns
            extended += bool(each.flags & FLAG_EXTENDED)
        jitters += any(each.jitter_ns for each in messages)
        names = {each.queue for each in messages}
        assert names <= {"", "one", "two"} or names <= {"", "train"}
        queues += bool(names & {"one", "two"})
        in_train = [each for each in messages if each.queue == "train"]
        assert all((each.offset_ns is not None) == (each.queue == "train") for each in messages)
        if in_train:
            trains += 1
            assert in_train == messages[: len(messages) // 2]
            slot = in_train[1].offset_ns if len(in_train) > 1 else None
            for place, each in enumerate(in_train):
                if slot:
                    assert each.offset_ns == place * slot and each.jitter_ns in (0, slot)
                assert each.period_ns in (
                    min(one.period_ns for one in in_train),
                    2 * min(o.period_ns for o in in_train),
                )
    assert (min(counts), max(counts)) == (2, 12) and rates == {125_000, 250_000, 500_000, 1_000_000, 3_000_000}
    # loads are drawn between 0.2 and 0.95; a train has at most its share
    assert 0.05 < min(loads) < 0.3 and 0.8 < max(loads) <= 0.951
    assert 25 <= jitters <= 75  # half of them may have jitter, and most of these do
    assert 12 <= queues <= 38 and 12 <= trains <= 38  # a quarter each
    assert 0.18 < extended / sum(counts) < 0.32


@pytest.mark.usefixtures("quick")
def test_without_a_train_the_load_is_what_was_drawn_and_messages_share_it():
    """The stream is the same: bit rate, number, load and shares are its first draws."""
    for number in range(60):
        stream = RandomStream(11, f"set {number}")
        senders, rate = random_set(RandomStream(11, f"set {number}"))
        assert rate == (125_000, 250_000, 500_000, 1_000_000, 3_000_000)[stream.integer(5)]
        count = 2 + stream.integer(11)
        load = 0.2 + 0.75 * stream.uniform()
        shares = [0.1 + stream.uniform() for _ in range(count)]
        assert len(senders) == count
        if any(each.message.queue == "train" for each in senders):
            continue
        for each, share in zip(senders, shares, strict=True):
            own = each.message.bits * SECOND / rate / each.message.period_ns
            assert own == pytest.approx(load * share / sum(shares), rel=1e-4)


@pytest.mark.usefixtures("quick")
def test_random_releases_keep_periods_and_jitters_and_fill_the_time():
    for number in range(40):
        stream = RandomStream(9, f"releases {number}")
        senders, _ = random_set(RandomStream(9, f"set {number}"))
        until = 12 * max(each.message.period_ns for each in senders)
        releases = random_releases(senders, stream, until)
        phases = set()
        for each, instants in zip(senders, releases, strict=True):
            one = each.message
            gaps = [b[0] - a[0] for a, b in itertools.pairwise(instants)]
            assert all(one.period_ns <= gap < 2 * one.period_ns for gap in gaps)
            assert sum(gap == one.period_ns for gap in gaps) >= len(gaps) / 2
            assert all(0 <= released <= queued for released, queued in instants)
            assert [queued for _, queued in instants] == sorted(queued for _, queued in instants)
            late = [queued - released for released, queued in instants]
            assert max(late) <= one.jitter_ns
            assert instants[-1][0] < until <= instants[-1][0] + 2 * one.period_ns
            if one.offset_ns is None:
                assert 0 <= instants[0][0] < one.period_ns
            else:
                assert set(gaps) <= {one.period_ns}
                phases.add(instants[0][0] - one.offset_ns)
        assert len(phases) <= 1  # a train has one


# ---- counting


def test_lengths_as_sent_are_those_of_the_contents():
    senders = [sender("a", 0x123, flags=8, lo=1, hi=2), sender("b", 0x5 << 18, flags=3 | FLAG_EXTENDED, lo=0xFFFFFF)]
    found = lengths_as_sent(senders)
    assert [each.bits for each in found] == [
        length(0x123, 8, 1, 2) + 3,
        length(0x5 << 18, 3, 0xFFFFFF, extended=True) + 3,
    ]
    assert [dataclasses.replace(each, bits=s.message.bits) for each, s in zip(found, senders, strict=True)] == [
        each.message for each in senders
    ]


def test_a_summary_has_least_median_and_the_part_of_nine_tenths():
    figures = Figures(sets=2, messages=5, exceeded=1, unbounded=3, later_instances=4)
    whole = {"sets": 2, "messages": 5, "unbounded": 3, "worst_in_a_later_instance": 4, "exceeded": 1}
    assert figures.summary() == whole
    figures.shares = [0.9, 0.3, 0.95, 0.89]
    figures.shares_as_sent = [1.0, 0.2, 0.9]
    assert figures.summary() == whole | {
        "reached_min": 0.3, "reached_median": 0.9, "reached_90_percent": 0.5,
        "reached_as_sent_min": 0.2, "reached_as_sent_median": 0.9, "reached_as_sent_90_percent": 2 / 3,
    }  # fmt: skip
    assert Figures() == Figures(0, 0, 0, 0, 0, [], [])


def test_a_set_is_played_once_for_each_bound_and_once_at_random(monkeypatch):
    """Bounds and responses are given: what is counted follows from them."""
    senders = [sender("a", 1, MS), sender("b", 2, 2 * MS), sender("c", 3, 3 * MS)]
    whole = [each.message for each in senders]
    short = lengths_as_sent(senders)
    bounds = [
        Bound(whole[0], 100, 0, 0, 1, 500),
        Bound(whole[1], 200, 0, 2, 3, 600),
        Bound(whole[2], None, 0, 0, 0, None),
    ]
    as_sent = [
        dataclasses.replace(bounds[0], response_ns=80),
        dataclasses.replace(bounds[1], response_ns=None),
        bounds[2],
    ]
    played = []
    answers = iter([[100, 201, 999], [81, 150, 0], [101, 200, 5]])

    def bounded(messages, rate, data_bit_rate):
        assert (rate, data_bit_rate) == (RATE, 0) and messages in (whole, short)
        return bounds if messages == whole else as_sent

    def answer(given, rate, releases, contents=None, data_bit_rate=0):
        played.append((given, rate, releases, contents))
        return next(answers)

    monkeypatch.setattr(bound_check, "response_times", bounded)
    monkeypatch.setattr(bound_check, "play", answer)
    figures = Figures()
    assert check_set(senders, RATE, RandomStream(1, "x"), figures) == bounds
    # at a's instant: b above its bound, a above the one of what was sent; at b's: a above that again; at random: a
    assert figures == Figures(
        sets=1, messages=3, exceeded=4, unbounded=1, later_instances=1,
        shares=[100 / 100, 150 / 200], shares_as_sent=[100 / 80, 150 / 200],
    )  # fmt: skip
    assert [each[2] for each in played[:2]] == [
        critical_releases(senders, 0, RATE, 500), critical_releases(senders, 1, RATE, 600),
    ]  # fmt: skip
    last = max(instants[-1][0] for instants in played[2][2])
    assert 6 * MS <= last < 9 * MS  # three of the longest period
    assert played[0][3] is played[1][3] is None
    drawn = {played[2][3](0) for _ in range(40)}
    assert (0, 0) in drawn and 10 < len(drawn) < 35  # half of them as long as can be
    assert all(0 <= word < 1 << 32 for pair in drawn for word in pair)


def test_a_set_with_queues_has_no_shares():
    figures = Figures()
    senders = [sender("a", 1, MS, queue="q"), sender("b", 2, MS)]
    check_set(senders, RATE, RandomStream(1, "x"), figures)
    assert (figures.sets, figures.messages, figures.exceeded, figures.shares, figures.shares_as_sent) == (
        1,
        2,
        0,
        [],
        [],
    )


def test_many_sets_are_those_of_their_numbers_and_their_load_is_the_mean():
    found = random_sets(6, seed=4)
    loads, messages = [], 0
    for number in range(6):
        senders, rate = random_set(RandomStream(4, f"bounds {number}"))
        loads.append(sum(each.message.bits * SECOND / rate / each.message.period_ns for each in senders))
        messages += len(senders)
    assert (found["sets"], found["messages"], found["exceeded"], found["seed"]) == (6, messages, 0, 4)
    assert found["load_mean"] == pytest.approx(sum(loads) / 6, rel=1e-9)
    assert found["unbounded"] == 0 and random_sets(6, seed=4) == found != random_sets(6, seed=5)


def test_without_a_bound_no_instance_answers_last():
    one = message("a", 1, 100_000, 8)  # 135 us of every 100
    [bound] = response_times([one], RATE)
    assert bound == Bound(one, None, 0, 0, 0, None)
