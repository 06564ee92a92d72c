"""Clients of a bus, event by event: how frames are laid into three buffers, what is reported, who is seen off."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.taps import (
    DROPPED,
    ERROR_ACTIVE,
    ERROR_PASSIVE,
    FULL,
    LISTENING,
    NOT_ON_BUS,
    OFF,
    QUEUED,
    RECEIVED,
    SENT,
    STATE,
    Tap,
    Taps,
    overflow_frame,
    taps_of,
)
from ranger_sim.can_bus.node import BUS_OFF, OPERATING, RESET
from ranger_sim.foundation.events import (
    FLAG_ERROR,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    NEVER,
    STAGE_BUS,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from tests.examples import examples

from . import bit_oracle as oracle

MS = 1_000_000
PROTOCOL, ACK, BUSERROR, COUNTERS, CONTROLLER, OFF_CLASS = 0x8, 0x20, 0x80, 0x200, 0x4, 0x40  # linux/can/error.h


def placed(count=1, depth=64):
    """A bus of 1 Mbit/s with clients alone, at 1 us, and the list of what they asked the bus for."""
    bus = Bus("can1", 1_000_000)
    taps = Taps(bus, depth)
    taps.poll(1_000)
    return taps, [taps.add(f"client {number}") for number in range(count)]


def buffers_of(tap):
    """{buffer: identifier} of what lies in the controller, as far as the client knows."""
    return {buffer: frame[0] for buffer, _, frame in tap.loaded}


def run(taps, until, step=20_000):
    for now in range(taps.time, until + 1, step):
        taps.bus.advance(now)
        taps.poll(now)


# ---- into the buffers


@pytest.mark.parametrize(
    ("identifiers", "buffers"),
    [
        # the controller sends the lowest field first, whatever its buffer; of equal ones the lowest buffer
        ([5], {1: 5}),
        ([5, 6, 7, 8], {1: 5, 2: 6, 3: 7}),
        ([5, 5, 5, 5], {1: 5, 2: 5, 3: 5}),
        ([5, 4], {1: 5}),  # it would overtake
        ([5, 5, 4, 9], {1: 5, 2: 5}),
        ([5, 9, 9], {1: 5, 2: 9, 3: 9}),
        ([0, 0x7FF, 0x7FF], {1: 0, 2: 0x7FF, 3: 0x7FF}),
    ],
)
def test_frames_are_loaded_as_far_as_that_keeps_their_order(identifiers, buffers):
    taps, (tap, _) = placed(2)
    for identifier in identifiers:
        assert tap.offer(identifier, 0, 0, 0) == QUEUED
    tap.poll(1_000)
    assert buffers_of(tap) == buffers
    assert [entry[0] for entry in tap.loaded] == list(buffers)
    assert [frame[0] for frame in tap.waiting] == identifiers[len(buffers) :]
    assert tap.queued == len(identifiers) and taps.queued


def test_equal_fields_take_a_buffer_above_the_one_before_or_wait():
    taps, (tap, _) = placed(2)
    for identifier in (1, 5, 5):
        tap.offer(identifier, 0, 0, 0)
    tap.poll(1_000)
    assert buffers_of(tap) == {1: 1, 2: 5, 3: 5}
    run(taps, 81_000)  # 47 bits and stuff bits for each frame: the first is through
    tap.offer(5, 0, 0, 0)
    tap.offer(6, 0, 0, 0)
    tap.poll(taps.time)
    assert tap.sent == 1
    assert buffers_of(tap) == {2: 5, 3: 5}  # buffer 1 is free, but would go before them
    assert [frame[0] for frame in tap.waiting] == [5, 6]
    run(taps, 400_000)
    assert [event[2] for event in tap.events if event[0] == SENT] == [1, 5, 5, 5, 6]


def test_a_greater_field_takes_the_lowest_buffer_that_is_free():
    taps, (tap, _) = placed(2)
    for identifier in (1, 5, 6):
        tap.offer(identifier, 0, 0, 0)
    run(taps, 81_000)
    tap.offer(7, 0, 0, 0)
    tap.poll(taps.time)
    assert buffers_of(tap) == {1: 7, 2: 5, 3: 6}
    assert tap.sent == 1


@pytest.mark.parametrize(
    ("first", "second", "waits"),
    [
        ((5, 0), (5, FLAG_REMOTE), False),  # the remote frame loses, so it may lie beside
        ((5, FLAG_REMOTE), (5, 0), True),
        ((5 << 18, FLAG_EXTENDED), (5, 0), True),  # a standard frame wins against the same first eleven bits
        ((5, 0), (5 << 18, FLAG_EXTENDED), False),
        ((5, 8), (5, 0), False),  # lengths are not in the field
    ],
)
def test_what_would_overtake_is_judged_by_the_whole_arbitration_field(first, second, waits):
    taps, (tap, _) = placed(2)
    for identifier, flags in (first, second):
        tap.offer(identifier, flags, 0, 0)
    tap.poll(1_000)
    assert len(tap.waiting) == int(waits)
    run(taps, MS)
    assert [event[2:4] for event in tap.events] == [first, second]


frames = st.tuples(st.integers(0, 6), st.sampled_from([0, 3, FLAG_REMOTE, FLAG_EXTENDED, FLAG_EXTENDED | FLAG_REMOTE]))


@settings(max_examples=examples(40))
@given(st.lists(st.tuples(frames, st.integers(0, 400_000)), max_size=25))
def test_whatever_is_offered_whenever_leaves_in_that_order(offers):
    taps, (tap, other) = placed(2)
    for (identifier, flags), pause in offers:
        tap.offer(identifier << (18 if flags & FLAG_EXTENDED else 0), flags, 0, 0)
        run(taps, taps.time + pause)
    run(taps, taps.time + 8 * MS)
    reported = [
        (identifier >> (18 if flags & FLAG_EXTENDED else 0), flags) for _, _, identifier, flags, _, _ in tap.events
    ]
    assert reported == [frame for frame, _ in offers]
    assert [event[2:] for event in other.events] == [event[2:] for event in tap.events]
    assert {event[0] for event in tap.events} <= {SENT} and {event[0] for event in other.events} <= {RECEIVED}
    assert (tap.sent, tap.received, other.received, tap.queued) == (len(offers), 0, len(offers), 0)


def test_a_place_has_space_for_its_depth_of_frames_on_their_way_and_waiting():
    _, (tap,) = placed(1, depth=5)
    assert [tap.offer(n, 0, 0, 0) for n in range(6)] == [QUEUED] * 5 + [FULL]
    tap.poll(1_000)
    assert (len(tap.loaded), len(tap.waiting), tap.queued) == (3, 2, 5)
    assert tap.offer(9, 0, 0, 0) == FULL


def test_nothing_is_loaded_while_the_controller_is_off_the_bus():
    for mode in (RESET, BUS_OFF):
        _, (tap,) = placed()
        tap.controller.mode = mode
        tap.offer(1, 0, 0, 0)
        tap.poll(2_000)
        assert not tap.loaded and len(tap.waiting) == 1


# ---- what is told


@pytest.mark.parametrize(
    ("status", "kind", "sent", "dropped"),
    [(TX_SENT, SENT, 1, 0), (TX_ABORTED, DROPPED, 0, 1), (TX_LOST, DROPPED, 0, 1)],
)
@pytest.mark.parametrize("buffer", [1, 2, 3])
def test_the_end_of_each_buffers_frame_is_reported_with_that_frame(status, kind, sent, dropped, buffer):
    _, (tap,) = placed()
    given_frames = [(n, 2, 7 * n, n) for n in (1, 2, 3)]
    for frame in given_frames:
        tap.offer(*frame)
    tap.poll(1_000)
    tap._done(5_000, buffer, status)
    assert tap.events == [(kind, 5_000, *given_frames[buffer - 1])]
    assert (tap.sent, tap.dropped) == (sent, dropped)
    assert [entry[0] for entry in tap.loaded] == [n for n in (1, 2, 3) if n != buffer]
    tap._done(6_000, buffer, status)  # told twice: nothing of ours
    assert len(tap.events) == 1


def test_a_frame_arrives_as_it_was_sent_at_the_time_of_its_last_but_one_bit():
    taps, (sender, receiver) = placed(2)
    words = (0x1ABCDEF0, 5 | FLAG_EXTENDED, 0x04030201, 0x05)
    sender.offer(*words)
    run(taps, 300_000)
    bits = len(oracle.stuffed(oracle.Frame(0x1ABCDEF0, b"\1\2\3\4\5", extended=True))[0]) + 10
    # asked for at 1 us, which is the edge of bit 1: it begins with bit 2
    assert receiver.events == [(RECEIVED, (2 + bits - 1) * 1000, *words)]
    assert sender.events == [(SENT, (2 + bits) * 1000, *words)]


def test_what_has_not_come_by_now_is_left_for_later():
    taps, (sender, receiver) = placed(2)
    sender.offer(1, 0, 0, 0)
    sender.poll(1_000)
    taps.bus.advance(40_000)  # the frame is decided, and has 44 bits and stuff bits
    due = taps.poll(40_000)
    assert not receiver.events and 40_000 < due < NEVER
    assert taps.poll(due - 1) == due and not receiver.events
    taps.poll(due)
    assert len(receiver.events) == 1
    assert taps.poll(due + 2_000) == NEVER and len(sender.events) == 1


def error(event):
    """(classes, bytes) of an error frame sent to a client."""
    kind, _, classes, flags, low, high = event
    assert (kind, flags) == (RECEIVED, 8 | FLAG_ERROR)
    return classes, struct.pack("<II", low, high)


def test_a_lone_client_gets_a_report_of_each_missing_acknowledgement_until_it_is_passive():
    taps, (tap,) = placed()
    tap.offer(1, 0, 0, 0)
    run(taps, 6 * MS)
    assert tap.state == ERROR_PASSIVE and tap.counters == (128, 0) and tap.controller.retries > 20
    reported = [each for each in tap.events if each[0] == RECEIVED]
    states = [each[2:] for each in tap.events if each[0] == STATE]
    assert [kind for kind, *_ in tap.events] == [RECEIVED, STATE] * 16
    assert states == [(int(n == 16), 8 * n, 0, 0) for n in range(1, 17)]
    for n, each in enumerate(reported, 1):
        classes, data = error(each)
        crossed = {12: 0x08, 16: 0x20}.get(n, 0)  # transmit warning at 96, passive at 128
        assert classes == ACK | BUSERROR | COUNTERS | (CONTROLLER if crossed else 0)
        assert data == bytes([0, crossed, 0, 25, 0, 0, 8 * n, 0])  # 25: the ACK slot
    assert [a[1] for a in reported] == [b[1] for b in tap.events if b[0] == STATE]


def test_bus_off_drops_what_waits_and_activating_brings_an_empty_controller_back():
    taps, (tap, _) = placed(2)
    for n in range(6):
        tap.offer(n, 0, n, 0)
    tap.poll(1_000)
    tap.controller.transmit_errors = 248
    tap.controller.passive = tap.controller.warning = True
    taps.bus.inject_errors(1, 30)
    run(taps, MS)
    assert (tap.state, tap.off, tap.counters[1]) == (OFF, True, 0)
    assert tap.queued == 0 and tap.dropped == 6 and tap.sent == 0
    dropped = [each[2:] for each in tap.events if each[0] == DROPPED]
    assert sorted(dropped) == [(n, 0, n, 0) for n in range(6)]
    [state] = [each for each in tap.events if each[0] == STATE]
    assert state[2:] == (OFF, 127, 0, 0)  # the counter of a controller that is off stands at 127
    [reported] = [each for each in tap.events if each[0] == RECEIVED]
    assert error(reported)[0] & OFF_CLASS
    assert tap.offer(1, 0, 0, 0) == NOT_ON_BUS
    tap.listen(taps.time)  # not now
    assert not tap.silent and tap.controller.mode == BUS_OFF
    tap.events.clear()
    run(taps, 3 * MS)
    assert tap.events == []  # nobody asked
    tap.activate(taps.time)
    begun = taps.time
    run(taps, 6 * MS)
    assert tap.controller.mode == OPERATING and tap.state == ERROR_ACTIVE and tap.counters == (0, 0)
    [back, state] = tap.events
    assert error(back) == (0x100 | COUNTERS, bytes(8)) and state == (STATE, back[1], ERROR_ACTIVE, 0, 0, 0)
    assert begun + 128 * 11 * 1_000 <= back[1] <= begun + (128 * 11 + 2) * 1_000
    assert tap.offer(1, 0, 0, 0) == QUEUED
    run(taps, 7 * MS)
    assert tap.sent == 1


@pytest.mark.parametrize(
    ("counters", "off", "silent", "state"),
    [
        ((127, 127), False, False, ERROR_ACTIVE),
        ((128, 0), False, False, ERROR_PASSIVE),
        ((0, 128), False, False, ERROR_PASSIVE),
        ((128, 128), False, True, LISTENING),
        ((0, 0), False, True, LISTENING),
        ((0, 0), True, True, OFF),
    ],
)
def test_the_state_is_off_before_listening_before_passive(counters, off, silent, state):
    _, (tap,) = placed()
    tap.counters, tap.off, tap.silent = counters, off, silent
    assert tap.state == state
    tap.report_state(9)
    assert tap.events == [(STATE, 9, state, *counters, 0)]
    assert (tap.offer(1, 0, 0, 0) == NOT_ON_BUS) == (off or silent)


def test_a_status_is_reported_once_and_only_when_something_in_it_is_new():
    _, (tap,) = placed()
    tap._status(1, 0, 3, 0, False)  # counters alone: a state, no error frame
    assert tap.events == [(STATE, 1, ERROR_ACTIVE, 3, 0, 0)]
    tap._status(2, 0x80, 3, 0, False)
    assert len(tap.events) == 1
    tap._status(3, 0x4, 3, 96, False)
    assert [each[0] for each in tap.events] == [STATE, RECEIVED, STATE]
    assert tap.counters == (3, 96)
    tap._status(4, 0x4, 3, 96, True)  # bus-off alone is news too
    assert [each[0] for each in tap.events][3:] == [RECEIVED, STATE] and tap.off


def test_a_missing_stretch_is_an_error_frame_of_a_controller_that_overflowed():
    assert error(overflow_frame(77)) == (CONTROLLER, bytes([0, 1, 0, 0, 0, 0, 0, 0])) and overflow_frame(77)[1] == 77


# ---- wishes


def test_a_client_that_begins_to_listen_drops_its_queue_and_acknowledges_no_more():
    taps, (tap, other) = placed(2)
    for n in range(5):
        tap.offer(n, 0, 0, 0)
    tap.poll(1_000)
    tap.listen(1_000)
    tap.listen(1_000)  # once more: nothing
    run(taps, MS)
    assert (tap.state, tap.dropped, tap.queued) == (LISTENING, 5, 0)
    assert [each[0] for each in tap.events] == [DROPPED, DROPPED, STATE, DROPPED, DROPPED, DROPPED]
    assert [each[2] for each in tap.events if each[0] == DROPPED] == [3, 4, 0, 1, 2]
    assert taps.bus.operating == 1 and tap.controller.silent
    other.offer(9, 0, 0, 0)
    run(taps, 2 * MS)
    assert other.sent == 0 and other.counters[0] > 0
    tap.events.clear()
    tap.activate(taps.time)
    assert tap.events == [(STATE, taps.time, ERROR_ACTIVE, *tap.counters, 0)] and not tap.controller.silent
    assert taps.bus.operating == 2
    run(taps, 4 * MS)
    got = [each[2] for each in tap.events if each[0] == RECEIVED and not each[3] & FLAG_ERROR]
    assert other.sent == 1 and got == [9]
    reported = len(tap.events)
    tap.activate(taps.time)  # takes part already: nothing
    assert len(tap.events) == reported and tap.controller.mode == OPERATING


def test_flushing_completes_what_is_under_way():
    taps, (tap, _) = placed(2)
    for n in range(5):
        tap.offer(n, 0, 0, 0)
    run(taps, 40_000)  # the first one is being sent
    tap.flush(taps.time)
    assert [each[2] for each in tap.events] == [3, 4]
    run(taps, 500_000)
    assert [(each[0], each[2]) for each in tap.events] == [
        (DROPPED, 3), (DROPPED, 4), (DROPPED, 1), (DROPPED, 2), (SENT, 0),
    ]  # fmt: skip


def test_a_client_that_leaves_is_off_the_bus_and_its_place_is_kept_for_the_next():
    taps, (first, second, third) = placed(3)
    first.listen(1_000)
    taps.remove(first)
    assert not first.controller.silent and not first.silent
    second.controller.mode = BUS_OFF
    second.off = True
    taps.bus.acknowledging -= 1
    taps.remove(second)
    assert second.controller.mode == RESET  # not owed a recovery: the next client is another controller
    run(taps, 100_000)
    assert first.controller.mode == RESET and taps.taps == [third] and taps.spare == [first, second]
    assert taps.add("fourth") is first and taps.spare == [second]
    assert taps.add("fifth") is second and taps.spare == []
    new = taps.add("sixth")
    assert new.node == 3 and new.controller.name == "sixth" and new.depth == taps.depth
    run(taps, 200_000)
    assert {each.controller.mode for each in taps.taps} == {OPERATING} and taps.bus.operating == 4


def test_a_place_whose_controller_is_not_off_yet_is_not_given_away():
    taps, (first, _) = placed(2)
    taps.remove(first)  # its reset is carried out when time passes
    assert first.controller.mode == OPERATING
    assert taps.add("next") is not first
    assert taps.spare == [first]


def test_a_client_that_left_still_sends_without_receiving_until_all_is_sent_or_no_node_receives():
    taps, (leaver, other) = placed(2)
    for n in range(4):
        leaver.offer(n, 0, 0, 0)
    taps.remove(leaver)
    assert not leaver.controller.listening and leaver.leaving and taps.leaving == 1
    assert leaver.leave_by == 1_000 + 1_000_000_000
    other.offer(9, 0, 0, 0)
    run(taps, MS)
    assert [each[2] for each in other.events if each[0] == RECEIVED] == [0, 1, 2, 3]
    assert (leaver.received, leaver.events, taps.leaving, taps.taps) == (0, [], 0, [other])
    taps, (leaver, other) = placed(2)
    leaver.offer(1, 0, 0, 0)
    taps.remove(leaver)
    other.listen(taps.time)  # nobody acknowledges any more
    taps.poll(taps.time)
    assert taps.taps == [other] and taps.leaving == 0
    taps.remove(leaver)  # not there any more: nothing
    assert taps.leaving == 0 and taps.spare == [leaver]


def test_places_of_a_bus_are_made_once():
    bus = Bus("can1", 1_000_000)
    made, mine = taps_of(bus)
    assert isinstance(made, Taps) and mine and made.bus is bus
    assert taps_of(made) == (made, False)


def test_frames_wait_in_taps_while_any_client_has_one():
    taps, (first, second) = placed(2)
    assert not taps.queued
    second.offer(1, 0, 0, 0)
    assert taps.queued
    second.poll(1_000)
    assert taps.queued and not second.waiting
    run(taps, MS)
    assert not taps.queued and not first.queued


def test_a_tap_comes_last_at_each_time_on_its_bus():
    """Boards' controllers have orders of STAGE_BUS * 256 and their number; a client comes behind all of them."""
    bus = Bus("can1", 1_000_000)
    bus.add_node("board", EventQueue(8), 1, STAGE_BUS * 256)
    tap = Tap(bus, "client")
    bus.request(0, 1, 0, 1, 0, 0, 0)
    bus.advance(MS)
    assert tap.inbox.take() and tap.inbox.order == STAGE_BUS * 256 + 255
