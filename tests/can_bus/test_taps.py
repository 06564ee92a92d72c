"""Clients that leave a bus: what they had queued is still sent, for a while, if a node is there to receive it."""

import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.edge.taps import LINGER_NS, Taps, fault_of_frame
from ranger_sim.foundation.events import FLAG_EXTENDED

EIGHT_BYTES = 8


def clients(count):
    taps = Taps(Bus("can1", 1_000_000, 1))
    taps.poll(1_000)
    return taps, [taps.add(f"client {number}") for number in range(count)]


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ((0x7FF, 8, 0xFFFFFFFF, 0xFFFFFFFF), ""),
        ((0x1FFFFFFF, FLAG_EXTENDED, 0, 0), ""),
        ((0x800, 0, 0, 0), "identifier 0x800 is above 0x7ff"),
        ((0x20000000, FLAG_EXTENDED, 0, 0), "identifier 0x20000000 is above 0x1fffffff"),
        ((-1, 0, 0, 0), "identifier -0x1 is above 0x7ff"),
        ((1, 9, 0, 0), "flags 0x9 are not a classic data or remote frame of 0 ... 8 bytes"),
        ((1, 1 << 20, 0, 0), "flags 0x100000 are not a classic data or remote frame of 0 ... 8 bytes"),
        ((1, 8, 1 << 32, 0), "a data word has more than 32 bits"),
        ((1, 8, 0, 1 << 32), "a data word has more than 32 bits"),
        ((1, 8, -1, 0), "a data word has more than 32 bits"),
    ],
)
def test_a_frame_that_cannot_be_sent_is_named_to_the_bit(frame, words):
    assert fault_of_frame(*frame) == words


def test_a_client_that_has_nothing_queued_leaves_at_once():
    taps, (leaver, other) = clients(2)
    taps.remove(leaver)
    assert taps.taps == [other] and taps.leaving == 0


def test_a_client_whose_frames_do_not_go_out_leaves_when_its_time_is_over_and_not_before():
    taps, (leaver, other) = clients(2)
    leaver.offer(0x123, EIGHT_BYTES, 1, 2)  # and the bus stands still
    taps.remove(leaver)
    taps.remove(leaver)  # once more: nothing
    assert taps.taps == [leaver, other] and taps.leaving == 1
    taps.poll(1_000 + LINGER_NS)
    assert taps.taps == [leaver, other]
    taps.poll(1_000 + LINGER_NS + 1)
    assert taps.taps == [other] and taps.leaving == 0 and taps.spare == [leaver]


def test_a_client_that_is_alone_has_no_receiver_and_leaves_at_once():
    taps, (leaver,) = clients(1)
    leaver.offer(0x123, EIGHT_BYTES, 1, 2)
    taps.remove(leaver)
    assert taps.taps == [] and taps.leaving == 0


def test_a_client_that_left_is_gone_when_its_frame_was_sent():
    taps, (leaver, _) = clients(2)
    leaver.offer(0x123, EIGHT_BYTES, 1, 2)
    taps.remove(leaver)
    assert taps.leaving == 1
    now = 1_000
    while taps.leaving and now < 1_000_000:
        now += 20_000
        taps.bus.advance(now)
        taps.poll(now)
    assert taps.leaving == 0 and leaver.sent == 1
    assert 100_000 < now < 200_000  # a frame of 8 bytes at 1 Mbit/s takes 111 bits and stuff bits


def pass_time(taps, until_ns, step_ns=50_000):
    for now in range(taps.time, until_ns + 1, step_ns):
        taps.bus.advance(now)
        taps.poll(now)


def test_a_client_in_the_place_of_another_is_new_under_its_own_name():
    """Node, counters, queue, filters of state: nothing of the one before is left, and a bus has no more nodes."""
    taps, (leaver, other) = clients(2)
    leaver.offer(0x123, EIGHT_BYTES, 1, 2)
    pass_time(taps, 2_000_000)
    assert (leaver.sent, other.received) == (1, 1)
    other.offer(0x124, EIGHT_BYTES, 3, 4)
    pass_time(taps, 4_000_000)
    assert leaver.received == 1 and leaver.events
    leaver.controller.transmit_errors = 9
    leaver.listen(taps.time)
    taps.remove(leaver)
    pass_time(taps, 5_000_000)
    assert taps.spare == [leaver]
    new = taps.add("the next one")
    assert new is leaver and taps.taps == [other, new] and taps.spare == [] and len(taps.bus.nodes) == 2
    assert (new.name, new.controller.name) == ("the next one", "the next one")
    assert (new.sent, new.received, new.dropped, new.counters) == (0, 0, 0, (0, 0))
    assert (new.controller.transmit_errors, new.controller.listening) == (0, True)
    assert not (new.off or new.silent or new.leaving or new.held or new.waiting or new.loaded or new.events)
    pass_time(taps, 7_000_000)
    new.offer(0x125, EIGHT_BYTES, 5, 6)
    other.offer(0x126, EIGHT_BYTES, 7, 8)
    pass_time(taps, 9_000_000)
    assert (new.sent, new.received, other.sent, other.received) == (1, 1, 2, 2)


def test_a_bus_is_full_with_sixteen_clients():
    taps, found = clients(15)
    assert not taps.full
    taps.add("one more")
    assert taps.full
    taps.remove(found[0])
    assert not taps.full
