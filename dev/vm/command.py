"""`python -m dev.vm -- COMMAND`: run a command with SocketCAN on a host that has none."""

from __future__ import annotations

import argparse
import os
import pathlib
import sys

from dev.vm import machine
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools import cli
from ranger_sim.tools.command_line.units import TIMES, quantity, whole_number

COMMAND = "python -m dev.vm"


def parser(_command: str = "") -> cli.OneLineParser:
    """The options."""
    default = machine.Guest()
    command = cli.OneLineParser(
        prog=COMMAND,
        usage="python -m dev.vm [options] -- COMMAND [ARGUMENT ...]",
        description="Boots Debian's kernel under software emulation and runs COMMAND in it, in this folder and among "
        "the files of this machine, with vcan0 ... vcan3 up and two Kvaser adapters on one bus as can0 and can1. "
        "Files that COMMAND writes are gone afterwards, except below --shared.",
    )
    command.add_argument(
        "--time-limit",
        type=quantity(TIMES, "s", 0.0),
        default=default.time_limit_s,
        metavar="10min",
        help="the machine is switched off after this time, with exit code 124 (default 10min)",
    )
    command.add_argument(
        "--memory",
        type=whole_number(256),
        default=default.memory_MiB,
        metavar="MiB",
        help="memory of the machine (default 2048)",
    )
    command.add_argument(
        "--processors",
        type=whole_number(1),
        default=default.processors,
        metavar="N",
        help="processors of the machine (default 1, the best for processes that wait for each other)",
    )
    command.add_argument(
        "--shared",
        action="append",
        default=[],
        metavar="DIR",
        help="folder that COMMAND may write to (repeatable)",
    )
    command.add_argument(
        "--kvm", action="store_true", help="use /dev/kvm instead of emulation: far faster where it works"
    )
    command.add_argument("--console", action="store_true", help="show the machine's console on standard error")
    command.add_argument("command_line", nargs="+", metavar="COMMAND", help="the command to run, after --")
    command.set_defaults(run=run)
    return command


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    return cli.main(arguments, parser, COMMAND)


def run(options: argparse.Namespace) -> int:
    """Run the command; returns its exit code."""
    for name in options.shared:
        if not pathlib.Path(name).is_dir():
            raise UserError(f"--shared {name!r}: not a folder")
    if options.kvm and not os.access("/dev/kvm", os.R_OK | os.W_OK):
        raise UserError("--kvm: /dev/kvm is not there or may not be used; leave --kvm out for software emulation")
    guest = machine.Guest(
        memory_MiB=options.memory,
        processors=options.processors,
        time_limit_s=options.time_limit,
        shared=tuple(pathlib.Path(name).resolve() for name in options.shared),
        accelerator="kvm" if options.kvm else machine.ACCELERATOR,
        shows_console=options.console,
    )
    sys.stdout.flush()
    ended = machine.run(options.command_line, os.environ, pathlib.Path.cwd(), guest, write_all)
    if ended.code == machine.EXIT_TIME_LIMIT and ended.total_s >= options.time_limit:
        what = "the machine had not come up" if ended.boot_s is None else "the command had not ended"
        print(f"{COMMAND}: {what} after {options.time_limit:g} s (--time-limit); switched off", file=sys.stderr)
    return ended.code


def write_all(number: int, data: bytes) -> None:
    """Write everything to standard output (1) or standard error (2)."""
    stream = sys.stdout if number == 1 else sys.stderr
    while data:
        data = data[os.write(stream.fileno(), data) :]
