"""`python -m dev.floods`: the robot at a pace under floods by clients: pace, processor time, memory (minutes)."""

import argparse
import json
import pathlib
import sys

from dev.floods import floods
from ranger_sim.foundation import wallclock
from ranger_sim.tools import cli
from ranger_sim.tools.bench.command import machine
from ranger_sim.tools.command_line import streams
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import number, whole_number

COMMAND = "python -m dev.floods"


def parser(_command: str = "") -> cli.OneLineParser:
    """The options."""
    command = cli.OneLineParser(prog=COMMAND, description=__doc__)
    command.add_argument(
        "--seconds", type=whole_number(1), default=20, metavar="S", help="virtual seconds per flood (default 20)"
    )
    command.add_argument(
        "--speed",
        type=number(above=0.0),
        metavar="FACTOR",
        help="times real time of the robot (default: 0.25 to 1 by the number of processors)",
    )
    command.add_argument("--keep", metavar="FILE", help="rows that FILE has are not measured again, new ones are added")
    command.add_argument("--json", metavar="FILE|-", help="everything as JSON; - prints it and nothing else")
    command.set_defaults(run=run)
    return command


def run(options: argparse.Namespace) -> int:
    """Measure."""
    target = json_target(options.json)
    kept = None if options.keep is None else pathlib.Path(options.keep)

    def say(text: str) -> None:
        if options.json != "-":
            print(text, flush=True)

    about = machine()
    rows = floods.run(options.seconds, say, speed=options.speed, kept=kept)
    text = json.dumps({"date": wallclock.today_iso(), "machine": about, "floods": rows}, indent=2)
    if target is not None:
        replace_file(target, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    return 0


if __name__ == "__main__":
    sys.exit(cli.main(None, parser, COMMAND))
