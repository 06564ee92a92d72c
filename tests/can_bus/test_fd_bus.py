"""CAN FD on the bus: known times, mixed traffic, classic nodes, errors, misuse, and an independent oracle."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus.bit_timing import BitTiming
from ranger_sim.can_bus.bus import Bus
from ranger_sim.can_bus.frame_log import FrameTimes
from ranger_sim.can_bus.node import BUS_OFF, OPERATING, PASSIVE_LIMIT, RESET
from ranger_sim.foundation.events import (
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_BRS,
    FLAG_ERROR,
    FLAG_ESI,
    FLAG_FD,
    FLAG_REMOTE,
    ORDER_BUS,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.user_error import BusError
from tests.examples import examples

from . import fd_comparison as comparison
from . import fd_oracle

BIT_NS = 2000  # 500 kbit/s
DATA_BIT_NS = 500  # 2 Mbit/s
FAST = FLAG_FD | FLAG_BRS
SEEDS = 12  # of each kind; `python -m tests.can_bus.fd_comparison` does any number


class FdBus:
    """Three nodes on a CAN FD bus of 500 kbit/s and 2 Mbit/s."""

    def __init__(self, **options):
        self.bus = Bus("can1", 500_000, data_bitrate=2_000_000, **options)
        self.inboxes = [EventQueue(16) for _ in range(3)]
        for number, inbox in enumerate(self.inboxes):
            self.bus.add_node(f"n{number}", inbox, 1, ORDER_BUS + number)

    def send(self, node, identifier, flags, data=b"", time=0, buffer=1):
        return self.bus.request_fd(node, buffer, time, identifier, flags, data)

    def messages(self, node):
        inbox, found = self.inboxes[node], []
        while inbox.take():
            if inbox.kind == CAN_RX:
                found.append(("rx", inbox.time, inbox.b, inbox.c, inbox.ref))
            elif inbox.kind == CAN_TX_DONE:
                found.append(("done", inbox.time, inbox.b, inbox.c))
            elif inbox.kind == CAN_STATUS:
                found.append(("status", inbox.time, inbox.c, inbox.d))
        return found

    def of(self, node, kind):
        return [message[1:] for message in self.messages(node) if message[0] == kind]


@pytest.fixture
def fd():
    return FdBus()


def test_a_frame_with_two_rates_lasts_as_long_as_its_phases(fd):
    """0x555 with 64 bytes 0x55: 26 nominal bits and 550 data bits, counted in test_fd_frame; it starts at bit 1."""
    fd.send(0, 0x555, FAST | 15, b"\x55" * 64)
    fd.bus.advance(10**7)
    end = BIT_NS + 26 * BIT_NS + 550 * DATA_BIT_NS
    assert fd.messages(0) == [("done", end, 1, TX_SENT)]
    assert fd.messages(1) == [("rx", end - BIT_NS, 0x555, FAST | 15, b"\x55" * 64)]
    assert fd.bus.free_time == end + 3 * BIT_NS


def test_without_brs_all_bits_are_nominal(fd):
    fd.send(0, 0x555, FLAG_FD | 15, b"\x55" * 64)
    fd.bus.advance(10**7)
    assert fd.of(0, "done") == [(BIT_NS + 576 * BIT_NS, 1, TX_SENT)]


def test_classic_and_fd_frames_arbitrate_by_identifier(fd):
    fd.send(0, 0x101, FAST | 9, bytes(12))
    fd.bus.request(1, 1, 0, 0x100, 8, 1, 2)
    fd.send(2, 0x102, FLAG_FD | 0)
    fd.bus.advance(10**7)
    assert [frame[1] for frame in fd.bus.log.take()] == [0x100, 0x101, 0x102]
    assert [message[1:3] for message in fd.of(2, "rx")] == [(0x100, 8), (0x101, FAST | 9)]


def test_a_frame_behind_one_with_two_rates_follows_after_three_nominal_bits(fd):
    """Its start is whole nominal bits after the end of the first, which a whole number of data bits has moved."""
    fd.send(0, 0x555, FAST | 15, b"\x55" * 64)
    fd.send(1, 0x556, FLAG_FD | 0)
    fd.bus.advance(10**7)
    [(first, *_)] = fd.of(0, "done")
    [(second, *_)] = fd.of(1, "done")
    length = comparison.phases(0x556, FLAG_FD, b"") & comparison.PHASE_MASK
    assert second - first == (3 + length) * BIT_NS
    assert second % BIT_NS != 0
    asked = 10**7 + 1  # on an idle bus: it starts at the next of these bits
    fd.send(2, 0x557, FLAG_FD | 0, time=asked)
    fd.bus.advance(2 * 10**7)
    length = comparison.phases(0x557, FLAG_FD, b"") & comparison.PHASE_MASK
    assert fd.of(2, "done") == [(second + (-(-(asked - second) // BIT_NS) + length) * BIT_NS, 1, TX_SENT)]


def test_the_load_of_the_data_phase_is_counted_separately(fd):
    fd.send(0, 0x555, FAST | 15, b"\x55" * 64)
    fd.bus.advance(10**7)
    data, nominal = 550 * DATA_BIT_NS, 29 * BIT_NS  # with intermission
    assert fd.bus.load.data_share() == pytest.approx(data / (data + nominal), rel=1e-12)
    assert fd.bus.load_mean(10**7) == pytest.approx((data + nominal) / 10**7, rel=1e-12)


def test_a_log_entry_holds_all_bytes_in_its_two_words(fd):
    fd.send(0, 0x555, FAST | 10, bytes(range(16)))
    fd.bus.advance(10**7)
    [(_, identifier, flags, lo, hi, node)] = fd.bus.log.take()
    assert (identifier, flags, node) == (0x555, FAST | 10, 0)
    assert (lo | hi << 32).to_bytes(16, "little") == bytes(range(16))


# ---- classic nodes


def test_a_classic_node_answers_fdf_with_a_form_error_until_it_is_passive(fd):
    """0x555 has no stuff bits: FDF is the 15th bit. Its flag begins with the next one, at the nominal rate; the sender
    sees it at BRS, the 17th. The classic node's errors are 1 and 8 (it flags first) per attempt: at 135 it is passive,
    and its flags disturb no frame any more."""
    fd.bus.set_classic(2)
    fd.send(0, 0x555, FAST | 0)
    fd.bus.advance(10**8)
    errors = fd.of(2, "status")
    assert errors[:2] == [(BIT_NS + 15 * BIT_NS, 0, 1), (BIT_NS + 15 * BIT_NS + 7 * BIT_NS, 0, 9)]
    sender = fd.messages(0)
    assert sender[0] == ("status", BIT_NS + 17 * BIT_NS, 8, 0)
    assert sum(message[0] == "status" and message[2] % 8 == 0 for message in sender) == 15
    assert [message[0] for message in sender].count("done") == 1
    assert errors[29][2] == 135 >= PASSIVE_LIMIT


def test_classic_nodes_take_part_in_classic_traffic(fd):
    fd.bus.set_classic(2)
    fd.bus.request(2, 1, 0, 0x10, 8, 1, 2)
    fd.bus.advance(10**7)
    assert len(fd.of(0, "rx")) == 1 and fd.bus.counters.errors == 0
    with pytest.raises(ValueError, match="node 2 is a classic node"):
        fd.send(2, 0x10, FLAG_FD)
    fd.bus.set_classic(2, False)
    assert fd.send(2, 0x10, FLAG_FD, time=2 * 10**7)


# ---- errors


def test_an_error_in_the_data_phase_is_flagged_at_the_nominal_rate(fd):
    """A recessive bit of the data is inverted: the sender sees it at its sample point, 80 % of a data bit, and ends
    that bit at the nominal rate, 20 % of a nominal bit later. Its flag is six nominal bits."""
    fd.send(0, 0x555, FAST | 15, b"\x55" * 64)
    place = 22 + 101  # behind the header: data bits 0 and 1 in turn, this one 1
    fd.bus.inject_errors(1, place)
    fd.bus.advance(10**7)
    sampled = BIT_NS + 16 * BIT_NS + 1600 + 100 + (place - 17) * DATA_BIT_NS + 400
    first = fd.of(0, "status")[0]
    assert first == (sampled + 400, 8, 0)
    error = fd.bus.log.take()[0]
    assert error[2] & FLAG_ERROR and error[4] == place
    # receivers see a stuff error after six data bits 0 of the flag, and their own flags end as many data bits later
    seen = fd.of(1, "status")[0][0]
    assert 0 < seen - first[0] < 2 * BIT_NS


def test_a_passive_sender_shows_esi_and_a_gateway_shows_that_of_another(fd):
    fd.bus.nodes[0].transmit_errors = 200
    fd.bus.nodes[0].passive = True
    fd.send(0, 0x10, FAST | 0)
    fd.send(1, 0x11, FAST | FLAG_ESI)
    fd.send(1, 0x12, FAST, buffer=2)
    fd.bus.advance(10**7)
    assert [message[2] for message in fd.of(2, "rx")] == [FAST | FLAG_ESI, FAST | FLAG_ESI, FAST]


def test_one_lone_node_gets_no_acknowledgement(fd):
    fd.bus.set_mode(1, RESET, 0)
    fd.bus.set_mode(2, RESET, 0)
    fd.send(0, 0x10, FAST | 8, bytes(8), time=1000)
    fd.bus.advance(10**7)
    assert fd.bus.nodes[0].transmit_errors == 128 and not fd.of(0, "done")


# ---- nodes that leave and join


@pytest.mark.parametrize("disturbed", [False, True])
def test_a_node_that_joins_in_a_data_phase_does_not_take_it_for_an_idle_bus(fd, disturbed):
    """The bytes 0x77 have an edge each fourth data bit, which is one nominal bit: samples at the nominal rate are all
    recessive. The node counts from each edge on, so it joins with the intermission and receives what follows: the next
    frame, or the same one again where an inverted bit has made the bus pass bit by bit."""
    fd.bus.set_mode(2, RESET, 0)
    fd.send(0, 0x100, FAST | 15, b"\x77" * 64, time=100)
    fd.bus.advance(100)
    if disturbed:
        fd.bus.inject_error_at(150 * BIT_NS)
    fd.bus.set_mode(2, OPERATING, 40 * BIT_NS)
    fd.send(1, 0x101, FAST | 15, b"\x77" * 64, time=100_000)
    fd.bus.advance(10**7)
    assert [message[1] for message in fd.of(2, "rx")] == ([0x100, 0x101] if disturbed else [0x101])
    assert [message[1] for message in fd.of(1, "rx")] == [0x100]
    assert fd.bus.nodes[2].receive_errors == 0


def test_a_node_comes_back_from_bus_off_after_128_sequences_on_an_idle_bus(fd):
    fd.bus.nodes[0].transmit_errors = 250
    fd.bus.nodes[0].passive = True
    fd.bus.inject_errors(1)
    fd.send(0, 0x100, FAST | 8, bytes(8))
    fd.bus.advance(10**6)
    assert fd.bus.nodes[0].mode == BUS_OFF
    asked = 10**6 // BIT_NS * BIT_NS + BIT_NS // 2
    fd.bus.set_mode(0, OPERATING, asked)
    fd.bus.advance(10**7)
    [joined] = [time for time, transmit_errors, _ in fd.of(0, "status") if transmit_errors == 0]
    recovery = 128 * 11 * BIT_NS
    assert asked + recovery < joined <= asked + BIT_NS + recovery
    assert fd.bus.nodes[0].mode == OPERATING and fd.bus.nodes[0].transmit_errors == 0


# ---- misuse


@pytest.mark.parametrize(
    ("flags", "data", "words"),
    [
        (FLAG_FD | FLAG_REMOTE, b"", "CAN FD has no remote frames"),
        (FLAG_BRS | 8, bytes(8), "BRS and ESI are bits of CAN FD frames"),
        (FLAG_FD | 9, bytes(9), "9 data bytes, its length code means 12"),
    ],
)
def test_misuse_is_refused_by_name(fd, flags, data, words):
    with pytest.raises(ValueError, match=words):
        fd.send(0, 0x10, flags, data)


def test_a_classic_bus_refuses_fd_frames_and_classic_nodes():
    bus = Bus("can1", 500_000)
    bus.add_node("n0", EventQueue(8), 1, ORDER_BUS)
    with pytest.raises(ValueError, match="this bus is classic CAN"):
        bus.request_fd(0, 1, 0, 0x10, FLAG_FD, b"")
    with pytest.raises(ValueError, match="this bus is classic CAN"):
        bus.request(0, 1, 0, 0x10, FLAG_FD | 8, 0, 0)
    with pytest.raises(BusError, match="all nodes of a classic bus are classic"):
        bus.set_classic(0)
    assert not bus.is_fd and bus.data_bitrate == 0


def test_two_words_are_enough_for_a_request_of_eight_bytes(fd):
    fd.bus.request(0, 1, 0, 0x10, FAST | 9, 0x04030201, 0x08070605)
    fd.bus.advance(10**7)
    assert fd.of(1, "rx")[0][3] == bytes(range(1, 9)) + bytes(4)


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ((500_000, 400_000), "data bit rate 400000 bit/s is outside 500000"),
        ((500_000, 7_654_321), "have no common clock"),
        ((500_000, 2_000_000, 0.99), "sample point 0.99 is outside"),
    ],
)
def test_impossible_bit_timings_are_refused(rates, words):
    with pytest.raises(ValueError, match=words):
        BitTiming("bus can1", *rates)


# ---- the oracle


@pytest.mark.parametrize("kind", comparison.KINDS)
def test_what_nodes_send_receive_and_count_is_what_the_standard_says(kind):
    for seed in range(SEEDS):
        assert comparison.differences(comparison.scenario_of(kind, seed)) == [], f"{kind}, seed {seed}"


def test_the_scenarios_hold_what_they_are_for():
    """Otherwise agreement would say nothing."""

    def outcomes(kind):
        return [comparison.on_our_bus(comparison.scenario_of(kind, seed))[0] for seed in range(SEEDS)]

    clean = [each for outcome in outcomes("clean") for seen in outcome.seen for each in seen]
    assert sum(len(each) > 2 and bool(each[3] & FLAG_BRS) for each in clean) > 3 * SEEDS
    assert sum(len(each) > 2 and len(each[4]) > 16 for each in clean) > SEEDS
    back = [scenario.modes[0][0] for scenario in (comparison.scenario_of("recovery", seed) for seed in range(SEEDS))]
    later = [outcome.seen[0][-1:] for outcome in outcomes("recovery")]
    assert sum(bool(seen) and seen[0][0] > time for seen, time in zip(later, back, strict=True)) > SEEDS // 2
    for kind, counter in (("equal", 1), ("classic", 2)):
        passive = [max(each[counter] for node in outcome.counters for each in node) for outcome in outcomes(kind)]
        assert sum(peak >= PASSIVE_LIMIT for peak in passive) > SEEDS // 5, kind


def test_a_disagreement_would_be_found(monkeypatch):
    scenario = comparison.scenario_of("errors", 1)
    ours, accepted = comparison.on_our_bus(scenario)
    ours.counters[0].append((9, 1, 1))
    monkeypatch.setattr(comparison, "on_our_bus", lambda scenario: (ours, accepted))
    assert comparison.differences(scenario) == ["counters"]


@settings(max_examples=examples(30))
@given(
    st.sampled_from(comparison.KINDS),
    st.integers(0, 10_000),
    st.lists(st.integers(300, 200_000), min_size=1, max_size=12),
)
def test_a_bus_does_not_depend_on_how_time_is_cut(kind, seed, steps):
    scenario = comparison.scenario_of(kind, seed)
    assert comparison.on_our_bus(scenario, steps) == comparison.on_our_bus(scenario)


@pytest.mark.parametrize("seed", [605, 719])
def test_a_request_within_a_bit_that_an_edge_begins_anew_takes_part_in_the_frame_of_that_edge(seed):
    """Found among 10,000 scenarios: the last bit of intermission, of a node that was out of step."""
    assert comparison.differences(comparison.scenario_of("noise", seed)) == []


@pytest.mark.parametrize(("rates", "rows"), [({"data_bitrate": 2_000_000}, 1), ({}, 0)])
def test_a_frame_on_a_real_bus_in_its_place_has_the_length_of_both_its_phases(rates, rows):
    bus = Bus("can1", 500_000, **rates)
    bus.log.times = FrameTimes()
    kept = []
    bus.log.times.sink = lambda _time, block: kept.append(list(memoryview(block).cast("B").cast("q")))
    data = bytes(range(64))
    low, high = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    bus.note_outside(1_000_000, 0x123, FAST | 15, low, high)
    bus.log.times.flush()
    assert len(kept) == rows  # a classic bus does not know the other bit rate
    if rows:
        text, brs, delimiter = fd_oracle.transmitted(fd_oracle.FdFrame(0x123, data, brs=True))
        fast = delimiter - brs  # one bit for the two parts of BRS and of the CRC delimiter
        begun = 1_000_000 - fast * DATA_BIT_NS - (len(text) - fast) * BIT_NS
        assert kept == [[begun, begun, 1_000_000, 0x123, FAST | 15, low, 0x07060504]]
