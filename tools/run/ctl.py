"""`ranger-sim ctl`: requests to a robot that `up` runs."""

from __future__ import annotations

import argparse
import contextlib
import json
from typing import Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control
from ranger_sim.ranger.requests import admitted

# Fields of a request, as ctl gives them, and the name of each there.
FIELDS = {
    "restart": {"board": "BOARD"},
    "key": {"key": "N"},
    "set": {"name": "NAME", "value": "VALUE"},
    "fault": {"fault": "PLACE:MODE"},
    "clear": {"which": "N"},
    "radio": {"stick": "-1...1"},
}


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    ctl = commands.add_parser(
        "ctl",
        description="status, pause, resume; restart BOARD; key N: press a key for 0.2 s (1: walk; 2: stop, and a "
        "walking robot falls); set NAME VALUE: write a parameter, within its limits (ranger-sim table show NAME); "
        "fault PLACE:MODE: arm a fault, as --fault of `up` has it; clear N: end the fault that was armed as number N, "
        "from 0; radio STICK: steer, -1 (left) to 1 (right).",
    )
    ctl.add_argument("request", choices=("status", "pause", "resume", *FIELDS), help="what is asked for")
    ctl.add_argument("values", nargs="*", metavar="VALUE", help="its board, key, or name and value")
    ctl.add_argument("--name", default="ranger", help="name of the robot (default ranger)")
    ctl.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Send the request and print the answer."""
    what, values = options.request, options.values
    wanted = FIELDS.get(what, {})
    if len(values) != len(wanted):
        raise UserError(f"ctl {what} takes {' '.join(wanted.values()) or 'no value'}, got {' '.join(values) or 'none'}")
    request: dict = {"do": what, **dict(zip(wanted, values, strict=True))}
    for name in ("key", "which", "value", "stick"):
        with contextlib.suppress(KeyError, ValueError):  # the model of requests refuses what is not a number
            request[name] = int(request[name]) if name in ("key", "which") else float(request[name])
    try:
        admitted(json.dumps(request).encode())  # what the robot would refuse needs no robot
    except UserError as fault:
        raise UserError(f"ctl {fault}") from None
    answer = control.ask(options.name, request)
    if what == "status":
        print(json.dumps(answer, indent=2))
    elif what == "restart":
        print(f"{answer['restarting']} is being restarted")
    else:
        print(f"{what}: at {answer['time_s']:.4f} s of the robot's time")
    return 0
