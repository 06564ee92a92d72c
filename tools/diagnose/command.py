"""`ranger-sim diagnose`: its options. Its work is in work.py, which needs libraries that a walk does not."""

from __future__ import annotations

import argparse
from typing import Any

from ranger_sim.sysid.machines import EXPERIMENTS, MOTOR_STAGE
from ranger_sim.tools.command_line.options import add_verbosity
from ranger_sim.tools.command_line.units import number, whole_number
from ranger_sim.tools.recordings import datasets


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "diagnose",
        description="Looks for a misfit between measured data and the equations of an experiment, names its cause or "
        "says that it cannot, and measures what the extended model gains on held-out data. Exit code 0: nothing was "
        "found; 1: something was; 2: a mistake, or data that contradict their own description; 3: no cause was found, "
        "and an equation leaves far more than its channel's noise, the data are too short for their noise, or a "
        "parameter comes out as no machine has it.",
    )
    command.add_argument("data", nargs="+", metavar="DATA", help="recordings: CSV, MF4, a run's folder, CAN logs")
    command.add_argument(
        "--holdout", nargs="+", default=[], metavar="DATA", help="recordings that only measure the gain"
    )
    command.add_argument(
        "--holdout-part",
        type=number(),
        metavar="P",
        help="instead of --holdout: the last part of each DATA by time, above 0 and below 1",
    )
    command.add_argument(
        "--experiment",
        required=True,
        metavar="NAME",
        help=f"{', '.join(EXPERIMENTS)}, or a machine of your own as module:object",
    )
    command.add_argument(
        "--model",
        metavar="FILE",
        help="model to start from: the extended.toml of an earlier diagnosis, or [[term]] tables; terms that it "
        "has are not findings; for motor-stage a body, by name or as a .toml file (ranger)",
    )
    command.add_argument(
        "--gear", type=number(least=0.01, most=1e4), metavar="N", help="of the motor bench's gearbox (14)"
    )
    command.add_argument(
        "--repair",
        action="append",
        default=[],
        metavar="CHANNEL",
        help="put right what looks wrong in a channel that drives the machine as well (repeatable)",
    )
    command.add_argument("--seed", type=whole_number(0), default=0, metavar="N", help="of the bootstrap (0)")
    command.add_argument(
        "--out", metavar="DIR", help="folder for report.html, diagnosis.json and extended.toml, made if missing"
    )
    command.add_argument("--json", metavar="FILE|-", help="the answer as JSON; - prints it and nothing else")
    datasets.add_options(command)
    add_verbosity(command)
    datasets.add_accept_loss(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """The command."""
    if options.experiment == MOTOR_STAGE:
        from ranger_sim.tools.diagnose import motor_stages

        return motor_stages.run(options)
    from ranger_sim.tools.diagnose import work

    return work.run(options)
