"""The console that commands print on. streams.py has the streams below it."""

import argparse
import os
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

from ranger_sim.foundation import wallclock

UNLIMITED = 10_000  # columns: more than any table of ours
VERBOSE_S = 1.0  # between two lines of progress with --verbose
FILE_COLUMNS = 160  # for lines in a file or a pipe, which have no window width: tables stay whole


class SteadyConsole(Console):
    """A console that never hides the cursor: a suspended or killed program leaves the terminal with one."""

    def show_cursor(self, show: bool = True) -> bool:
        """Leave the cursor unchanged."""
        return False


def console(**settings: Any) -> Console:
    """A console with these settings of rich's; in a file or a pipe its lines are long, unless COLUMNS sets a length.

    Printed strings are text, and [brackets] in them are brackets, unless the settings enable rich's markup.
    """
    made = SteadyConsole(**{"markup": False, **settings})
    if not made.is_terminal and "COLUMNS" not in os.environ:
        made.width = FILE_COLUMNS
    return made


def for_progress(options: argparse.Namespace) -> Console:
    """The console for progress and notes, on standard error; silent with --quiet and `--json -`."""
    return console(stderr=True, quiet=options.quiet or options.json == "-")


def progress_every_s(options: argparse.Namespace, usual_s: float) -> float:
    """Seconds between two lines of progress where there is no terminal."""
    return VERBOSE_S if options.verbose else usual_s


class ProgressLines:
    """Lines of progress where there is no terminal: with --verbose one every second at most, otherwise none."""

    def __init__(self, console: Console, options: argparse.Namespace) -> None:
        self.console = console
        self.is_wanted = options.verbose and not console.is_terminal
        self.next_s = 0.0

    def show(self, text: str) -> None:
        """Print it if one is due."""
        if self.is_wanted and wallclock.monotonic_s() >= self.next_s:
            self.next_s = wallclock.monotonic_s() + VERBOSE_S
            self.console.print(text, highlight=False, soft_wrap=True)


def print_table(console: Console, table: Table, spare: Sequence[str]) -> None:
    """Print a table with every line whole: in a narrow window columns of `spare` are left out, with a note.

    spare: headings, the first to go first. If that is not enough, columns that may wrap are wrapped.
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
        names = ", ".join(map(one_line, gone))
        console.print(f"too narrow for {names}: widen the window or use --json", soft_wrap=True)


def one_line(heading: str) -> str:
    """A heading without its line break and its unit's brackets."""
    return heading.partition("\n")[0]
