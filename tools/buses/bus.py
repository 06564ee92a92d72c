"""`ranger-sim bus`: private CAN buses that any program on this machine can attach to, without a robot."""

import argparse
import math
import sys
from contextlib import ExitStack, closing
from typing import Any

from ranger_sim.can_bus.edge.attach import DEFAULT_NAME, AttachServer
from ranger_sim.can_bus.edge.host import BusHost
from ranger_sim.can_bus.edge.paced import DEFAULT_BITRATE, PacedBus, speed_of
from ranger_sim.can_bus.edge.peers import loopback, owners_are_known
from ranger_sim.can_bus.edge.slcan import SlcanServer
from ranger_sim.can_bus.edge.socketcand import SocketcandServer
from ranger_sim.can_bus.edge.taps import Taps
from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.stop_rule import MOST_TIME_S
from ranger_sim.tools.buses import server_options
from ranger_sim.tools.command_line.units import TIMES, number, quantity, whole_number


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "bus",
        description="Emulated CAN buses for programs of your own, which attach by python-can, slcan or socketcand.",
    )
    command.add_argument("channel", nargs="*", default=["can1"], help="names of the buses (default can1)")
    command.add_argument(
        "--name", default=DEFAULT_NAME, help=f"name under which programs attach (default {DEFAULT_NAME})"
    )
    command.add_argument(
        "--bitrate", type=whole_number(1000), default=DEFAULT_BITRATE, help="bit/s of every bus (default 1000000)"
    )
    command.add_argument(
        "--data-bitrate",
        type=whole_number(1000),
        default=0,
        help="bit/s of the data of CAN FD (default: classic buses)",
    )
    command.add_argument("--speed", default="1", help="times real time, or max: as fast as frames are sent (default 1)")
    command.add_argument(
        "--bit-error-rate",
        type=number(),
        default=0.0,
        help="share of disturbed bits, 0 to 0.1 (default 0)",
    )
    command.add_argument("--seed", type=whole_number(0), default=0, help="seed of the disturbances (default 0)")
    command.add_argument(
        "--acknowledge",
        action="store_true",
        help="a silent node acknowledges every frame, so that a program may be alone on a bus",
    )
    server_options.add_options(command)
    command.add_argument(
        "--seconds",
        type=quantity(TIMES, "s", above=0.0, most=MOST_TIME_S),
        default=math.inf,
        help="end after this time (default: with Ctrl-C)",
    )
    command.set_defaults(run=run)


def open_servers(buses: dict[str, Any], options: argparse.Namespace, epoch_ns: int = 0) -> tuple[list[Any], list[str]]:
    """(servers, one line for each that says how to reach it) for buses {channel: Bus or Taps}.

    `options`: those of `server_options`, and `name`.
    """
    name, socketcand = options.name, options.socketcand
    if options.allow_network and socketcand is None and not getattr(options, "gdb", ()):
        raise UserError("--allow-network: nothing would listen there; give --socketcand HOST:PORT with it")
    with ExitStack() as opened:
        first = next(iter(buses))
        servers: list[Any] = []
        lines = []
        if systems.is_linux():
            servers.append(opened.enter_context(closing(AttachServer(name, buses, epoch_ns))))
            prefix = "" if name == DEFAULT_NAME else f"{name}/"
            bus = buses[first]
            fd = ", fd=True" if (bus.bus if isinstance(bus, Taps) else bus).is_fd else ""
            lines.append(f'python-can: can.Bus(interface="ranger_sim", channel="{prefix}{first}"{fd})')
        elif socketcand is None:
            systems.require_linux("bus: names to attach by", "abstract sockets", "give --socketcand PORT")
        for channel in options.slcan:
            if channel not in buses:
                raise UserError(f"--slcan {channel}: no such bus; there are {', '.join(buses)}")
            terminal = opened.enter_context(closing(SlcanServer(channel, buses[channel], epoch_ns)))
            servers.append(terminal)
            lines.append(f"slcan: {channel} is {terminal.path}")
        if socketcand is not None:
            host, _, port = socketcand.rpartition(":")
            if not port.isdecimal():
                raise UserError(f"--socketcand {socketcand}: PORT or HOST:PORT is expected")
            server = SocketcandServer(buses, int(port), host or "127.0.0.1", epoch_ns, options.allow_network)
            tcp = opened.enter_context(closing(server))
            servers.append(tcp)
            open_to_all = ""
            if not loopback(tcp.host):
                open_to_all = ", open to the network: any client there may send frames"
            elif not owners_are_known():
                open_to_all = f", open to every user of this machine: {sys.platform} does not report whose a client is"
            lines.append(f"socketcand: {tcp.host}:{tcp.port}{open_to_all}")
        opened.pop_all()
        return servers, lines


def run(options: argparse.Namespace) -> int:
    """Host the buses until Ctrl-C; then report their traffic."""
    speed = speed_of(options.speed)
    if len(set(options.channel)) != len(options.channel):
        raise UserError(f"bus: a name is given twice in {' '.join(options.channel)}")
    for channel in options.channel:
        if not channel or "/" in channel or any(c.isspace() for c in channel):
            raise UserError(f"bus: {channel!r} is not a name for a bus: slashes and blanks are not allowed")
    buses = [
        PacedBus(
            channel,
            options.bitrate,
            speed,
            options.seed,
            options.bit_error_rate,
            acknowledge=options.acknowledge,
            data_bitrate=options.data_bitrate,
        )
        for channel in options.channel
    ]
    host = BusHost(buses)
    servers, lines = open_servers({bus.channel: bus.taps for bus in buses}, options, buses[0].epoch_ns)
    for server in servers:
        host.serve(server)
    end = wallclock.monotonic_s() + options.seconds
    pace = "as fast as frames are sent" if speed == 0.0 else f"{speed:g} x real time"
    data = f", CAN FD at {options.data_bitrate} bit/s" if options.data_bitrate else ""
    try:
        print(
            f"{', '.join(options.channel)}: {options.bitrate} bit/s{data}, {pace}; Ctrl-C ends",
            *lines,
            sep="\n",
            flush=True,
        )
        while (left := end - wallclock.monotonic_s()) > 0.0:
            host.turn(min(left, 1.0))
    except KeyboardInterrupt:
        pass
    finally:
        host.close()
    for bus in buses:
        figures = bus.bus.counters
        print(f"{bus.channel}: {figures.frames} frames, {figures.errors} error frames", flush=True)
    for server in servers:
        counted = {name: value for name, value in server.counters().items() if value and name != "clients"}
        if counted:
            print(f"{type(server).__name__}: " + ", ".join(f"{name} {value}" for name, value in counted.items()))
    return 0
