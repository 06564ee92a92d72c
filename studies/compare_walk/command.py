"""`python -m studies.compare_walk`: its options. Its work is in work.py, with the libraries that it needs."""

from __future__ import annotations

import argparse

from ranger_sim.tools import cli
from ranger_sim.tools.command_line.options import add_verbosity
from ranger_sim.tools.command_line.units import ANGLES, whole_number
from ranger_sim.tools.recordings import datasets
from ranger_sim.tools.run.walk_options import of_scenario

COMMAND = "python -m studies.compare_walk"


def parser(_command: str = "") -> cli.OneLineParser:
    """The options."""
    command = cli.OneLineParser(
        prog=COMMAND,
        description="Takes the strides of a logged walk of the controller of 2015 (hip angle, outer leg's lean, state "
        "of the walk machine), lets the emulated robot walk, and reports what differs, with intervals from their "
        "scatter. With --causes it names the wrong numbers that would explain it, and what they gain on strides held "
        "out. Exit code 1 when the walks differ by more than the scatter.",
    )
    command.add_argument("log", metavar="LOG", help="the walk that was measured: CSV, MF4, a walk's folder, CAN logs")
    command.add_argument(
        "--controller", default="head-2015", metavar="NAME", help="parameter set for the program head-2015 (head-2015)"
    )
    command.add_argument("--body", default="ranger", metavar="NAME", help="body, by name or as a .toml file (ranger)")
    command.add_argument("--model", metavar="FILE", help="model file (.toml) with additional terms")
    command.add_argument(
        "--slope",
        type=of_scenario("slope_rad", ANGLES, "rad"),
        default=0.0,
        metavar="RAD",
        help="of the floor, positive downhill (0)",
    )
    command.add_argument("--seed", type=whole_number(0), default=1, help="of the emulated walks (1)")
    command.add_argument(
        "--steps",
        type=whole_number(12),
        default=18,
        metavar="N",
        help="of the emulated walks, the last 6 count (18)",
    )
    command.add_argument("--causes", action="store_true", help="name causes: some 150 walks, a few minutes")
    command.add_argument("--out", metavar="DIR", help="folder for the plot, the answer, and the extended files")
    command.add_argument("--json", metavar="FILE|-", help="the answer as JSON; - prints it and nothing else")
    datasets.add_options(command)
    add_verbosity(command)
    datasets.add_accept_loss(command)
    command.set_defaults(run=run)
    return command


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    return cli.main(arguments, parser, COMMAND)


def run(options: argparse.Namespace) -> int:
    """The command."""
    from studies.compare_walk import work

    return work.run(options)
