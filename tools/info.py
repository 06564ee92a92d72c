"""`ranger-sim info`: the installed versions and how they run."""

import argparse
import json
import platform
import sys
from typing import Any

from rich.table import Table

from ranger_sim import __version__, datatable, loading
from ranger_sim.tools.command_line import terminal


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser("info")
    command.add_argument("--json", action="store_true", help="print JSON instead of a table")
    command.set_defaults(run=run)


def facts() -> dict[str, Any]:
    """Everything that the command reports, as plain data."""
    from ranger_sim.can_bus.edge import interfaces  # loads python-can, which its help does not need

    declared = set(loading.declared_modules())
    return {
        "version": __version__,
        "compiled": loading.RUNS_COMPILED,
        "interpreted_because": loading.RUNS_INTERPRETED_BECAUSE,
        "compiled_modules": len(declared & loading.COMPILED_MODULES),
        "interpreted_modules": sorted(declared - loading.COMPILED_MODULES),
        "python": sys.version.split()[0],
        "implementation": platform.python_implementation(),
        "platform": platform.platform(),
        "can_interfaces": interfaces.available_interfaces(),
        "data_table_hash": datatable.table_hash(),
    }


def run(options: argparse.Namespace) -> int:
    """Print the facts."""
    found = facts()
    if options.json:
        print(json.dumps(found, indent=2))
        return 0
    table = Table(show_header=False, box=None, pad_edge=False)
    run_as = "compiled" if found["compiled"] else f"interpreted ({found['interpreted_because']})"
    if found["compiled"] and found["interpreted_modules"]:
        run_as += f" (not compiled: {', '.join(found['interpreted_modules'])})"
    table.add_row("ranger-sim", found["version"])
    table.add_row("runs", run_as)
    table.add_row("Python", f"{found['python']} ({found['implementation']})")
    table.add_row("platform", found["platform"])
    table.add_row("CAN interfaces", ", ".join(found["can_interfaces"]) or "none found (python-can's own still work)")
    table.add_row("data table", found["data_table_hash"])
    terminal.console().print(table)
    return 0
