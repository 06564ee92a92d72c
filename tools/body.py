"""`ranger-sim body`: the available bodies, and every number of one with unit, limits and source."""

import argparse
import json
from typing import Any

from ranger_sim.plant import body_files
from ranger_sim.tools.command_line import terminal

WIDE = 120  # columns of a window wide enough for sources next to their numbers


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "body",
        description="A body is a .toml file: title, description, base, [parameters] and [sources].",
    )
    parts = command.add_subparsers(dest="part", required=True, metavar="list|show")
    parts.add_parser("list", help="names and titles").set_defaults(run=run_list)
    show = parts.add_parser("show", help="values, units, limits and sources of a body")
    show.add_argument("name", metavar="NAME", help="body, by name or as a .toml file")
    show.add_argument("--changes", action="store_true", help="only the differences from its base")
    show.add_argument("--json", action="store_true", help="print JSON instead of a table")
    show.set_defaults(run=run_show)


def run_list(options: argparse.Namespace) -> int:
    """Print name, base and description of every body that comes with the project."""
    for name in body_files.available():
        body = body_files.load(name)
        base = f", on {body.base}" if body.base else ""
        print(f"{name:12}{body.title}{base}: {body.description}")
    return 0


def rows(body: body_files.BodyFile, changes_only: bool = False) -> list[dict[str, Any]]:
    """Key, value, unit, limits and source of each number, in the order of the tables."""
    return [
        {
            "key": key.name,
            "value": body.values[key.name],
            "unit": key.metadata["unit"],
            "limits": key.limits,
            "source": body.sources[key.name],
        }
        for key in body_files.keys().values()
        if not changes_only or key.name in body.changes
    ]


def run_show(options: argparse.Namespace) -> int:
    """Print one body."""
    body = body_files.load(options.name)
    found = rows(body, options.changes)
    if options.json:
        print(json.dumps({"name": body.name, "title": body.title, "base": body.base, "parameters": found}, indent=2))
        return 0
    console = terminal.console(highlight=False)
    console.print(f"{body.title}: {body.description}")
    for line in listed(found, console.width):
        console.print(line, soft_wrap=True)
    return 0


def listed(found: list[dict], width: int) -> list[str]:
    """Lines of a table; in a window of less than WIDE columns each source has a separate line below its number."""
    cells = [("key", "value", "unit", "limits", "source")]
    for row in found:
        value = f"{row['value']:g}" if isinstance(row["value"], float) else str(row["value"])
        cells.append((row["key"], value, row["unit"], row["limits"], row["source"]))
    widths = [max(len(row[column]) for row in cells) for column in range(4)]
    lines = []
    for *facts, source in cells:
        line = "  ".join(f"{text:<{size}}" for text, size in zip(facts, widths, strict=True))
        lines += [f"{line}  {source}"] if width >= WIDE else [line.rstrip(), f"    {source}"]
    return lines
