"""The standard streams of a command: one layer below print, rich, argparse, warnings and tracebacks.

A reader that closes its end (a closed terminal, `| head`) does not end the command: later output is discarded, and the
command finishes its files. Descriptor 1 leads to standard error, so that only Python prints on standard output: output
of a library or a program in C does not mix with results.
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

from ranger_sim.foundation import systems

# The errors of a terminal, a pipe or a socket without a reader, and of a closed descriptor.
GONE = (errno.EIO, errno.EPIPE, errno.EBADF, errno.ENXIO, errno.ECONNRESET)
OUT, ERR = 1, 2

_own: Any = None  # the stream made by `take_over`
# The stream for results while standard output is reserved for them; None: `sys.stdout` takes everything.
_results: Any = None


class PatientFile(io.FileIO):
    """A descriptor to write to whose reader may disconnect; `expendable`: a full disk is not a failure either."""

    def __init__(self, descriptor: int, expendable: bool) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self.expendable = expendable

    def write(self, data: Any) -> int:
        """Write all of it, even if the descriptor does not block; bytes without a reader count as written."""
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
    """True for a file: an EIO of a disk loses data that were to be kept."""
    try:
        return stat.S_ISREG(os.fstat(descriptor).st_mode)
    except OSError:
        return False


def take_over() -> bool:
    """Give the process its two streams; False, and no change, if another program has replaced them, and on
    Windows, whose console takes text through Python's own streams only.

    A descriptor that is closed at the start leads to /dev/null from now on (else the next file would get its number,
    and all output with it). A letter that the stream's encoding lacks is written as its escape.
    """
    global _own
    if _own is not None and sys.stdout is _own:
        return True
    if systems.is_windows() or sys.stdout is not sys.__stdout__ or sys.stderr is not sys.__stderr__:
        return False
    for number in (0, OUT, ERR):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number: this one
    own = os.dup(OUT)  # processes that this one starts do not inherit it
    os.dup2(ERR, OUT)
    _own = sys.stdout = sys.__stdout__ = _stream(PatientFile(own, expendable=False), sys.__stdout__)  # type: ignore[misc]
    sys.stderr = sys.__stderr__ = _stream(PatientFile(ERR, expendable=True), sys.__stderr__)  # type: ignore[misc]
    return True


def _stream(file: PatientFile, previous: Any) -> io.TextIOWrapper:
    """A text stream over `file` with the buffering and encoding of `previous`."""
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
    """Inside, standard output takes only the output of `print_result`; everything else goes to standard error."""
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
    """The descriptor on which a child process is to print this process's result; None: its usual one."""
    stream = _results if _results is not None else sys.stdout
    try:
        return int(stream.fileno())
    except (OSError, ValueError):  # a stream in memory
        return None


def is_stuck() -> bool:
    """True when standard output does not accept its queued bytes, as on a full disk; they are discarded."""
    try:
        sys.stdout.flush()
    except OSError:
        lead_nowhere(sys.stdout)
        return True
    return False


def lead_nowhere(stream: Any) -> None:
    """Discard all further output to the stream."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        if nowhere != stream.fileno():
            os.close(nowhere)
