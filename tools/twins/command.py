"""`ranger-sim twins`: makes the file of twins that the diagnosis of a walk compares with."""

from __future__ import annotations

import argparse
from typing import Any

from ranger_sim.tools.command_line.options import add_verbosity
from ranger_sim.tools.command_line.units import number, whole_number, word


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "twins",
        description="Lets sound robots, and robots with one cause each, walk in the emulator, and makes the file that "
        "`ranger-sim diagnose --experiment walk` compares a walk with. After a kill, the same command continues. The "
        "same version, controller and body make the same bytes.",
    )
    command.add_argument(
        "controller", nargs="?", default="record-2011", metavar="CONTROLLER", help="parameter set (record-2011)"
    )
    command.add_argument(
        "--body", default="ranger", type=word("a body's name"), metavar="NAME", help="sound body (ranger)"
    )
    command.add_argument("--work", metavar="DIR", help="folder of the walks (runs/twins/CONTROLLER)")
    command.add_argument("--out", metavar="FILE", help="file to make (default: the one in the package)")
    command.add_argument("--jobs", type=whole_number(1), default=2, metavar="N", help="walks at a time (2)")
    command.add_argument(
        "--share", type=number(above=0.0, most=1.0), default=1.0, metavar="P", help="of all walks, for a trial (1)"
    )
    command.add_argument("--json", metavar="FILE|-", help="what the file was made of, as JSON")
    add_verbosity(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """The command."""
    from ranger_sim.tools.twins import work

    return work.run(options)
