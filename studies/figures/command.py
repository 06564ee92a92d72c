"""`python -m studies.figures`: its options. Its work is in work.py, whose libraries a walk does not need."""

import argparse

from ranger_sim.tools import cli
from ranger_sim.tools.command_line.options import add_verbosity
from ranger_sim.tools.command_line.units import whole_number

COMMAND = "python -m studies.figures"


def parser(_command: str = "") -> cli.OneLineParser:
    """The options."""
    command = cli.OneLineParser(
        prog=COMMAND,
        description="Walks the emulated robot with each number of the file changed, finds which of them explain the "
        "measured figures, with values and intervals, what ties, and which further measurement would decide. Exit "
        "code 1 when something was found.",
        epilog="docs/foot-too-high.md is an example from end to end, and has the form of the file.",
    )
    command.add_argument("file", metavar="FIGURES", help="a TOML file, or record-walk: the figures of May 2011")
    command.add_argument("--body", metavar="NAME", help="the body to check, in place of the file's")
    command.add_argument("--controller", metavar="NAME", help="its controller, in place of the file's")
    command.add_argument("--steps", type=whole_number(20), metavar="N", help="of each walk, in place of the file's")
    command.add_argument(
        "--seeds", type=whole_number(2), metavar="N", help="walks of each body, in place of the file's"
    )
    command.add_argument(
        "--also",
        action="append",
        default=[],
        metavar="NAME=VALUE+-SD",
        help="a further measured figure, as sole_to_hip_m=1.0+-0.005; may be given several times",
    )
    command.add_argument(
        "--hide",
        action="append",
        default=[],
        metavar="KEY=CHANGE",
        help="a blind check: take the figures of a robot with this number changed (body.hip_spring_Nm_per_rad=-30%%, "
        "NAME=+0.02 for a candidate) in place of the measured ones, and see whether it is named; may be given several "
        "times",
    )
    command.add_argument(
        "--rounds",
        type=whole_number(0),
        metavar="N",
        help="how often the best hypotheses are walked where they are best (4, or until none is left)",
    )
    command.add_argument("--jobs", type=whole_number(1), default=2, metavar="N", help="walks at a time (2)")
    command.add_argument(
        "--out", metavar="DIR", help="folder for the answer, the corrected body, and the walks: it goes on from those"
    )
    command.add_argument("--json", metavar="FILE|-", help="the answer as JSON; - prints it and nothing else")
    add_verbosity(command)
    command.set_defaults(run=run)
    return command


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    return cli.main(arguments, parser, COMMAND)


def run(options: argparse.Namespace) -> int:
    """The command."""
    from studies.figures import work

    return work.run(options)
