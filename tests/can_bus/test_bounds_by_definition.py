"""Bounds on response times compared with their definition, in exact fractions of a bit and by listing releases.

`equations` is equations 7 to 11 of Davis, Burns, Bril, Lukkien 2007, for frames that have buffers to themselves.
`Listed` is the analysis of queues and trains as in the module's docstring, with every release of some cycles in a list
where the module counts by distances kept in order.
"""

import dataclasses
from bisect import bisect_left
from fractions import Fraction
from math import ceil, lcm

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus.bounds import Message, message, most_waiting, response_times
from tests.examples import examples

MS = 1_000_000
BIT = 1_000  # ns: of a bus with 1 Mbit/s
CYCLES = 40  # so many are listed; the drawn sets are busy for less


def settle(begin, step):
    """The least fixed point of `step` at or above `begin`."""
    while (following := step(begin)) != begin:
        begin = following
    return begin


def equations(streams, m, bit_rate):
    """(response in ns, which instance, how many, blocking in ns, busy period in ns) of streams[m]."""
    bit_ns = Fraction(10**9, bit_rate)
    C = [Fraction(one.bits) for one in streams]
    T = [one.period_ns / bit_ns for one in streams]
    J = [one.jitter_ns / bit_ns for one in streams]
    others = [k for k in range(len(streams)) if k != m]
    hp = [k for k in others if streams[k].key <= streams[m].key]
    B = max((C[k] for k in others if streams[k].key > streams[m].key), default=Fraction(0))
    t = settle(C[m], lambda t: B + sum(ceil((t + J[k]) / T[k]) * C[k] for k in [*hp, m]))
    Q = ceil((t + J[m]) / T[m])
    R = []
    for q in range(Q):
        own = B + q * C[m]
        w = settle(own, lambda w, own=own: own + sum(ceil((w + J[k] + 1) / T[k]) * C[k] for k in hp))
        R.append(J[m] + w - q * T[m] + C[m])
    return ceil(max(R) * bit_ns), R.index(max(R)), Q, ceil(B * bit_ns), ceil(t * bit_ns)


def reported(bound):
    return bound.response_ns, bound.instance, bound.instances, bound.blocking_ns, bound.busy_ns


streams_of_a_bus = st.lists(
    st.tuples(
        st.integers(0, 20),  # two may have one key: then they delay each other
        st.integers(44, 135),
        st.integers(300_000, 2_000_000),
        st.sampled_from([0, 0, 1, 60_000, 700_000]),
    ),
    min_size=1,
    max_size=7,
)


@settings(max_examples=examples(100))
@given(streams_of_a_bus, st.sampled_from([1_000_000, 500_000, 3_000_000]))
def test_bounds_of_frames_with_their_own_buffers_are_those_of_the_equations(drawn, bit_rate):
    streams = [Message(f"m{n}", key, bits, T, T, J) for n, (key, bits, T, J) in enumerate(drawn)]
    assume(sum(one.bits * 10**9 / bit_rate / one.period_ns for one in streams) < 0.97)
    for m, bound in enumerate(response_times(streams, bit_rate)):
        assert reported(bound) == equations(streams, m, bit_rate)


class Listed:
    """A train: the `releases` (in ns, with their messages) of CYCLES cycles. A bit is BIT ns."""

    def __init__(self, messages, members):
        self.messages = messages
        self.queue = messages[0].queue
        self.C = max(one.bits for one in messages) * BIT
        self.J = max(one.jitter_ns for one in messages)
        self.pause = max(one.pause_ns for one in messages)
        self.level = max(max(one.key, one.last_key) for one in (members if self.queue else messages))
        self.held = 0
        cycle = lcm(*(one.period_ns for one in messages))
        self.releases = sorted(
            ((one.offset_ns or 0) % one.period_ns + n * one.period_ns, number, one)
            for number, one in enumerate(messages)
            for n in range(CYCLES * cycle // one.period_ns)
        )
        self.in_a_cycle = len(self.releases) // CYCLES
        self.at = {}

    def most(self, level, window):
        """Most releases of this level or above in any half-open window, by trying each that begins at a release."""
        if level not in self.at:
            self.at[level] = [at for at, _, one in self.releases if level is None or one.key <= level]
        at = self.at[level]
        return max((bisect_left(at, at[n] + window) - n for n in range(min(self.in_a_cycle, len(at)))), default=0)


def listed(messages):
    """{name: response in ns} of every message."""
    trains = []
    for queue in dict.fromkeys(one.queue for one in messages):
        members = [one for one in messages if one.queue == queue]
        if queue and all(one.offset_ns is not None for one in members):
            trains.append(Listed(members, members))
        else:
            trains += [Listed([one], members) for one in members]
    found = {}
    for own in sorted(trains, key=lambda train: train.level, reverse=True):
        sources = []
        B = 0
        for other in trains:
            if other is own:
                continue
            if own.queue and other.queue == own.queue:
                sources.append((other, None, other.J))
                continue
            if any(one.key <= own.level for one in other.messages):
                sources.append((other, own.level, other.J + (other.held if other.level > own.level else 0)))
            if any(max(one.key, one.last_key) > own.level for one in other.messages):
                B = max(B, other.C)
        answers = responses(own, sources, B + own.pause)
        found |= answers
        if own.queue:  # until it has been sent, it may wait behind what others above its queue do not see
            own.held = max(answers.values()) - own.J
    return found


def responses(own, sources, B):
    """{name: response in ns} of the messages of a train, which begins each busy period that matters."""

    def work(time):
        return sum(train.most(level, time + jitter) * train.C for train, level, jitter in sources)

    busy = settle(B + own.C, lambda t: B + own.most(None, t + own.J) * own.C + work(t))
    instances = own.most(None, busy + own.J)
    answers = {}
    middle = CYCLES // 2 * own.in_a_cycle
    for p in range(middle, middle + own.in_a_cycle):
        release, _, one = own.releases[p]
        for b in range(instances):
            begun = own.releases[p - b][0]
            if release - begun >= busy + own.J:
                break
            after = [at for at, _, o in own.releases[p + 1 :] if o.key <= one.key] if own.queue else []

            def following(w, b=b, begun=begun, after=after):
                return B + (b + bisect_left(after, begun + w + BIT + own.J)) * own.C + work(w + BIT)

            w = settle(B + b * own.C, following)
            answers[one.name] = max(answers.get(one.name, 0), own.J + w + own.C - (release - begun))
    return answers


# Periods of a queue divide a cycle of 2 ms, so that there is one; offsets lie anywhere in it.
in_queues = st.lists(
    st.tuples(
        st.integers(0, 30),
        st.integers(44, 135),
        st.sampled_from([500_000, 1_000_000, 2_000_000]),
        st.sampled_from([0, 0, 90_000]),
        st.sampled_from(["", "one", "two"]),
        st.integers(0, 7),
        st.sampled_from([0, 0, 40_000]),
    ),
    min_size=2,
    max_size=5,
)


@settings(max_examples=examples(60))
@given(in_queues, st.booleans())
def test_bounds_of_queues_and_trains_are_those_of_their_releases_in_a_list(drawn, trains):
    messages = [
        Message(f"m{n}", key, bits, T, T, J, queue, pause if queue else 0, offset_ns=o * 125_000 if trains else None)
        for n, (key, bits, T, J, queue, o, pause) in enumerate(drawn)
    ]
    # a train counts all its frames with the longest
    longest = {q: max(one.bits for one in messages if one.queue == q) for q in {one.queue for one in messages}}
    assume(sum(longest[one.queue] * BIT / one.period_ns for one in messages) < 0.9)
    assert {bound.message.name: bound.response_ns for bound in response_times(messages, 10**9 // BIT)} == listed(
        messages
    )


def test_slow_and_fast_clocks_bring_a_trains_frames_closer_by_their_share():
    """Two frames 100 us apart, one of 135 us: the second waits for 35 us, and for 36 where clocks differ by 1 %."""
    pair = [message("a", 1, MS, queue="q", offset_ns=0), message("b", 2, MS, queue="q", offset_ns=100_000)]
    assert [bound.response_ns for bound in response_times(pair, 1_000_000)] == [135_000, 170_000]
    assert [bound.response_ns for bound in response_times(pair, 1_000_000, clock_ppm=10_000)] == [135_000, 171_000]


def test_as_many_frames_of_a_queue_wait_as_are_released_within_its_longest_response():
    """Three of 135 us each: the last answers after 405 us, so that of one with a period of 0.3 ms two are under way."""
    bounds = response_times(
        [message("quick", 1, 300_000, queue="q"), message("b", 2, MS, queue="q"), message("other", 9, MS)], 1_000_000
    )
    longest = max(bound.response_ns for bound in bounds[:2])
    assert 300_000 < longest <= 600_000
    assert most_waiting(bounds, "q", 1_000_000) == 2 + 1
    assert most_waiting(bounds, "", 1_000_000) == 1


def test_what_has_no_bound_in_a_queue_gives_none_to_those_above_it():
    """Its frames may come in any number at once, since it is unknown how long they waited."""
    full = [message("high", 1, MS, queue="q"), message("low", 50, 136_000, queue="q")]  # 13.5 and 99.3 %
    above = message("above", 20, 5 * MS)
    bounds = response_times([*full, above], 1_000_000)
    assert [bound.response_ns for bound in bounds] == [None, None, None]
    assert [bound.busy_ns for bound in bounds] == [None, None, None]
    assert response_times([dataclasses.replace(full[0], queue=""), full[1], above], 1_000_000)[2].response_ns


@pytest.mark.parametrize(("field", "least"), [("bits", 1), ("period_ns", 1), ("deadline_ns", 1), ("jitter_ns", 0)])
def test_the_least_values_of_a_message_are_taken_and_one_less_is_refused(field, least):
    one = message("A", 1, MS)
    assert getattr(dataclasses.replace(one, **{field: least}), field) == least
    with pytest.raises(ValueError, match="message A: "):
        dataclasses.replace(one, **{field: least - 1})
