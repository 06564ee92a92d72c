"""Help that fits a window of 80 columns where argparse leaves the lines as they are."""

import textwrap
from collections.abc import Mapping

COLUMNS = 79


def named_lines(meanings: Mapping[str, str], width: int) -> str:
    """Names in a column of `width`, with their meanings to the right, wrapped if long."""
    margin = " " * (width + 3)
    return "\n".join(
        textwrap.fill(f"  {name:{width}} {meaning}", COLUMNS, subsequent_indent=margin, break_on_hyphens=False)
        for name, meaning in meanings.items()
    )
