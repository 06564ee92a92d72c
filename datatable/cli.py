"""`ranger-sim table`: generate the code, check that it is up to date, query the master table."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import shlex
import sys

from ranger_sim.datatable.model import Table, Variable
from ranger_sim.foundation.user_error import TableError

EXIT_DONE, EXIT_STALE = 0, 1
FILE_COLUMNS = 160  # of lines in a file or a pipe
WIDE = 120  # columns of a window wide enough for descriptions


def register(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the `table` command; each action sets `run`, a function of the arguments giving the exit code."""
    parser = subparsers.add_parser("table")
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")

    generate = actions.add_parser("generate", help="write everything that is generated from the master table")
    generate.add_argument("--check", action="store_true", help="write nothing; exit code 1 when files are stale")
    generate.add_argument("--out", metavar="DIR", help="write to this folder (default: generated, in the master's)")
    generate.set_defaults(run=run_generate)

    copying = actions.add_parser("copy", help="copy the master files into a new folder, for your own table")
    copying.add_argument("folder", metavar="DIR", help="a folder that does not exist yet")
    copying.set_defaults(run=run_copy)

    show = actions.add_parser("show", help="one variable by name or id")
    show.add_argument("variable", metavar="NAME|ID")
    show.set_defaults(run=run_show)

    listing = actions.add_parser("list", help="variables, all or of one board")
    listing.add_argument("--board", metavar="BOARD", help="only what this board publishes or receives")
    listing.set_defaults(run=run_list)

    for action in (generate, show, listing):
        action.add_argument("--master", metavar="DIR", help="folder with other master files")
        action.add_argument("--json", action="store_true", help="JSON on standard output")


def load(arguments: argparse.Namespace) -> Table:
    from ranger_sim.datatable.loader import load_table

    return load_table(arguments.master)


def run_generate(arguments: argparse.Namespace) -> int:
    """Write, or with --check only compare. Exit code 0, or 1 when --check found stale files."""
    from ranger_sim.datatable.generate import GENERATED_FOLDER, stale, write

    table = load(arguments)
    default = pathlib.Path(arguments.master) / "generated" if arguments.master else GENERATED_FOLDER
    folder = pathlib.Path(arguments.out) if arguments.out else default
    changed = stale(table, folder) if arguments.check else write(table, folder)
    if arguments.json:
        print(json.dumps({"folder": str(folder), "checked": arguments.check, "changed": changed}))
    elif arguments.check:
        for name in changed:
            print(f"stale: {folder / name}", file=sys.stderr)
        if changed:
            print("run `ranger-sim table generate` and check the files in", file=sys.stderr)
        else:
            print("the generated files are up to date")
    else:
        print(f"{len(changed)} files written to {folder}" if changed else "nothing to do: the files are up to date")
    return EXIT_STALE if arguments.check and changed else EXIT_DONE


def run_copy(arguments: argparse.Namespace) -> int:
    """The master files in a new folder."""
    import shutil

    from ranger_sim.datatable.loader import folder_of

    folder = pathlib.Path(arguments.folder)
    try:
        folder.mkdir(parents=True)
        for path in sorted(folder_of(None).glob("*.*")):
            if path.suffix in (".csv", ".toml"):
                shutil.copyfile(path, folder / path.name)
    except OSError as error:
        raise TableError(f"{error.filename or folder}: {error.strerror}: the copy needs a new folder") from error
    print(f"{folder}: change variables.csv, then ranger-sim table generate --master {shlex.quote(str(folder))}")
    print(f"every program with this variable uses it: RANGER_SIM_TABLE={folder}")
    return EXIT_DONE


def facts_of(variable: Variable) -> dict[str, object]:
    """A variable as plain values, in reading order."""
    return {
        "id": variable.id,
        "name": variable.name,
        "description": variable.description,
        "type": variable.type,
        "unit": variable.unit,
        "initial": variable.initial_as_stored,
        "publisher": variable.publisher,
        "subscribers": list(variable.subscribers),
        "buses": list(variable.buses),
        "period_ms": None if variable.period_ms is None else float(variable.period_ms),
        "minimum": variable.minimum,
        "maximum": variable.maximum,
    }


def readable(value: object) -> str:
    """A value for the terminal."""
    if value is None or value == "" or value == []:
        return "-"
    return ", ".join(value) if isinstance(value, list) else str(value)


def run_show(arguments: argparse.Namespace) -> int:
    """Everything about one variable."""
    facts = facts_of(load(arguments).variable(arguments.variable))
    if arguments.json:
        print(json.dumps(facts))
        return EXIT_DONE
    for key, value in facts.items():
        print(f"{key:12} {readable(value)}")
    return EXIT_DONE


def run_list(arguments: argparse.Namespace) -> int:
    """A line per variable: all, or those that one board publishes and receives."""
    table = load(arguments)
    variables = list(table.variables)
    if arguments.board:
        board = table.board(arguments.board.upper()).name
        variables = [v for v in variables if board == v.publisher or board in v.subscribers]
    if arguments.json:
        print(json.dumps([facts_of(variable) for variable in variables]))
        return EXIT_DONE
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table as Grid

    known_width = sys.stdout.isatty() or "COLUMNS" in os.environ
    console = Console(width=None if known_width else FILE_COLUMNS, markup=False, highlight=False)
    described = console.width >= WIDE
    grid = Grid(box=SIMPLE_HEAD, pad_edge=False)
    for heading in ("id", "name", "type", "unit", "from", "to", "period (ms)", *["description"] * described):
        number = heading in ("id", "period (ms)")
        grid.add_column(heading, justify="right" if number else "left", no_wrap=heading == "name")
    for variable in variables:
        period = "-" if variable.period_ms is None else f"{float(variable.period_ms):g}"
        grid.add_row(
            str(variable.id),
            variable.name,
            variable.type,
            variable.unit or "-",
            variable.publisher,
            " ".join(variable.subscribers),
            period,
            *[variable.description] * described,
        )
    console.print(grid)
    if not described:
        print("too narrow for descriptions: use a wider window, --json or `table show NAME`")
    return EXIT_DONE
