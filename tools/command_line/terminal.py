"""The console that commands print on. The streams below it: streams.py."""

import os
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.measure import Measurement
from rich.table import Table

UNLIMITED = 10_000  # columns: more than any table of ours
FILE_COLUMNS = 160  # of lines in a file or a pipe, where nothing is as wide as a window: tables stay whole


class SteadyConsole(Console):
    """A console that never hides the cursor: a program that is suspended or killed leaves a terminal that has one."""

    def show_cursor(self, show: bool = True) -> bool:
        """Leave it as it is."""
        return False


def console(**settings: Any) -> Console:
    """A console with these settings of rich's; in a file or a pipe its lines are long, unless COLUMNS says how long.

    What is printed is text, and [brackets] in it are brackets, unless the settings ask for rich's markup.
    """
    made = SteadyConsole(**{"markup": False, **settings})
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
