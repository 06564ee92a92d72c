"""A board in a process of its own, alone: it answers whatever it is told."""

import contextlib
import os

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from foundation.events import PIN_EDGE, EventQueue
from harness import wiring
from harness.processes import block as places
from harness.processes import board_process
from harness.processes.block import Block, new_stage
from harness.processes.channel import SLOT_WORDS, Bell, Mailbox
from harness.processes.kinds import TO_BOARD
from harness.processes.settings import Settings
from harness.ranger import Ranger

STEP_NS = 100_000


class Served:
    """A board process and our end of its channel."""

    def __init__(self, robot, name):
        self.name = name
        self.place = wiring.BOARDS.index(name)
        self.block = Block(name, self.place, 0)
        self.words = self.block.words
        self.stage = new_stage()
        self.process = os.fork()
        if self.process == 0:
            code = 9
            try:
                code = board_process.serve(robot, name, self.block, self.stage, Settings(real_time=False), False)
            finally:
                os._exit(code)
        self.ask = Bell(self.words, places.ASKED, places.BOARD_SLEEPS, self.block.ask_descriptor)
        self.answer = Bell(self.words, places.ANSWERED, places.PLANT_SLEEPS, self.block.answer_descriptor)
        self.mailbox = Mailbox(
            self.words, "of the test", self.block.to_board_first, places.SLOTS, places.ASK_USED, TO_BOARD
        )
        self.until = 0

    def turn(self, command=places.COMMAND_ADVANCE, until=None):
        self.until += STEP_NS
        self.words[places.COMMAND] = command
        self.words[places.UNTIL] = self.until if until is None else until
        self.ask.ring()
        while not self.answer.wait(self.ask.rung):
            pass

    def end(self):
        self.words[places.COMMAND] = places.COMMAND_STOP
        self.ask.ring()
        return os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])


@pytest.fixture(scope="module")
def served():
    with contextlib.closing(Ranger()) as robot:
        board = Served(robot, "MCSI")
        yield board
        assert board.end() == 0


@given(
    damage=st.lists(
        st.tuples(st.integers(0, 20 * SLOT_WORDS - 1), st.integers(-(2**63), 2**63 - 1)), min_size=1, max_size=20
    ),
    used=st.one_of(st.just(20), st.integers(-(2**63), 2**63 - 1)),
    until=st.one_of(st.none(), st.integers(-(2**62), 2**62)),
    command=st.one_of(st.just(places.COMMAND_ADVANCE), st.integers(-5, 1000)),
)
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_board_survives_whatever_stands_in_its_channel(served, damage, used, until, command):
    """It answers, counts what it could not read, and goes on with its slots."""
    if command in (places.COMMAND_STOP, places.COMMAND_SNAPSHOT):
        command = places.COMMAND_MORE
    for place, value in damage:
        served.words[served.block.to_board_first + place] = value
    served.words[places.ASK_USED] = used
    before = served.words[places.DAMAGED]
    served.turn(command, until)
    if command == places.COMMAND_ADVANCE and until is None and used != 0:
        assert served.words[places.DAMAGED] > before
    served.words[places.ASK_USED] = 0
    served.until = max(served.until, served.words[places.REACHED])
    slots = served.words[places.SLOT_COUNT]
    for _ in range(6):
        served.turn()
    assert served.words[places.SLOT_COUNT] == slots + 1 or served.words[places.SLOT_COUNT] == slots + 2


def test_a_whole_message_after_damaged_ones_reaches_the_chip(served):
    queue = EventQueue()
    queue.push(served.until + 10, 256, PIN_EDGE, 5, 1, -1, 0)
    queue.take()
    served.mailbox.put(queue)
    served.mailbox.send()
    before = served.words[places.DAMAGED]
    served.turn()
    served.words[places.ASK_USED] = 0
    # its number is not the one that follows the last whole one: that is counted, and it is delivered all the same
    assert served.words[places.DAMAGED] <= before + 1


def test_a_program_that_raises_says_what_and_where():
    with contextlib.closing(Ranger()) as robot:

        def divide():
            return 1 // 0

        robot.replace("MCSI", "mc_compliant_control", divide, cost=100)
        board = Served(robot, "MCSI")
        board.words[places.COMMAND] = places.COMMAND_ADVANCE
        board.words[places.UNTIL] = 20_000_000
        board.ask.ring()
        code = os.waitstatus_to_exitcode(os.waitpid(board.process, 0)[1])
    assert code == board_process.FAILED
    assert board.block.fault().startswith(
        "ZeroDivisionError: integer division or modulo by zero (test_board_process.py:"
    )
