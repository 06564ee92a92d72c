"""`--gdb`: a debugger connected to a board of a walking robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from ranger_sim.can_bus.edge.peers import loopback, told
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.options import Option
from ranger_sim.tools.command_line.units import word

if TYPE_CHECKING:
    from rich.console import Console

    from ranger_sim.firmware_sim.gdb.server import GdbServer
    from ranger_sim.harness.ranger import Ranger

GDB = Option(
    "--gdb",
    "let gdb debug this board, which runs an --image: `target remote :PORT` (0: a free one). The run begins when gdb "
    "lets it, and virtual time stands whenever gdb has the board. BOARD=HOST:PORT beyond this machine needs "
    "--allow-network",
    word("BOARD=PORT"),
    "BOARD=PORT",
    repeated=True,
    of_run=False,
)
ALLOW_NETWORK = Option(
    "--allow-network",
    "let --gdb BOARD=HOST:PORT listen beyond this machine; whoever reaches it may then do anything to the board",
    of_run=False,
)


def never() -> bool:
    """Return False: the wait does not end from here, because each board's supervisor ends its process."""
    return False


def line(door: GdbServer) -> str:
    """The line that tells the user how to connect gdb to a port."""
    host = "" if door.host == "127.0.0.1" else door.host
    open_to_all = (
        "" if loopback(door.host) else ", open to the network: whoever reaches it may do anything to the board"
    )
    return f"gdb for {door.board.name}: target remote {host}:{door.port}; the run waits for it{open_to_all}"


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
        close_doors,
        open_doors,
    )

    doors = open_doors(robot.boards, options.gdb, options.allow_network, ends)
    try:
        for door in doors:
            console.print(line(door), highlight=False, soft_wrap=True)
        yield doors
    finally:
        close_doors(doors)
        for door in doors:
            if away := told(door.sent_away):
                console.print(f"gdb for {door.board.name}: {away}", highlight=False, soft_wrap=True)
