"""`ranger-sim up`: the robot as processes at the pace of the wall clock."""

from __future__ import annotations

import argparse
from typing import Any

from ranger_sim.datatable.addresses import XCP_BUS, XCP_MASTER_ID, XCP_SLAVE_ID
from ranger_sim.harness.processes.settings import FASTEST, NEVER, ON_FAILURE, SLOWEST
from ranger_sim.tools import faults
from ranger_sim.tools.buses import server_options
from ranger_sim.tools.command_line.options import add_all
from ranger_sim.tools.command_line.units import number, whole_number, word
from ranger_sim.tools.firmware import gdb_options
from ranger_sim.tools.firmware.command import OPTIONS as FIRMWARE
from ranger_sim.tools.firmware.images import OPTIONS as IMAGES
from ranger_sim.tools.run import walk_options
from ranger_sim.tools.timing import trace

PACE = number(least=SLOWEST, most=FASTEST)


def speed(text: str) -> float | None:
    """An argparse type: a factor, or max (None)."""
    if text == "max":
        return None
    try:
        return PACE(text)
    except argparse.ArgumentTypeError as wrong:
        raise argparse.ArgumentTypeError(f"{wrong}, or max") from None


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    up = commands.add_parser(
        "up",
        description="One process for each board and one for the body. Without an end it walks until Ctrl-C.",
    )
    walk_options.add_run_options(up)
    group = up.add_argument_group("processes")
    group.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="FACTOR|max",
        help="virtual seconds per second of the wall clock; max: as fast as it goes (default 1.0)",
    )
    group.add_argument(
        "--restart",
        choices=(NEVER, ON_FAILURE),
        default=NEVER,
        help="whether a board that dies is started again (default never)",
    )
    group.add_argument(
        "--name",
        type=word("a name"),
        default="ranger",
        help="name under which other programs find this robot (default ranger)",
    )
    group.add_argument(
        "--no-real-time", action="store_true", help="do not ask for SCHED_FIFO and locked memory, even if permitted"
    )
    group.add_argument(
        "--processor",
        type=word("one, all or a number"),
        default="one",
        metavar="one|all|N",
        help="processors for body and boards. They take turns, so one is the fastest (default; interpreted: all)",
    )
    server_options.add_options(group)
    group.add_argument(
        "--xcp-udp",
        type=whole_number(0, 65535),
        metavar="PORT",
        help="let a calibration program measure and set parameters by XCP on UDP, on this machine (0: a free port)",
    )
    group.add_argument(
        "--xcp-can",
        nargs="?",
        const=XCP_BUS.lower(),
        choices=[f"can{number}" for number in range(1, 5)],
        metavar="BUS",
        help=f"the same by XCP on CAN, on one of the robot's buses (default {XCP_BUS.lower()}), identifiers "
        f"{XCP_MASTER_ID} and {XCP_SLAVE_ID}",
    )
    group.add_argument(
        "--bus",
        action="append",
        default=[],
        metavar="BUS=INTERFACE:CHANNEL",
        help="put a bus on a python-can interface, e.g. can1=socketcan:vcan0, with python-can's options behind it if "
        "needed ('can1=slcan:/dev/ttyACM0 --bitrate 1000000'); can1= asks python-can's configuration, section can1; "
        "MCH=... gives one board of such a bus a place of its own (repeatable). The run is then asynchronous",
    )
    add_all(up, (faults.FAULT, faults.MODULE, *FIRMWARE, *IMAGES, gdb_options.GDB))
    trace.add_options(up)
    up.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Start the processes and supervise them; exit codes as for `walk`."""
    from ranger_sim.harness.processes.supervisor import check_platform
    from ranger_sim.tools.command_line import terminal
    from ranger_sim.tools.command_line.files import json_target, writable_folder
    from ranger_sim.tools.firmware.command import folders_of, run_sanitized, wants_another_process
    from ranger_sim.tools.run.up_execution import Execution
    from ranger_sim.tools.run.up_plan import plan_of

    check_platform()
    if wants_another_process(options):
        return run_sanitized(options, folders_of(options))
    trace.check(options)
    faults.load_modules(options)
    plan = plan_of(options)
    if options.out:
        writable_folder(options.out)
    console = terminal.for_progress(options)
    return Execution(plan, options, json_target(options.json), console).run()
