"""Error frames, counters, error passive, bus-off and the way back."""

import pytest

from ranger_sim.can_bus import node as can_node
from ranger_sim.can_bus.frame import FIELD_ACK_SLOT, FIELD_CRC_DELIMITER, FIELD_ID_28_21, frame_bits
from ranger_sim.can_bus.node import BUS_OFF, JOINING, OPERATING, RESET
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_SINGLE_SHOT, TX_ABORTED, TX_LOST, TX_SENT

from .wiring import Wired, edge

SECOND = 10**9
EI = can_node.ICR_ERROR_WARNING
EPI = can_node.ICR_ERROR_PASSIVE
BEI = can_node.ICR_BUS_ERROR
RECEIVING = can_node.ICR_RECEIVING


def test_a_corrupted_frame_is_repeated_and_received_once():
    wired = Wired(3)
    wired.bus.inject_errors(1)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    assert [frame[1:4] for frame in wired.of(1, "rx")] == [(0x10, 8, 7)]
    counters = wired.bus.counters
    assert (counters.errors, counters.retries, counters.frames, counters.lost) == (1, 1, 1, 0)
    assert [status for *_, status in wired.of(0, "done")] == [TX_SENT]


def test_the_repetition_is_logged_at_its_last_bit_and_lost_once_without_a_receiver():
    wired = Wired(2)
    wired.bus.nodes[1].listening = False
    wired.bus.inject_errors(1)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    [(ended, _, status)] = wired.of(0, "done")
    _error, frame = wired.log()
    bit = next(number for number in range(1000) if edge(number) == ended)  # the bit behind the frame
    assert status == TX_SENT and frame[:2] == (edge(bit - 1), 0x10)
    assert wired.bus.counters.lost == 1


def test_an_error_costs_the_sender_eight_and_a_receiver_one_and_success_pays_one_back():
    wired = Wired(2)
    wired.bus.inject_errors(1)
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)
    sender = wired.of(0, "status")
    receiver = wired.of(1, "status")
    assert [status[2:4] for status in sender] == [(8, 0), (7, 0)]
    assert [status[2:4] for status in receiver] == [(0, 1), (0, 0)]
    assert sender[0][1] & BEI and not sender[0][1] & RECEIVING
    assert receiver[0][1] & BEI and receiver[0][1] & RECEIVING
    assert sender[1][1] == 0


def test_the_length_of_an_error_frame_depends_on_what_receivers_have_seen():
    # frame 0x555 without stuffing in its identifier: 0 10101010101 0 0 0 ...; one error, then the repetition
    def taken_by_error(position, identifier=0x555, lo=0, hi=0):
        wired = Wired(2)
        wired.bus.inject_errors(1, position)
        wired.send(0, identifier, lo=lo, hi=hi)
        wired.bus.advance(SECOND)
        return wired.bus.load.bits - frame_bits(identifier, 8, lo, hi) - 3

    # data begins behind 0 10101010101 0 0 0 1000 0...: bits 19 ... hold AA AA AA, alternating
    alternating = {"lo": 0xAAAAAAAA, "hi": 0xAAAAAAAA}
    # bit 30 is 0 in 0101: false, it is recessive, so six dominant bits of the flag must pass first
    for position in (29, 30):
        bits = "0" + f"{0x555:011b}" + "000" + "1000" + "10" * 32
        sent = bits[position]
        # a false recessive bit: 6 flag bits seen by receivers, 6 of theirs; a false dominant one joins its
        # dominant neighbour: the receivers have seen two already, 4 more, then 6 of theirs
        flags = 12 if sent == "0" else 10
        assert taken_by_error(position, **alternating) == position + 1 + flags + 8 + 3
    # behind the CRC everybody notices at once
    bits = frame_bits(0x555, 8, 0, 0)
    assert taken_by_error(bits - 10) == bits - 10 + 1 + 6 + 8 + 3
    # the sixth bit of EOF is the last at which receivers reject
    assert taken_by_error(bits - 2) == bits - 2 + 1 + 6 + 8 + 3
    # in the last one their overload flags meet the sender's error flag
    assert taken_by_error(bits - 1) == bits + 6 + 8 + 3
    # a false recessive start of frame, at which all who do not send see an idle bus
    assert taken_by_error(0) == 1 + 6 + 6 + 8 + 3
    # a false dominant bit of the identifier: its sender falls silent, and all see six recessive bits behind it
    assert taken_by_error(3) == 4 + 6 + 6 + 8 + 3
    # on the idle bus behind the frame a false start of frame, with six recessive bits behind it
    assert taken_by_error(bits + 50) == 1 + 6 + 6 + 8 + 3


def test_the_error_is_reported_at_its_bit_and_logged_at_its_end():
    wired = Wired(2)
    bits = frame_bits(0x10, 8, 0, 0)
    wired.bus.inject_errors(1, bits - 10)
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)
    start = 1
    assert wired.of(0, "status")[0][0] == edge(start + bits - 9)
    error, frame = wired.log()
    assert error == (
        edge(start + bits - 9 + 14), 0x10, 8 | FLAG_ERROR, FIELD_CRC_DELIMITER, bits - 10, 0,
    )  # fmt: skip
    assert frame[2] == 8


def test_an_error_at_a_time_hits_what_is_on_the_bus_then():
    wired = Wired(2)
    wired.bus.inject_error_at(20_000)
    wired.bus.inject_error_at(500_000)  # nothing runs then: a dominant bit is a start of frame to everybody
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)
    wired.send(0, 0x11, time=SECOND)
    wired.bus.advance(2 * SECOND)
    assert wired.bus.counters.errors == 2 and wired.bus.counters.frames == 2
    first, _, second, _ = wired.log()
    assert first[4] == 20_000 * 3 // 1000 - 1  # bit position from the start at bit 1
    # the sixth recessive bit behind it is one too many; nobody sent that frame
    assert second == (edge(1500 + 1 + 6 + 6 + 8), 0, FLAG_ERROR, FIELD_ID_28_21, 6, -1)
    assert [node.receive_errors for node in wired.bus.nodes] == [1, 0]  # a frame received since pays it back
    with pytest.raises(ValueError, match="decided already"):
        wired.bus.inject_error_at(SECOND)


def test_a_bit_of_a_frame_that_is_decided_cannot_be_hit_any_more():
    wired = Wired(2)
    wired.send(0, 0x10)
    wired.bus.advance(1000)
    bits = frame_bits(0x10, 8, 0, 0)
    with pytest.raises(ValueError, match="decided already"):
        wired.bus.inject_error_at(edge(1 + bits + 2))  # the last bit of intermission
    wired.bus.inject_error_at(edge(1 + bits + 3))
    wired.bus.advance(SECOND)
    assert (wired.bus.counters.frames, wired.bus.counters.errors) == (1, 1)


def test_a_single_shot_that_meets_an_error_is_not_repeated():
    wired = Wired(2)
    wired.bus.inject_errors(1)
    wired.send(0, 0x10, flags=8 | FLAG_SINGLE_SHOT)
    wired.bus.advance(SECOND)
    assert [status for *_, status in wired.of(0, "done")] == [TX_LOST]
    counters = wired.bus.counters
    assert (counters.frames, counters.single_shot_skipped, counters.retries) == (0, 1, 0)


def test_an_abort_during_a_failing_attempt_prevents_its_repetition():
    wired = Wired(2)
    wired.bus.inject_errors(1)
    wired.send(0, 0x10)
    wired.bus.advance(5000)
    wired.bus.abort(0, 1, 5000)
    wired.bus.advance(SECOND)
    ((time, buffer, status),) = wired.of(0, "done")
    assert (buffer, status) == (1, TX_ABORTED)
    # the last bit of intermission, where it could have begun again: a dominant one is a start of frame (ISO 11898-1)
    assert time == edge(1 + wired.bus.load.bits - 1)
    assert wired.bus.counters.frames == 0


# ---- acknowledgement -------------------------------------------------------------------------------------


def test_alone_on_the_bus_a_sender_becomes_passive_but_never_goes_bus_off():
    wired = Wired(1)
    wired.send(0, 0x10)
    wired.bus.advance(SECOND // 10)
    node = wired.bus.nodes[0]
    assert (node.transmit_errors, node.passive, node.mode) == (128, True, OPERATING)
    assert wired.bus.counters.frames == 0 and wired.bus.counters.errors > 1000 and wired.bus.buffers.waiting_count == 1
    reported = wired.of(0, "status")
    assert [status[2] for status in reported[:16]] == [8 * n for n in range(1, 17)]
    assert reported[11][1] & EI and reported[15][1] & EPI  # 96, 128
    assert reported[0][1] >> 16 & 31 == FIELD_ACK_SLOT


def test_a_node_that_joins_ends_the_endless_repetition():
    wired = Wired(2)
    wired.bus.set_mode(1, RESET, 0)
    wired.send(0, 0x10, time=10)
    wired.bus.advance(10_000_000)
    assert wired.bus.counters.frames == 0
    wired.bus.set_mode(1, OPERATING, 10_000_000)
    wired.bus.advance(20_000_000)
    assert wired.bus.counters.frames == 1
    assert len(wired.of(1, "rx")) == 1
    assert wired.bus.nodes[0].transmit_errors == 127
    assert not wired.bus.nodes[0].passive


# ---- fault confinement -----------------------------------------------------------------------------------


def frames_until_bus_off(wired):
    wired.bus.inject_errors(1000)
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)


def test_32_errors_in_a_row_make_a_sender_bus_off_and_its_frames_lost():
    wired = Wired(2)
    wired.send(0, 0x20, buffer=2)
    frames_until_bus_off(wired)
    assert wired.bus.counters.errors == 32  # 32 * 8 = 256
    assert wired.bus.nodes[0].mode == BUS_OFF
    messages = wired.messages(0)
    reported = [message[1:] for message in messages if message[0] == "status"]
    done = [message[1:] for message in messages if message[0] == "done"]
    assert [status[4] for status in reported] == [0] * 31 + [1]
    assert reported[11][1] & EI and reported[15][1] & EPI and reported[31][1] & EI
    assert reported[31][2] == 127  # the register of the LPC2194 once it is off
    assert sorted(done) == [(done[0][0], 1, TX_ABORTED), (done[0][0], 2, TX_ABORTED)]
    assert wired.bus.counters.lost == wired.bus.counters.flushed == wired.bus.nodes[0].flushed == 2
    # the receiver counted each error once and is well below its limits
    assert wired.bus.nodes[1].receive_errors == 32
    assert wired.bus.accepted == wired.bus.counters.frames + wired.bus.counters.flushed


def test_a_node_off_the_bus_neither_sends_nor_receives_nor_acknowledges():
    wired = Wired(2)
    frames_until_bus_off(wired)
    wired.bus.inject_errors(0)
    wired.messages(0)
    assert not wired.send(0, 0x11, time=SECOND)
    assert wired.of(0, "done") == [(SECOND, 1, TX_ABORTED)]
    wired.send(1, 0x12, time=SECOND)
    wired.bus.advance(SECOND + SECOND // 100)
    assert wired.messages(0) == []
    assert wired.bus.counters.frames == 0  # nobody acknowledged


def test_bus_off_ends_128_times_11_recessive_bits_after_the_request_on_a_quiet_bus():
    wired = Wired(2)
    frames_until_bus_off(wired)
    wired.bus.inject_errors(0)
    wired.messages(0)
    asked = 2 * SECOND
    wired.bus.set_mode(0, OPERATING, asked)
    wired.bus.advance(asked)
    assert wired.bus.nodes[0].mode == JOINING
    wired.send(0, 0x11, time=asked + 1000)  # held until then
    wired.bus.advance(3 * SECOND)
    start = asked * 3 // 1000 + 1 + 128 * 11
    messages = wired.messages(0)
    assert messages[0] == ("status", edge(start), EI, 0, 0, 0)
    assert messages[1] == ("done", edge(start + frame_bits(0x11, 8, 0, 0)), 1, TX_SENT)
    assert wired.bus.nodes[0].mode == OPERATING


def test_on_a_busy_bus_each_gap_between_frames_counts_once_for_the_recovery():
    wired = Wired(3)
    frames_until_bus_off(wired)
    wired.bus.inject_errors(0)
    asked = 2 * SECOND
    time = asked
    wired.bus.set_mode(0, OPERATING, asked)
    before = wired.bus.counters.frames
    while wired.bus.nodes[0].mode != OPERATING:
        for buffer in (1, 2, 3):  # node 1 fills the bus
            wired.send(1, 0x100 + buffer, time=time, buffer=buffer)
        time += 25_000
        wired.bus.advance(time)
        assert time < 3 * SECOND
    # ACK delimiter, EOF and intermission are 11 recessive bits; the first gap may give more or less
    assert 126 <= wired.bus.counters.frames - before <= 129


def test_a_passive_sender_lets_others_go_first_for_eight_bits():
    def order(passive):
        wired = Wired(3)
        if passive:
            wired.bus.nodes[0].transmit_errors = 200
            wired.bus.nodes[0].passive = wired.bus.nodes[0].warning = True
        wired.send(0, 0x10, buffer=1)
        wired.send(0, 0x11, buffer=2)
        wired.send(1, 0x700, time=5_000)  # waits as long as 0x11 does
        wired.bus.advance(SECOND)
        return [frame[1] for frame in wired.of(2, "rx")], wired.bus

    assert order(False)[0] == [0x10, 0x11, 0x700]
    frames, bus = order(True)
    assert frames == [0x10, 0x700, 0x11]
    assert bus.nodes[0].transmit_errors == 198


def test_a_passive_receiver_is_calmed_to_119_by_one_good_frame():
    wired = Wired(2)
    node = wired.bus.nodes[1]
    node.receive_errors = 130
    node.passive = node.warning = True
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)
    assert node.receive_errors == 119 and not node.passive and node.warning
    assert wired.of(1, "status")[0][1] == EPI


def test_reset_drops_what_waits_and_one_quiet_sequence_brings_back():
    wired = Wired(2)
    wired.send(0, 0x10)
    wired.send(0, 0x11, buffer=2)
    wired.bus.advance(1000)
    wired.bus.set_mode(0, RESET, 2000)
    wired.bus.advance(100_000)
    assert sorted(status for *_, status in wired.of(0, "done")) == [TX_SENT, TX_ABORTED]
    assert wired.bus.counters.aborted == 1
    wired.bus.set_mode(0, OPERATING, 200_000)
    wired.send(0, 0x12, time=200_000)
    wired.bus.advance(200_000)
    wired.send(0, 0x12, time=200_100)
    wired.bus.advance(SECOND)
    assert wired.of(0, "done")[-1] == (edge(601 + 11 + frame_bits(0x12, 8, 0, 0)), 1, TX_SENT)


@pytest.mark.parametrize("others", [0, 1, 2])
def test_two_nodes_with_one_identifier_and_different_data_both_get_through_after_sixteen_errors(others):
    """16 x 8 = 128: then both are passive, and the passive flag of the one that sent recessive destroys nothing."""
    wired = Wired(2 + others)
    wired.send(0, 9, lo=4)
    wired.send(1, 9, lo=5)  # the bit that differs is recessive here
    wired.bus.advance(SECOND)
    counters = wired.bus.counters
    assert (counters.errors, counters.frames, counters.lost) == (17, 2, 0)
    # the sender of the dominant bit: 128, and its frame; the other one failed once more
    assert [node.transmit_errors for node in wired.bus.nodes[:2]] == [128 - 1, 128 + 8 - 1]
    for n in range(2, 2 + others):
        assert [frame[3] for frame in wired.of(n, "rx")] == [4, 5]
        assert wired.bus.nodes[n].receive_errors == 16 - 2  # it never saw the passive flag


# ---- noise -----------------------------------------------------------------------------------------------


def noisy(seed, rate=1e-4):
    wired = Wired(3, seed=seed)
    wired.bus.set_bit_error_rate(rate)
    for frame in range(2000):
        wired.send(frame % 2, 0x100 + frame % 2, time=frame * 100_000, lo=frame)
        wired.bus.advance(frame * 100_000 + 90_000)
    wired.bus.set_bit_error_rate(0.0)
    wired.bus.advance(SECOND)
    return wired


def test_noise_is_seeded_has_the_asked_rate_and_loses_nothing():
    wired = noisy(1)
    # 200 ms are 600,000 bits, and each inverted one ends in an error frame, on the idle bus too: mean 60, standard
    # deviation 7.7; but for those that fall into an error frame or an intermission, 20 bits of about 60 errors: 0.1
    assert 36 <= wired.bus.counters.errors <= 84
    # 2000 frames of about 115 bits are hit with p = 1.1 %: mean 23, standard deviation 4.8; a hit that reads as lost
    # arbitration (6 recessive bits of these identifiers) is no failure
    assert 8 <= wired.bus.counters.retries <= 40
    assert wired.bus.counters.frames == wired.bus.accepted == 2000 and wired.bus.counters.lost == 0
    assert [frame[3] for frame in wired.of(2, "rx")] == list(range(2000))
    assert noisy(1).bus.log.take() == wired.bus.log.take()
    assert noisy(2).bus.log.take() != noisy(1).bus.log.take()


def test_noise_can_be_switched_off_and_its_rate_is_checked():
    wired = noisy(1)
    errors = wired.bus.counters.errors
    wired.bus.set_bit_error_rate(0.0)
    for frame in range(500):
        wired.send(0, 1, time=SECOND + frame * 100_000)
        wired.bus.advance(SECOND + frame * 100_000 + 90_000)
    assert wired.bus.counters.errors == errors
    with pytest.raises(ValueError, match="0.2 is outside"):
        wired.bus.set_bit_error_rate(0.2)


@pytest.mark.parametrize("flags", [8, 5, 1, 0, 8 | FLAG_EXTENDED])
def test_a_frame_that_is_hit_anywhere_is_hit_in_its_middle_or_behind_its_arbitration(flags):
    """The reported bit is the middle one of an odd number of bits, of an even number the one before the middle."""
    lengths = set()
    for lo in range(12):
        wired = Wired(2)
        wired.bus.inject_errors(1)
        wired.send(0, 0x123, flags=flags | FLAG_SINGLE_SHOT, lo=lo * 0x01010101)
        wired.bus.advance(1_000_000)
        (error,) = wired.log()
        bits = frame_bits(0x123, flags, lo * 0x01010101, 0)
        lengths.add(bits % 2)
        behind = 41 if flags & FLAG_EXTENDED else 17
        assert error[4] == max((bits - 1) // 2, behind)
        assert error[2] == flags | FLAG_ERROR
    assert lengths == {0, 1} or flags == 0


def test_what_is_taken_out_of_a_disturbed_bus_is_not_sent_any_more():
    """A frame that met an error and waits to be repeated, and one that has not begun."""
    wired = Wired(3)
    bus = wired.bus
    bus.inject_errors(1)
    wired.send(0, 0x100, lo=1, hi=2)
    wired.send(0, 0x200, buffer=2, lo=3, hi=4)
    wired.send(1, 0x300, buffer=3)
    bus.advance(edge(70))  # in the error frame of the first
    assert bus.disturbed and bus.counters.errors == 1
    assert sorted(bus.take_out(0, edge(70))) == [(1, 0x100, 8, 1, 2), (2, 0x200, 8, 3, 4)]
    bus.recompute_next()
    bus.advance(edge(2000))
    assert [(identifier, node) for _, identifier, flags, _, _, node in wired.log() if not flags & FLAG_ERROR] == [
        (0x300, 1)
    ]
    assert bus.nodes[0].sent == 0 and wired.of(0, "done") == []
    assert wired.send(0, 0x101, time=edge(2000), buffer=1) and wired.send(0, 0x102, time=edge(2000), buffer=2)
    bus.advance(edge(3000))
    assert bus.nodes[0].sent == 2
