"""Errors that one node is made to see, frames lost behind a controller, nodes that do not belong, wires that part."""

import pytest

from ranger_sim.can_bus import rewiring, tampering
from ranger_sim.can_bus.frame import frame_bits, wire
from ranger_sim.can_bus.node import BUS_OFF, JOINING, OPERATING, RESET, UNPLUGGED
from ranger_sim.foundation.user_error import UserError

from .wiring import RATE, Wired, edge

SECOND = 10**9
MS = 10**6
BITS_11_128 = 11 * 128


def tampered(tamper, count=3):
    wired = Wired(count)
    tampering.tampering_of(wired.bus).add(tamper)
    return wired


def counters(wired):
    return [(node.transmit_errors, node.receive_errors) for node in wired.bus.nodes]


def once(error, node, of_sender):
    tamper = tampering.Misreading(error, node, of_sender)
    tamper.count = 1
    return tamper


# what the node sees, by the standard's letters: the rest of the bus has a secondary error because of its flag
CASES = [
    # error, sender?, what the others see, TEC of the sender and REC of node 1 when the repetition is through
    ("BIT", True, {"n1": "BIT_STUFFING", "n2": "BIT_STUFFING"}, 8 - 1, 0),
    ("ACK", True, {"n1": "FORM", "n2": "FORM"}, 8 - 1, 0),
    ("BIT", False, {"n0": "BIT", "n2": "FORM"}, 8 - 1, 1 + 8 - 1),
    ("BIT_STUFFING", False, {"n0": "BIT", "n2": "BIT_STUFFING"}, 8 - 1, 1 + 8 - 1),
    ("FORM", False, {"n0": "BIT", "n2": "FORM"}, 8 - 1, 1 + 8 - 1),
    ("CRC", False, {"n0": "BIT", "n2": "FORM"}, 8 - 1, 1 + 8 - 1),
]


@pytest.mark.parametrize(("error", "of_sender", "others", "sender_errors", "receiver_errors"), CASES)
def test_one_node_sees_the_error_first_and_the_others_because_of_its_flag(
    error, of_sender, others, sender_errors, receiver_errors
):
    tamper = once(error, 0 if of_sender else 1, of_sender)
    wired = tampered(tamper)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    first = "n0" if of_sender else "n1"
    assert tamper.seen == {(first, error, "primary"): 1, **{(n, e, "secondary"): 1 for n, e in others.items()}}
    assert counters(wired)[0] == (sender_errors, 0) and counters(wired)[1] == (0, receiver_errors)
    # repeated by its sender, and received once by everybody
    assert (wired.bus.counters.errors, wired.bus.counters.retries, wired.bus.counters.frames) == (1, 1, 1)
    assert [len(wired.of(n, "rx")) for n in (1, 2)] == [1, 1]


def test_a_missing_acknowledgement_costs_eight_and_the_repetition_starts_behind_the_error_frame():
    reported = []
    tamper = once("ACK", 0, True)
    tamper.noted = lambda time, difference: reported.append(time)
    wired = tampered(tamper)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    bits = frame_bits(0x10, 8, 7, 0)
    slot = 1 + bits - 9  # the frame starts at bit 1; the ACK slot is the ninth bit from its end
    # six bits of its flag, one more of the receivers' that begins a bit later; eight of delimiter, three between frames
    again = slot + 1 + 7 + 8 + 3
    assert [time for time, *_ in wired.of(1, "rx")] == [edge(again + bits - 1)]
    assert [status[2] for status in wired.of(0, "status")] == [8, 7]
    assert reported == [edge(slot + 1)]


def test_a_stuff_error_of_the_sender_in_its_arbitration_field_costs_it_nothing():
    # rule (c), exception 2 of ISO 11898-1; 0 00000 is followed by a recessive stuff bit
    tamper = once("BIT_STUFFING", 0, True)
    wired = tampered(tamper)
    wired.send(0, 0x01F)
    wired.bus.advance(SECOND)
    assert tamper.seen["n0", "BIT_STUFFING", "primary"] == 1
    assert [status[2] for status in wired.of(0, "status")] == [0]
    assert wired.bus.counters.frames == 1


def test_a_frame_without_a_recessive_stuff_bit_cannot_show_its_sender_a_stuff_error():
    tamper = once("BIT_STUFFING", 0, True)
    wired = tampered(tamper)
    wired.send(0, 0x555)
    wired.bus.advance(SECOND)
    assert (tamper.tampered, tamper.unfit, wired.bus.counters.errors) == (0, 1, 0)


def test_an_error_flag_that_is_broken_costs_another_eight():
    tamper = once("BROKEN_ERROR_FRAME", 0, True)
    wired = tampered(tamper)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    assert tamper.seen["n0", "BROKEN_ERROR_FRAME", "primary"] == 1
    assert [status[2] for status in wired.of(0, "status")] == [8, 16, 15]  # rule (d)


@pytest.mark.parametrize(("error", "of_sender"), [("FORM", True), ("CRC", True), ("ACK", False)])
def test_what_such_a_node_cannot_see_is_refused_with_the_reason(error, of_sender):
    with pytest.raises(UserError, match=f"{error}: "):
        tampering.Misreading(error, 0, of_sender)


def test_a_crc_error_is_found_by_the_crc_and_by_nothing_before_it():
    for low in (0, 0xFFFFFFFF, 0x12345678):
        bits, fields = wire(0x123, 8, low, 0)
        (place,) = tampering.places_of_error("CRC", False, bits, fields)
        assert tampering._what_a_receiver_sees(bits, fields, place) == "CRC"
        assert tampering._what_a_receiver_sees(bits, fields, -1) == ""


def test_every_third_frame_of_one_identifier_is_lost_behind_one_controller():
    tamper = tampering.Loss(1, 0x10)
    tamper.every = 3
    wired = tampered(tamper)
    for n in range(9):
        wired.send(0, 0x10, time=n * MS, lo=n)
        wired.send(0, 0x11, time=n * MS, buffer=2, lo=n)
        wired.bus.advance((n + 1) * MS - 1)
    assert [frame[3] for frame in wired.of(1, "rx") if frame[1] == 0x10] == [0, 1, 3, 4, 6, 7]
    assert len(wired.of(2, "rx")) == 18 and wired.bus.counters.errors == 0
    assert tamper.tampered == 3


def test_corrupted_and_late_frames_reach_one_node_only():
    wired = tampered(tampering.Corruption(1, 1 << 22, 0x10))
    tampering.tampering_of(wired.bus).add(tampering.Delay(2, 5000, 0x10))
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    (near,), (late,) = wired.of(1, "rx"), wired.of(2, "rx")
    assert near[3] == 7 | 1 << 22 and late[3] == 7
    assert late[0] - near[0] == 5000


def test_a_bus_without_tampering_is_plain_again():
    tamper = tampering.Loss(1)
    wired = tampered(tamper)
    assert wired.bus.next_strike == -1
    wired.bus.tampering.remove(tamper)
    assert wired.bus.tampering is None and wired.bus.next_strike > 0


def test_32_bit_errors_silence_a_node_which_comes_back_after_128_sequences():
    tamper = tampering.Silence(0)
    wired = tampered(tamper)
    wired.send(0, 0x10)
    wired.bus.advance(10 * MS)
    node = wired.bus.nodes[0]
    assert (node.mode, tamper.tampered, wired.bus.counters.errors) == (BUS_OFF, 32, 32)
    wired.bus.set_mode(0, OPERATING, 10 * MS)
    wired.bus.advance(SECOND)
    back = wired.of(0, "status")[-1]
    # the sequences begin with the bit behind the command: 10 ms are bit 30,000
    assert back[0] == edge(30_001 + BITS_11_128) and back[2:4] == (0, 0)
    wired.send(0, 0x10, time=SECOND)
    wired.bus.advance(2 * SECOND)
    assert wired.bus.counters.frames == 1  # and it is left alone


def test_a_reset_amid_the_recovery_owes_all_of_it_again():
    wired = tampered(tampering.Silence(0))
    wired.send(0, 0x10)
    wired.bus.advance(10 * MS)
    node = wired.bus.nodes[0]
    for begun_ms in (10, 20):
        wired.bus.set_mode(0, OPERATING, begun_ms * MS)
        wired.bus.advance(begun_ms * MS + MS // 10)
        assert (node.mode, wired.bus.joining) == (JOINING, 1)
        wired.bus.set_mode(0, RESET, begun_ms * MS + MS // 5)
        wired.bus.advance(begun_ms * MS + 9 * MS)  # 128 sequences are 0.47 ms
        assert (node.mode, wired.bus.joining) == (BUS_OFF, 0)
    wired.bus.set_mode(0, OPERATING, 30 * MS)
    wired.bus.advance(SECOND)
    assert (node.mode, wired.bus.joining) == (OPERATING, 0)
    assert wired.of(0, "status")[-1][0] == edge(90_001 + BITS_11_128)


def test_a_node_that_is_to_be_silenced_leaves_the_frames_of_others_alone():
    wired = tampered(tampering.Silence(0))
    wired.send(1, 0x10)
    wired.bus.advance(10 * MS)
    assert (wired.bus.counters.frames, wired.bus.counters.errors) == (1, 0)


def test_a_babbling_node_at_identifier_0_leaves_no_other_node_a_frame():
    wired = Wired(3)
    intruder = tampering.Intruder(wired.bus, "intruder")
    babbling = tampering.Babbling(intruder, 0, 0)
    tampering.tampering_of(wired.bus).add(babbling)
    babbling.start_from(0)
    wired.send(0, 0x10, time=1000)
    for until in range(0, MS, 25_000):  # however time is cut
        wired.bus.advance(until)
    bits = frame_bits(0, 8, 0, 0) + 3
    assert {frame[1] for frame in wired.of(1, "rx")} == {0}
    assert babbling.tampered == (RATE // 1000 - 25 * 3) // bits + 1
    assert wired.bus.buffers.waiting_count == 2  # the other's and its own next one
    rewiring.unplug(wired.bus, intruder.number, MS)
    wired.bus.tampering.remove(babbling)
    wired.bus.advance(2 * MS)
    assert [frame[1] for frame in wired.of(1, "rx")][-1] == 0x10 and wired.bus.nodes[3].mode == UNPLUGGED


def test_two_senders_of_one_identifier_destroy_each_others_frames_until_one_is_passive():
    wired = Wired(2)
    duplicate = tampering.Duplicate(tampering.Intruder(wired.bus, "intruder"), 0x10, 1)
    tampering.tampering_of(wired.bus).add(duplicate)
    wired.send(0, 0x10, lo=4)
    wired.bus.advance(SECOND)
    # The intruder's 5 has a recessive bit where 4 has a dominant one: a bit error, and its flag is one of the other's.
    # 16 times 8 make both passive; the intruder's 17th flag is recessive, and the other's frame gets through.
    assert duplicate.tampered == 1 and wired.bus.counters.errors == 17
    assert [frame[3] for frame in wired.of(1, "rx")] == [4, 5]
    assert wired.bus.nodes[0].transmit_errors == 128 - 1 and wired.bus.nodes[2].transmit_errors == 136 - 1


@pytest.mark.parametrize("rate", [1_000_000, 2_000_000, 2_900_000, 6_000_000])
def test_a_node_at_another_bit_rate_sees_errors_only_and_recovers_when_it_is_right_again(rate):
    wired = Wired(3)
    tamper = tampering.WrongRate(wired.bus.nodes[2])
    tampering.tampering_of(wired.bus).add(tamper)
    rewiring.set_rate_of(wired.bus, 2, rate, 0)
    for n in range(20):
        wired.bus.advance(n * MS // 4)
        wired.send(0, 0x5AA, time=n * MS // 4, lo=0x12345678)
    wired.bus.advance(5 * MS)
    assert wired.of(2, "rx") == [] and tamper.tampered > 0 and wired.bus.counters.errors > 0
    rewiring.set_rate_of(wired.bus, 2, 0, 5 * MS)
    wired.bus.tampering.remove(tamper)
    wired.bus.set_mode(0, OPERATING, 5 * MS)  # the sender's program, if its errors have thrown it off the bus
    for n in range(20, 60):
        wired.bus.advance(n * MS // 4)
        wired.send(0, 0x5AA, time=n * MS // 4, lo=n)
    wired.bus.advance(20 * MS)
    assert wired.bus.nodes[2].mode == OPERATING
    assert wired.of(2, "rx")[-1][3] == 59


def test_a_rate_that_synchronisation_makes_up_for_is_not_a_fault():
    with pytest.raises(UserError, match="synchronisation"):
        rewiring.set_rate_of(Wired(2).bus, 1, 2_970_000, 0)
    with pytest.raises(UserError, match="8 times"):
        rewiring.set_rate_of(Wired(2).bus, 1, 300_000, 0)


def test_a_cut_leaves_each_side_alone_and_a_mended_cable_carries_what_waited():
    wired = Wired(3)
    cut = rewiring.Cut(wired.bus, 2)
    wired.send(2, 0x10, time=100)  # waits at the cut, nothing has started
    far = cut.part(200)
    wired.send(0, 0x20, time=300)
    for until in range(0, 20 * MS, MS // 4):
        wired.bus.advance(until)
        far.advance(until)
    assert [frame[1] for frame in wired.of(1, "rx")] == [0x20] and wired.of(2, "rx") == []
    # alone it is error passive by sixteen missing acknowledgements and never bus-off
    assert far.nodes[0].transmit_errors == 128 and far.nodes[0].mode == OPERATING
    cut.mend(20 * MS)
    assert wired.bus.nodes[2].mode == JOINING
    wired.bus.advance(SECOND)
    assert [frame[1] for frame in wired.of(0, "rx")] == [0x10]
    assert wired.bus.nodes[2].transmit_errors == 127 and wired.bus.nodes[2].mode == OPERATING
    assert far.buffers.waiting_count == 0 and far.nodes[0].mode == UNPLUGGED
