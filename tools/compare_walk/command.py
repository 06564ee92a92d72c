"""`ranger-sim compare-walk`: its options. Its work is in work.py, with the libraries that it needs."""

from __future__ import annotations

import argparse
from typing import Any

from ranger_sim.tools.command_line.units import ANGLES, whole_number
from ranger_sim.tools.recordings import datasets
from ranger_sim.tools.run.walk_options import of_scenario


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "compare-walk",
        help="a walk that the robot logged beside the emulated robot's with the same controller",
        description="Takes the strides of a logged walk of the controller of 2015 (hip angle, outer leg's lean, state "
        "of the walk machine), lets the emulated robot walk, and tells what differs, with intervals from the strides' "
        "scatter. With --causes it names the wrong numbers that would explain it, and what they gain on strides held "
        "out. Exit code 1 when the walks differ by more than the scatter.",
    )
    command.add_argument("log", metavar="LOG", help="the walk that was measured: CSV, MF4, a walk's folder, CAN logs")
    command.add_argument(
        "--controller", default="head-2015", metavar="NAME", help="parameter set for the program head-2015 (head-2015)"
    )
    command.add_argument("--body", default="ranger", metavar="NAME", help="what walks, by name or .toml file (ranger)")
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
    datasets.add_accept_loss(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """The command."""
    from ranger_sim.tools.compare_walk import work

    return work.run(options)
