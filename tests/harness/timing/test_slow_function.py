"""A user's function in a table entry, once too slow: from its cycles to the entry in the main brain's list."""

import array
import contextlib

import pytest

from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import mch
from ranger_sim.ranger.robot import Ranger

SLOW_CYCLES = 27_000  # with what its slot does beside, more than the 30,000 of 500 us


class SlowOnce:
    """The board's own compliant control, which once spends more than a slot has left."""

    def __init__(self, board, after_ns):
        self.board = board
        self.after_ns = after_ns
        self.was_slow_at = None

    def control(self):
        self.board.compliant_control()
        if self.was_slow_at is None and self.board.now >= self.after_ns:
            self.was_slow_at = self.board.now
            self.board.spend(SLOW_CYCLES)


def error_frames(robot, board):
    """(time, value word) of every error frame of a board on bus 1, from now on; the stream's block may hold some."""
    found = []

    def take(time_ns, rows):
        numbers = array.array("q", rows)
        for at in range(0, len(numbers), 3):
            if numbers[at + 2] & 0x1FFFFFFF == mch.ERROR_MCH:
                found.append((numbers[at], numbers[at + 1] >> 12))

    stream = robot.recorder.frames[0]
    stream.flush()
    stream.sink = take
    return found


def test_a_slow_function_overruns_its_slot_and_the_main_brain_lists_the_error():
    with contextlib.closing(Ranger()) as robot:
        board = robot.board("MCH")
        slots = robot.slots("MCH")
        frames = error_frames(robot, board)
        robot.run_for(0.1)
        slots.assert_no_overrun()
        slots.assert_function("mc_compliant_control", at_most=1470)
        slow = SlowOnce(board, robot.loop.time)
        robot.replace("MCH", "mc_compliant_control", slow.control, cost=1600, limit=2100)
        robot.run_for(0.15)
        slots.assert_latency("adcx_busy", at_most="10 us")

        # the slot: the function that was too slow, and what it kept from running
        with pytest.raises(AssertionError) as failure:
            slots.assert_no_overrun()
        (late,) = (slot for slot in slots if slot.overran)
        assert late.start_ns < slow.was_slow_at - robot.start_ns < late.end_ns
        assert late.cycles_by_function()["mc_compliant_control"] == 1600 + SLOW_CYCLES
        row = [task.name for task in board.scheduler.schedule.row_tasks(late.row)]
        assert late.dropped == row[row.index("mc_compliant_control") + 1 :]
        assert "mc_compliant_control" in str(failure.value) and "over!" in str(failure.value)
        with pytest.raises(AssertionError, match="mc_compliant_control cost 28,600 cycles"):
            slots.assert_function("mc_compliant_control", at_most=2100)
        (task,) = (task for task in board.scheduler.tasks if task.name == "mc_compliant_control")
        assert task.hits == 1

        # the frame: the board's next turn of its error variable, within 22 ms
        robot.recorder.frames[0].flush()
        own = [(time, word) for time, word in frames if word & 0xFFFF == codes.ASCHED_DNF]
        ((sent_ns, word),) = own
        assert late.end_ns < sent_ns - robot.start_ns < late.end_ns + 22_500_000
        assert (word >> 16 & 0x3F, word >> 22) == (mch.BOARD_NUMBER, 1)

        # the main brain's list
        assert robot.board("MB").distribution.totals[mch.BOARD_NUMBER, codes.ASCHED_DNF] == 1


def test_the_same_function_a_little_faster_keeps_its_slot():
    with contextlib.closing(Ranger()) as robot:
        board = robot.board("MCH")
        slots = robot.slots("MCH")
        robot.replace("MCH", "mc_compliant_control", board.compliant_control, cost=14_000, limit=15_000)
        robot.run_for(0.1)
        slots.assert_no_overrun()
        assert robot.board("MB").distribution.totals.get((mch.BOARD_NUMBER, codes.ASCHED_DNF), 0) == 0
