"""The memory that the processes share. All of it is anonymous: it disappears with the processes.

One block per board, written by its board process, the plant process and the supervisor; one stage, written by the
plant process, with the sensors' values for all boards, which boards can only read. places.py has the place of every
word.
"""

import contextlib
import mmap
import os
from collections.abc import Iterable, Iterator
from typing import Any

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.harness.processes.channel import SLOT_WORDS, VERSION
from ranger_sim.harness.processes.places import (
    FAULT_TEXT,
    FAULT_WORDS,
    MAGIC_WORD,
    PLACE_WORD,
    PRIVATE_WORDS,
    RING,
    RING_ROW,
    ROW_SIZE,
    SLOTS,
    SLOTS_WORD,
    STAGE_FIRST,
    STAGE_RING,
    TABLE,
    TABLE_WORD,
    VERSION_WORD,
)

MAGIC = 0x52414E4745523031  # "RANGER01"
OVERWRITTEN = "the program wrote over the message about its end"
F_SEAL_FUTURE_WRITE = 0x0010  # linux/fcntl.h, from Linux 5.1 on; pidfds, which boards as processes need, came with 5.3


class Block:
    """The shared words of one board, those that its own process does not have, and the eventfds of its two bells."""

    def __init__(self, name: str, place: int, table_words: int) -> None:
        self.name = name
        self.to_board_first = TABLE + table_words
        self.from_board_first = self.to_board_first + SLOTS * SLOT_WORDS
        self.ring_first = self.from_board_first + SLOTS * SLOT_WORDS
        self.size = self.ring_first + RING * RING_ROW
        self.memory = mmap.mmap(-1, 8 * self.size)
        self.words = memoryview(self.memory).cast("q")
        self.private_memory = mmap.mmap(-1, 8 * PRIVATE_WORDS)
        self.private = memoryview(self.private_memory).cast("q")
        self.table_words = table_words
        header = {
            MAGIC_WORD: MAGIC,
            VERSION_WORD: VERSION,
            PLACE_WORD: place,
            SLOTS_WORD: SLOTS,
            TABLE_WORD: table_words,
        }
        for word, value in header.items():
            self.words[word] = value
        self.ask_descriptor = os.eventfd(0, os.EFD_CLOEXEC)
        self.answer_descriptor = os.eventfd(0, os.EFD_CLOEXEC)

    def is_forked(self, shared: bool, private: bool) -> None:
        """Whether processes that this one forks from now on have its memory."""
        for memory, wanted in ((self.memory, shared), (self.private_memory, private)):
            memory.madvise(mmap.MADV_DOFORK if wanted else mmap.MADV_DONTFORK)

    def close(self) -> None:
        """Close this process's ends of the bells; none of them may be rung or waited for after this."""
        for descriptor in (self.ask_descriptor, self.answer_descriptor):
            if descriptor >= 0:
                os.close(descriptor)
        self.ask_descriptor = self.answer_descriptor = -1

    def check(self, place: int) -> None:
        """UserError when the header is not that of board `place` in this version."""
        expected = {
            "magic": (MAGIC_WORD, MAGIC),
            "version": (VERSION_WORD, VERSION),
            "place": (PLACE_WORD, place),
            "slots": (SLOTS_WORD, SLOTS),
            "table words": (TABLE_WORD, self.table_words),
        }
        for what, (word, value) in expected.items():
            if self.words[word] != value:
                raise UserError(f"channel of {self.name}: {what} in its header is {self.words[word]}, not {value}")

    def table(self) -> Any:
        """The words of its memory that the board shows: the main brain its data table, the user interface its panel."""
        return self.words[TABLE : TABLE + self.table_words]

    def fault(self) -> str:
        """The board process's message about its end; a program in C can write over it."""
        length = self.words[FAULT_TEXT]
        text = self.words[FAULT_TEXT + 1 : FAULT_TEXT + FAULT_WORDS].tobytes()
        left = text[: max(0, length)].decode(errors="replace")
        is_whole = 0 <= length <= len(text) and "\ufffd" not in left
        return printable(left) if is_whole and left.replace("\n", "").isprintable() else OVERWRITTEN

    def leave_fault(self, text: str) -> None:
        """Write it, cut to what fits."""
        data = text.encode()[: 8 * (FAULT_WORDS - 1)].decode(errors="ignore").encode()  # whole characters
        padded = memoryview(data + bytes(-len(data) % 8)).cast("q")
        self.words[FAULT_TEXT + 1 : FAULT_TEXT + 1 + len(padded)] = padded
        self.words[FAULT_TEXT] = len(data)


@contextlib.contextmanager
def alone(block: Block, blocks: Iterable[Block], stage: "StageMemory", is_held: bool = False) -> Iterator[None]:
    """Within it, a forked process can write into the shared memory of `block` and no other; it reads the stage.

    is_held: a debugger may hold the board, whose process then moves the pace on: it writes the stage as well.
    """
    every = list(blocks)
    for each in every:
        each.is_forked(shared=each is block, private=False)
    stage.is_forked(is_held)
    try:
        yield
    finally:
        stage.is_forked(True)
        for each in every:
            each.is_forked(shared=True, private=True)


def words_shown(board: Any) -> int:
    """How many words of its memory a board shows."""
    return 0 if board.memory is None else len(board.memory)


class StageMemory:
    """The stage as two mappings of one anonymous memory, each as (words, doubles): `written`, and `shown`, which no
    process can make writable: the memory is sealed against further writers.
    """

    def __init__(self) -> None:
        size = 8 * (STAGE_FIRST + STAGE_RING * ROW_SIZE)
        descriptor = os.memfd_create("ranger-stage", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
        try:
            os.ftruncate(descriptor, size)
            self.memory = mmap.mmap(descriptor, size)
            import fcntl  # only where there is one: other systems have messages of their own

            fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, F_SEAL_FUTURE_WRITE | fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW)
            view = memoryview(mmap.mmap(descriptor, size, access=mmap.ACCESS_READ))
        finally:
            os.close(descriptor)
        self.shown = view.cast("q"), view.cast("d")
        view = memoryview(self.memory)
        self.written = words, _ = view.cast("q"), view.cast("d")
        words[MAGIC_WORD], words[VERSION_WORD] = MAGIC, VERSION

    def is_forked(self, writable: bool) -> None:
        """Whether processes that this one forks from now on can write it; all can read it."""
        self.memory.madvise(mmap.MADV_DOFORK if writable else mmap.MADV_DONTFORK)
