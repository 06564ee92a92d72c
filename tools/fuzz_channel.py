"""Damaged words in the channel of a board process: it answers every turn, counts, and keeps its slots.

One case is one turn of 0.5 ms with words of the mailbox, the number of its slots, the instant or the command changed
to anything. The board is a steering board in a process of its own, as `ranger-sim up` has it.
"""

from __future__ import annotations

import contextlib
import os
from typing import Any

from foundation import wallclock
from foundation.random_stream import RandomStream
from foundation.user_error import UserError
from harness import wiring
from harness.processes import block as places
from harness.processes import board_process, kernel
from harness.processes.block import Block, new_stage
from harness.processes.channel import SLOT_WORDS, Bell
from harness.processes.settings import Settings
from harness.ranger import Ranger

BOARD = "MCSI"
TURN_NS = 500_000  # one slot of that board
TOUCHED_SLOTS = 30


class Fuzz:
    """`case()` is one case; UserError as soon as the board does not answer as it must."""

    def __init__(self, robot: Ranger, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "channel fuzz")
        self.block = Block(BOARD, wiring.BOARDS.index(BOARD), 0)
        self.words = self.block.words
        stage = new_stage()
        parent = os.getpid()
        self.process = os.fork()
        if self.process == 0:
            kernel.die_with_parent(parent)
            os._exit(board_process.serve(robot, BOARD, self.block, stage, Settings(real_time=False), False))
        self.ask = Bell(self.words, places.ASKED, places.BOARD_SLEEPS, self.block.ask_descriptor)
        self.answer = Bell(self.words, places.ANSWERED, places.PLANT_SLEEPS, self.block.answer_descriptor)
        self.until = 0
        self.turn()

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def word(self) -> int:
        """Any word, often a small one."""
        if self.number(2):
            return self.number(256)
        return (self.number(1 << 32) << 32 | self.number(1 << 32)) - (1 << 63)

    def turn(self, command: int = places.COMMAND_ADVANCE, until: int | None = None) -> None:
        """One turn; UserError when the board has ended instead."""
        self.until = max(self.until, self.words[places.REACHED]) + TURN_NS
        self.words[places.COMMAND] = command
        self.words[places.UNTIL] = self.until if until is None else until
        self.ask.ring()
        while not self.answer.wait(self.ask.rung):
            pass
        self.words[places.ASK_USED] = 0

    def case(self) -> None:
        """Damage something, hand it over, and see that the next whole turn has its slot."""
        for _ in range(1 + self.number(20)):
            self.words[self.block.to_board_first + self.number(TOUCHED_SLOTS * SLOT_WORDS)] = self.word()
        self.words[places.ASK_USED] = self.word() if self.number(4) == 0 else 1 + self.number(TOUCHED_SLOTS)
        kind, damaged = self.number(8), self.words[places.DAMAGED]
        if kind == 0:
            command = self.word()
            ends = (places.COMMAND_STOP, places.COMMAND_SNAPSHOT, places.COMMAND_ADVANCE)
            self.turn(places.COMMAND_MORE if command in ends else command)
        elif kind == 1:
            self.turn(until=self.word())
        else:
            used = self.words[places.ASK_USED]
            self.turn()
            if used != 0 and self.words[places.DAMAGED] <= damaged:
                raise UserError("channel fuzz: damage was not counted")
        slots = self.words[places.SLOT_COUNT]
        self.turn()
        self.turn()
        if self.words[places.SLOT_COUNT] == slots:
            raise UserError("channel fuzz: the board has lost its slots")

    def end(self) -> None:
        """Let the board's process end; UserError when it had ended before."""
        self.words[places.COMMAND] = places.COMMAND_STOP
        self.ask.ring()
        code = os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])
        if code != 0:
            raise UserError(f"channel fuzz: the board's process ended with {code}: {self.block.fault()}")


def benchmark(cases: int) -> dict:
    """Run so many cases; the figure is cases per second."""
    with contextlib.closing(Ranger()) as robot:
        fuzz = Fuzz(robot)
        started = wallclock.monotonic_s()
        for _ in range(cases):
            fuzz.case()
        seconds = wallclock.monotonic_s() - started
        fuzz.end()
    return {
        "figure": cases / seconds,
        "unit": "cases per s",
        "cases": cases,
        "unreadable_messages": fuzz.words[places.DAMAGED],
        "slots_kept": fuzz.words[places.SLOT_COUNT],
    }
