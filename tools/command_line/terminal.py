"""Where commands print: the console, and standard streams that are closed, full, or know few letters."""

import contextlib
import io
import os
import sys
from collections.abc import Sequence
from typing import IO, Any

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

UNLIMITED = 10_000  # columns: more than any table of ours
FILE_COLUMNS = 160  # of lines in a file or a pipe, where nothing is as wide as a window: tables stay whole
OUTPUT = "standard output"


class PatientConsole(Console):
    """A console whose reader may leave without ending the command: its files are still to be finished."""

    def on_broken_pipe(self) -> None:
        """Print into nothing from now on."""
        self.quiet = True
        lead_nowhere(self.file)


def console(**settings: Any) -> Console:
    """A console with these settings of rich's; in a file or a pipe its lines are long, unless COLUMNS says how long.

    What is printed is text, and [brackets] in it are brackets, unless the settings ask for rich's markup.
    """
    made = PatientConsole(**{"markup": False, **settings})
    if not made.is_terminal and "COLUMNS" not in os.environ:
        made.width = FILE_COLUMNS
    return made


def print_table(console: Console, table: Table, spare: Sequence[str]) -> None:
    """Print a table with every line whole: in a narrow window columns of `spare` are left out, and that is told.

    spare: headings, the first to go first. Where that is not enough, what may wrap is wrapped.
    """
    gone = []
    for heading in spare:
        if Measurement.get(console, console.options.update(width=UNLIMITED), table).maximum <= console.width:
            break
        kept = [column for column in table.columns if column.header != heading]
        gone += [heading] * (len(kept) < len(table.columns))
        table.columns = kept
    console.print(table)
    if gone:
        console.print(f"no room for {', '.join(map(one_line, gone))}: a wider window or --json has it", soft_wrap=True)


def one_line(heading: str) -> str:
    """A heading without its break and its unit's brackets."""
    return heading.partition("\n")[0]


def stand_in_for_closed_streams() -> None:
    """Give the process three standard streams that take every letter.

    A descriptor that is closed at the start leads nowhere from now on (the next file would get its number, and what
    is printed with it). A letter that the stream's encoding has not is written as its escape.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest number that is free: this one
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w", closefd=False))
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_now(text: str) -> None:
    """Print on standard output, at once; a reader that has left misses it."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        lead_nowhere(sys.stdout)


def output_is_stuck() -> bool:
    """True when standard output does not take what waits in it, as on a full disk; what waits is given up."""
    try:
        sys.stdout.flush()
    except OSError:
        lead_nowhere(sys.stdout)
        return True
    return False


def lead_nowhere(stream: IO[str]) -> None:
    """Let what is still written to the stream vanish."""
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
