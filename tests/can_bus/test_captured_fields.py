"""Where in a frame, and in what follows it, a controller says that it met an error: each field named on paper.

One node sends a frame of four bytes, two receive it, and single bits of it are sampled inverted by all. LPC2194 user
manual UM10114, table of CANICR: codes of the fields, bits 16 to 20; what kind of error, 22 and 23; who met it, 21.
"""

import pytest

from ranger_sim.can_bus.frame import wire
from ranger_sim.can_bus.node import (
    ICR_BUS_ERROR,
    ICR_FIELD_MASK,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    ICR_RECEIVING,
    KIND_BIT,
    KIND_FORM,
    KIND_OTHER,
)
from ranger_sim.can_bus.tampering import error_name, places_of_error
from ranger_sim.foundation.events import CAN_STATUS

from .bit_oracle import Frame, stuffed
from .oracle_comparison import BIT_NS, Scenario, run_on_our_bus

SENDER, RECEIVERS = 0, (1, 2)
START = 1
STANDARD = Frame(0x2AB, b"\x55" * 4, single_shot=True, buffer=1)  # never five alike before the CRC: nothing to stuff
EXTENDED = Frame(0x0AAAAAAB, b"\x55" * 4, extended=True, single_shot=True, buffer=1)
# (code, bits) of UM10114 in the order in which they pass, up to the CRC sequence, which has 15 bits and its stuff bits
BEHIND = ((9, 1), (11, 4), (10, 32))
HEADS = {
    STANDARD: ((3, 1), (2, 8), (6, 3), (4, 1), (5, 1), *BEHIND),
    EXTENDED: ((3, 1), (2, 8), (6, 3), (4, 1), (5, 1), (7, 5), (15, 8), (14, 5), (12, 1), (13, 1), *BEHIND),
}
ARBITRATION = {STANDARD: 13, EXTENDED: 33}
CRC, CRC_DELIMITER, ACK_SLOT, ACK_DELIMITER, END = 8, 24, 25, 27, 26
ACTIVE_FLAG, INTERMISSION, DELIMITER, OVERLOAD_FLAG = 17, 18, 23, 28


def met(frame, *inverted):
    """{node: [(bit, field, kind, as a receiver)]} of the errors that each node reported."""
    inboxes = run_on_our_bus(Scenario(3, 400, ((START, SENDER, frame),), ((0, 0),) * 3, inverted))[1]
    found = {}
    for number, inbox in enumerate(inboxes):
        found[number] = []
        while inbox.take():
            if inbox.kind == CAN_STATUS and inbox.b & ICR_BUS_ERROR:
                field = inbox.b >> ICR_FIELD_SHIFT & ICR_FIELD_MASK
                reported = (
                    inbox.time // BIT_NS - 1,
                    field,
                    inbox.b >> ICR_KIND_SHIFT & 3,
                    bool(inbox.b & ICR_RECEIVING),
                )
                found[number].append(reported)
    return found


def fields_of(frame):
    """The code of each bit of a frame that has no stuff bits before its CRC."""
    bits, is_stuff, _ = stuffed(frame)
    head = [code for code, count in HEADS[frame] for _ in range(count)]
    assert not any(is_stuff[: len(head)]), "the frame was chosen without"
    return head + [CRC] * (len(bits) - len(head)) + [CRC_DELIMITER, ACK_SLOT, ACK_DELIMITER] + [END] * 7


@pytest.mark.parametrize("frame", [STANDARD, EXTENDED], ids=["standard", "extended"])
def test_a_sender_names_the_field_of_the_bit_that_is_not_what_it_sent(frame):
    fields = fields_of(frame)
    for place in range(ARBITRATION[frame], len(fields)):
        (bit, field, kind, receiving), *_ = met(frame, START + place)[SENDER]
        assert (bit, field, receiving) == (START + place, fields[place], False)
        # what differs from the bit sent is a bit error first, in a field of fixed form as well; no answer is another
        assert kind == (KIND_OTHER if fields[place] == ACK_SLOT else KIND_BIT), f"bit {place} of the frame"


def test_receivers_name_the_field_of_fixed_form_that_is_broken():
    fields = fields_of(STANDARD)
    for place in range(len(stuffed(STANDARD)[0]), len(fields) - 1):
        if fields[place] in (CRC_DELIMITER, ACK_DELIMITER, END):
            for node in RECEIVERS:
                assert met(STANDARD, START + place)[node][0] == (START + place, fields[place], KIND_FORM, True)


def test_an_active_flag_that_does_not_show_is_an_error_in_it():
    """The flag begins behind the error and has six bits; each that is recessive is a bit error there."""
    at = START + fields_of(STANDARD).index(CRC_DELIMITER)
    for n in range(1, 7):
        found = met(STANDARD, at, at + n)
        assert found[SENDER][1][:3] == (at + n, ACTIVE_FLAG, KIND_BIT)
        assert [found[node][1] for node in RECEIVERS] == [(at + n, ACTIVE_FLAG, KIND_BIT, True)] * 2


def test_a_dominant_bit_in_a_delimiter_is_an_error_of_form_in_it():
    """The first bit behind the flag is waited for; bits two to seven of the delimiter have a fixed form."""
    at = START + fields_of(STANDARD).index(CRC_DELIMITER)
    for n in range(2, 8):
        found = met(STANDARD, at, at + 6 + n)
        for node in (SENDER, *RECEIVERS):
            assert found[node][1][:3] == (at + 6 + n, DELIMITER, KIND_FORM)


@pytest.mark.parametrize("first", [1, 2])
def test_an_overload_flag_that_does_not_show_is_an_error_in_it(first):
    """A dominant bit in one of the first two of the intermission calls for an overload frame of every node."""
    behind = START + len(fields_of(STANDARD)) - 1 + first
    for n in range(1, 7):
        found = met(STANDARD, behind, behind + n)
        for node in (SENDER, *RECEIVERS):
            assert found[node][0][:3] == (behind + n, OVERLOAD_FLAG, KIND_BIT)
    for n in range(2, 8):
        found = met(STANDARD, behind, behind + 6 + n)
        for node in (SENDER, *RECEIVERS):
            assert found[node][0][:3] == (behind + 6 + n, DELIMITER, KIND_FORM)


def test_an_undisturbed_frame_and_an_overload_frame_are_not_errors():
    behind = START + len(fields_of(STANDARD))
    assert met(STANDARD) == met(STANDARD, behind) == {0: [], 1: [], 2: []}


def test_a_captured_error_has_one_of_six_names_or_is_not_new():
    """By field and kind of UM10114: 0 bit, 1 form, 2 stuff, 3 other; whatever else is in the interrupt word."""
    for rest in (0, ICR_RECEIVING, ICR_BUS_ERROR | 0x4, 0xFF000000 | ICR_RECEIVING | 0xFFFF):

        def name(field, kind, rest=rest):
            return error_name(rest & ~(0x1F << 16 | 3 << 22) | field << 16 | kind << 22)

        for kind in range(4):
            assert [name(field, kind) for field in (17, 23, 28)] == ["BROKEN_ERROR_FRAME"] * 3
            assert [name(field, kind) for field in (19, 22)] == ["", ""]
        for field in (2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 18, 24, 25, 26, 27):
            wanted = ["BIT", "FORM", "BIT_STUFFING", "ACK" if field == 25 else "CRC"]
            assert [name(field, kind) for kind in range(4)] == wanted


def test_of_a_broken_error_frame_the_third_bit_of_the_flag_is_misread():
    """The flag begins behind the error; of the sender's own error that is behind the arbitration, of a receiver's
    behind the CRC."""
    bits, fields = wire(STANDARD.identifier, 4, 0x55555555, 0)
    for of_sender, first in ((True, 14), (False, fields.index(24))):
        error, misread = places_of_error("BROKEN_ERROR_FRAME", of_sender, bits, fields)
        assert (error, misread) == (first, first + 3)
        found = met(STANDARD, START + error, START + misread)
        assert found[SENDER][1][:2] == (START + misread, ACTIVE_FLAG)
