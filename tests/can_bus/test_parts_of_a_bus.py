"""The parts of a bus against plain second derivations: load by listing bits, lists of what waits, states by field."""

import array
import dataclasses
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus import rewiring
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.bus_counters import BusCounters
from ranger_sim.can_bus.disturbance import Disturbance
from ranger_sim.can_bus.frame_log import TIMES_BUFFER_SHIFT, FrameTimes
from ranger_sim.can_bus.medium_access import MediumAccess
from ranger_sim.can_bus.node import BUS_OFF, JOINING, OPERATING, RESET, UNPLUGGED, Node
from ranger_sim.can_bus.transmit_ends import BY_MESSAGE, TransmitEnds
from ranger_sim.foundation.events import (
    CAN_TX_DONE,
    FLAG_ERROR,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    NEVER,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.foundation.user_error import UserError
from tests.examples import examples

from . import bit_oracle as oracle
from . import oracle_comparison as comparison
from .wiring import RATE, Wired, edge

SECOND = 10**9
MS = 10**6


def length(identifier, data=b"", **more):
    """Bits of a frame without intermission, by the oracle."""
    return len(oracle.stuffed(oracle.Frame(identifier, data, **more))[0]) + 10


# ---- load


@settings(max_examples=examples(40))
@given(
    st.sampled_from([1_000, 1_099, 10_000, 20_000]),
    st.lists(st.tuples(st.integers(0, 60_000_000), st.sampled_from([b"", b"\xaa\x55", bytes(8)])), max_size=30),
    st.integers(0, 40_000_000),
    st.integers(0, 100_000_000),
)
def test_load_is_that_of_the_bits_in_a_list(rate, pauses, begun, later):
    """A window is 10 ms of bits: at 1 kbit/s ten of them, so that a frame goes through several."""
    wired = Wired(2, bitrate=rate)
    wired.bus.advance(begun)
    wired.bus.reset_statistics(begun)
    origin = begun * rate // SECOND
    window = rate // 100
    taken, free, time = set(), 0, begun
    for pause, data in pauses:
        time = max(time + pause, edge(free, rate))
        words = comparison.words(data)
        assert wired.send(0, 0x2AA, time=time, flags=len(data), lo=words[0], hi=words[1])
        start = max(time * rate // SECOND + 1, free)
        wired.bus.advance(edge(start, rate))
        free = start + length(0x2AA, data) + 3
        taken |= set(range(start, free))
        wired.messages(1)
    load = wired.bus.load
    busy = {}
    for bit in taken:
        busy[(bit - origin) // window] = busy.get((bit - origin) // window, 0) + 1
    closed = (free - 1 - origin) // window if taken else 0
    assert (load.bits, load.count) == (len(taken), closed)
    assert load.windows() == [busy.get(n, 0) / window for n in range(max(closed - 1024, 0), closed)]
    assert load.window_busy == busy.get(closed, 0)
    assert load.largest() == max(busy.values(), default=0) / window
    for at in (origin, origin + 1, free - 1, free, free + later * rate // SECOND):
        if at > origin and (not taken or at >= start):
            assert wired.bus.load_mean(edge(at, rate)) == sum(bit < at for bit in taken) / (at - origin)
    assert wired.bus.load_mean(begun) == wired.bus.load_mean(0) == 0.0


def test_after_more_idle_windows_than_are_kept_all_are_idle_and_counted():
    """1024 are kept: one less and one more, and a frame in the first of them."""
    for idle in (1022, 1023, 1024, 1025, 1026, 2050, 2051):
        wired = Wired(2, bitrate=100_000)
        wired.send(0, 0x2AA, flags=0)
        wired.bus.advance(0)
        wired.bus.advance(20_000)
        wired.send(0, 0x2AA, time=(idle + 1) * 10 * MS, flags=0)
        wired.bus.advance((idle + 1) * 10 * MS + MS)
        bits = length(0x2AA) + 3
        load = wired.bus.load
        assert (load.count, load.window_busy, load.busiest) == (idle + 1, bits, bits)
        first = [bits / 1000] if idle < 1024 else []
        assert load.windows() == first + [0.0] * (min(idle + 1, 1024) - len(first))
        assert load.window_end == (idle + 2) * 1000


# ---- what waits


waits = st.lists(
    st.tuples(
        st.integers(0, 3), st.integers(1, 3), st.sampled_from(["ask", "ask", "take back"]), st.integers(0, 0x7FF)
    ),
    max_size=30,
)


@settings(max_examples=examples(60))
@given(waits)
def test_what_waits_is_a_list_with_an_entry_for_each_full_buffer(steps):
    wired = Wired(4)
    buffers, model = wired.bus.buffers, {}
    for time, (node, buffer, what, identifier) in enumerate(steps):  # and the bus stands still
        row = node << 5 | buffer << 3
        if what == "ask":
            accepted = wired.send(node, identifier, time=time, buffer=buffer, lo=identifier, hi=node)
            assert accepted == (row not in model)
            model.setdefault(row, (time, identifier, 8, identifier, node))
        else:
            waited = wired.bus.take_out(node, time)
            assert waited == [((each >> 3) & 3, *model[each][1:]) for each in sorted(model) if each >> 5 == node]
            model = {each: frame for each, frame in model.items() if each >> 5 != node}
        assert sorted(buffers.waiting()) == sorted(model) and buffers.waiting_count == len(model)
        for each in range(4):
            assert buffers.waiting_of(each) == sorted(one for one in model if one >> 5 == each)
        assert wired.bus.accepted == len(model)
        for each, (asked, *frame) in model.items():
            assert buffers.is_full(each) and buffers.rows[each + 2] == asked
            assert list(buffers.rows[each + 4 : each + 8]) == frame
            data = b"".join(word.to_bytes(4, "little") for word in frame[2:])
            assert buffers.wire(each)[0] == oracle.stuffed(oracle.Frame(frame[0], data))[0] + [1] * 10
    wired.bus.recompute_next()
    assert wired.bus.next_bit == (1 if model else NEVER) and wired.bus.next_time == (edge(1) if model else NEVER)


def test_a_frame_is_held_until_a_bit_and_no_earlier_one_changes_that():
    wired = Wired(2)
    wired.send(0, 1, time=1000)
    row = 1 << 3
    for bit, ready in ((3, 4), (9, 9), (5, 9)):
        wired.bus.buffers.hold(row, bit)
        assert wired.bus.buffers.rows[row + 1] == ready


def test_buffers_keep_what_they_hold_when_nodes_are_added():
    wired = Wired(1)
    wired.send(0, 0x123, time=1000, buffer=2, flags=5, lo=1, hi=2)
    wired.bus.add_node("late", EventQueue(8), 1, 700)
    row = 2 << 3
    assert list(wired.bus.buffers.rows[row : row + 8]) == [NEVER, 4, 1000, -1, 0x123, 5, 1, 2]
    assert len(wired.bus.buffers.rows) == 2 * 32 and sum(wired.bus.buffers.rows[32:]) == 0
    wired.bus.advance(SECOND)
    assert wired.of(0, "done")[0][1:] == (2, TX_SENT)


# ---- a node


FIELDS = (
    "mode", "transmit_errors", "receive_errors", "listening", "passive", "silent", "sent", "received", "warning",
    "sequences_left", "join_from", "suspend_bit", "off_ns", "sending_end", "refused", "aborted", "single_shot_skipped",
    "flushed", "arbitrations_lost", "retries", "name", "index", "order", "controller",
)  # fmt: skip


def fresh(**changes):
    node = Node("n", 7, EventQueue(8), 2, 900)
    for name, value in changes.items():
        setattr(node, name, value)
    return node


def state(node):
    return {name: getattr(node, name) for name in FIELDS}


def test_a_new_node_takes_part_listens_and_has_done_nothing():
    node = fresh()
    zero = dict.fromkeys(FIELDS, 0)
    assert state(node) == zero | {
        "listening": True, "sending_end": -1, "name": "n", "index": 7, "order": 900, "controller": 2, "mode": OPERATING,
    }  # fmt: skip
    assert node.following is node and list(node.ends.times) == [BY_MESSAGE] * 4


def test_a_renewed_node_has_no_errors_and_keeps_what_it_counted():
    node = fresh(transmit_errors=200, receive_errors=3, passive=True, warning=True, suspend_bit=9, off_ns=8, sent=5)
    before = state(node)
    node.renew("other")
    assert state(node) == before | dict.fromkeys(
        ("transmit_errors", "receive_errors", "passive", "warning", "suspend_bit", "off_ns"), 0
    ) | {"name": "other"}


def test_what_a_controller_takes_along_to_another_bus():
    other = fresh(
        transmit_errors=1, receive_errors=2, passive=True, warning=True, listening=False, silent=True, off_ns=3, sent=4,
        mode=BUS_OFF, suspend_bit=6, received=7,
    )  # fmt: skip
    node = fresh()
    before = state(node)
    node.take_over(other)
    assert state(node) == before | {
        "transmit_errors": 1, "receive_errors": 2, "passive": True, "warning": True, "listening": False,
        "silent": True, "off_ns": 3,
    }  # fmt: skip


@pytest.mark.parametrize(("errors", "mode"), [(0, RESET), (255, RESET), (256, BUS_OFF), (300, BUS_OFF)])
def test_a_node_that_leaves_owes_its_recovery_from_256_errors_on(errors, mode):
    node = fresh(transmit_errors=errors)
    node.leave()
    assert node.mode == mode
    node.start_joining(50)
    assert (node.mode, node.join_from, node.sequences_left) == (JOINING, 50, 128 if mode == BUS_OFF else 1)
    assert node.join() == (mode == BUS_OFF)
    assert (node.mode, node.sequences_left) == (OPERATING, 0)
    assert node.transmit_errors == (0 if mode == BUS_OFF else errors)
    node.mode = BUS_OFF
    node.unplug()
    assert node.mode == RESET


@pytest.mark.parametrize(
    ("join_from", "free_bit", "start", "left"),
    [
        # from the later of: the bit at which it began to wait; eleven before the bus was free, which are recessive
        (0, 100, 100, 9), (0, 100, 110, 9), (0, 100, 111, 8), (0, 100, 121, 8), (0, 100, 122, 7), (95, 100, 105, 10),
        (95, 100, 106, 9), (100, 100, 99, 10), (500, 100, 110, 10), (89, 100, 100, 9), (90, 100, 100, 10),
    ],
)  # fmt: skip
def test_sequences_count_from_eleven_bits_before_the_bus_was_free(join_from, free_bit, start, left):
    node = fresh(sequences_left=10, join_from=join_from, mode=JOINING)
    node.count_sequences(free_bit, start)
    assert node.sequences_left == left


def test_an_end_is_written_to_the_buffer_of_its_controller_or_sent_as_a_message():
    node = fresh()
    node.end_unsent(2, 77, TX_LOST)
    assert node.inbox.take()
    reported = node.inbox
    assert (reported.time, reported.order, reported.kind, reported.a, reported.b, reported.c) == (
        77,
        900,
        CAN_TX_DONE,
        2,
        2,
        TX_LOST,
    )
    ends = TransmitEnds()
    assert (list(ends.times), list(ends.statuses), ends.order) == ([NEVER] * 4, [0] * 4, 0)
    node.connect(ends)
    assert ends.order == 900
    node.end_unsent(3, 78, TX_ABORTED)
    assert not node.inbox.take() and list(ends.times) == [NEVER, NEVER, NEVER, 78]
    assert list(ends.statuses) == [0, 0, 0, TX_ABORTED]
    node.end_unsent(3, 79, TX_LOST)  # nobody has taken in the one before
    assert node.inbox.take() and node.inbox.time == 79 and ends.times[3] == 78
    node.connect(None)
    assert node.ends is not ends and list(node.ends.times) == [BY_MESSAGE] * 4 and node.ends.order == 900


def test_ends_of_frames_are_written_for_a_controller_that_polls():
    wired = Wired(2)
    ends = TransmitEnds()
    wired.bus.nodes[0].connect(ends)
    for buffer in (1, 2, 3):
        wired.send(0, buffer, buffer=buffer)
    wired.bus.advance(SECOND)
    assert wired.messages(0) == []
    bit, expected = 1, [NEVER]
    for identifier in (1, 2, 3):
        bit += length(identifier, bytes(8))
        expected.append(edge(bit))
        bit += 3
    assert list(ends.times) == expected and list(ends.statuses) == [0] + [TX_SENT] * 3


# ---- counters and log


COUNTS = (
    "frames", "merged", "lost", "single_shot_skipped", "single_shot_dropped", "retries", "errors", "refused",
    "arbitrations_lost", "aborted", "flushed", "late_results", "late_requests",
)  # fmt: skip


def test_counters_begin_at_zero_and_go_back_to_it():
    counters = BusCounters()
    for name in COUNTS:
        assert getattr(counters, name) == 0
        setattr(counters, name, 1 << COUNTS.index(name))
    over = ("frames", "merged", "aborted", "flushed", "single_shot_dropped")
    assert counters.over == sum(1 << COUNTS.index(name) for name in over)
    counters.identifiers[6] = 4
    counters.identifiers[7] = 5
    assert counters.frames_by_identifier[:5] == [0, 0, 0, 4, 0] and counters.response_max_ns[:5] == [0, 0, 0, 5, 0]
    assert len(counters.frames_by_identifier) == len(counters.response_max_ns) == 2048
    counters.reset()
    assert [getattr(counters, name) for name in COUNTS] == [0] * len(COUNTS) and not any(counters.identifiers)


def test_statistics_that_begin_anew_count_what_waits_as_accepted():
    wired = Wired(2)
    for buffer in (1, 2):
        wired.send(0, buffer, buffer=buffer)
    wired.bus.advance(1_000)
    wired.bus.reset_statistics(60_000)
    assert (wired.bus.accepted, wired.bus.counters.frames, wired.bus.load.bits) == (1, 0, 0)
    wired.bus.advance(SECOND)
    assert (wired.bus.accepted, wired.bus.counters.frames) == (1, 1)
    assert wired.bus.load.bits == length(2, bytes(8)) + 3


def test_a_log_with_a_stream_keeps_nothing_itself():
    bus = Bus("can1", RATE, log_capacity=1)
    assert (bus.log.frames, bus.log.dropped, bus.log.stream, bus.log.times, bus.log.capacity) == ([], 0, None, None, 1)
    bus.note_outside(1, 2, 3, 4, 5)
    bus.note_outside(7, 2, 3, 4, 5)
    assert (bus.log.frames, bus.log.dropped) == ([(1, 2, 3, 4, 5, -1)], 1)
    bus.log.stream = FrameStream(3)
    got = []
    bus.log.stream.sink = lambda _time, block: got.extend(memoryview(block).cast("B").cast("q").tolist())
    bus.note_outside(8, 2, 3, 4, 5)
    bus.log.stream.flush()
    assert got == [8, 4 << 12 | 3 << 4 | 3, 5 << 29 | 2]  # as `foundation/row_stream.py` packs three numbers
    assert bus.log.take() == [(1, 2, 3, 4, 5, -1)] and bus.log.take() == [] and bus.log.dropped == 1


def test_frames_on_a_real_bus_in_its_place_are_kept_like_its_own():
    wired = Wired(2, bitrate=1_000_000)
    rows = []
    wired.bus.note_outside(9 * MS, 0x7, 3, 1, 2)
    wired.bus.log.times = FrameTimes()
    wired.bus.log.times.sink = lambda _time, block: rows.append(list(memoryview(block).cast("B").cast("q")))
    wired.bus.note_outside(10 * MS, 0x1ABCDEF0, 5 | FLAG_EXTENDED | FLAG_SINGLE_SHOT, 0x04030201, 0x05)
    wired.bus.log.times.flush()
    bits = length(0x1ABCDEF0, b"\1\2\3\4\5", extended=True)
    flags = 5 | FLAG_EXTENDED
    assert wired.bus.counters.frames == 2 and wired.bus.counters.lost == 0
    assert wired.log() == [
        (9 * MS, 0x7, 3, 1, 2, -1),
        (10 * MS, 0x1ABCDEF0, flags | FLAG_SINGLE_SHOT, 0x04030201, 0x05, -1),
    ]
    begun = 10 * MS - bits * 1000
    assert rows == [[begun, begun, 10 * MS, 0x1ABCDEF0, flags, 0x04030201, 0x05]]


# ---- disturbances


def test_bits_to_be_hit_are_kept_in_order_and_the_first_is_the_next():
    disturbance = Disturbance(RandomStream(0, "test"))
    assert (disturbance.next_bit, disturbance.next_misread, disturbance.next_noise_bit) == (NEVER, NEVER, NEVER)
    assert (disturbance.frames_left, disturbance.position, disturbance.bit_error_rate) == (0, -1, 0.0)
    for bit, following in ((50, 50), (20, 20), (70, 20)):
        disturbance.hit_bit(bit)
        assert disturbance.next_bit == following
    assert disturbance.planned_bits == [20, 50, 70]
    for bit, node, following in ((9, 1, 9), (5, 2, 5), (5, 0, 5)):
        disturbance.hit_node(bit, node)
        assert disturbance.next_misread == following
    assert disturbance.misread == [(5, 0), (5, 2), (9, 1)]
    disturbance.hit_frames(3, 7)
    assert (disturbance.frames_left, disturbance.position) == (3, 7)


def test_noise_comes_at_distances_that_are_exponential():
    """By the inverse of the distribution: -log(1 - u) / rate bits, whole, and one more."""
    disturbance = Disturbance(RandomStream(3, "noise"))
    same = RandomStream(3, "noise")
    disturbance.set_rate(0.01, 1000)
    first = 1000 + 1 + math.floor(-math.log(1.0 - same.uniform()) / 0.01)
    assert disturbance.next_bit == disturbance.next_noise_bit == first
    disturbance.hit_bit(first - 1)
    assert disturbance.next_bit == first - 1
    disturbance.set_rate(0.0, 5)
    assert disturbance.next_noise_bit == NEVER and disturbance.next_bit == first - 1


@pytest.mark.parametrize(
    ("frame", "bit"),
    [
        # the middle bit of those that the frame has; where that is in the arbitration field, the first one behind
        ({"identifier": 0x555, "data": b"\x55" * 8}, (length(0x555, b"\x55" * 8) - 1) // 2),
        ({"identifier": 0x555, "data": b""}, (length(0x555) - 1) // 2),
        ({"identifier": 0x0AAAAAAA, "data": b"", "extended": True}, 41),
        (
            {"identifier": 0x0AAAAAAA, "data": b"\x55" * 8, "extended": True},
            (length(0x0AAAAAAA, b"\x55" * 8, extended=True) - 1) // 2,
        ),
    ],
)
def test_a_frame_is_hit_in_its_middle_or_behind_its_arbitration(frame, bit):
    wired = Wired(2)
    wired.bus.inject_errors(1)
    flags = len(frame["data"]) | (FLAG_EXTENDED if frame.get("extended") else 0)
    words = comparison.words(frame["data"])
    wired.send(0, frame["identifier"], flags=flags, lo=words[0], hi=words[1])
    wired.bus.advance(SECOND)
    reported = wired.of(0, "status")[0]
    assert reported[0] == edge(1 + bit + 1) and wired.bus.disturbance.frames_left == 0
    assert wired.bus.disturbance.planned_bits == [] and wired.bus.disturbance.next_bit == NEVER


@pytest.mark.parametrize(("rate", "fits"), [(0.0, True), (0.1, True), (0.1000001, False), (-1e-9, False)])
def test_a_bit_error_rate_is_a_tenth_at_most(rate, fits):
    bus = Bus("can1", RATE)
    if fits:
        bus.set_bit_error_rate(rate)
        assert bus.disturbance.bit_error_rate == rate
    else:
        with pytest.raises(ValueError, match="bus can1: bit error rate .* is outside 0 ... 0.1"):
            bus.set_bit_error_rate(rate)


@pytest.mark.parametrize(("rate", "fits"), [(999, False), (1_000, True), (100_000_000, True), (100_000_001, False)])
def test_bit_rates_have_two_limits(rate, fits):
    if fits:
        assert Bus("can1", rate).bitrate == rate
    else:
        with pytest.raises(ValueError, match=f"bus can1: bit rate {rate} bit/s is outside"):
            Bus("can1", rate)


# ---- what a bus says of the future


@pytest.mark.parametrize("kind", comparison.KINDS)
def test_a_bus_that_is_asked_only_when_it_wants_to_be_does_the_same(kind):
    """`next_time` is all that the harness goes by: between two of its times nothing needs the bus."""
    for seed in range(4):
        scenario = comparison.scenario_of(kind, seed)
        if kind == "recovery":
            scenario = dataclasses.replace(scenario, bits=3000)
        plain, accepted = comparison.on_our_bus(scenario)
        wired = Wired(scenario.nodes, comparison.BITRATE)
        bus = wired.bus
        wakes = array.array("q", [NEVER, 5, NEVER])
        bus.wake(wakes, 2)
        for node, (transmit, receive) in zip(bus.nodes, scenario.counters, strict=True):
            node.transmit_errors, node.receive_errors = transmit, receive
            node.passive, node.warning = max(transmit, receive) >= 128, max(transmit, receive) >= 96
        for bit in scenario.inverted:
            bus.inject_error_at(bit * comparison.BIT_NS)
        taken = []
        for bit, node, buffer, what in comparison.commands_of(scenario):
            at = bit * comparison.BIT_NS - 1
            while bus.next_time < at:
                assert bus.advance(bus.next_time) == bus.next_time
            before, wakes[2] = bus.next_time, NEVER
            if buffer == 0:
                bus.set_mode(node, what, at)
                taken.append((bit, node, what))
            elif bus.request(
                node, buffer, at, what.identifier, comparison.flags_of(what), *comparison.words(what.data)
            ):
                taken.append((bit, node, what))
            if bus.next_time < before:
                assert wakes[2] == bus.next_time
            assert wakes[2] >= bus.next_time and list(wakes[:2]) == [NEVER, 5]
        while bus.next_time <= scenario.bits * comparison.BIT_NS:
            bus.advance(bus.next_time)
        assert taken == accepted
        seen = []
        for inbox in wired.inboxes:
            found = []
            while inbox.take():
                at = inbox.time // comparison.BIT_NS - 1
                if at < scenario.bits - 1 and inbox.kind == comparison.CAN_RX:
                    found.append((at, "received", (inbox.b, inbox.c, inbox.d, inbox.e)))
                elif at < scenario.bits - 1 and inbox.kind == CAN_TX_DONE and inbox.c == TX_SENT:
                    found.append((at, "sent"))
            seen.append(found)
        assert seen == plain.seen, f"{kind}, seed {seed}"


@pytest.mark.parametrize("rate", [125_000, 1_000_000, 3_000_000])
def test_the_next_time_is_the_start_of_the_next_frame_the_next_command_or_never(rate):
    wired = Wired(2, bitrate=rate)
    bus = wired.bus
    assert (bus.next_time, bus.advance(1_000), bus.advanced) == (NEVER, NEVER, 1_000)
    wired.send(0, 1, time=20_000)
    start = 20_000 * rate // SECOND + 1
    assert bus.next_time == edge(start, rate) and bus.next_bit == start
    wired.send(1, 2, time=10 * MS)
    assert bus.next_time == edge(start, rate)
    bus.abort(1, 1, 10_000)
    assert bus.next_time == 10_000
    bus.advance(10_000)
    assert bus.next_time == edge(start, rate) and wired.bus.buffers.waiting_count == 1
    bus.advance(edge(start, rate))
    assert bus.next_time == NEVER
    free = start + length(1, bytes(8)) + 3
    assert (bus.free_bit, bus.free_time) == (free, edge(free, rate))
    done = edge(free - 3, rate)
    wired.send(0, 3, time=done)  # during the intermission: at its end
    assert bus.next_time == edge(free, rate)
    bus.inject_error_at(edge(free + 1, rate))
    assert bus.next_time == edge(free, rate)  # the frame comes first, and its second bit is hit
    bus.advance(edge(free, rate))
    bus.set_bit_error_rate(0.0)
    bus.advance(SECOND)
    assert bus.next_time == NEVER and bus.counters.errors == 1 and bus.counters.frames == 2


def test_requests_and_commands_from_the_past_act_from_what_is_decided_on():
    wired = Wired(2)
    wired.bus.advance(1_000_000)
    wired.send(0, 1, time=999_999)
    assert wired.bus.next_bit == 3_001 and wired.bus.counters.late_requests == 1
    wired.bus.set_mode(1, RESET, 5)
    assert wired.bus.next_time == wired.bus.commands.head_time == 1_000_000
    wired.bus.advance(1_000_000)
    assert wired.bus.nodes[1].mode == RESET
    wired = Wired(2)
    wired.bus.advance(1_000_000)
    wired.send(0, 1, time=1_000_000)  # at that very instant: not late
    assert wired.bus.next_bit == 3_001 and wired.bus.counters.late_requests == 0


def test_a_result_is_late_when_it_was_due_at_the_time_that_found_it():
    bits = length(1, bytes(8))
    for until, late in ((edge(bits) - 1, 0), (edge(bits), 1)):  # receivers have it behind bit 1 + bits - 2
        wired = Wired(2)
        wired.send(0, 1)
        wired.bus.advance(until)
        assert wired.of(1, "rx")[0][0] == edge(bits) and wired.bus.counters.late_results == late


# ---- silence, wires, rates


def test_a_silent_node_does_not_acknowledge_and_counts_again_when_it_sends():
    wired = Wired(3)
    bus = wired.bus
    assert bus.operating == 3
    bus.set_silent(1, True)
    bus.set_silent(1, True)
    assert bus.operating == 2 and bus.nodes[1].silent
    bus.set_silent(2, True)
    assert bus.operating == 1
    wired.send(0, 1)
    bus.advance(10 * MS)
    assert bus.counters.frames == 0 and bus.nodes[0].passive and wired.of(1, "rx") == []
    bus.set_silent(2, False)
    bus.set_silent(2, False)
    assert bus.operating == 2 and not bus.nodes[2].silent
    bus.advance(SECOND)
    assert bus.counters.frames == 1
    assert [len(wired.of(n, "rx")) for n in (1, 2)] == [1, 1]
    bus.set_mode(1, RESET, SECOND)
    bus.set_mode(2, RESET, SECOND)
    bus.advance(SECOND + MS)
    assert bus.operating == 1
    bus.set_silent(2, True)  # it takes no part: nothing to count
    assert bus.operating == 1
    bus.set_mode(1, OPERATING, SECOND + MS)
    bus.set_mode(2, OPERATING, SECOND + MS)
    bus.advance(2 * SECOND)
    assert [node.mode for node in bus.nodes] == [OPERATING] * 3 and bus.operating == 1  # both are silent but node 0


def test_a_wire_that_parts_takes_its_node_off_with_what_waited_there():
    wired = Wired(3)
    bus = wired.bus
    for buffer in (1, 3):
        wired.send(1, 0x700 + buffer, buffer=buffer, lo=buffer, hi=9)
    wired.send(0, 1)
    bus.advance(1_000)
    assert rewiring.unplug(bus, 1, 2_000) == [(1, 0x701, 8, 1, 9), (3, 0x703, 8, 3, 9)]
    assert (bus.nodes[1].mode, bus.operating, bus.joining, bus.buffers.waiting_count) == (UNPLUGGED, 2, 0, 0)
    assert not wired.send(1, 5, time=3_000)
    assert ("done", 3_000, 1, TX_ABORTED) in wired.messages(1)
    rewiring.plug(bus, 2, 4_000)  # hangs there already: nothing
    assert bus.nodes[2].mode == OPERATING and bus.joining == 0
    rewiring.plug(bus, 1, MS)
    assert (bus.nodes[1].mode, bus.joining, bus.operating) == (JOINING, 1, 2)
    assert rewiring.unplug(bus, 1, MS + 10) == [] and bus.joining == 0
    rewiring.plug(bus, 1, MS + 20)
    wired.send(1, 6, time=MS + 30)
    bus.advance(SECOND)
    joined = (MS + 20) * 3 // 1000 + 1 + 11
    assert wired.of(1, "done") == [(edge(joined + length(6, bytes(8))), 1, TX_SENT)]
    assert (bus.operating, bus.joining, bus.nodes[1].mode) == (3, 0, OPERATING)


@pytest.mark.parametrize(
    ("rate", "fits"),
    [
        (2_940_000, True), (2_940_001, False), (3_059_999, False), (3_060_000, True), (375_000, True),
        (374_999, False), (24_000_000, True), (24_000_001, False), (3_000_000, False), (1, False),
    ],
)  # fmt: skip
def test_a_wrong_rate_is_two_percent_off_at_least_and_eight_times_at_most(rate, fits):
    bus = Wired(1).bus
    if fits:
        rewiring.check_rate(bus, rate, "here")
    else:
        with pytest.raises(UserError, match=f"^here: {rate} bit/s must be 2% off 3000000 at least"):
            rewiring.check_rate(bus, rate, "here")


def test_another_rate_takes_a_reset_which_ends_what_waits():
    wired = Wired(2)
    bus = wired.bus
    wired.send(0, 1)
    wired.send(1, 2)
    bus.advance(1_000)
    rewiring.set_rate_of(bus, 1, 1_000_000, 2_000)
    assert wired.of(1, "done") == [(2_000, 1, TX_ABORTED)] and bus.counters.aborted == 1
    assert bus.bit_level.machines[1].own_rate == 1_000_000 and bus.bit_level.machines[0].own_rate == 0
    assert (bus.nodes[1].mode, bus.joining, bus.operating) == (JOINING, 1, 1)
    rewiring.set_rate_of(bus, 1, 0, 3_000)  # the bus's own, in any way
    assert bus.bit_level.machines[1].own_rate == 0 and bus.joining == 1
    bus.set_mode(1, RESET, 4_000)
    bus.advance(5_000)
    rewiring.set_rate_of(bus, 1, 6_000_000, 6_000)
    assert (bus.nodes[1].mode, bus.joining) == (RESET, 0)  # off it stays off
    with pytest.raises(UserError, match=r"^bus can1, n1: 3000001 bit/s"):
        rewiring.set_rate_of(bus, 1, 3_000_001, 6_000)


@pytest.mark.parametrize("mode", [RESET, BUS_OFF])
def test_a_node_that_is_off_stays_off_on_the_far_side_of_a_cut(mode):
    wired = Wired(3)
    bus = wired.bus
    if mode == RESET:
        bus.set_mode(2, RESET, 0)
        bus.advance(0)
    else:
        bus.nodes[2].transmit_errors = 248
        bus.inject_errors(1)
        wired.send(2, 1)
        bus.advance(MS)
    assert bus.nodes[2].mode == mode
    cut = rewiring.Cut(bus, 2)
    far = cut.part(2 * MS)
    assert (far.nodes[0].mode, bus.nodes[2].mode, far.operating) == (mode, UNPLUGGED, 0)
    assert (far.name, far.bitrate, far.log.capacity) == ("can1 behind the cut", RATE, 0)
    assert (far.nodes[0].name, far.nodes[0].order, far.nodes[0].controller) == ("n2", bus.nodes[2].order, 1)
    assert far.nodes[0].transmit_errors == bus.nodes[2].transmit_errors
    far.set_mode(0, OPERATING, 3 * MS)
    far.advance(SECOND)
    assert far.nodes[0].mode == OPERATING and far.operating == 1
    cut.mend(SECOND)
    bus.advance(2 * SECOND)
    assert (far.nodes[0].mode, bus.nodes[2].mode, bus.operating) == (UNPLUGGED, OPERATING, 3)
    assert far.operating == 0 and far.joining == 0


# ---- a state machine begins


def test_a_machine_begins_off_the_bus_and_drives_nothing():
    machine = MediumAccess(fresh())
    names = (
        "state", "count", "begun", "left", "position", "stuff_run", "register", "identifier", "flags", "lo", "hi",
        "arbitration_bits", "capture", "met", "own_rate", "own_bit", "own_rest", "sending", "failed", "after_error",
        "unacknowledged", "unheeded",
    )  # fmt: skip
    assert {name: getattr(machine, name) for name in names} == dict.fromkeys(names, 0)
    assert (machine.driven, machine.run_level, machine.stuff_level, machine.field) == (1, 1, 1, 18)
    assert (machine.row, machine.offered, machine.bits) == (-1, -1, [])


AWAY, JOINS, IDLE, SUSPENDED = 0, 1, 2, 10


@pytest.mark.parametrize(
    ("changes", "bit", "free_bit", "place"),
    [
        ({"mode": OPERATING}, 500, 400, (IDLE, 0)),
        ({"mode": OPERATING, "suspend_bit": 500}, 500, 492, (IDLE, 0)),
        ({"mode": OPERATING, "suspend_bit": 501}, 500, 493, (SUSPENDED, 7)),
        ({"mode": OPERATING, "suspend_bit": 508}, 500, 500, (SUSPENDED, 0)),
        ({"mode": RESET}, 500, 400, (AWAY, 0)),
        ({"mode": BUS_OFF}, 500, 400, (AWAY, 0)),
        ({"mode": UNPLUGGED}, 500, 400, (AWAY, 0)),
        # recessive bits of a sequence that have been seen: from eleven before the bus was free, or since it waits
        ({"mode": JOINING, "join_from": 0}, 500, 500, (JOINS, 0)),
        ({"mode": JOINING, "join_from": 0}, 503, 500, (JOINS, 3)),
        ({"mode": JOINING, "join_from": 495}, 500, 500, (JOINS, 5)),
        ({"mode": JOINING, "join_from": 495}, 510, 500, (JOINS, 4)),
        ({"mode": JOINING, "join_from": 505}, 500, 500, (JOINS, 0)),
    ],
)
def test_the_state_of_a_machine_on_an_idle_bus(changes, bit, free_bit, place):
    machine = MediumAccess(fresh(**changes))
    machine.sending = machine.failed = True
    machine.row = machine.offered = 8
    machine.field, machine.count = 3, 99
    machine.place(bit, free_bit)
    assert (machine.state, machine.count) == place
    assert (machine.sending, machine.failed, machine.row, machine.offered, machine.field) == (False, False, -1, -1, 18)


@pytest.mark.parametrize(
    "frame",
    [
        oracle.Frame(0x2AB, b"\x55\x12\xfe", buffer=1),
        oracle.Frame(0x000, bytes(8), buffer=1),
        oracle.Frame(0x7FF, b"\xff" * 5, buffer=1),
        oracle.Frame(0x1F0F0F0F, b"\1\2\3\4\5\6\7", extended=True, buffer=1),
        oracle.Frame(0x123, b"", remote=True, length=5, buffer=1),
        oracle.Frame(0x00ABCDEF, b"", extended=True, remote=True, length=8, buffer=1),
    ],
)
def test_a_machine_reads_the_frame_that_passes(frame):
    bits = oracle.stuffed(frame)[0] + [1] + [0] + [1] * 8  # acknowledged by another node
    machine = MediumAccess(fresh())
    machine.place(50, 50)
    met = [machine.sample(bit, 50 + n) for n, bit in enumerate(bits)]
    assert met == [0] * (len(bits) - 2) + [1, 0]  # MET_RECEIVED in the last bit but one
    assert (machine.identifier, machine.flags) == (frame.identifier, comparison.flags_of(frame))
    assert (machine.lo, machine.hi) == comparison.words(frame.data)
    assert (machine.begun, machine.position, machine.register) == (50, len(bits), 0)
    assert [machine.sample(1, 50 + len(bits) + n) for n in range(3)] == [0, 0, 0] and machine.state == IDLE


def test_a_recording_of_an_error_frame_begins_at_its_frame_and_names_its_sender():
    wired = Wired(3)
    rows = []
    wired.bus.log.times = FrameTimes()
    wired.bus.log.times.sink = lambda _time, block: rows.extend(memoryview(block).cast("B").cast("q").tolist())
    delimiter = length(0x10, bytes(8)) - 10
    wired.bus.inject_errors(1, delimiter)
    wired.send(1, 0x10, time=1_000, buffer=2)
    wired.bus.advance(SECOND)
    wired.bus.log.times.flush()
    error, good = rows[:7], rows[7:]
    begun, end = 4, 4 + delimiter + 1 + 6 + 8
    sender = (1 + 1) << 16
    assert error == [edge(begun), edge(begun), edge(end), 0x10, sender | 8 | FLAG_ERROR, 24, delimiter]
    again = end + 3
    assert good == [
        edge(again),
        1_000,
        edge(again + length(0x10, bytes(8))),
        0x10,
        sender | 2 << TIMES_BUFFER_SHIFT | 8,
        0,
        0,
    ]


# ---- refusals


@pytest.mark.parametrize(
    ("identifier", "flags", "words"),
    [
        (0x7FF, 0, ""),
        (0x800, 0, "identifier 2048 does not fit in 11 bits"),
        (-1, 0, "identifier -1 does not fit in 11 bits"),
        (0x1FFFFFFF, FLAG_EXTENDED, ""),
        (0x20000000, FLAG_EXTENDED, "identifier 536870912 does not fit in 29 bits"),
        (-1, FLAG_EXTENDED, "identifier -1 does not fit in 29 bits"),
        (1, 15 | FLAG_REMOTE | FLAG_SINGLE_SHOT, ""),
        (1, 8 | 0x80, "flags 0x88 of identifier 0x1 cannot be sent"),
        (1, 8 | 0x100, "identifier 0x1: this bus is classic CAN, without a data bit rate"),
        (1, 8 | 0x800, "flags 0x808 of identifier 0x1 cannot be sent"),
    ],
)
def test_identifiers_and_flags_have_limits(identifier, flags, words):
    wired = Wired(2)
    if not words:
        assert wired.send(0, identifier, flags=flags)
        return
    with pytest.raises(ValueError, match=f"^bus can1: {words}$"):
        wired.send(0, identifier, flags=flags)
    assert wired.bus.buffers.waiting_count == 0 and wired.bus.next_time == NEVER


@pytest.mark.parametrize(
    ("node", "buffer", "words"),
    [
        (2, 1, "node 2"),
        (-1, 1, "node -1"),
        (0, 0, "transmit buffer 0 is"),
        (0, 4, "transmit buffer 4 is"),
        (2, 4, "node 2"),
    ],
)
def test_only_buffers_that_exist_are_asked(node, buffer, words):
    with pytest.raises(ValueError, match=f"^bus can1: {words}"):
        Wired(2).send(node, 1, buffer=buffer)


@pytest.mark.parametrize(
    ("node", "mode", "words"), [(2, 0, "node 2"), (-1, 0, "node -1"), (0, 2, "mode 2"), (0, -1, "mode -1")]
)
def test_only_nodes_and_modes_that_exist_are_set(node, mode, words):
    bus = Wired(2).bus
    with pytest.raises(ValueError, match=f"^bus can1: {words}"):
        bus.set_mode(node, mode, 0)
    assert bus.next_time == NEVER


@pytest.mark.parametrize(
    ("code", "lo", "hi"),
    [
        (0, 0, 0),
        (1, 0x88, 0),
        (2, 0x7788, 0),
        (3, 0x667788, 0),
        (4, 0xFF667788, 0),
        (5, 0xFF667788, 0x44),
        (7, 0xFF667788, 0x223344),
        (8, 0xFF667788, 0x11223344),
    ],
)
def test_a_frame_carries_the_bytes_of_its_length_and_of_words_the_low_half(code, lo, hi):
    wired = Wired(2)
    wired.send(0, 1, flags=code, lo=0x1_FF66_7788, hi=0x5_1122_3344)
    wired.bus.advance(SECOND)
    assert wired.of(1, "rx")[0][2:] == (code, lo, hi)
