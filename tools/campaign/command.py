"""`ranger-sim campaign FILE.toml`: many runs of one plan, here or on a Dask cluster, resumable at any time."""

import argparse
from typing import Any

from ranger_sim.tools.command_line.options import add_verbosity
from ranger_sim.tools.command_line.units import whole_number, word


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "campaign",
        description="Runs the cases of the plan that have no result yet, then writes tables and a page. After a "
        "kill, the same command continues.",
        epilog="The plan's form: harness/campaigns/README.md; examples: campaigns/.",
    )
    command.add_argument("file", metavar="FILE.toml", help="the plan")
    command.add_argument("--out", metavar="DIR", help="folder for results and page (default runs/campaigns/NAME)")
    command.add_argument(
        "--jobs", type=whole_number(1), help="runs at a time on this machine (default: its processors)"
    )
    command.add_argument(
        "--pool",
        choices=("local", "dask"),
        help="plain processes of this machine (the default), or a new Dask cluster, encrypted",
    )
    command.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster that runs already, as tls://host:8786")
    for option, what in (
        ("--tls-ca-file", "certificate of the authority"),
        ("--tls-cert", "certificate"),
        ("--tls-key", "key"),
    ):
        command.add_argument(option, metavar="FILE", help=f"{what} (PEM) for --scheduler tls://...")
    command.add_argument("--report", action="store_true", help="run nothing, only write tables and page")
    command.add_argument(
        "--document", metavar="FILE.md", help="also put the tables into this document, between its two marks"
    )
    command.add_argument("--replay", metavar="KEY", help="run one case again, from power-up, and print what happened")
    command.add_argument(
        "--seed", type=whole_number(0), metavar="N", help="what [sample] or [search] draws (default: the plan's seed)"
    )
    command.add_argument(
        "--json",
        type=word("a file or -"),
        metavar="FILE|-",
        help="the summary as JSON, as summary.json of the folder; - prints it and nothing else",
    )
    add_verbosity(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the plan; 0 done, 1 when a run crashed or timed out, 130 interrupted."""
    from ranger_sim.tools.campaign import work  # statistics and plots: only when there is a campaign

    return work.run(options)
