"""Where every word stands in the memory that the processes share. All anonymous: it is gone with the processes.

One block per board, written by its board process, the plant process and the supervisor; one stage, written by the
plant process, where all boards see what the sensors show. Every word is a signed 64-bit integer in the machine's
order; doubles stand in the same words.
"""

import mmap
import os
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.channel import SLOT_WORDS, VERSION

MAGIC = 0x52414E4745523031  # "RANGER01"
SLOTS = 1024  # of each mailbox: forty times what a turn of the default scenario needs at most

# --- a board's block: header
MAGIC_WORD, VERSION_WORD, PLACE_WORD, SLOTS_WORD, TABLE_WORD = 0, 1, 2, 3, 4
# the plant's words
ASKED = 16  # how often the plant has rung
BOARD_SLEEPS = 17
COMMAND = 18  # one of the COMMAND_* below
UNTIL = 19  # ns: run everything before this instant
ASK_USED = 20  # slots in use of the mailbox to the board
ROWS = 21  # rows of the stage that were written so far
POWER_UP = 22  # ns: when a restarted board gets its power
# the board's words
ANSWERED = 32  # how often the board has rung
PLANT_SLEEPS = 33
RESULT = 34  # one of the RESULT_* below
NEXT_TIME = 35  # ns: `next_time` of the board
NEXT_OUTPUT = 36  # ns: before this instant it puts nothing out, whatever comes in of a kind that can wait
ANSWER_USED = 37  # slots in use of the mailbox from the board
SWING_LEG = 38  # of the main brain's estimator
SLOT_TIME = 39  # ns: start of the latest slot
SLOT_COUNT = 40
OVERRUNS = 41
MAX_SLOT_CYCLES = 42
ERRORS = 43  # errors that the board noted, all names together
DAMAGED = 44  # messages to the board that were not readable
REACHED = 45  # ns: the instant up to which it has run
LATE_MAX = 46  # ns
LATE_COUNT = 47
TURNS = 48
URGENT = 49  # message kinds (bits) that the board may answer at once
# the supervisor's words
FATE = 56  # 0 alive, 1 gone: nobody will answer
# text of what ended the process, UTF-8, its length in bytes in the first word
FAULT_TEXT, FAULT_WORDS = 64, 64
LATENESS, LATENESS_WORDS = 128, 1344  # see lateness.py
TABLE = LATENESS + LATENESS_WORDS

COMMAND_ADVANCE, COMMAND_MORE, COMMAND_SNAPSHOT, COMMAND_STOP = 1, 2, 3, 4
RESULT_DONE, RESULT_MORE = 0, 1

# --- the stage: header, pace, then a ring of rows, one per step of the plant
STAGE_ROWS = 2  # rows written so far
PACED = 3  # 1 when virtual time follows the wall clock
PACE_WALL_NS = 4  # monotonic clock when virtual time was PACE_TIME_NS
PACE_TIME_NS = 5
PACE_WALL_PER_TIME = 6  # a double: 1 / speed
HEARTBEAT_NS = 8  # monotonic clock when the plant process last went round its loop
STAGE_FIRST, STAGE_RING = 64, 64
ROW_START, ROW_END, ROW_WORDS, ROW_ANALOG_START, ROW_ANALOG_END, ROW_SIZE = 0, 1, 2, 16, 48, 80
MOST_WORDS, MOST_VOLTAGES = 14, 32


class Block:
    """The shared words of one board, and the eventfds of its two bells."""

    def __init__(self, name: str, place: int, table_words: int) -> None:
        self.name = name
        self.to_board_first = TABLE + table_words
        self.from_board_first = self.to_board_first + SLOTS * SLOT_WORDS
        self.size = self.from_board_first + SLOTS * SLOT_WORDS
        self.memory = mmap.mmap(-1, 8 * self.size)
        self.words = memoryview(self.memory).cast("q")
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
        """The words of the main brain's data table."""
        return self.words[TABLE : TABLE + self.table_words]

    def fault(self) -> str:
        """What the board process left to be said about its end."""
        length = max(0, min(self.words[FAULT_TEXT], 8 * (FAULT_WORDS - 1)))
        text = self.words[FAULT_TEXT + 1 : FAULT_TEXT + FAULT_WORDS].tobytes()[:length]
        return text.decode("utf-8", "replace")

    def leave_fault(self, text: str) -> None:
        """Write it, cut to what fits."""
        data = text.encode()[: 8 * (FAULT_WORDS - 1)]
        padded = memoryview(data + bytes(-len(data) % 8)).cast("q")
        self.words[FAULT_TEXT + 1 : FAULT_TEXT + 1 + len(padded)] = padded
        self.words[FAULT_TEXT] = len(data)


def new_stage() -> Any:
    """The stage as (words, doubles), two views of one anonymous shared memory."""
    memory = mmap.mmap(-1, 8 * (STAGE_FIRST + STAGE_RING * ROW_SIZE))
    view = memoryview(memory)
    words = view.cast("q")
    words[MAGIC_WORD], words[VERSION_WORD] = MAGIC, VERSION
    return words, view.cast("d")
