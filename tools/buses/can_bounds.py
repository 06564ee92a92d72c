"""`ranger-sim can-bounds`: how late every frame can be, proven, against its deadline."""

from __future__ import annotations

import argparse
import json
import pathlib
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from ranger_sim.can_bus.bounds import Bound, response_times, utilisation
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import whole_number

EXIT_DONE, EXIT_MISSED = 0, 1
TIMES_MS = ("period\n(ms)", "jitter\n(ms)", "response\n(ms)", "deadline\n(ms)")


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "can-bounds",
        description="Worst-case response times (Davis, Burns, Bril, Lukkien 2007) on the robot's buses, a profile's, "
        "or of the messages of a DBC file. Exit code 1 when something can miss its deadline.",
    )
    what = command.add_mutually_exclusive_group()
    what.add_argument(
        "--profile", metavar="FILE", help="buses of a profile, by name or as a .toml file (default: the robot's own)"
    )
    what.add_argument("--dbc", metavar="FILE", help="messages of a DBC file that have a cycle time (GenMsgCycleTime)")
    command.add_argument("--bit-rate", type=whole_number(1000), metavar="BIT/S", help="bit rate of the DBC file's bus")
    command.add_argument(
        "--data-bit-rate", type=whole_number(1000), metavar="BIT/S", help="data bit rate of the DBC file's CAN FD bus"
    )
    command.add_argument("--json", metavar="FILE|-", help="the bounds as JSON; - prints them and nothing else")
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Analyse, print; 0 when every deadline is met, 1 otherwise."""
    for name, value in (("--bit-rate", options.bit_rate), ("--data-bit-rate", options.data_bit_rate)):
        if value is not None and options.dbc is None:
            raise UserError(f"{name} goes with --dbc; a profile and the robot have their own")
    json_file = json_target(options.json)
    buses = of_dbc(options) if options.dbc else of_profile(options)
    met = all(frame["met"] for bus in buses for frame in bus["frames"])
    text = json.dumps({"met": met, "buses": buses}, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        console = terminal.console()
        for bus in buses:
            show(bus, console)
    return EXIT_DONE if met else EXIT_MISSED


def of_profile(options: argparse.Namespace) -> list[dict]:
    """The four buses of a profile, or of the robot."""
    chosen = profile.load(options.profile) if options.profile else profile.default()
    table = bus_schedule.robots_table()
    found = []
    for name, bus in chosen.buses.items():
        streams = bus_schedule.streams(table, name, chosen.schedules(), chosen.absent())
        bounds = bus_schedule.bounds_of(table, name, bus.bit_rate, streams)
        frames = [
            facts(bound, stream.board, list(stream.variables))
            for bound, stream in zip(bounds.bounds, streams, strict=True)
        ]
        notes = []
        if not bus.schedule.commands_in_turn:
            rare = f"{float(bus_schedule.ON_DEMAND_MS):g}"
            notes.append(
                "of other commands to a motor one per slot of the main brain is counted, of those to the user "
                f"interface each every {rare} ms; the first slot after power-up sends every command once: not covered"
            )
        found.append(report(name, bus.bit_rate, bus.schedule_name, bounds.bounds, frames, bounds.waiting, notes))
    return found


def of_dbc(options: argparse.Namespace) -> list[dict]:
    """The one bus of a DBC file."""
    from ranger_sim.can_bus.edge.dbc import read_messages

    path = pathlib.Path(options.dbc)
    found = read_messages(path, options.bit_rate, options.data_bit_rate)
    if not found.messages:
        raise UserError(f"{path}: no message has a cycle time (GenMsgCycleTime), so there is nothing to bound")
    bounds = tuple(response_times(found.messages, found.bit_rate, data_bit_rate=found.data_bit_rate))
    notes = [f"without GenMsgCycleTime, left out: {', '.join(found.silent)}"] if found.silent else []
    frames = [facts(bound, "", [bound.message.name]) for bound in bounds]
    return [report(path.name, found.bit_rate, "", bounds, frames, {}, notes, found.data_bit_rate)]


def facts(bound: Bound, board: str, variables: list[str]) -> dict:
    """A bound as plain values, times in ms."""
    one = bound.message
    return {
        "name": one.name,
        "board": board,
        "variables": variables,
        "identifier": one.key >> 21 if not one.key & 0x180000 else (one.key >> 21) << 18 | one.key >> 1 & 0x3FFFF,
        "bits": one.bits,
        "data_bits": one.data_bits,
        "period_ms": one.period_ns / 1e6,
        "jitter_ms": one.jitter_ns / 1e6,
        "deadline_ms": one.deadline_ns / 1e6,
        "response_ms": None if bound.response_ns is None else bound.response_ns / 1e6,
        "blocking_ms": bound.blocking_ns / 1e6,
        "instance": bound.instance,
        "met": bound.met,
    }


def report(
    name: str,
    bit_rate: int,
    schedule: str,
    bounds: tuple[Bound, ...],
    frames: list[dict],
    waiting: Mapping[str, int | None],
    notes: list[str],
    data_bit_rate: int = 0,
) -> dict:
    """One bus as plain values."""
    return {
        "bus": name,
        "bit_rate": bit_rate,
        "data_bit_rate": data_bit_rate,
        "schedule": schedule,
        "utilisation": float(utilisation((bound.message for bound in bounds), bit_rate, data_bit_rate)),
        "most_waiting": dict(waiting),
        "notes": notes,
        "frames": sorted(frames, key=lambda frame: frame["identifier"]),
    }


def show(bus: dict, console: Console) -> None:
    """One bus as a table."""
    missed = sum(not frame["met"] for frame in bus["frames"])
    schedule = f", schedule {bus['schedule']}" if bus["schedule"] else ""
    used = f"at most {100 * bus['utilisation']:.1f} % used"
    verdict = f"{missed} can miss their deadlines" if missed else "every deadline met"
    data = f" and {bus['data_bit_rate'] / 1e6:g}" if bus["data_bit_rate"] else ""
    heading = f"{bus['bus']}: {bus['bit_rate'] / 1e6:g}{data} Mbit/s{schedule}, {used}, {verdict}"
    table = Table(box=None, pad_edge=False)
    for column in ("id", "frame", "from", *TIMES_MS, ""):
        left = column in ("frame", "from", "")
        table.add_column(column, justify="left" if left else "right", no_wrap=True)
    for frame in bus["frames"]:
        response = "none" if frame["response_ms"] is None else f"{frame['response_ms']:.3f}"
        times = [f"{frame[key]:.3f}" for key in ("period_ms", "jitter_ms")]
        table.add_row(
            str(frame["identifier"]),
            frame["name"],
            frame["board"],
            *times,
            response,
            f"{frame['deadline_ms']:.3f}",
            "" if frame["met"] else "late",
            style=None if frame["met"] else "red",
        )
    console.print(heading, style="bold", soft_wrap=True)
    terminal.print_table(console, table, spare=TIMES_MS[1:2])
    for note in bus["notes"]:
        console.print(Padding(note, (0, 0, 0, 2)), highlight=False)
