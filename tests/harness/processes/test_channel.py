"""The stamped channel: what goes in comes out, and what is damaged is named and never delivered."""

import contextlib
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation import events
from ranger_sim.foundation.events import NEVER, EventQueue
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import kinds, places, shared_words
from ranger_sim.harness.processes.block import Block, StageMemory
from ranger_sim.harness.processes.channel import SLOT_WORDS, Bell, Mailbox
from ranger_sim.harness.processes.kinds import FROM_BOARD, KINDS, TO_BOARD
from ranger_sim.harness.processes.places import SLOTS
from ranger_sim.harness.processes.remote_board import RemoteBoard
from ranger_sim.harness.processes.stage import Stage
from ranger_sim.ranger import wiring
from ranger_sim.ranger.robot import Ranger
from tests.examples import examples
from tests.harness.processes.child import Child

NEAR = 1_000_000  # ns; stamps of the tests


class Pair:
    """Both ends of one mailbox of a board's block. They do not ring: the bells are closed at once."""

    def __init__(self, direction):
        self.block = Block("MCH", 0, 0)
        self.block.close()
        first, used = (
            (self.block.to_board_first, places.ASK_USED)
            if direction == TO_BOARD
            else (self.block.from_board_first, places.ANSWER_USED)
        )
        self.first = first
        self.used_word = used
        self.writer = Mailbox(self.block.words, "of the test", first, SLOTS, used, direction)
        self.reader = Mailbox(self.block.words, "of the test", first, SLOTS, used, direction)
        self.writer.until = self.reader.until = NEAR
        self.queue = EventQueue()

    def put(self, time, order, kind, *fields, ref=None):
        self.queue.push(time, order, kind, *(list(fields) + [0] * (6 - len(fields))), ref)
        self.queue.take()
        return self.writer.put(self.queue)

    def delivered(self):
        """Everything the reader delivers: (time, order, kind, a ... f, ref)."""
        self.writer.send()
        return self.read()

    def read(self):
        self.reader.open()
        arrived = EventQueue()
        while self.reader.take(arrived):
            pass
        found = []
        while arrived.take():
            q = arrived
            found.append((q.time, q.order, q.kind, q.a, q.b, q.c, q.d, q.e, q.f, q.ref))
        return found


def segment_of(words, used):
    segment = SspSegment()
    segment.words = [*words, *[0] * (31 - len(words))]
    segment.used = used
    return segment


def test_a_message_arrives_as_it_was_sent():
    pair = Pair(FROM_BOARD)
    pair.put(NEAR, 3, events.CAN_REQUEST, 2, 1, 0x123, 8, 0xFFFFFFFF, 7)
    assert pair.delivered() == [(NEAR, 3, events.CAN_REQUEST, 2, 1, 0x123, 8, 0xFFFFFFFF, 7, None)]
    assert pair.reader.damaged == 0


def test_the_words_of_a_message_are_those_of_the_documentation():
    """Known answer by hand: kind 33 in version 1, no payload, message number 0; then stamp, order and fields."""
    pair = Pair(FROM_BOARD)
    pair.put(NEAR, 5, events.CAN_ABORT, 4, 3)
    words = list(pair.block.words[pair.first : pair.first + SLOT_WORDS])
    assert words[:11] == [33 | 1 << 8, NEAR, 5, 4, 3, 0, 0, 0, 0, 0, 0]
    check = 1
    for word in words[:11]:
        check = (check ^ word) * 1099511628211 % 2**64
    assert words[11] % 2**64 == check
    pair.writer.send()
    assert pair.block.words[pair.used_word] == 1


def test_a_segment_travels_whole():
    pair = Pair(FROM_BOARD)
    pair.put(NEAR, 0, events.SSP_START, ref=segment_of(range(65505, 65536), 30))
    ((*_, segment),) = pair.delivered()
    assert list(segment.words) == list(range(65505, 65536)) and segment.used == 30


@pytest.mark.parametrize("length", [1, 7, 8, 9, 92, 2040])
def test_bytes_of_a_transfer_travel_whole(length):
    pair = Pair(FROM_BOARD)
    data = bytes(range(256)) * 8
    pair.put(NEAR, 0, events.UART_OUTPUT, 1, 0, length, ref=data[:length])
    assert pair.delivered()[0][-1] == data[:length]


def test_messages_keep_their_order_also_with_payloads_between_them():
    pair = Pair(FROM_BOARD)
    for number in range(20):
        pair.put(NEAR, 0, events.PIN_OUTPUT, number, 1)
        pair.put(NEAR, 0, events.SSP_LOAD, ref=segment_of([number] * 31, 5))
    found = pair.delivered()
    assert [each[3] for each in found if each[2] == events.PIN_OUTPUT] == list(range(20))
    assert [each[9].words[0] for each in found if each[2] == events.SSP_LOAD] == list(range(20))


def test_a_full_mailbox_refuses_and_keeps_what_it_has():
    pair = Pair(FROM_BOARD)
    written = 0
    while pair.put(NEAR, 0, events.PIN_OUTPUT, 1, written & 1):
        written += 1
    assert SLOTS - 30 < written < SLOTS
    assert len(pair.delivered()) == written


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ((events.CAN_REQUEST, 5, 1, 1, 8), "CAN_REQUEST: field a is 5, allowed are 1 to 4"),
        ((events.CAN_REQUEST, 1, 0, 1, 8), "CAN_REQUEST: field b is 0, allowed are 1 to 3"),
        ((events.CAN_REQUEST, 1, 1, 0x800, 8), "CAN_REQUEST: its identifier does not fit in 11 bits"),
        ((events.PWM_UPDATE, 1, 1, 0), "PWM_UPDATE: field c is 0, allowed are 1 to"),
        ((events.CAN_RX, 1, 1, 8), "CAN_RX: its kind is not one that goes this way"),
        ((100,), "kind 100: its kind is not one that goes this way"),
        ((events.SSP_START,), "SSP_START: its length does not fit its kind"),
    ],
)
def test_a_message_that_means_nothing_is_named_and_not_delivered(message, reason):
    pair = Pair(FROM_BOARD)
    pair.put(NEAR, 0, *message)
    assert pair.delivered() == []
    assert pair.reader.damaged == 1 and reason in pair.reader.last_damage
    assert "channel of the test, message 0" in pair.reader.last_damage


def test_a_stamp_far_from_the_turn_is_refused():
    pair = Pair(FROM_BOARD)
    pair.put(NEAR + 2_000_000_000, 0, events.PIN_OUTPUT, 1, 1)
    assert pair.delivered() == [] and "stamp is more than a second" in pair.reader.last_damage


@pytest.mark.parametrize("used", [-1, SLOTS + 1, 1 << 40])
def test_an_impossible_number_of_slots_is_named(used):
    pair = Pair(FROM_BOARD)
    pair.block.words[pair.used_word] = used
    assert pair.read() == [] and f"{used} slots in use" in pair.reader.last_damage


def test_any_flipped_bit_is_noticed_and_the_messages_around_it_arrive():
    for word in range(SLOT_WORDS):
        for bit in range(0, 63, 7):
            pair = Pair(FROM_BOARD)
            for number in range(3):
                pair.put(NEAR, 0, events.PIN_OUTPUT, number, 1)
            pair.writer.send()
            pair.block.words[pair.first + SLOT_WORDS + word] ^= 1 << bit
            assert [each[3] for each in pair.read()] == [0, 2], (word, bit)
            assert pair.reader.damaged >= 1


def test_after_damage_the_next_turn_is_clean():
    pair = Pair(FROM_BOARD)
    pair.put(NEAR, 0, events.SSP_START, ref=segment_of([1] * 31, 5))
    pair.writer.send()
    pair.block.words[pair.first + 20] ^= 1
    assert pair.read() == []
    pair.put(NEAR, 0, events.PIN_OUTPUT, 1, 1)
    assert len(pair.delivered()) == 1
    before = pair.reader.damaged
    pair.put(NEAR, 0, events.PIN_OUTPUT, 1, 0)
    assert len(pair.delivered()) == 1 and pair.reader.damaged == before


def covered(pair):
    """The words of the first 40 slots that belong to a message: a frame and a segment take 5 slots, less 4 words."""
    words = pair.block.words[pair.first : pair.first + 40 * SLOT_WORDS]
    return [word for place, word in enumerate(words) if place % (5 * SLOT_WORDS) < 5 * SLOT_WORDS - 4]


def in_range(message):
    """True when every field of a delivered message is one its kind allows."""
    ranges = KINDS[message[2]].ranges
    return all(least <= value <= largest for value, (least, largest) in zip(message[3:9], ranges, strict=True))


@given(
    damage=st.lists(
        st.tuples(st.integers(0, 40 * SLOT_WORDS - 1), st.integers(-(2**63), 2**63 - 1)), min_size=1, max_size=30
    ),
    used=st.one_of(st.none(), st.integers(-(2**63), 2**63 - 1)),
)
@settings(max_examples=examples(300))
def test_with_any_content_of_a_mailbox_nothing_raises_and_only_whole_messages_arrive(damage, used):
    pair = Pair(FROM_BOARD)
    for number in range(10):
        pair.put(NEAR, 0, events.CAN_REQUEST, 1, 1, number, 8, number, number)
        pair.put(NEAR, 0, events.SSP_START, ref=segment_of([number] * 31, 5))
    pair.writer.send()
    before = covered(pair)
    for place, value in damage:
        pair.block.words[pair.first + place] = value
    if used is not None:
        pair.block.words[pair.used_word] = used
    found = pair.read()
    assert all(in_range(message) for message in found)
    changed = covered(pair) != before
    if changed and used is None:
        assert pair.reader.damaged > 0 and pair.reader.last_damage
    elif used is None:
        assert len(found) == 20 and pair.reader.damaged == 0


@given(st.integers(-(2**63), 2**63 - 1), st.integers(-(2**63), 2**63 - 1))
def test_one_step_of_the_check_never_loses_a_difference(so_far, word):
    """(h ^ w) * odd number is a bijection in w: two words that differ in anything give different checks."""
    for bit in range(64):
        other = word ^ (1 << bit)
        other = other - 2**64 if other >= 2**63 else other
        assert shared_words.mix(so_far, word) != shared_words.mix(so_far, other)


def test_a_header_of_another_version_is_refused():
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        block.check(0)
        with pytest.raises(UserError, match="channel of MCH: place in its header is 0, not 3"):
            block.check(3)
        block.words[places.VERSION_WORD] = 99
        with pytest.raises(UserError, match="version in its header is 99, not 1"):
            block.check(0)


def test_what_ended_a_process_is_kept_and_cut_to_what_fits():
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        assert block.fault() == ""
        block.leave_fault("ZeroDivisionError: float division by zero")
        assert block.fault() == "ZeroDivisionError: float division by zero"
        block.leave_fault("x" * 5000)
        assert block.fault() == "x" * 504


@pytest.fixture
def bells():
    """(block, ask, answer): the bells of a board's block."""
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        yield (
            block,
            Bell(block.words, places.ASKED, places.BOARD_SLEEPS, block.ask_descriptor),
            Bell(block.words, places.ANSWERED, places.PLANT_SLEEPS, block.answer_descriptor),
        )


def test_a_bell_between_two_processes_rings_as_often_as_it_was_rung(bells):
    block, ask, answer = bells

    def count():
        for turn in range(1, 2001):
            while not ask.wait(turn):
                pass
            block.words[places.NEXT_TIME] += turn
            answer.ring()
        return 0

    with Child(block, count) as child:
        for turn in range(1, 2001):
            ask.ring()
            child.answered(answer, turn)
            assert block.words[places.NEXT_TIME] == turn * (turn + 1) // 2
        assert child.ended().si_status == 0


def test_a_sleeper_on_the_bell_of_a_process_that_ends_is_woken_with_the_reason(bells):
    block, ask, answer = bells

    def end_when_asked():
        while not ask.wait(1):
            pass
        return 7

    with Child(block, end_when_asked) as child:
        ask.ring()
        with pytest.raises(AssertionError, match="no answer in turn 1: ended with 7"):
            child.answered(answer, 1)


def test_a_board_that_ends_in_its_turn_is_gone_for_the_plant_and_not_asked_again():
    new_block = Block("MCSI", wiring.BOARDS.index("MCSI"), 0)
    with contextlib.closing(Ranger()) as robot, contextlib.closing(new_block) as block:
        words, doubles = StageMemory().written
        stage = Stage(words, doubles, robot.plant, robot.loop.step_times, [])
        remote = RemoteBoard(robot.boards["MCSI"], block, stage, wiring.BOARDS.index("MCSI"), False)
        ask = Bell(block.words, places.ASKED, places.BOARD_SLEEPS, block.ask_descriptor)

        def end_when_asked():
            while not ask.wait(1):
                pass
            return 7

        with Child(block, end_when_asked):
            assert remote.advance(1_000_000) == NEVER
        assert remote.gone
        remote.catch_up(2_000_000)
        remote.command(places.COMMAND_COUNTERS)
        with pytest.raises(UserError, match="MCSI is gone"):
            remote.send(kinds.SET_WORD, 2_000_000, 1, 1)


def test_a_ring_from_a_third_side_wakes_without_being_an_answer():
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        answer = Bell(block.words, places.ANSWERED, places.PLANT_SLEEPS, block.answer_descriptor)
        os.eventfd_write(block.answer_descriptor, 1)
        assert not answer.wait(1)


def test_every_message_kind_of_the_foundation_may_travel():
    named = {
        value
        for name, value in vars(events).items()
        if name.isupper() and name.partition("_")[0] in ("PIN", "CAN", "UART", "SSP", "PWM") and isinstance(value, int)
    }
    assert named <= set(kinds.KINDS)


def test_a_message_about_an_end_is_read_as_it_was_left_and_is_cut_between_characters():
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        assert block.fault() == ""
        block.leave_fault("it exceeded 5 µs in control() at small.c:9")
        assert block.fault() == "it exceeded 5 µs in control() at small.c:9"
        most = 8 * (places.FAULT_WORDS - 1)
        block.leave_fault("x" * (most - 1) + "µ")  # of two bytes, of which one would fit
        assert block.fault() == "x" * (most - 1)


@pytest.mark.parametrize("value", [-1, 1, 0x7FFFFFFF, 0x00000000FFFFFF7F, (1 << 63) - 1])
def test_a_message_that_a_program_wrote_over_is_named_and_not_shown(value):
    with contextlib.closing(Block("MCH", 0, 0)) as block:
        for word in range(places.FAULT_TEXT, places.FAULT_TEXT + places.FAULT_WORDS):
            block.words[word] = value
        assert block.fault() == "the program wrote over the message about its end"
