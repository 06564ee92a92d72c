"""`ranger-sim read`: its options. Its work is in work.py, which needs libraries that a walk does not."""

from __future__ import annotations

import argparse
from typing import Any

from ranger_sim.tools.recordings import datasets


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "read",
        description="Reads text tables of any kind, oscilloscope exports, MDF, MATLAB, Parquet, ULog, MCAP, recordings "
        "of CAN frames, and folders of runs; accounts for every line and sample, finds what is odd, proposes repairs. "
        "Exit code 0: read; 1: read, with findings that matter; 2: refused.",
    )
    command.add_argument("files", nargs="+", metavar="FILE", help="recordings, or folders of runs")
    command.add_argument("--json", metavar="FILE|-", help="the answer as JSON; - prints it and nothing else")
    command.add_argument("--plot", metavar="FILE", help="every channel with its findings: .html, or .png by matplotlib")
    command.add_argument(
        "--write-recipe", metavar="FILE", help="how the first FILE was read, as an import recipe (TOML)"
    )
    datasets.add_options(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """The command."""
    from ranger_sim.tools.read import work

    return work.run(options)
