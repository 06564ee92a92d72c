"""Where a program in C ended its process: the runtime leaves a record, this module describes it.

The record is `RECORD` numbers: the signal, plus `OVERFLOW` when the stack was left, or `EXITED` plus the code where the
program called exit; then places in the library's code from its beginning, the innermost function first, 0 for none. The
program can write over it, as over all memory of its process: nothing in it is taken for granted.
"""

import json
import mmap
import pathlib
import shutil
import signal
import subprocess
from collections.abc import Sequence
from typing import Any

from ranger_sim.foundation.user_error import printable

RECORD = 7
OVERFLOW = 256  # OVERFLOW_FLAG of runtime.c
EXITED = 512  # EXIT_FLAG of runtime.c
LARGEST_PLACE = 1 << 48  # bytes; a library is smaller by far
UNREADABLE = "the record of its end is not readable: its program wrote over it"
# Sent to a program that lets no time pass, to get its place; 0: a system without it, where no process of a board runs.
ASKED: int = getattr(signal, "SIGXCPU", 0)
LONGEST_S = 20.0  # binutils read some megabytes of debug information at most
UNKNOWN = "??"  # addr2line's output for an unknown place

ENTRY_WORDS = 256  # of a notebook: a record, and what it is about as JSON, its length in bytes before it
ENTRIES = 16


class Notebook:
    """Memory for records of a process that runs programs in C, for the process that forked it: `describe` returns
    the cause of its end."""

    def __init__(self) -> None:
        self.words = memoryview(mmap.mmap(-1, 8 * ENTRIES * ENTRY_WORDS)).cast("q")
        self.used = 0

    def new_record(self, board: str, library: pathlib.Path, sources: pathlib.Path) -> Any:
        """In that process: memory for the record of a board, whose program is in `library`."""
        entry = self.words[self.used % ENTRIES * ENTRY_WORDS :][:ENTRY_WORDS]
        self.used += 1
        about = json.dumps([board, str(library), str(sources)]).encode()[: 8 * (ENTRY_WORDS - RECORD - 1)]
        entry[RECORD] = len(about)
        padded = memoryview(about + bytes(-len(about) % 8)).cast("q")
        entry[RECORD + 1 : RECORD + 1 + len(padded)] = padded
        return entry[:RECORD]

    def describe(self) -> str:
        """`MCH: SIGSEGV ... in control() at hip.c:42`; empty when no program has ended its process."""
        for number in range(ENTRIES):
            entry = self.words[number * ENTRY_WORDS :][:ENTRY_WORDS]
            if entry[0]:
                try:
                    board, library, sources = json.loads(entry[RECORD + 1 :].tobytes()[: max(0, entry[RECORD])])
                    paths = pathlib.Path(library), pathlib.Path(sources)
                except (ValueError, TypeError, RecursionError):
                    return f"a board with a program in C: {UNREADABLE}"
                return printable(f"{board}: {describe(*paths, entry[:RECORD].tolist())}")
        return ""


# The process that forked this one and reports its end; None: no such process, and the program's last word goes to the
# terminal.
notebook: Notebook | None = None


def record_of(board: str, library: pathlib.Path, sources: pathlib.Path) -> tuple[Any, str]:
    """Memory for the record of a program that runs in this process, and what is to be printed at its end."""
    if notebook is not None:
        return notebook.new_record(board, library, sources), ""
    words = memoryview(bytearray(8 * RECORD)).cast("q")
    return words, f"ranger-sim: {board}: its program has ended this process, where: addr2line -f -e {library}"


def describe(library: pathlib.Path, sources: pathlib.Path, record: Sequence[int]) -> str:
    """`SIGSEGV (Segmentation fault) in control() at hip.c:42, called from slot() at hip.c:17`; "" for no record.

    library: the file with its debug information; sources: the folder to which file names are relative.
    """
    if record[0] == 0:
        return ""
    number = record[0] % OVERFLOW
    places = [place for place in record[1:RECORD] if place]
    if any(not 0 < place < LARGEST_PLACE for place in places):
        return UNREADABLE
    if EXITED <= record[0] < EXITED + OVERFLOW:
        what = f"it called exit({number})"
    elif not 0 < record[0] < EXITED or number not in signal.valid_signals():
        return UNREADABLE
    elif number == ASKED:
        what = "its program let no time pass"
    else:
        what = f"{_name_of(number)} ({signal.strsignal(number)})"
        if record[0] & OVERFLOW:
            what = f"stack overflow, {what}"
    if not places:
        return f"{what}, outside of the program's code"
    lines = lines_of(library, sources, places)
    once = [line for i, line in enumerate(lines) if line not in lines[:i]]  # a recursion is reported once
    if number == ASKED:  # the call of the header that it was in at that moment says nothing of the endless loop
        once = [line for line in once if " at runtime.c:" not in line] or once
    return f"{what} in {', called from '.join(once)}"


def _name_of(number: int) -> str:
    """SIGSEGV; a real-time signal has no name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def lines_of(library: pathlib.Path, sources: pathlib.Path, places: Sequence[int]) -> list[str]:
    """`function() at file:line` of each place, the file relative to the folder `sources`.

    Offsets in the library where no addr2line is installed, or it does not know.
    """
    offsets = [f"{library.name}+0x{place:x}" for place in places]
    program = shutil.which("addr2line")
    if program is None:
        return offsets
    command = [program, "-f", "-e", str(library), *(f"0x{place:x}" for place in places)]
    try:
        done = subprocess.run(
            command, capture_output=True, check=False, timeout=LONGEST_S, encoding="utf-8", errors="replace"
        )
    except (subprocess.TimeoutExpired, OSError, ValueError):  # the last: no path of a file
        return offsets
    output = done.stdout.splitlines()
    if len(output) != 2 * len(places):
        return offsets
    return [
        offset if function == UNKNOWN else f"{function}() at {_shown(place, sources)}"
        for offset, function, place in zip(offsets, output[::2], output[1::2], strict=True)
    ]


def _shown(place: str, sources: pathlib.Path) -> str:
    """File and line, the file relative to the folder when it is within."""
    file, _, line = place.partition(" ")[0].rpartition(":")
    path = pathlib.Path(file)
    shown = path.relative_to(sources) if path.is_relative_to(sources) else path.name
    return f"{shown}:{line}"
