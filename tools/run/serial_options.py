"""Options of every command that runs a robot: its serial lines on pseudo-terminals or real ports."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import serial_ports
from ranger_sim.ranger import serial_ports as robot_ports
from ranger_sim.tools.command_line.options import Option, add_all
from ranger_sim.tools.command_line.units import word

if TYPE_CHECKING:
    from ranger_sim.ranger.robot import Ranger


PORT = word("a port, or pty")
OPTIONS = (
    Option("--daq-port", "the main brain's data link, for `ranger-sim daq`", PORT, "PORT"),
    Option(
        "--daq-link",
        "928.6 kbaud (default), or 464.3 kbaud with flow control",
        choices=("wired", "bluetooth"),
    ),
    Option(
        "--daq-dropouts",
        "silences of 50 to 180 ms every 3.7 s on average, as the real robot's Bluetooth logs have them; seeded",
    ),
    Option("--imu-port", "a real inertial unit, in place of the emulated one", PORT, "PORT"),
    Option("--imu-offer", "the emulated inertial unit, for a real host to read", PORT, "PORT", of_run=False),
)


def add_options(command: Any) -> None:
    """The options `--daq-...` and `--imu-...`."""
    group = command.add_argument_group(
        "serial lines", "PORT: a serial port, a URL that pyserial knows, or pty for a new pseudo-terminal"
    )
    add_all(group, OPTIONS)


def quirks_of(given: argparse.Namespace) -> Quirks:
    """The quirks that these options select: drop-outs without `--daq-link` mean Bluetooth.

    UserError for options that contradict each other.
    """
    if (given.daq_dropouts or given.daq_link) and not given.daq_port:
        raise UserError("--daq-link and --daq-dropouts need --daq-port")
    if given.imu_port and given.imu_offer:
        raise UserError("--imu-port and --imu-offer exclude each other: one replaces the emulated unit, one shows it")
    link = given.daq_link or ("bluetooth" if given.daq_dropouts else "wired")
    return Quirks(computer_link=link)


def wanted(given: argparse.Namespace) -> bool:
    """True when an external program is to be connected: the robot then runs at the pace of the wall clock."""
    return bool(given.daq_port or given.imu_port or given.imu_offer)


def ports_of(given: argparse.Namespace) -> dict[str, serial_ports.Port]:
    """Opened ports by what they are for: daq, imu, imu-offer. UserError when one cannot be opened."""
    bluetooth = quirks_of(given).computer_link == "bluetooth"
    daq_baud = serial_ports.BLUETOOTH_BAUD if bluetooth else serial_ports.DAQ_BAUD
    ports: dict[str, serial_ports.Port] = {}
    if given.daq_port:
        ports["daq"] = serial_ports.open_port(given.daq_port, daq_baud, bluetooth)
    if given.imu_port:
        ports["imu"] = serial_ports.open_port(given.imu_port, serial_ports.IMU_BAUD)
    if given.imu_offer:
        ports["imu-offer"] = serial_ports.open_port(given.imu_offer, serial_ports.IMU_BAUD)
    return ports


MEANINGS = {
    "daq": "data link: ranger-sim daq --port {}",
    "imu": "inertial unit at {}",
    "imu-offer": "emulated inertial unit: {}",
}


def connect(robot: Ranger, given: argparse.Namespace) -> tuple[dict[str, Any], list[str]]:
    """Open the ports and connect them to a robot in lockstep: (ends by name, lines that say where they are)."""
    ports = ports_of(given)
    ends: dict[str, Any] = {}
    if "daq" in ports:
        dropouts = None
        if given.daq_dropouts:
            dropouts = serial_ports.Dropouts(robot.scenario.seed, robot.start_ns)
        ends["daq"] = robot_ports.connect_daq(robot, ports["daq"], dropouts)
    if "imu" in ports:
        ends["imu"] = robot_ports.connect_imu(robot, ports["imu"])
    if "imu-offer" in ports:
        ends["imu-offer"] = robot_ports.offer_imu(robot, ports["imu-offer"])
    lines = [MEANINGS[name].format(port.path) for name, port in ports.items()]
    if lines and given.json == "-":  # nothing else is printed, and without its name a pseudo-terminal is of no use
        print(*lines, sep="\n", file=sys.stderr, flush=True)
    return ends, lines


def report(ends: dict[str, Any]) -> list[str]:
    """Lines for the end of a run: traffic, what was lost, and whether the run can be repeated."""
    lines = []
    for name, end in ends.items():
        counts = ", ".join(f"{key.replace('_', ' ')} {count}" for key, count in end.counters().items() if count)
        lines.append(f"{name}: {counts or 'no traffic'}" + (f"; the port is gone: {end.gone}" if end.gone else ""))
    if any(end.asynchronous for end in ends.values()):
        lines.append("bytes arrived at the wall clock's pace: this run cannot be repeated byte for byte")
    return lines
