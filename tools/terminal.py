"""The console that commands print on."""

import os
from typing import Any

from rich.console import Console

FILE_COLUMNS = 160  # of lines in a file or a pipe, where nothing is as wide as a window: tables stay whole


def console(**settings: Any) -> Console:
    """A console with these settings of rich's; in a file or a pipe its lines are long, unless COLUMNS says how long."""
    made = Console(**settings)
    if not made.is_terminal and "COLUMNS" not in os.environ:
        made.width = FILE_COLUMNS
    return made
