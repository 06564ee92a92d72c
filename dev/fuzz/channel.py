"""Damaged words in the channel of a board process: it answers every turn, counts the damage, and keeps its slots.

One case is one turn of 0.5 ms with words of the mailbox, the number of its slots, the time or the command changed to
any value. The board is a steering board in a separate process, as in `ranger-sim up`.
"""

from __future__ import annotations

import contextlib
from typing import Any

from dev.fuzz import Finding
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import places
from ranger_sim.harness.processes.channel import SLOT_WORDS
from ranger_sim.harness.processes.lone_board import LoneBoard
from ranger_sim.ranger.robot import Ranger

BOARD = "MCSI"
TURN_NS = 500_000  # one slot of that board
TOUCHED_SLOTS = 30


class Fuzz:
    """`case()` is one case; Finding as soon as the board answers wrongly."""

    def __init__(self, robot: Ranger, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "channel fuzz")
        self.board = LoneBoard(robot, BOARD)
        self.block = self.board.block
        self.words = self.block.words
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
        """One turn; Finding when the board has ended instead, or does not answer."""
        self.until = max(self.until, self.words[places.REACHED]) + TURN_NS
        try:
            self.board.turn(self.until if until is None else until, command)
        except UserError as ended:
            raise Finding(str(ended)) from ended
        self.words[places.ASK_USED] = 0

    def case(self) -> None:
        """Damage something, pass it to the board, and check that the next whole turn has its slot."""
        for _ in range(1 + self.number(20)):
            self.words[self.block.to_board_first + self.number(TOUCHED_SLOTS * SLOT_WORDS)] = self.word()
        self.words[places.ASK_USED] = self.word() if self.number(4) == 0 else 1 + self.number(TOUCHED_SLOTS)
        kind, damaged = self.number(8), self.words[places.DAMAGED]
        if kind == 0:
            command = self.word()
            ends = (places.COMMAND_STOP, places.COMMAND_COUNTERS, places.COMMAND_ADVANCE)
            self.turn(places.COMMAND_MORE if command in ends else command)
        elif kind == 1:
            self.turn(until=self.word())
        else:
            used = self.words[places.ASK_USED]
            self.turn()
            if used != 0 and self.words[places.DAMAGED] <= damaged:
                raise Finding("damage was not counted")
        slots = self.words[places.SLOT_COUNT]
        self.turn()
        self.turn()
        if self.words[places.SLOT_COUNT] == slots:
            raise Finding("the board has lost its slots")

    def end(self) -> None:
        """Let the board's process end; Finding when it had ended before."""
        code = self.board.end()
        if code != 0:
            raise Finding(f"the board's process ended with {code}: {self.block.fault()}")


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts of the board."""
    with contextlib.closing(Ranger()) as robot:
        fuzz = Fuzz(robot, seed)
        with contextlib.closing(fuzz.board):
            for number in range(cases):
                try:
                    fuzz.case()
                except Finding as finding:
                    raise Finding(f"{finding} (case {number})") from finding
            fuzz.end()
    return {
        "cases": cases,
        "unreadable_messages": fuzz.words[places.DAMAGED],
        "slots_kept": fuzz.words[places.SLOT_COUNT],
    }
