"""A board in a separate process, alone: it answers all that it receives."""

import contextlib
import os
import signal

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from ranger_sim.foundation.events import PIN_EDGE, EventQueue
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import places
from ranger_sim.harness.processes.channel import SLOT_WORDS, Mailbox
from ranger_sim.harness.processes.kinds import FROM_BOARD, TO_BOARD
from ranger_sim.harness.processes.lone_board import LoneBoard
from ranger_sim.ranger.robot import Ranger
from tests.examples import examples

STEP_NS = 100_000
LONG_TURN_NS = 900_000_000  # MCSI puts out six times what its mailbox holds


class Served(LoneBoard):
    """A board that goes on in steps, and what is written to it."""

    def __init__(self, robot, name):
        super().__init__(robot, name)
        self.mailbox = Mailbox(
            self.words, "of the test", self.block.to_board_first, places.SLOTS, places.ASK_USED, TO_BOARD
        )
        self.until = 0

    def step(self, command=places.COMMAND_ADVANCE, until=None):
        self.until += STEP_NS
        self.turn(self.until if until is None else until, command)


@pytest.fixture(scope="module")
def served():
    with contextlib.closing(Ranger()) as robot, contextlib.closing(Served(robot, "MCSI")) as board:
        board.step()  # a board that has not run yet may be told any instant, as a restarted one is
        yield board
        assert board.end() == 0


@pytest.fixture
def lone():
    """lone(patience_s=...): its own board for a test that ends it."""
    with contextlib.ExitStack() as stack:
        robot = stack.enter_context(contextlib.closing(Ranger()))
        yield lambda **how: stack.enter_context(contextlib.closing(LoneBoard(robot, "MCSI", **how)))


@given(
    damage=st.lists(
        st.tuples(st.integers(0, 20 * SLOT_WORDS - 1), st.integers(-(2**63), 2**63 - 1)), min_size=1, max_size=20
    ),
    used=st.one_of(st.just(20), st.integers(-(2**63), 2**63 - 1)),
    until=st.one_of(st.none(), st.integers(-(2**62), 2**62)),
    command=st.one_of(st.just(places.COMMAND_ADVANCE), st.integers(-5, 1000)),
)
@example(damage=[(0, 0)], used=20, until=LONG_TURN_NS, command=places.COMMAND_ADVANCE)  # and the answer does not fit
@settings(max_examples=examples(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_board_survives_any_content_of_its_channel(served, damage, used, until, command):
    """It answers, counts what it could not read, and goes on with its slots."""
    if command in (places.COMMAND_STOP, places.COMMAND_COUNTERS):
        command = places.COMMAND_MORE
    for place, value in damage:
        served.words[served.block.to_board_first + place] = value
    served.words[places.ASK_USED] = used
    before = served.words[places.DAMAGED]
    served.step(command, until)
    if command == places.COMMAND_ADVANCE and until is None and used != 0:
        assert served.words[places.DAMAGED] > before
    served.words[places.ASK_USED] = 0
    served.until = max(served.until, served.words[places.REACHED])
    slots = served.words[places.SLOT_COUNT]
    for _ in range(6):
        served.step()
    assert served.words[places.SLOT_COUNT] == slots + 1 or served.words[places.SLOT_COUNT] == slots + 2


def test_a_whole_message_after_damaged_ones_reaches_the_chip(served):
    queue = EventQueue()
    queue.push(served.until + 10, 256, PIN_EDGE, 5, 1, -1, 0)
    queue.take()
    served.mailbox.put(queue)
    served.mailbox.send()
    before = served.words[places.DAMAGED]
    served.step()
    served.words[places.ASK_USED] = 0
    # its number is not the one that follows the last whole one: that is counted, and it is delivered all the same
    assert served.words[places.DAMAGED] <= before + 1


def test_a_program_that_raises_says_what_and_where():
    with contextlib.closing(Ranger()) as robot:

        def divide():
            return 1 // 0

        robot.replace("MCSI", "mc_compliant_control", divide, cost=100)
        with (
            contextlib.closing(LoneBoard(robot, "MCSI")) as board,
            pytest.raises(
                UserError,
                match=r"^MCSI \(process \d+\) ended with code 4: "
                r"ZeroDivisionError: integer division or modulo by zero \(test_board_process.py:",
            ),
        ):
            board.turn(20_000_000)


def put_out(board, instants):
    """Everything the board puts out when it is asked up to one time after the other: stamps, kinds and fields."""
    reader = Mailbox(
        board.words, "of the test", board.block.from_board_first, places.SLOTS, places.ANSWER_USED, FROM_BOARD
    )
    arrived = EventQueue()
    for reader.until in instants:
        command, more = places.COMMAND_ADVANCE, True
        while more:
            board.turn(reader.until, command)
            reader.open()
            while reader.take(arrived):
                pass
            command, more = places.COMMAND_MORE, board.words[places.RESULT] == places.RESULT_MORE
    assert reader.damaged == 0
    found = []
    while arrived.take():
        found.append((arrived.time, arrived.order, arrived.kind, arrived.a, arrived.b, arrived.c, arrived.d))
    return found


def test_what_does_not_fit_in_one_answer_comes_in_the_next_ones(lone):
    in_short_turns = put_out(lone(), range(1_000_000, LONG_TURN_NS + 1, 1_000_000))
    assert len(in_short_turns) > 5 * places.SLOTS
    assert put_out(lone(), [LONG_TURN_NS]) == in_short_turns


@pytest.mark.parametrize("turns", [0, 1])
def test_waiting_for_a_board_whose_process_was_killed_raises(lone, turns):
    """Also when it was killed before its first answer."""
    board = lone()
    for turn in range(turns):
        board.turn((turn + 1) * STEP_NS)
    os.kill(board.process, signal.SIGKILL)
    with pytest.raises(UserError, match=r"^MCSI \(process \d+\) was killed by signal 9$"):
        while True:  # one turn may still be answered before the signal arrives
            board.turn(STEP_NS)
    assert board.end() == -signal.SIGKILL


def test_waiting_for_a_board_that_hangs_raises_and_it_is_killed(lone):
    board = lone(patience_s=0.001)
    os.kill(board.process, signal.SIGSTOP)
    os.waitpid(board.process, os.WUNTRACED)
    with pytest.raises(UserError, match=r"^MCSI \(process \d+\) hangs: no answer for 0.001 s; it is killed$"):
        board.turn(STEP_NS)
    assert board.code == -signal.SIGKILL


def test_waiting_for_a_stopped_board_to_end_raises_and_it_is_killed(lone):
    board = lone(patience_s=0.001)
    os.kill(board.process, signal.SIGSTOP)
    os.waitpid(board.process, os.WUNTRACED)
    with pytest.raises(UserError, match="hangs: no end for 0.001 s; it is killed$"):
        board.end()
    assert board.code == -signal.SIGKILL
