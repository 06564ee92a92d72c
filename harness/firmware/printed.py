"""Output of programs in C: kept out of this process's standard output, and passed on by board.

Descriptors 1 and 2 of a board's process are an unnamed file; the process that passes the robot's time reads it.
A program in that process itself has descriptor 1 only while it runs.
"""

import contextlib
import ctypes
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import IO

from ranger_sim.foundation.user_error import printable

LINE_BUFFERED = 1  # _IOLBF of stdio.h, glibc
LONGEST_LINE = 4096  # bytes of a line that is shown; a longer line is shown in parts. Chosen by us
READ_BYTES = 1 << 16

OUT, ERR = 1, 2


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None)


def _flush() -> None:
    """Flush the stdio buffers of programs in C."""
    _libc().fflush(None)


def _buffer_lines() -> None:
    """Let programs in C print line by line, as on a terminal: the output of a killed process is kept."""
    with contextlib.suppress(ValueError):  # a C library that has no such name
        stream = ctypes.c_void_p.in_dll(_libc(), "stdout")
        _libc().setvbuf(stream, None, LINE_BUFFERED, 0)


class Printed:
    """The outputs of a robot's programs in C. Give it to `Ranger(printed=...)`, and close it after the robot.

    show(line): called with `BOARD: text` for each line. keep(board, data): where set, it takes all bytes instead.
    """

    def __init__(self, show: Callable[[str], None]) -> None:
        self.show = show
        self.keep: Callable[[str, bytes], None] | None = None
        self.files: dict[str, IO[bytes]] = {}
        self.read: dict[str, int] = {}  # bytes of each file that were passed on
        self.begun: dict[str, bytes] = {}  # lines without an end so far

    def lead(self, board: str) -> None:
        """Make this process the board's from now on: a program's output in it is the board's output.

        Python's output on standard error still goes to its previous target.
        """
        sys.stderr = os.fdopen(os.dup(ERR), "w", buffering=1, errors="backslashreplace")
        for number in (OUT, ERR):
            os.dup2(self._file(board).fileno(), number)
        _buffer_lines()

    @contextlib.contextmanager
    def during(self, board: str) -> Iterator[None]:
        """Within it, output of programs in C in this process counts as output of `board`."""
        file = self._file(board)
        _flush()
        previous = os.dup(OUT)
        os.dup2(file.fileno(), OUT)
        _buffer_lines()
        try:
            yield
        finally:
            _flush()
            os.dup2(previous, OUT)
            os.close(previous)

    def drop(self, board: str) -> None:
        """Pass on nothing of what the board has printed so far."""
        self.read[board] = os.fstat(self._file(board).fileno()).st_size

    def poll(self) -> None:
        """Pass on what was printed since the last time."""
        for board, file in self.files.items():
            while data := os.pread(file.fileno(), READ_BYTES, self.read[board]):
                self.read[board] += len(data)
                self._pass_on(board, data)

    def finish(self) -> None:
        """Pass on the rest, also a line without an end."""
        self.poll()
        for board, line in self.begun.items():
            if line:
                self._show(board, line)
        self.begun.clear()

    def close(self) -> None:
        """Close the files."""
        for file in self.files.values():
            file.close()
        self.files.clear()

    def _file(self, board: str) -> IO[bytes]:
        if board not in self.files:
            # Copies of its descriptor, also in forked processes, share the place at which the next byte is written.
            self.files[board] = tempfile.TemporaryFile(buffering=0, prefix="ranger-sim-")  # noqa: SIM115
            self.read[board] = 0
        return self.files[board]

    def _pass_on(self, board: str, data: bytes) -> None:
        if self.keep is not None:
            self.keep(board, data)
            return
        *lines, rest = (self.begun.get(board, b"") + data).split(b"\n")
        for line in lines:
            self._show(board, line)
        while len(rest) > LONGEST_LINE:
            self._show(board, rest[:LONGEST_LINE])
            rest = rest[LONGEST_LINE:]
        self.begun[board] = rest

    def _show(self, board: str, line: bytes) -> None:
        for at in range(0, max(1, len(line)), LONGEST_LINE):
            self.show(f"{board}: {printable(line[at : at + LONGEST_LINE].decode(errors='replace').rstrip(chr(13)))}")
