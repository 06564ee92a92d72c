"""A short run of `python -m dev.fuzz channel`, and that it ends when the board has ended."""

import contextlib
import os
import signal

import pytest

from dev.fuzz import Finding
from dev.fuzz import channel as fuzz_channel
from ranger_sim.ranger.robot import Ranger


def test_three_hundred_damaged_turns_are_answered():
    result = fuzz_channel.run(300)
    assert result["cases"] == 300 and result["slots_kept"] >= 300 and result["unreadable_messages"] > 150


def test_a_board_that_ends_among_the_cases_is_named():
    with contextlib.closing(Ranger()) as robot:
        fuzz = fuzz_channel.Fuzz(robot)
        with contextlib.closing(fuzz.board):
            os.kill(fuzz.board.process, signal.SIGKILL)
            with pytest.raises(Finding, match=r"^MCSI \(process \d+\) was killed by signal 9$"):
                while True:
                    fuzz.case()
