"""The standard streams of a command: one layer below print, rich, argparse, warnings and tracebacks.

A reader that leaves (a closed terminal, `| head`) ends nothing: from then on what is written there vanishes, and the
command finishes its files. Descriptor 1 leads to standard error, so that only Python prints on standard output: what
a library or a program in C prints is in no result.
"""

import contextlib
import errno
import io
import os
import select
import stat
import sys
from collections.abc import Iterator
from typing import Any

# What a terminal, a pipe or a socket answers when nothing is at its other end, and a descriptor that was closed.
GONE = (errno.EIO, errno.EPIPE, errno.EBADF, errno.ENXIO, errno.ECONNRESET)
OUT, ERR = 1, 2

_own: Any = None  # the stream that `take_over` has made
# Where results go while standard output is for them alone; None: `sys.stdout` takes everything.
_results: Any = None


class PatientFile(io.FileIO):
    """A descriptor to write to whose reader may leave; `expendable`: a full disk is no failure either."""

    def __init__(self, descriptor: int, expendable: bool) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.expendable = expendable

    def write(self, data: Any) -> int:
        """All of it, also where the descriptor does not block; what has no reader counts as written."""
        try:
            while (count := super().write(data)) is None:
                select.select([], [self], [])
        except OSError as error:
            if not self.expendable and not (error.errno in GONE and not is_on_disk(self.fileno())):
                raise
            lead_nowhere(self)
            return memoryview(data).nbytes
        return count


def is_on_disk(descriptor: int) -> bool:
    """True for a file: an EIO of a disk loses what was to be kept."""
    try:
        return stat.S_ISREG(os.fstat(descriptor).st_mode)
    except OSError:
        return False


def take_over() -> bool:
    """Give the process its two streams; False, and nothing changed, where another program has replaced them.

    A descriptor that is closed at the start leads nowhere from now on (the next file would get its number, and what
    is printed with it). A letter that the stream's encoding has not is written as its escape.
    """
    global _own
    if _own is not None and sys.stdout is _own:
        return True
    if sys.stdout is not sys.__stdout__ or sys.stderr is not sys.__stderr__:
        return False
    for number in (0, OUT, ERR):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
    own = os.dup(OUT)  # no process that this one starts inherits it
    os.dup2(ERR, OUT)
    _own = sys.stdout = sys.__stdout__ = _stream(PatientFile(own, expendable=False), sys.__stdout__)  # type: ignore[misc]
    sys.stderr = sys.__stderr__ = _stream(PatientFile(ERR, expendable=True), sys.__stderr__)  # type: ignore[misc]
    return True


def _stream(file: PatientFile, previous: Any) -> io.TextIOWrapper:
    """A stream of text over `file` that buffers and encodes as `previous` does."""
    is_error = file.fileno() == ERR
    return io.TextIOWrapper(
        io.BufferedWriter(file),
        encoding=previous.encoding if previous is not None else "utf-8",
        errors="backslashreplace",
        line_buffering=is_error or file.isatty(),
        write_through=previous is not None and previous.write_through,
    )


@contextlib.contextmanager
def results_alone() -> Iterator[None]:
    """Inside, standard output takes what `print_result` prints; whatever else is printed goes to standard error."""
    global _results
    previous, _results = sys.stdout, sys.stdout
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        sys.stdout, _results = previous, None


def print_result(text: str) -> None:
    """Print the result of a command on standard output, at once."""
    print(text, file=_results if _results is not None else sys.stdout, flush=True)


def result_descriptor() -> int | None:
    """Where a process that prints this one's result is to print; None: where it prints anyway."""
    stream = _results if _results is not None else sys.stdout
    try:
        return int(stream.fileno())
    except (OSError, ValueError):  # a stream in memory
        return None


def is_stuck() -> bool:
    """True when standard output does not take what waits in it, as on a full disk; what waits is given up."""
    try:
        sys.stdout.flush()
    except OSError:
        lead_nowhere(sys.stdout)
        return True
    return False


def lead_nowhere(stream: Any) -> None:
    """Let what is still written to the stream vanish."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        if nowhere != stream.fileno():
            os.close(nowhere)
