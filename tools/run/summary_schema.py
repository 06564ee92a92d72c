"""`ranger-sim summary-schema`: the JSON Schema of `summary.json`, with unit and meaning of every figure.

`python -m ranger_sim.tools.run.summary_schema` writes the table of docs/summary.md from the same source.
"""

import argparse
import json
import pathlib
from typing import Any

from ranger_sim.ranger.records import summary_schema

DOCUMENT = pathlib.Path(__file__).resolve().parents[2] / "docs" / "summary.md"
TABLE_BEGIN = "<!-- written by python -m ranger_sim.tools.run.summary_schema: begin -->"
TABLE_END = "<!-- written by python -m ranger_sim.tools.run.summary_schema: end -->"


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser("summary-schema")
    command.set_defaults(run=run)


def run(_options: argparse.Namespace) -> int:
    """Print it."""
    print(json.dumps(summary_schema.json_schema(), indent=2))
    return 0


def with_table(text: str) -> str:
    """The document with the table of today."""
    before, _, rest = text.partition(TABLE_BEGIN)
    _, _, after = rest.partition(TABLE_END)
    return f"{before}{TABLE_BEGIN}\n\n{summary_schema.markdown()}\n\n{TABLE_END}{after}"


if __name__ == "__main__":
    DOCUMENT.write_text(with_table(DOCUMENT.read_text(encoding="utf-8")), encoding="utf-8")
    print(f"written: {DOCUMENT.name}")
