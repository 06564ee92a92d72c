"""The activity log of a board in a separate process: kept there, fetched over the channel when a reader requests it.

An answer is a head of two whole numbers (rows discarded for newer ones since the last answer, bytes that are left) and
rows as in firmware_sim/activity.py.
"""

from __future__ import annotations

import array
import collections
from collections.abc import Callable
from typing import Any

from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS
from ranger_sim.harness.processes.kinds import NOTE_ACTIVITY
from ranger_sim.harness.processes.places import COMMAND_ACTIVITY, KEEP_NS

HEAD_BYTES = 16
ROW_BYTES = 8 * ACTIVITY_COLUMNS
MOST_BYTES = 256 * 1024 * 1024  # kept for later readers (chosen by us: a minute of a motor board that walks)
ANSWER_BYTES = 4096 * ROW_BYTES  # of one answer: some hundred messages of the channel

Sink = Callable[[int, bytes], None]


class ActivityStore:
    """In the board's process: the rows not fetched yet. The log exists from the first request on.

    It keeps their last `words[KEEP_NS]` (ns), or what MOST_BYTES hold. A log that the board had before its process was
    forked is read by the plant: its sinks are in that process's memory.
    """

    def __init__(self, board: Any, words: Any) -> None:
        self.board = board
        self.words = words
        self.blocks: collections.deque[tuple[int, bytes]] = collections.deque()
        self.kept = 0
        self.lost = 0
        self.begun = False
        if board.scheduler.log is not None:
            board.scheduler.log.sinks.clear()
            self._begin()

    def _begin(self) -> None:
        self.begun = True
        self.board.activity().add_sink(self.take)

    def take(self, time_ns: int, rows: bytes) -> None:
        """Keep rows; drop the oldest when there are too many, or when they are too old."""
        self.blocks.append((time_ns, rows))
        self.kept += len(rows)
        oldest_ns = time_ns - self.words[KEEP_NS] if self.words[KEEP_NS] else 0
        while self.kept > MOST_BYTES or self.blocks[0][0] < oldest_ns:
            given_up = len(self.blocks.popleft()[1])
            self.kept -= given_up
            self.lost += given_up // ROW_BYTES

    def next(self) -> bytes:
        """The next answer."""
        if not self.begun:
            self._begin()
        self.board.activity().flush()
        parts = []
        room = ANSWER_BYTES
        while self.blocks and room > 0:
            time_ns, block = self.blocks.popleft()
            if len(block) > room:
                self.blocks.appendleft((time_ns, block[room:]))
                block = block[:room]
            parts.append(block)
            room -= len(block)
            self.kept -= len(block)
        head = array.array("q", [self.lost, self.kept])
        self.lost = 0
        return head.tobytes() + b"".join(parts)


class RemoteActivity:
    """In the plant's process: like an ActivityLog of the board, for its readers. `lost`: rows discarded unread."""

    def __init__(self, remote: Any, words: Any, before: Any) -> None:
        self.remote = remote
        self.words = words
        self.sinks: list[Sink] = [] if before is None else before.sinks  # readers of the log before it moved out
        self.lost = 0
        self.keep_ns = 0 if before is None else before.keep_ns

    @property
    def keep_ns(self) -> int:
        """How much the board keeps for the next reader, ns; 0: all that fits."""
        return int(self.words[KEEP_NS])

    @keep_ns.setter
    def keep_ns(self, length_ns: int) -> None:
        self.words[KEEP_NS] = length_ns

    def add_sink(self, sink: Sink) -> None:
        """Call `sink(time_ns, rows)` with the rows from here on."""
        self.flush()
        self.sinks.append(sink)

    def flush(self) -> None:
        """Fetch what the board has written, and pass it on; nothing from a board that is gone."""
        left = 1
        while left:
            answer = self.remote.notes_of(COMMAND_ACTIVITY, NOTE_ACTIVITY)
            if not answer:
                return
            lost, left = array.array("q", answer[:HEAD_BYTES])
            self.lost += lost
            for sink in self.sinks:
                sink(self.remote.reached, answer[HEAD_BYTES:])
