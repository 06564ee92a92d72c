"""What ISO 11898-1 says of errors, overload and intermission, bit by bit: answers counted on paper.

Bits are 1 us; a frame that is asked for before bit 1 starts there, and the bit at position n of it is bit 1 + n.
`LENGTH` is that of the frame, from the start of frame to the end of EOF, and bits behind its CRC count from its end.
"""

import pytest

from ranger_sim.can_bus.frame import (
    FIELD_CRC_DELIMITER,
    FIELD_DATA,
    FIELD_TOLERATED,
    frame_bits,
)
from ranger_sim.can_bus.node import (
    ICR_BUS_ERROR,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    ICR_RECEIVING,
    KIND_BIT,
    KIND_FORM,
    KIND_OTHER,
    KIND_STUFF,
    OPERATING,
)

from .bit_oracle import Frame
from .oracle_comparison import Scenario, on_our_bus
from .wiring import Wired, edge

FRAME, NEXT = Frame(0x555, buffer=1), Frame(0x556, buffer=2)
LENGTH, NEXT_LENGTH = frame_bits(0x555, 0, 0, 0), frame_bits(0x556, 0, 0, 0)
START = 1
FLAG, DELIMITER, INTERMISSION, SUSPENSION = 6, 8, 3, 8
ACK_SLOT = START + LENGTH - 9
EOF = START + LENGTH - 7  # its first bit
LAST = START + LENGTH - 1  # of the frame
CRC_DELIMITER = START + LENGTH - 10  # where a dominant bit is an error to everybody at once
REPEATED = CRC_DELIMITER + FLAG + DELIMITER + INTERMISSION + 1  # where the frame begins again after that


def outcome(*inverted, frames=(FRAME,), counters=((0, 0), (0, 0))):
    """Node 0 sends `frames`; the other ones receive."""
    requests = tuple((START, 0, frame) for frame in frames)
    return on_our_bus(Scenario(len(counters), 800, requests, tuple(counters), inverted))[0]


def moves(of, node):
    """(bit, transmit errors, receive errors) whenever they moved, without what they were at first."""
    return of.counters[node][1:]


def sent(of, node=0):
    return [bit for bit, what, *_ in of.seen[node] if what == "sent"]


def received(of, node=1):
    return [bit for bit, what, *_ in of.seen[node] if what == "received"]


# ---- error frames ----------------------------------------------------------------------------------------


def test_an_error_that_all_see_at_once_takes_a_flag_a_delimiter_and_an_intermission():
    of = outcome(CRC_DELIMITER)
    assert sent(of) == [REPEATED + LENGTH - 1] and received(of) == [REPEATED + LENGTH - 2]
    assert moves(of, 0) == [(CRC_DELIMITER, 8, 0), (REPEATED + LENGTH - 1, 7, 0)]
    assert moves(of, 1) == [(CRC_DELIMITER, 0, 1), (REPEATED + LENGTH - 9, 0, 0)]  # its ACK bit


@pytest.mark.parametrize(("position", "seen"), [(30, 0), (29, 2)])
def test_receivers_inside_the_stuffed_region_notice_with_the_sixth_equal_bit(position, seen):
    """Data 1010...: a 0 that reads 1 begins no run of dominant bits; a 1 that reads 0, behind a 0, is its second."""
    wired = Wired(2)
    wired.bus.inject_errors(1, position)
    wired.send(0, 0x555, lo=0xAAAAAAAA, hi=0xAAAAAAAA)
    wired.bus.advance(10**9)
    field = ICR_BUS_ERROR | FIELD_DATA << ICR_FIELD_SHIFT
    noticed = START + position + FLAG - seen
    assert wired.of(0, "status")[0][:2] == (edge(START + position + 1), field | KIND_BIT << ICR_KIND_SHIFT)
    assert wired.of(1, "status")[0][:2] == (edge(noticed + 1), field | ICR_RECEIVING | KIND_STUFF << ICR_KIND_SHIFT)
    assert wired.log()[0][0] == edge(noticed + 1 + FLAG + DELIMITER)


@pytest.mark.parametrize("inside", range(1, FLAG + 1))
def test_a_bit_error_in_an_active_flag_costs_all_eight_and_begins_the_flag_anew(inside):
    wrong = CRC_DELIMITER + inside
    of = outcome(CRC_DELIMITER, wrong)
    assert moves(of, 0)[:2] == [(CRC_DELIMITER, 8, 0), (wrong, 16, 0)]
    assert moves(of, 1)[:2] == [(CRC_DELIMITER, 0, 1), (wrong, 0, 9)]
    assert sent(of) == [wrong + FLAG + DELIMITER + INTERMISSION + LENGTH]


def test_a_dominant_bit_right_behind_its_flag_costs_a_receiver_eight_and_the_transmitter_nothing():
    behind = CRC_DELIMITER + FLAG + 1
    of = outcome(CRC_DELIMITER, behind)
    assert moves(of, 0)[:1] == [(CRC_DELIMITER, 8, 0)] and moves(of, 0)[1][1:] == (7, 0)
    assert moves(of, 1)[:2] == [(CRC_DELIMITER, 0, 1), (behind, 0, 9)]
    assert sent(of) == [REPEATED + 1 + LENGTH - 1]


def test_seven_dominant_bits_behind_a_flag_are_tolerated_and_each_eighth_costs_all_eight():
    behind = CRC_DELIMITER + FLAG + 1
    seven = outcome(CRC_DELIMITER, *range(behind, behind + 7))
    assert moves(seven, 0)[1][1:] == (7, 0) and moves(seven, 1)[1:2] == [(behind, 0, 9)]
    of = outcome(CRC_DELIMITER, *range(behind, behind + 16))
    assert moves(of, 0)[:3] == [(CRC_DELIMITER, 8, 0), (behind + 7, 16, 0), (behind + 15, 24, 0)]
    assert moves(of, 1)[1:4] == [(behind, 0, 9), (behind + 7, 0, 17), (behind + 15, 0, 25)]
    assert sent(of) == [REPEATED + 16 + LENGTH - 1]


@pytest.mark.parametrize("place", range(2, DELIMITER))
def test_a_dominant_bit_in_a_delimiter_is_a_form_error(place):
    wrong = CRC_DELIMITER + FLAG + place
    of = outcome(CRC_DELIMITER, wrong)
    assert moves(of, 0)[:2] == [(CRC_DELIMITER, 8, 0), (wrong, 16, 0)]
    assert moves(of, 1)[:2] == [(CRC_DELIMITER, 0, 1), (wrong, 0, 2)]
    assert sent(of) == [wrong + FLAG + DELIMITER + INTERMISSION + LENGTH]


def test_what_a_register_shows_of_each_error():
    wired = Wired(2)
    start = CRC_DELIMITER - START
    for position in (start, start + FLAG + 1):
        wired.bus.inject_error_at(edge(START + position))
    wired.send(0, 0x555, flags=0)
    wired.bus.advance(10**9)
    at = FIELD_CRC_DELIMITER << ICR_FIELD_SHIFT | ICR_BUS_ERROR
    behind = FIELD_TOLERATED << ICR_FIELD_SHIFT | ICR_BUS_ERROR
    assert [status[1:4] for status in wired.of(0, "status")] == [(at | KIND_BIT << ICR_KIND_SHIFT, 8, 0), (0, 7, 0)]
    assert [status[1:4] for status in wired.of(1, "status")] == [
        (at | ICR_RECEIVING | KIND_FORM << ICR_KIND_SHIFT, 0, 1),
        (behind | ICR_RECEIVING | KIND_OTHER << ICR_KIND_SHIFT, 0, 9),
        (0, 0, 8),
    ]
    assert wired.bus.counters.errors == 1  # one error frame


# ---- passive nodes ---------------------------------------------------------------------------------------


def test_a_passive_sender_without_acknowledgement_pays_only_for_a_dominant_bit_in_its_flag():
    assert moves(outcome(counters=((130, 0),)), 0) == []
    disturbed = ACK_SLOT + 3
    assert moves(outcome(disturbed, counters=((130, 0),)), 0) == [(disturbed, 138, 0)]
    behind = ACK_SLOT + FLAG + 1  # no bit of the flag any more; (b) is a receiver's
    assert moves(outcome(behind, counters=((130, 0),)), 0) == []


def test_a_passive_flag_is_complete_after_six_equal_bits():
    """The third bit of the flag reads dominant: six equal bits begin behind it."""
    alone = Wired(1, 1_000_000)
    alone.bus.nodes[0].transmit_errors, alone.bus.nodes[0].passive = 130, True
    alone.bus.inject_error_at((ACK_SLOT + 3) * 1000)
    alone.send(0, 0x555, flags=0)
    alone.bus.advance(200_000)
    first, second, *_ = alone.log()
    end = ACK_SLOT + 3 + FLAG + DELIMITER + 1
    assert first[0] == end * 1000
    again = end + INTERMISSION + SUSPENSION  # and its length to the ACK slot, flag and delimiter
    assert second[0] == (again + (ACK_SLOT - START) + 1 + FLAG + DELIMITER) * 1000


def test_a_passive_error_frame_on_a_recessive_bus_is_not_seen():
    of = outcome(START, counters=((200, 0), (0, 0)))  # its start of frame reads recessive
    again = START + 1 + FLAG + DELIMITER + INTERMISSION + SUSPENSION
    assert moves(of, 0) == [(START, 208, 0), (again + LENGTH - 1, 207, 0)]
    assert moves(of, 1) == [] and received(of) == [again + LENGTH - 2]


@pytest.mark.parametrize(("errors", "wait"), [(127, 0), (128, 0), (129, SUSPENSION)])
def test_a_sender_suspends_transmission_when_it_is_passive_at_the_end_of_intermission(errors, wait):
    """At 128 its own frame has made it error active again by then."""
    of = outcome(frames=(FRAME, NEXT), counters=((errors, 0), (0, 0)))
    first, second = sent(of)
    assert (first, second - first) == (LAST, INTERMISSION + wait + NEXT_LENGTH)


def test_suspension_holds_on_the_bit_by_bit_path_too():
    for errors, wait in ((120, 0), (121, SUSPENSION)):  # eight more by the error; one less by the frame
        of = outcome(CRC_DELIMITER, frames=(FRAME, NEXT), counters=((errors, 0), (0, 0)))
        first, second = sent(of)
        # it was active when the error came; passive with 128 or 129 at the end of the error frame's intermission
        assert first == REPEATED + SUSPENSION + LENGTH - 1
        assert second - first == INTERMISSION + wait + NEXT_LENGTH


# ---- the arbitration field -------------------------------------------------------------------------------


def test_a_recessive_stuff_bit_of_the_arbitration_field_that_reads_dominant_costs_its_sender_nothing():
    frame = Frame(0, buffer=1)  # 00000 1: the first stuff bit is at position 5
    of = outcome(START + 5, frames=(frame,), counters=((5, 0), (0, 0)))
    assert [each[1:] for each in moves(of, 0)] == [(4, 0)]  # its frame, the second time
    assert moves(of, 1)[0] == (START + 5, 0, 1)
    # behind the arbitration field it is a bit error: 13 bits and two stuff bits, then 00 0|0 0
    of = outcome(START + 17, frames=(frame,), counters=((5, 0), (0, 0)))
    assert moves(of, 0)[0] == (START + 17, 13, 0)


def test_a_false_dominant_bit_of_an_identifier_is_a_lost_arbitration_and_leaves_a_frame_without_sender():
    of = outcome(START + 3)  # 0 10[1]
    six = START + 3 + 6  # the sixth recessive bit behind it
    assert moves(of, 0)[0] == (six, 0, 1) and moves(of, 1)[0] == (six, 0, 1)
    assert sent(of) == [six + FLAG + DELIMITER + INTERMISSION + LENGTH]


# ---- the end of a frame and intermission -----------------------------------------------------------------


def test_a_reception_is_good_once_it_is_acknowledged_even_if_the_end_of_frame_is_not():
    of = outcome(EOF + 1, counters=((0, 0), (0, 5)))
    assert moves(of, 1)[:2] == [(ACK_SLOT, 0, 4), (EOF + 1, 0, 5)]
    assert len(received(of)) == 1


@pytest.mark.parametrize("place", range(6))
def test_a_dominant_bit_in_the_first_six_of_eof_is_an_error_to_all(place):
    of = outcome(EOF + place)
    assert moves(of, 0)[0] == (EOF + place, 8, 0) and moves(of, 1)[0] == (EOF + place, 0, 1)
    again = EOF + place + FLAG + DELIMITER + INTERMISSION + 1
    assert sent(of) == [again + LENGTH - 1] and received(of) == [again + LENGTH - 2]


def test_a_dominant_last_bit_of_eof_makes_the_sender_repeat_what_receivers_have():
    of = outcome(LAST)
    again = LAST + FLAG + DELIMITER + INTERMISSION + 1
    assert moves(of, 0) == [(LAST, 8, 0), (again + LENGTH - 1, 7, 0)]
    assert moves(of, 1) == []  # its overload flag is no error
    assert received(of) == [LAST - 1, again + LENGTH - 2]


@pytest.mark.parametrize("place", [1, 2])
def test_a_dominant_bit_at_the_begin_of_intermission_is_an_overload_condition(place):
    of = outcome(LAST + place, frames=(FRAME, NEXT))
    assert sent(of) == [LAST, LAST + place + FLAG + DELIMITER + INTERMISSION + NEXT_LENGTH]
    assert moves(of, 0) == moves(of, 1) == []


def test_a_dominant_last_bit_of_a_delimiter_is_an_overload_condition():
    wrong = CRC_DELIMITER + FLAG + DELIMITER
    of = outcome(CRC_DELIMITER, wrong)
    assert moves(of, 0)[0] == (CRC_DELIMITER, 8, 0) and len(moves(of, 0)) == 2
    assert sent(of) == [wrong + FLAG + DELIMITER + INTERMISSION + LENGTH]


def test_a_dominant_last_bit_of_intermission_is_the_start_of_a_frame_that_waits():
    of = outcome(LAST + 3, frames=(FRAME, NEXT))
    assert sent(of) == [LAST, LAST + 3 + NEXT_LENGTH - 1]
    assert received(of) == [LAST - 1, LAST + 3 + NEXT_LENGTH - 2]
    assert moves(of, 0) == moves(of, 1) == []
    # a passive sender must not: for it that is a false start of another's frame
    of = outcome(LAST + 3, frames=(FRAME, NEXT), counters=((200, 0), (0, 0)))
    assert moves(of, 1)[0] == (LAST + 3 + 6, 0, 1)


def test_a_false_start_on_an_idle_bus_is_a_stuff_error_after_six_recessive_bits():
    of = outcome(START + 300, frames=())
    assert moves(of, 0) == moves(of, 1) == [(START + 306, 0, 1)]


# ---- nodes that listen, and those that come late ---------------------------------------------------------


def test_a_silent_node_receives_acknowledged_frames_and_disturbs_nothing():
    wired = Wired(3)
    wired.bus.set_silent(2, True)
    assert wired.bus.operating == 2
    wired.bus.inject_errors(1)
    wired.send(0, 0x10)
    wired.bus.advance(10**9)
    assert len(wired.of(2, "rx")) == len(wired.of(1, "rx")) == 1
    alone = Wired(2)
    alone.bus.set_silent(1, True)
    alone.send(0, 0x10)
    alone.bus.advance(10_000_000)
    assert alone.of(1, "rx") == [] and alone.bus.counters.frames == 0  # nobody acknowledged
    alone.bus.set_silent(1, False)
    alone.bus.advance(20_000_000)
    assert len(alone.of(1, "rx")) == 1


def test_a_node_that_is_added_while_an_error_frame_goes_on_waits_for_a_recessive_sequence():
    wired = Wired(2)
    wired.bus.inject_errors(1)
    wired.send(0, 0x10)
    wired.bus.advance(1000)
    assert wired.bus.disturbed
    wired.bus.add_node("late", wired.inboxes[0], 2, 0)
    late = wired.bus.nodes[2]
    assert late.mode != OPERATING
    wired.bus.advance(10**9)
    assert late.mode == OPERATING and wired.bus.operating == 3
    assert wired.bus.counters.frames == 1
