"""Faults of frames on CAN FD buses: errors that one node is made to see, a misread BRS, nodes at wrong rates."""

import pytest

from ranger_sim.can_bus import rewiring, tampering
from ranger_sim.can_bus.frame import FIELD_ACK_SLOT, FIELD_CRC_DELIMITER
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.foundation.events import FLAG_ESI, FLAG_FD
from ranger_sim.foundation.user_error import BusError

from .test_fd_bus import BIT_NS, FAST, FdBus
from .wiring import Wired

MS = 10**6
BRS_BIT = 16  # of 0x555 without stuff bits up to there
TO_BRS_END = 16 * BIT_NS + 1600 + 100  # from the start of frame: sample point of BRS at 80 %, then 20 % of a data bit


def tampered(*tampers, count=1):
    fd = FdBus()
    for tamper in tampers:
        tamper.count = count
        tampering.tampering_of(fd.bus).add(tamper)
    return fd


@pytest.mark.parametrize(
    ("error", "of_sender", "others"),
    [
        ("BIT", True, {"n1": "FORM", "n2": "FORM"}),
        ("ACK", True, {"n1": "FORM", "n2": "FORM"}),
        ("BIT", False, {"n0": "BIT", "n2": "FORM"}),
        ("FORM", False, {"n0": "BIT", "n2": "FORM"}),
        ("CRC", False, {"n0": "BIT", "n2": "FORM"}),
    ],
)
def test_one_node_sees_the_error_first_and_the_others_because_of_its_flag(error, of_sender, others):
    """As on a classic bus (test_tampering.py): the frame is repeated, and received once by both. The sender's bit error
    is at ESI: its flag reads as length code 0, behind which a fixed stuff bit has to be recessive."""
    tamper = tampering.Misreading(error, 0 if of_sender else 1, of_sender)
    fd = tampered(tamper)
    fd.send(0, 0x555, FAST | 10, bytes(range(16)))
    fd.bus.advance(10 * MS)
    first = "n0" if of_sender else "n1"
    assert tamper.seen == {(first, error, "primary"): 1, **{(n, e, "secondary"): 1 for n, e in others.items()}}
    assert (fd.bus.counters.errors, fd.bus.counters.retries, fd.bus.counters.frames) == (1, 1, 1)
    assert [fd.of(n, "rx")[0][3] for n in (1, 2)] == [bytes(range(16))] * 2
    assert fd.bus.nodes[0].transmit_errors == 7


def test_a_stuff_error_of_a_receiver_in_the_data_phase_is_flagged_at_the_nominal_rate():
    """Bytes 0x00: five equal data bits, a stuff bit. The node misreads one of them, sees six equal bits, and its flag
    of nominal bits is an error to the sender a few data bits later."""
    tamper = tampering.Misreading("BIT_STUFFING", 1, False)
    fd = tampered(tamper)
    fd.send(0, 0x555, FAST | 10, bytes(16))
    fd.bus.advance(10 * MS)
    assert tamper.seen["n1", "BIT_STUFFING", "primary"] == 1 == tamper.seen["n0", "BIT", "secondary"]
    seen = fd.of(1, "status")[0][0]
    sender = fd.of(0, "status")[0][0]
    assert 0 <= sender - seen <= 6 * BIT_NS
    assert len(fd.of(2, "rx")) == 1


def test_a_sender_s_bit_error_behind_brs_has_the_time_of_its_data_bit():
    """ESI is the first bit at the data rate: it is sampled 80 % of a data bit after its start, and the rest of that
    bit is nominal."""
    fd = tampered(tampering.Misreading("BIT", 0, True))
    fd.send(0, 0x555, FAST | 10, bytes(16))
    fd.bus.advance(10 * MS)
    first = fd.of(0, "status")[0]
    assert first == (BIT_NS + TO_BRS_END + 400 + 400, 8, 0)


def test_a_broken_error_flag_costs_its_sender_eight_more():
    tamper = tampering.Misreading("BROKEN_ERROR_FRAME", 0, True)
    fd = tampered(tamper)
    fd.send(0, 0x555, FAST | 10, bytes(16))
    fd.bus.advance(10 * MS)
    assert tamper.seen["n0", "BROKEN_ERROR_FRAME", "primary"] == 1
    statuses = fd.of(0, "status")
    assert [each[1] for each in statuses[:2]] == [8, 16]
    assert statuses[1][0] - statuses[0][0] == 3 * BIT_NS  # the third bit of the flag


def test_an_error_in_every_frame_ends_in_bus_off():
    silence = tampering.Silence(0)
    fd = FdBus()
    tampering.tampering_of(fd.bus).add(silence)
    fd.send(0, 0x555, FAST | 10, bytes(16))
    fd.bus.advance(100 * MS)
    assert fd.bus.nodes[0].mode != OPERATING and silence.seen["n0", "BIT", "primary"] == 32
    assert fd.of(1, "rx") == []


def test_a_node_that_misreads_brs_samples_at_the_wrong_rate_and_destroys_the_frame():
    """It takes data bits for nominal ones. The frame is repeated, and then it has it, too."""
    acted = []
    switch = tampering.MisreadSwitch(1)
    switch.noted = lambda time, _: acted.append(time)
    fd = tampered(switch)
    fd.send(0, 0x555, FAST | 10, bytes(range(16)))
    fd.bus.advance(10 * MS)
    assert switch.tampered == 1 and len(acted) >= 1
    assert acted[0] >= BIT_NS + TO_BRS_END
    assert fd.bus.counters.errors >= 1 and [len(fd.of(n, "rx")) for n in (1, 2)] == [1, 1]


def test_frames_without_brs_of_either_kind_have_no_bit_to_misread():
    switch = tampering.MisreadSwitch(1)
    fd = tampered(switch)
    fd.bus.request(0, 1, 0, 0x10, 8, 1, 2)
    fd.bus.advance(10 * MS)
    assert switch.tampered == 0 and len(fd.of(1, "rx")) == 1


def test_lost_late_and_changed_frames_keep_all_their_bytes():
    data = bytes(range(64))
    fd = tampered(tampering.Loss(1), tampering.Delay(2, 5000))
    fd.send(0, 0x555, FAST | 15, data)
    fd.bus.advance(10 * MS)
    [(late, *_, received)] = fd.of(2, "rx")
    assert fd.of(1, "rx") == [] and received == data
    assert late == fd.of(0, "done")[0][0] - BIT_NS + 5000
    fd = tampered(tampering.Corruption(1, 0xFF00))
    fd.send(0, 0x555, FAST | 15, data)
    fd.bus.advance(10 * MS)
    assert fd.of(1, "rx")[0][3] == b"\x00\xfe" + data[2:] and fd.of(2, "rx")[0][3] == data


def test_a_duplicate_of_an_fd_frame_ends_both_in_errors_until_one_is_passive():
    fd = FdBus()
    intruder = tampering.Intruder(fd.bus, "intruder")
    duplicate = tampering.Duplicate(intruder, 0x555, 1)
    duplicate.count = 1
    tampering.tampering_of(fd.bus).add(duplicate)
    fd.send(0, 0x555, FAST | 8, bytes([4] * 8))
    fd.bus.advance(100 * MS)
    assert duplicate.tampered == 1 and fd.bus.counters.errors >= 16
    assert sorted(frame[3] for frame in fd.of(1, "rx")) == [bytes([4] * 8), bytes([5] + [4] * 7)]


# ---- wrong rates


def traffic(fd, first, last):
    for n in range(first, last):
        fd.bus.advance(n * MS)
        fd.send(0, 0x555, FAST | 10, bytes([n] * 16), time=n * MS)


@pytest.mark.parametrize(("rate", "data_rate"), [(0, 1_000_000), (0, 4_000_000), (250_000, 0), (1_000_000, 0)])
def test_a_node_at_a_wrong_rate_sees_errors_only_and_recovers_when_it_is_right_again(rate, data_rate):
    fd = FdBus()
    tamper = tampering.WrongRate(fd.bus.nodes[2])
    tampering.tampering_of(fd.bus).add(tamper)
    rewiring.set_rate_of(fd.bus, 2, rate, 0, data_rate)
    traffic(fd, 1, 10)
    fd.bus.advance(10 * MS)
    assert fd.of(2, "rx") == [] and tamper.tampered > 0 and fd.bus.counters.errors > 0
    rewiring.set_rate_of(fd.bus, 2, 0, 10 * MS)
    fd.bus.tampering.remove(tamper)
    fd.bus.set_mode(0, OPERATING, 10 * MS)  # the sender's program, if its errors have taken it off the bus
    traffic(fd, 20, 60)
    fd.bus.advance(100 * MS)
    assert fd.bus.nodes[2].mode == OPERATING and fd.of(2, "rx")[-1][3] == bytes([59] * 16)


def test_a_wrong_data_rate_leaves_frames_without_brs_alone():
    fd = FdBus()
    tampering.tampering_of(fd.bus).add(tampering.WrongRate(fd.bus.nodes[2]))
    rewiring.set_rate_of(fd.bus, 2, 0, 0, 1_000_000)
    fd.bus.advance(MS)
    fd.send(0, 0x555, FLAG_FD | 10, bytes(16), time=MS)
    fd.bus.request(1, 1, MS, 0x10, 8, 1, 2)
    fd.bus.advance(10 * MS)
    assert [frame[1] for frame in fd.of(2, "rx")] == [0x10, 0x555] and fd.bus.counters.errors == 0


def test_rates_that_are_not_faults_are_refused():
    bus = FdBus().bus
    with pytest.raises(BusError, match="data phase: 2010000 bit/s must be 2% off 2000000"):
        rewiring.set_rate_of(bus, 1, 0, 0, 2_010_000)
    with pytest.raises(BusError, match="a classic bus has no data bit rate"):
        rewiring.set_rate_of(Wired(2).bus, 1, 0, 0, 2_000_000)


def test_the_places_of_errors_are_in_the_data_phase():
    fd = FdBus()
    fd.send(0, 0x555, FAST | 10, bytes(16))
    bits, fields = fd.bus.buffers.wire(fd.bus.buffers.first)
    for error, of_sender, place in (
        ("BIT", True, BRS_BIT + 1), ("FORM", False, fields.index(FIELD_CRC_DELIMITER)),
        ("ACK", True, fields.index(FIELD_ACK_SLOT)),
    ):  # fmt: skip
        assert tampering.places_of_error(error, of_sender, bits, fields) == [place]


def test_a_cut_leaves_each_side_alone_and_a_mended_cable_carries_what_waited():
    """As on a classic bus (test_tampering.py); what waited has all its bytes."""
    fd = FdBus()
    cut = rewiring.Cut(fd.bus, 2)
    fd.send(2, 0x10, FAST | 15, bytes(range(64)), time=100)
    far = cut.part(200)
    assert (far.data_bitrate, far.timing.sample, far.timing.data_sample) == (2_000_000, 64, 16)
    fd.send(0, 0x20, FAST | 9, bytes(12), time=300)
    for until in range(0, 200 * MS, MS):
        fd.bus.advance(until)
        far.advance(until)
    assert [frame[1] for frame in fd.of(1, "rx")] == [0x20] and fd.of(2, "rx") == []
    assert far.nodes[0].transmit_errors == 128 and far.nodes[0].mode == OPERATING
    cut.mend(200 * MS)
    fd.bus.advance(1000 * MS)
    assert [frame[1:] for frame in fd.of(0, "rx")] == [(0x10, FAST | FLAG_ESI | 15, bytes(range(64)))]
    assert fd.bus.nodes[2].transmit_errors == 127 and far.buffers.waiting_count == 0


def test_a_frame_that_waited_at_a_cut_shows_the_error_state_of_its_sender_when_it_is_sent():
    """Passive when it was offered, active when the wire is mended; a gateway's ESI remains."""
    fd = FdBus()
    cut = rewiring.Cut(fd.bus, 2)
    far = cut.part(200)
    far.nodes[0].transmit_errors, far.nodes[0].passive = 128, True
    far.request_fd(0, 1, 300, 0x10, FAST | 8, bytes(8))
    far.request_fd(0, 2, 300, 0x11, FAST | FLAG_ESI | 8, bytes(8))
    far.advance(MS)  # no node acknowledges
    far.nodes[0].forgive()
    cut.mend(2 * MS)
    fd.bus.advance(10 * MS)
    assert [frame[1:3] for frame in fd.of(0, "rx")] == [(0x10, FAST | 8), (0x11, FAST | FLAG_ESI | 8)]


def test_a_classic_node_behind_a_cut_remains_one():
    fd = FdBus()
    fd.bus.set_classic(2)
    cut = rewiring.Cut(fd.bus, 2)
    far = cut.part(200)
    with pytest.raises(ValueError, match="node 0 is a classic node"):
        far.request_fd(0, 1, 300, 0x10, FAST | 9, bytes(12))
    cut.mend(400)
    with pytest.raises(ValueError, match="node 2 is a classic node"):
        fd.send(2, 0x10, FAST | 9, bytes(12), time=500)
