"""A message between processes on both sides of everything that decides whether it is one."""

import pytest

from ranger_sim.foundation import events
from ranger_sim.foundation.events import FLAG_BRS, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.harness.processes.channel import SLOT_WORDS
from ranger_sim.harness.processes.kinds import FIELDS, FROM_BOARD, KINDS, NOTE, PAYLOADS, TO_BOARD
from ranger_sim.harness.processes.places import NOTE_WORDS, SSP_USED, SSP_WORDS
from tests.harness.processes.test_channel import NEAR, Pair

SECOND = 1_000_000_000
LONG_FRAME = [64, *[0] * 8]
SEGMENTS = (events.SSP_SEGMENT, events.SSP_START, events.SSP_LOAD)


class Line:
    """One message word by word, checked as the documentation says, and what the reader makes of it."""

    def __init__(self, kind, fields=None, time_ns=NEAR, order=0, payload=None, version=1, top=0):
        self.pair = Pair(KINDS[kind].direction if kind in KINDS else FROM_BOARD)
        ranges = KINDS[kind].ranges if kind in KINDS else [(0, 0)] * 6
        values = [least for least, _ in ranges]
        for field, value in (fields or {}).items():
            values[FIELDS.index(field)] = value
        if payload is None:
            payload = [0] * SSP_WORDS if kind in SEGMENTS else [3, 0] if kind in PAYLOADS else []
            if kind == events.CAN_REQUEST:  # a classic frame has none
                payload = LONG_FRAME if values[3] & FLAG_FD else []
        words = [kind | version << 8 | len(payload) << 16 | top, time_ns, order, *values, 0, 0]
        check = 1
        for word in [*words, *payload]:
            check = (check ^ word % 2**64) * 1099511628211 % 2**64
        words.append(check - 2**64 if check >= 2**63 else check)
        block = self.pair.block.words
        for at, word in enumerate([*words, *payload]):
            block[self.pair.first + at] = word
        self.slots = 1 + -(-len(payload) // SLOT_WORDS)
        block[self.pair.used_word] = self.slots

    def read(self):
        """(how many messages arrived, what was reported of it)."""
        arrived = self.pair.read()
        reader = self.pair.reader
        assert reader.damaged == (0 if arrived or reader.notes else 1)
        return len(arrived) + len(reader.notes), reader.last_damage


@pytest.mark.parametrize("kind", KINDS, ids=[each.name for each in KINDS.values()])
def test_every_field_takes_its_limits_and_nothing_beyond(kind):
    for field, (least, largest) in zip(FIELDS, KINDS[kind].ranges, strict=True):
        more = {"d": FLAG_EXTENDED} if kind == events.CAN_REQUEST and field != "d" else {}
        for value in (least, largest):
            assert Line(kind, {**more, field: value}).read() == (1, ""), (field, value)
        for value in (least - 1, largest + 1):
            reported = f"{KINDS[kind].name}: field {field} is {value}, allowed are {least} to {largest}"
            count, damage = Line(kind, {**more, field: value}).read()
            assert count == 0 and reported in damage, (field, value)


@pytest.mark.parametrize("kind", [events.PIN_OUTPUT, events.PIN_EDGE])
def test_a_stamp_lies_within_a_second_of_the_turn(kind):
    for off in (-SECOND, SECOND, 0):
        assert Line(kind, time_ns=NEAR + off).read() == (1, "")
    for off in (-SECOND - 1, SECOND + 1):
        count, damage = Line(kind, time_ns=NEAR + off).read()
        assert count == 0 and "stamp is more than a second" in damage


@pytest.mark.parametrize(
    ("identifier", "flags", "whole"),
    [(0x7FF, 0, True), (0x800, 0, False), (0x800, FLAG_EXTENDED, True), (0x7FF, FLAG_EXTENDED, True)],
)
def test_an_identifier_of_more_than_eleven_bits_is_an_extended_ones(identifier, flags, whole):
    count, damage = Line(events.CAN_REQUEST, {"c": identifier, "d": flags | 8}).read()
    assert count == (1 if whole else 0) and ("does not fit in 11 bits" in damage) is not whole


FAST = FLAG_FD | FLAG_BRS


@pytest.mark.parametrize(
    ("flags", "payload", "whole"),
    [
        (8, [], True),
        (FAST | 15, LONG_FRAME, True),
        (FLAG_FD, [0], True),
        (FAST | 9, [12, 1, 2], True),
        (FAST | 15, [], False),  # no data
        (FAST | 9, LONG_FRAME, False),  # a length code of twelve bytes
        (8, [8, 1], False),  # data of a classic frame are in its words
        (FLAG_BRS | 8, [8, 1], False),
        (FAST | FLAG_REMOTE, [0], False),
        (128, [], False),
        (FAST | 15, [64, 0], False),  # more bytes than its words hold
    ],
)
def test_only_a_can_fd_frame_has_data_and_as_many_as_its_length_code_means(flags, payload, whole):
    count, damage = Line(events.CAN_REQUEST, {"d": flags}, payload=payload).read()
    assert count == (1 if whole else 0) and bool(damage) is not whole


def test_only_this_version_and_no_other_number_is_read():
    assert Line(events.PIN_OUTPUT).read() == (1, "")
    for other in ({"version": 0}, {"version": 2}, {"top": -(2**63)}):
        count, damage = Line(events.PIN_OUTPUT, **other).read()
        assert count == 0 and "it is not of version 1" in damage


def test_a_kind_goes_its_own_way_alone():
    for kind, row in KINDS.items():
        line = Line(kind)
        line.pair.reader.direction = TO_BOARD if row.direction == FROM_BOARD else FROM_BOARD
        count, damage = line.read()
        assert count == 0 and "not one that goes this way" in damage
    for number in (0, 127, 128, 255):
        count, damage = Line(number).read()
        assert count == 0 and f"kind {number}: its kind is not one that goes this way" in damage


@pytest.mark.parametrize("kind", SEGMENTS)
def test_a_segment_has_all_its_words_of_sixteen_bits_and_a_number_in_use(kind):
    def segment(at=0, word=0):
        words = [0] * SSP_WORDS
        words[at] = word
        return words

    for at in (0, SSP_USED - 1):
        assert Line(kind, payload=segment(at, 0xFFFF)).read() == (1, "")
        for wrong in (-1, 0x10000):
            count, damage = Line(kind, payload=segment(at, wrong)).read()
            assert count == 0 and "its payload is out of range" in damage
    assert Line(kind, payload=segment(SSP_USED, SSP_USED)).read() == (1, "")
    for wrong in (-1, SSP_USED + 1):
        assert "its payload is out of range" in Line(kind, payload=segment(SSP_USED, wrong)).read()[1]
    assert "its payload is out of range" in Line(kind, payload=[0] * (SSP_WORDS - 1)).read()[1]
    for length in (0, SSP_WORDS + 1):
        assert "its length does not fit its kind" in Line(kind, payload=[0] * length).read()[1]


@pytest.mark.parametrize("kind", [events.UART_OUTPUT, NOTE])
def test_bytes_are_at_most_what_their_words_can_hold(kind):
    for length, words in ((0, 1), (0, 2), (8, 2), (16, 3), (2040, NOTE_WORDS)):
        assert Line(kind, payload=[length] + [0] * (words - 1)).read() == (1, "")
    for length, words in ((1, 1), (9, 2), (-1, 2), (17, 3)):
        count, damage = Line(kind, payload=[length] + [0] * (words - 1)).read()
        assert count == 0 and "its payload is out of range" in damage
    assert "its length does not fit its kind" in Line(kind, payload=[8] + [0] * NOTE_WORDS).read()[1]
    none = Line(kind, payload=[]).read()
    assert none == (1, "") if kind == events.UART_OUTPUT else "its length does not fit its kind" in none[1]


def test_what_carries_no_object_has_no_payload():
    assert "its length does not fit its kind" in Line(events.PIN_OUTPUT, payload=[0]).read()[1]


def test_a_message_ends_within_the_slots_that_are_in_use():
    line = Line(events.UART_OUTPUT, payload=[2040] + [0] * (NOTE_WORDS - 1))
    assert line.slots == 1 + -(-NOTE_WORDS // SLOT_WORDS)
    line.pair.block.words[line.pair.used_word] = line.slots - 1
    line.pair.read()
    assert "its length does not fit its kind" in line.pair.reader.last_damage
    assert line.pair.reader.notes == []
