"""Faults of frames one by one: which frames they take, what each node then has and receives, and when, by hand."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.can_bus.frame import wire
from ranger_sim.can_bus.node import BUS_OFF, JOINING, OPERATING, RESET, UNPLUGGED
from ranger_sim.can_bus.tampering import (
    Babbling,
    Corruption,
    Delay,
    Duplicate,
    Intruder,
    Loss,
    Misreading,
    Silence,
    Tamper,
    Tampering,
    WrongRate,
    places_of_error,
    tampering_of,
)
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_SINGLE_SHOT, NEVER, STAGE_BUS, TX_SENT
from tests.examples import examples

from . import bit_oracle as oracle
from . import oracle_comparison as comparison
from .wiring import Wired, edge

SECOND, MS = 10**9, 10**6


def length(identifier, data=bytes(8), **more):
    """Bits of a frame without intermission, by the oracle."""
    return len(oracle.stuffed(oracle.Frame(identifier, data, **more))[0]) + 10


def with_faults(count, *tampers):
    """A bus, and for each fault the list of (time, difference) that it noted."""
    wired = Wired(count)
    noted = []
    for tamper in tampers:
        said = []
        tamper.noted = lambda time, difference, said=said: said.append((time, difference))
        noted.append(said)
        tampering_of(wired.bus).add(tamper)
    return wired, noted


# ---- where a bit must be misread


frames = st.builds(
    oracle.Frame,
    st.integers(0, 0x7FF) | st.sampled_from([0, 0x01F, 0x7E0, 0x7FF, 0x555]),
    st.binary(max_size=8) | st.sampled_from([bytes(8), b"\xff" * 8, b"\x0f\xf0" * 4]),
    extended=st.booleans(),
)


def on_the_wire(frame):
    """(bits, fields) of our frame that is the oracle's."""
    return wire(frame.identifier, comparison.flags_of(frame), *comparison.words(frame.data))


def first_error(frame, misread):
    """What a receiver of the oracle sees first when it misreads one bit: "stuff", "form", "crc" or ""."""
    bits = oracle.stuffed(frame)[0] + [1, 0] + [1] * 8
    reception = oracle.Reception()
    for place, bit in enumerate(bits):
        wrong = reception.take(1 - bit if place == misread else bit)
        if wrong:
            return wrong
        if reception.tail == 3 and not reception.crc_right:
            return "crc"
    return ""


@settings(max_examples=examples(60))
@given(frames)
def test_a_receiver_sees_a_stuff_or_crc_error_of_the_first_bit_that_gives_it_and_no_earlier_one_does(frame):
    bits, fields = on_the_wire(frame)
    stuffed = len(oracle.stuffed(frame)[0])
    behind = behind_arbitration(frame)
    for error, seen in (("BIT_STUFFING", "stuff"), ("CRC", "crc")):
        fitting = [place for place in range(behind, stuffed) if first_error(frame, place) == seen]
        assert places_of_error(error, False, bits, fields) == fitting[:1]


def behind_arbitration(frame):
    """Place of the first bit that no arbitration decides: r0 behind IDE, or r1 behind RTR of an extended frame."""
    plain, is_stuff = -1, oracle.stuffed(frame)[1]
    for place, stuff in enumerate(is_stuff):
        plain += not stuff
        if not stuff and plain == (33 if frame.extended else 14):
            return place
    raise AssertionError


@settings(max_examples=examples(60))
@given(frames)
def test_places_of_the_other_errors_follow_from_the_layout(frame):
    bits, fields = on_the_wire(frame)
    end_of_crc = len(oracle.stuffed(frame)[0])
    behind = behind_arbitration(frame)
    assert places_of_error("ACK", True, bits, fields) == [end_of_crc + 1]
    assert places_of_error("BIT", False, bits, fields) == [end_of_crc + 1]
    assert places_of_error("BIT", True, bits, fields) == [behind]
    assert places_of_error("FORM", False, bits, fields) == [end_of_crc]
    assert places_of_error("BROKEN_ERROR_FRAME", True, bits, fields) == [behind, behind + 3]
    assert places_of_error("BROKEN_ERROR_FRAME", False, bits, fields) == [end_of_crc, end_of_crc + 3]
    is_stuff = oracle.stuffed(frame)[1]
    plain, recessive = 0, []
    for place, stuff in enumerate(is_stuff):
        if stuff and bits[place] == 1 and plain <= (32 if frame.extended else 12):  # before the RTR bit
            recessive.append(place)
        plain += not stuff
    assert places_of_error("BIT_STUFFING", True, bits, fields) == recessive[:1]


@pytest.mark.parametrize(
    ("identifier", "place"),
    [
        (0x01F, [5]),  # SOF and four zeros; then it is the sixth bit
        (0x000, [5]),
        (0x40F, [7]),  # SOF and a one, then five zeros in bits 2 to 6
        (0x555, []),
        (0x7FF, []),  # its stuff bits are dominant
    ],
)
def test_known_places_of_a_recessive_stuff_bit(identifier, place):
    bits, fields = wire(identifier, 8, 0, 0)
    assert places_of_error("BIT_STUFFING", True, bits, fields) == place


# ---- which frames are taken


@pytest.mark.parametrize(
    ("options", "taken"),
    [
        ({}, {(1, 0), (1, 2), (9, 0), (9, 2)}),
        ({"identifier": 9}, {(9, 0), (9, 2)}),
        ({"identifier": 0}, set()),
        ({"sender": 0}, {(1, 0), (9, 0)}),
        ({"but": 0}, {(1, 2), (9, 2)}),
        ({"identifier": 1, "sender": 2, "but": 0}, {(1, 2)}),
    ],
)
def test_a_fault_picks_by_identifier_and_sender(options, taken):
    tamper = Tamper(**options)
    assert {(i, n) for i in (1, 9) for n in (0, 2) if tamper.picks(i, n)} == taken
    assert {(i, n) for i in (1, 9) for n in (0, 2) if tamper.takes(i, n)} == taken
    assert (tamper.begun, tamper.tampered, tamper.hit) == (len(taken), 0, False)


def test_a_fault_takes_every_nth_frame_and_ends_with_its_count():
    tamper = Tamper(5)
    tamper.every, tamper.count = 3, 2
    found = []
    for _ in range(12):
        assert not tamper.takes(6, 0)
        found.append(tamper.takes(5, 0))
        tamper.tampered += found[-1]
    assert found == [False, False, True] * 2 + [False] * 6
    assert tamper.begun == 6
    assert tamper.receives(None, 0) and tamper.notices(None, 0) is None and tamper.frame_begins(None, 0, 0) is None


def test_a_fault_takes_a_share_by_chance():
    class Dice:
        drawn = iter((0.0, 0.249, 0.25, 0.9))

        def uniform(self):
            return next(self.drawn)

    tamper = Tamper()
    tamper.share, tamper.random = 0.25, Dice()
    assert [tamper.takes(1, 0) for _ in range(4)] == [True, True, False, False]
    tamper.share = 1.0
    assert tamper.takes(1, 0)  # without a throw


def test_a_fault_reports_to_its_owner_alone():
    tamper = Tamper()
    tamper.note(5)
    reported = []
    tamper.noted = lambda *what: reported.append(what)
    tamper.note(6)
    tamper.note(7, 2.5)
    assert reported == [(6, 1.0), (7, 2.5)]


def test_every_fault_of_a_bus_is_asked_whatever_the_others_answer():
    class Asked(Tamper):
        def __init__(self, says):
            Tamper.__init__(self)
            self.says, self.asked = says, []

        def takes(self, identifier, sender):
            self.asked.append(("takes", identifier, sender))
            return self.says

        def before_frame(self, bus, row, bit):
            self.asked.append(("before", row, bit))
            return self.says

        def frame_begins(self, level, row, bit):
            self.asked.append(("begins", row, bit))

        def receives(self, machine, time):
            self.asked.append(("receives", machine.node.index, time))
            return self.says

    yes, no = Asked(True), Asked(False)
    wired, _ = with_faults(2, yes, no, also := Asked(True))
    assert tampering_of(wired.bus) is wired.bus.tampering is wired.bus.bit_level.tampering
    wired.send(0, 7, buffer=2)
    wired.bus.advance(SECOND)
    row, bits = 2 << 3, length(7)
    whole = [("before", row, 1), ("takes", 7, 0), ("begins", row, 1), ("receives", 1, edge(bits))]
    assert yes.asked == also.asked == whole
    assert no.asked == whole[:2]  # not hit, so what follows is none of its business
    assert len(wired.of(1, "rx")) == 1
    wired.bus.tampering.remove(yes)
    assert wired.bus.tampering is not None
    wired.bus.tampering.remove(no)
    wired.bus.tampering.remove(also)
    assert wired.bus.tampering is wired.bus.bit_level.tampering is None


def test_where_nothing_reaches_into_frames_a_place_for_it_is_made_and_acts_with_the_first_fault():
    bus = Wired(2).bus
    made = tampering_of(bus)
    assert isinstance(made, Tampering) and made.bus is bus and made.tampers == [] and bus.tampering is None


# ---- what single nodes have


def test_a_lost_frame_is_acknowledged_and_neither_counted_nor_reported_at_its_node():
    wired, [noted] = with_faults(3, Loss(1, 0x10))
    wired.send(0, 0x10, lo=7)
    wired.send(1, 0x10, time=MS, lo=8)  # its own frames are no receptions
    wired.send(0, 0x11, time=2 * MS, buffer=2)
    wired.bus.advance(SECOND)
    first = edge(length(0x10, b"\7" + bytes(7)))  # starts with bit 1, and is had a bit before its end
    assert [(each[0], each[1], each[3]) for each in wired.of(2, "rx")][:2] == [
        (first, 0x10, 7),
        (edge(3001 + length(0x10, b"\x08" + bytes(7)) - 1), 0x10, 8),
    ]
    assert [each[1] for each in wired.of(1, "rx")] == [0x11]
    assert [node.received for node in wired.bus.nodes] == [1, 1, 3]
    assert noted == [(first, 1.0)]
    assert (wired.bus.counters.lost, wired.bus.counters.errors) == (0, 0)


def test_a_frame_that_its_only_listener_loses_is_lost():
    wired, _ = with_faults(2, Loss(1))
    wired.send(0, 0x10)
    wired.bus.advance(SECOND)
    assert wired.bus.counters.lost == 1 and wired.of(0, "done")[0][2] == TX_SENT


def test_a_corrupted_word_is_the_sent_one_with_the_bits_of_the_mask_inverted_at_one_node():
    fault = Corruption(2, 0x80000001, 0x10)
    fault.every = 2
    wired, [noted] = with_faults(3, fault)
    for n in range(4):
        wired.send(0, 0x10, time=n * MS, lo=0xF0 + n, hi=5)
        wired.bus.advance(n * MS + MS // 2)
    assert [each[3:] for each in wired.of(1, "rx")] == [(0xF0 + n, 5) for n in range(4)]
    got = wired.of(2, "rx")
    assert [each[3:] for each in got] == [(0xF0, 5), (0x800000F0, 5), (0xF2, 5), (0x800000F2, 5)]
    assert noted == [(got[1][0], 1.0), (got[3][0], 1.0)] and fault.tampered == 2


def test_a_late_frame_is_whole_and_may_be_overtaken():
    fault = Delay(1, 300_000, 0x10)
    wired, [noted] = with_faults(3, fault)
    words = {"flags": 6 | FLAG_EXTENDED, "lo": 0x04030201, "hi": 0x0605}
    wired.send(0, 0x10, **words)
    wired.send(0, 0x11, buffer=2)
    wired.bus.advance(SECOND)
    on_time = wired.of(2, "rx")
    late = wired.of(1, "rx")
    assert [each[1] for each in on_time] == [0x10, 0x11]  # eleven zeros go first
    assert [each[1] for each in late] == [0x11, 0x10]
    [(time, *frame)] = [each for each in on_time if each[1] == 0x10]
    assert frame == [0x10, 6 | FLAG_EXTENDED, 0x04030201, 0x0605]
    assert [each for each in late if each[1] == 0x10] == [(time + 300_000, *frame)]
    assert noted == [(time, 300.0)]  # in us
    assert wired.bus.nodes[1].received == wired.bus.nodes[2].received == 2 and wired.bus.counters.lost == 0
    assert fault.tampered == 1


@pytest.mark.parametrize("fault", [Loss(1), Corruption(1, 1), Delay(1, 5), Misreading("FORM", 1, False)])
def test_what_a_node_sends_itself_is_not_among_what_it_misses(fault):
    assert not fault.picks(5, 1) and fault.picks(5, 0)


def test_a_sender_that_is_to_misread_is_the_one_whose_frames_are_picked():
    fault = Misreading("BIT", 1, True, 5)
    assert fault.picks(5, 1) and not fault.picks(5, 0) and not fault.picks(6, 1)
    assert (fault.unfit, dict(fault.seen), fault.error, fault.node, fault.of_sender) == (0, {}, "BIT", 1, True)


def test_a_node_that_takes_no_part_cannot_misread():
    fault = Misreading("FORM", 1, False)
    wired, [noted] = with_faults(3, fault)
    wired.bus.set_mode(1, RESET, 0)
    wired.send(0, 5, time=10)
    wired.bus.advance(MS)
    assert (fault.unfit, fault.tampered, wired.bus.counters.errors, noted) == (1, 0, 0, [])
    wired.bus.set_mode(1, OPERATING, MS)
    wired.send(0, 5, time=2 * MS)
    wired.bus.advance(3 * MS)
    assert fault.unfit == 1 and fault.tampered > 10 and len(noted) == fault.tampered


def test_bits_that_are_misread_in_one_frame_are_over_with_the_next():
    """A fault plans two bits of an error flag; the frame is lost in arbitration before, and both are forgotten."""
    fault = Misreading("BROKEN_ERROR_FRAME", 0, True, 0x700)
    fault.count = 1
    wired, _ = with_faults(3, fault)
    wired.send(0, 0x700)
    wired.send(1, 0x100)
    wired.bus.advance(SECOND)
    assert [each[1] for each in wired.of(2, "rx")] == [0x100, 0x700]
    assert fault.seen["n0", "BROKEN_ERROR_FRAME", "primary"] == 1
    assert wired.bus.bit_level.disturbance.misread == []


def test_on_a_bus_of_two_a_wrong_crc_is_the_missing_acknowledgement_that_the_sender_flags_first():
    fault = Misreading("CRC", 1, False)
    fault.count = 1
    wired, [noted] = with_faults(2, fault)
    wired.send(0, 0x10, lo=7)
    wired.bus.advance(SECOND)
    assert fault.seen == {("n0", "ACK", "secondary"): 1, ("n1", "FORM", "primary"): 1}
    delimiter = 1 + length(0x10, b"\7" + bytes(7)) - 8
    assert noted == [(edge(delimiter + 1), 1.0)]


# ---- silence


def test_a_node_is_silenced_once_and_that_is_reported_when_it_is_off():
    fault = Silence(0)
    wired, [noted] = with_faults(3, fault)
    wired.send(0, 0x10)
    wired.bus.advance(100 * MS)
    statuses = wired.of(0, "status")
    assert [each[4] for each in statuses] == [0] * 31 + [1]
    assert noted == [(statuses[-1][0], 1.0)]
    assert (fault.tampered, fault.count, wired.bus.nodes[0].mode) == (32, 32, BUS_OFF)
    assert not fault.takes(0x10, 0)
    assert (
        fault.seen
        == {
            ("n0", "BIT", "primary"): 32,
            ("n1", "BIT_STUFFING", "secondary"): 16,  # passive flags are not seen
            ("n2", "BIT_STUFFING", "secondary"): 16,
        }
        or fault.seen["n0", "BIT", "primary"] == 32
    )


@pytest.mark.parametrize(
    ("mode", "picks"), [(OPERATING, True), (JOINING, True), (UNPLUGGED, True), (RESET, False), (BUS_OFF, False)]
)
def test_frames_pass_bit_by_bit_while_a_node_at_another_rate_takes_part(mode, picks):
    wired = Wired(2)
    fault = WrongRate(wired.bus.nodes[1])
    wired.bus.nodes[1].mode = mode
    assert fault.picks(1, 0) == fault.picks(2, 1) == picks


# ---- who does not belong


def intruded(count=2):
    wired = Wired(count)
    return wired, Intruder(wired.bus, "intruder")


def test_an_intruder_acknowledges_and_receives_nothing():
    wired, intruder = intruded(1)
    wired.send(0, 5)
    wired.bus.advance(SECOND)
    assert wired.of(0, "done")[0][2] == TX_SENT
    assert (intruder.number, intruder.node.name, intruder.node.listening, intruder.node.received) == (
        1, "intruder", False, 0,
    )  # fmt: skip
    assert not intruder.inbox.take() and intruder.node.order == STAGE_BUS * 256 + 255


def test_an_intruders_frame_starts_at_its_bit_and_a_full_buffer_takes_no_other():
    wired, intruder = intruded()
    assert intruder.offer(2, 100, 0x123, 5, 0x04030201, 0x05)
    assert not intruder.offer(2, 50, 1, 0, 0, 0)
    assert intruder.offer(1, 900, 0x124, 0, 0, 0)
    wired.bus.recompute_next()
    assert wired.bus.next_bit == 100 and wired.bus.buffers.waiting_count == 2
    row = intruder.number << 5 | 2 << 3
    assert wired.bus.buffers.rows[row + 2] == edge(100)  # asked for
    wired.bus.advance(SECOND)
    first, second = wired.of(0, "rx")
    bits = length(0x123, b"\1\2\3\4\5")
    assert first == (edge(100 + bits - 1), 0x123, 5, 0x04030201, 0x05)
    assert second == (edge(900 + length(0x124, b"") - 1), 0x124, 0, 0, 0)
    assert intruder.offer(2, 10_000_000, 1, 0, 0, 0)


def test_an_intruder_that_is_suspended_or_joins_waits_and_one_that_is_off_gives_up():
    wired, intruder = intruded()
    intruder.node.suspend_bit = 500
    assert intruder.offer(1, 100, 1, 0, 0, 0) and intruder.offer(2, 600, 1, 0, 0, 0)
    row = intruder.number << 5
    assert [wired.bus.buffers.rows[row + (buffer << 3) + 1] for buffer in (1, 2)] == [500, 600]
    intruder.node.mode = JOINING
    assert intruder.offer(3, 700, 1, 0, 0, 0)
    assert wired.bus.buffers.rows[row + (3 << 3) + 1] == NEVER + 700
    assert wired.bus.buffers.rows[row + (3 << 3) + 2] == edge(700)
    for mode in (RESET, BUS_OFF, UNPLUGGED):
        wired, intruder = intruded()
        intruder.node.mode = mode
        assert not intruder.offer(1, 100, 1, 0, 0, 0) and wired.bus.buffers.waiting_count == 0


@pytest.mark.parametrize(("flags", "sent"), [(8, 8), (8 | FLAG_SINGLE_SHOT, 8), (3, 3)])
def test_a_duplicate_begins_next_to_its_frame_with_the_bits_of_the_mask_inverted(flags, sent):
    wired, intruder = intruded()
    duplicate = Duplicate(intruder, 0x10, 0xFF)
    reported = []
    duplicate.noted = lambda *what: reported.append(what)
    tampering_of(wired.bus).add(duplicate)
    wired.send(0, 0x11)
    wired.bus.advance(MS)
    assert duplicate.tampered == 0
    wired.send(0, 0x10, time=MS, flags=flags, lo=0x0F0F0F, hi=0)
    start = 3001
    wired.bus.advance(edge(start))
    row = intruder.number << 5 | 1 << 3
    assert list(wired.bus.buffers.rows[row + 4 : row + 8]) == [0x10, sent, 0x0F0FF0, 0]
    assert reported == [(edge(start), 1.0)] and duplicate.tampered == 1
    wired.bus.advance(SECOND)
    assert wired.bus.counters.errors > 0
    assert 0x0F0FF0 in [each[3] for each in wired.of(1, "rx")]
    assert not duplicate.picks(0x10, intruder.number)  # its own is no reason for another


@pytest.mark.parametrize("period_us", [0, 100, 500])
def test_a_babbling_node_sends_as_often_as_it_can_or_by_its_period(period_us):
    wired, intruder = intruded()
    fault = Babbling(intruder, 0x0, period_us * 1000)
    reported = []
    fault.noted = lambda *what: reported.append(what)
    tampering_of(wired.bus).add(fault)
    fault.start_from(20_000)
    until = 3 * MS
    for now in range(0, until, 10_000):
        wired.bus.advance(now)
    bits = length(0)
    first = 20_000 * 3 // 1000 + 1
    step = max(period_us * 3, bits + 3)
    # the first is behind its instant; by a period the others begin in the bits in which they are due
    due = first if period_us == 0 else first - 1
    starts = [first] + [due + n * step for n in range(1, (until * 3 // 1000 - due) // step + 1)]
    got = [each[0] for each in wired.of(0, "rx")]
    found = [edge(start + bits - 1) for start in starts]
    assert got[: len(found) - 1] == found[:-1]
    assert [time for time, _ in reported][: len(starts) - 1] == [edge(start) for start in starts[:-1]]
    assert abs(fault.tampered - len(starts)) <= 1 and {difference for _, difference in reported} == {1.0}
    assert wired.bus.counters.errors == 0
