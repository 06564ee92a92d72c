"""`ranger-sim identify BENCH`: parameters from a bench's recording, with intervals; `all`: tables 2 and 3.

Its work is imported when needed: a first walk needs no scipy.
"""

import argparse
from typing import Any

from ranger_sim.tools.command_line.units import number, whole_number
from ranger_sim.tools.recordings import datasets

# the same as in sysid/identification/registry.py; a test compares them
BENCHES = {
    "stall": "Motor held: resistance and contact drop",
    "cantilever": "Motor against a brake: torque constant, and all of table 3 at once",
    "pulley": "Motor and a hanging mass: friction",
    "level": "Leg held level: first moment of mass",
    "hang": "Leg hanging: centre of mass ahead of the leg",
    "pendulum": "Leg swinging: moment of inertia about the hip",
    "hip-spring": "Leg pulled: the hip's spring",
    "ankle-spring": "Foot pulled with the motor held: the ankle's cable",
    "ankle-sine": "Ankle that tracks a sine: foot, return spring, friction",
}
GEAR = 14.0


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "identify",
        description="Benches: " + "; ".join(f"{name}: {meaning}" for name, meaning in BENCHES.items()),
    )
    command.add_argument("bench", metavar="BENCH", help=f"{', '.join(BENCHES)}, or all: tables 2 and 3")
    command.add_argument("--data", metavar="FILE", help="your recording; for all a folder with BENCH.csv of each")
    datasets.add_options(command)
    datasets.add_accept_loss(command)
    command.add_argument(
        "--known",
        action="append",
        default=[],
        metavar="NAME=VALUE+-SD",
        help="what is known already, as outer_cm=0.72+-0.004",
    )
    command.add_argument("--gear", type=number(above=0.0), default=GEAR, help="of the bench's gearbox (default 14)")
    command.add_argument("--seed", type=whole_number(0), default=1, help="of the virtual instruments (default 1)")
    command.add_argument(
        "--model", metavar="FILE", help="model file whose terms and motor the virtual bench has (of `diagnose --out`)"
    )
    command.add_argument("--json", metavar="FILE|-", help="everything as JSON; - prints it and nothing else")
    command.add_argument("--out", metavar="DIR", help="page with figures 28, 29, 31, the recordings, and the JSON")
    command.add_argument(
        "--coverage",
        type=whole_number(1),
        metavar="N",
        help="N virtual machines instead: how often intervals hold the truth",
    )
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Identify and report; 1 when a fit was refused."""
    from ranger_sim.tools.identify import work

    return work.run(options)
