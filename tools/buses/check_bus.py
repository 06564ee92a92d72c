"""`ranger-sim check-bus`: is every interface of a profile ready?"""

from __future__ import annotations

import argparse
import dataclasses
import json
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import TIMES, quantity

if TYPE_CHECKING:
    from ranger_sim.datatable.model import Table

EXIT_DONE, EXIT_FAULT = 0, 1


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "check-bus",
        description="Checks each interface: present, up, bit rate of the profile, state and error counters, traffic. "
        "Prints a command that mends each failure. Exit code 1 when there is one.",
    )
    command.add_argument("profile", metavar="PROFILE", help="name of a profile or a .toml file")
    command.add_argument(
        "--listen",
        type=quantity(TIMES, "s", 0.0),
        default=1.0,
        metavar="1s",
        help="time to listen (default 1 s)",
    )
    command.add_argument("--json", metavar="FILE|-", help="the findings as JSON; - prints them and nothing else")
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Look at every bus, print; 0 when all is well, 1 when something must be mended."""
    json_file = json_target(options.json)
    chosen = profile.load(options.profile)
    table = bus_schedule.robots_table()
    screen = terminal.console(stderr=True, quiet=options.json == "-")
    if screen.is_terminal:
        screen.print(f"listening for {options.listen:g} s on each bus", highlight=False)
    found = [check(chosen, name, table, options.listen) for name in chosen.buses]
    ready = all(finding["ok"] is not False for bus in found for finding in bus["findings"])
    text = json.dumps({"profile": chosen.path, "ready": ready, "buses": found}, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        show(found, terminal.console())
    return EXIT_DONE if ready else EXIT_FAULT


def check(chosen: profile.Profile, name: str, table: Table, seconds: float) -> dict:
    """Everything about one bus, as plain values."""
    from ranger_sim.can_bus.edge import check_bus as edge  # python-can takes a second to load

    bus = chosen.buses[name]
    arguments = bus.python_can()
    if arguments is None:
        findings = [edge.Finding("there", None, f"emulated inside at {bus.bit_rate} bit/s, nothing to check")]
        return {"bus": name, "place": "inside", "findings": [dataclasses.asdict(one) for one in findings]}
    findings = []
    channel = bus.channel or ""
    if bus.interface == "socketcan":
        findings = edge.check_link(channel, bus.bit_rate)
    ready = not findings or all(one.ok is not False for one in findings if one.what in ("there", "up"))
    if ready:
        on_bus = table.on_bus(name.upper())
        known = {variable.id: variable.name for variable in on_bus}
        expected = {variable.id: variable.name for variable in on_bus if variable.publisher in chosen.external()}
        try:
            findings += edge.check_traffic(channel, edge.observe(arguments, seconds), known, expected)
        except edge.NotReadError as error:
            findings.append(
                edge.Finding(
                    "open", False, f"cannot be opened: {error}", f"python -m can.logger -i {bus.interface} -c {channel}"
                )
            )
    return {
        "bus": name,
        "place": f"{bus.interface} {channel}",
        "findings": [dataclasses.asdict(one) for one in findings],
    }


def show(found: list[dict], console: Console) -> None:
    """A line per finding, and below each failure what mends it."""
    for bus in found:
        console.print(f"{bus['bus']} on {bus['place']}", style="bold", highlight=False, markup=False, soft_wrap=True)
        for finding in bus["findings"]:
            mark, style = {True: ("ok  ", "green"), False: ("FAIL", "red"), None: ("    ", None)}[finding["ok"]]
            line = f"  {mark} {finding['what']}: {finding['text']}"
            console.print(line, style=style, highlight=False, markup=False, soft_wrap=True)
            if finding["mend"]:
                verb = "mend" if finding["ok"] is False else "better"
                console.print(f"       {verb}: {finding['mend']}", highlight=False, markup=False, soft_wrap=True)
