"""Access of a fault to boards and controllers of a robot between two steps of the plant."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation.user_error import FaultError


def emulated(robot: Any, name: str, where: str) -> Any:
    """The board `name`, emulated in this process. UserError, naming `where`, when it runs elsewhere."""
    board = robot.loop.board(name)
    if not isinstance(board, Microcontroller):
        in_c = name in getattr(robot, "firmware", ())
        hint = " (firmware in C: --in-process, or Ranger(in_process=True))" if in_c else ""
        raise FaultError(
            f"{where}: {name} is not emulated in this process: its processor cannot be reached from here{hint}"
        )
    return board


@contextmanager
def reaching_into(robot: Any, name: str, now_ns: int) -> Iterator[Any]:
    """The board `name`, run to `now_ns`; after this it is due at once, because the fault may have changed it.

    Some boards are left alone while they only receive (harness/lockstep.py), so they are brought up to date first: a
    change to them must not depend on when their state was read.
    """
    loop = robot.loop
    place = loop.place(name)
    board = loop.boards[place]
    board.advance(now_ns)
    yield board
    board = loop.boards[place]  # it may have been replaced
    board.next_time = min(board.next_time, now_ns)
    loop.due[place] = loop.came[place] = now_ns
    loop.wires[place].silent_until = 0


def controller_of(robot: Any, board: str, bus: int, where: str) -> tuple[Any, int, Any, int]:
    """(bus, node, wires, controller) of `board`'s controller on a bus, from 1 on. UserError where that is outside."""
    loop = robot.loop
    wire = next(wire for wire in robot.wiring.can if wire.board == board and wire.bus == bus)
    wires = loop.wires[loop.place(board)]
    if wires.buses[wire.controller] is None:
        raise FaultError(
            f"{where}: can{bus} is a real bus outside here, on which bits of others cannot be reached;"
            " that takes a disturbance generator on the wire"
        )
    return wires.buses[wire.controller], wires.nodes[wire.controller], wires, wire.controller


def bus_of(robot: Any, number: int, where: str) -> Any:
    """A bus, counted from 1. UserError where it is outside."""
    wire = next(wire for wire in robot.wiring.can if wire.bus == number)
    return controller_of(robot, wire.board, number, where)[0]


def wake_buses(robot: Any, now_ns: int) -> None:
    """Let buses decide again, because one of them was changed."""
    due = robot.loop.due
    due[len(due) - 1] = min(due[len(due) - 1], now_ns)
