"""`--gdb`: a debugger connected to a board of a walking robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ranger_sim.can_bus.edge.peers import loopback, reasons_text
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.options import Option
from ranger_sim.tools.command_line.units import word

if TYPE_CHECKING:
    from rich.console import Console

    from ranger_sim.firmware_sim.gdb.server import GdbServer
    from ranger_sim.ranger.robot import Ranger

GDB = Option(
    "--gdb",
    "let gdb debug this board, which runs an --image: `target remote :PORT` (0: a free one). The run begins when gdb "
    "lets it, and virtual time stops whenever gdb has the board. BOARD=HOST:PORT beyond this machine needs "
    "--allow-network",
    word("BOARD=PORT"),
    "BOARD=PORT",
    repeated=True,
    of_run=False,
)
ALLOW_NETWORK = Option(
    "--allow-network",
    "let --gdb BOARD=HOST:PORT listen beyond this machine; any client there may then do anything to the board",
    of_run=False,
)


def never() -> bool:
    """Return False: the wait does not end from here, because each board's supervisor ends its process."""
    return False


def line(server: GdbServer) -> str:
    """The line with the command that connects gdb to a port."""
    host = "" if server.host == "127.0.0.1" else server.host
    open_to_all = (
        "" if loopback(server.host) else ", open to the network: any client there may do anything to the board"
    )
    return f"gdb for {server.board.name}: target remote {host}:{server.port}; the run waits for it{open_to_all}"


@contextmanager
def debuggers(
    robot: Ranger, options: argparse.Namespace, ends: Callable[[], bool], console: Console
) -> Iterator[list[GdbServer]]:
    """Open the requested debugger ports inside the context; at the end print a line for each refused client.

    UserError for boards and ports that are not available.
    """
    if not options.gdb:
        if options.allow_network and not hasattr(options, "socketcand"):
            raise UserError("--allow-network: nothing would listen there; give --gdb BOARD=HOST:PORT with it")
        yield []
        return
    from ranger_sim.harness.firmware.debuggers import (  # sockets are imported only when needed
        close_servers,
        open_servers,
    )

    servers = open_servers(robot.boards, options.gdb, options.allow_network, ends)
    try:
        for server in servers:
            console.print(line(server), highlight=False, soft_wrap=True)
        yield servers
    finally:
        close_servers(servers)
        for server in servers:
            if away := reasons_text(server.sent_away):
                console.print(f"gdb for {server.board.name}: {away}", highlight=False, soft_wrap=True)
