"""`python -m dev.fuzz`: hostile input by the thousand; ends with the first case that the program does not stand."""

from __future__ import annotations

import argparse
import importlib
import json
import pathlib
import sys

from dev.fuzz import Finding
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.help_text import named_lines
from ranger_sim.tools.command_line.units import whole_number

COMMAND = "python -m dev.fuzz"
EXIT_FOUND = 1
CASES = 10_000
TARGETS = {
    "can": "frames of every kind, and bytes that are none, from outside onto the buses of a walking robot",
    "channel": "damaged messages in the channel between a board's process and the body's",
    "firmware": "hostile programs in C and images in the place of a board of a walk",
    "gdb": "hostile debuggers at the gdb port of a board that runs machine code",
    "interfaces": "hostile programs at every endpoint: requests, connections, floods, unread answers; without a robot",
    "panel": "hostile programs at the panel's HTTP and WebSocket",
    "profiles": "profiles and bus schedules with pieces cut out, doubled and replaced",
    "requests": "requests of `ctl` that reach a walking robot, faults of every kind among them; viewers of the feed",
    "serial": "wrong bytes on the line between main brain and computer, both ways",
    "xcp": "hostile masters at the XCP slave's UDP port, with a robot",
}


def parser() -> argparse.ArgumentParser:
    """The options."""
    command = argparse.ArgumentParser(
        prog=COMMAND,
        description="Hostile input by the thousand. After every case everything is checked.\n"
        "The first case that the program fails is named with its seed;\nthe exit code is then 1.",
        epilog="targets:\n" + named_lines(TARGETS, 10),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument(
        "target", nargs="*", metavar="TARGET", help=f"{', '.join(TARGETS)} (default: one after the other)"
    )
    command.add_argument(
        "--cases", type=whole_number(1), default=CASES, metavar="N", help=f"cases for each target (default {CASES})"
    )
    command.add_argument(
        "--seed", type=whole_number(0), default=1, metavar="S", help="the same seed gives the same cases (default 1)"
    )
    command.add_argument(
        "--state", type=pathlib.Path, metavar="FILE", help="firmware: keep the counts in FILE, and go on there"
    )
    command.add_argument("--json", metavar="FILE|-", help="what was counted, as JSON; - prints it and nothing else")
    return command


def main(arguments: list[str] | None = None) -> int:
    """One target after the other; 0 when all held, 1 with the first finding, 2 for a user's mistake."""
    command = parser()
    options = command.parse_args(arguments)
    for name in options.target:
        if name not in TARGETS:
            command.error(f"unknown target {name!r} (available: {', '.join(TARGETS)})")
    if options.state is not None and options.target != ["firmware"]:
        command.error("--state is for the target firmware alone")
    try:
        return run(options)
    except UserError as mistake:
        print(f"{COMMAND}: {mistake}", file=sys.stderr)
        return 2


def run(options: argparse.Namespace) -> int:
    """The same with options that are right."""
    json_file = json_target(options.json)
    found: dict[str, dict] = {}
    for name in dict.fromkeys(options.target or TARGETS):
        fuzzer = importlib.import_module(f"dev.fuzz.{name}")
        try:
            more = [options.state] if options.state is not None else []
            counted = found[name] = fuzzer.run(options.cases, options.seed, *more)
        except Finding as finding:
            print(f"{COMMAND}: {name}, seed {options.seed}: {finding}", file=sys.stderr)
            return EXIT_FOUND
        if options.json != "-":
            counts = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in counted.items())
            print(f"{name}: {counts}", flush=True)
    text = json.dumps({"seed": options.seed, "fuzz": found}, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
