"""Buses of the robot on interfaces outside: the boards' controllers leave the emulated bus and become peers there."""

import array
from typing import Any

from can_bus.bus import LOG_FIELDS
from foundation.events import STAGE_BUS
from harness import wiring


def move_bus(robot: Any, external: Any, openers: dict, boards: tuple) -> None:
    """Every controller of `boards` on bus `external.name` is unplugged from the emulated bus and gets a peer instead.

    `external`: an object with add_peer, poll, sinks (can_bus.edge.external_bus.ExternalBus). `openers`: {board: what
    opens its peer}, for those that have a place of their own. UserError when an interface cannot be opened. Its
    frames go into the robot's record like those of an emulated bus.
    """
    loop = robot.loop
    number = next(place for place, bus in enumerate(robot.buses) if bus.name == external.name)
    for wire in wiring.CAN:
        if wire.bus != number + 1:
            continue
        place = wiring.BOARDS.index(wire.board)
        wires = loop.wires[place]
        wires.connect_bus(wire.controller, None, -1)
        if wire.board not in boards:
            continue
        order = STAGE_BUS * 256 + 16 * place + wire.controller
        wires.can_lines[wire.controller] = external.add_peer(
            f"{external.name}, {wire.board}",
            robot.boards[wire.board].inbox,
            wire.controller,
            order,
            openers.get(wire.board),
        )
    row = array.array("q", [0]) * LOG_FIELDS  # as the emulated bus logs a frame
    bus = robot.buses[number]

    def note(time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> None:
        row[0], row[1], row[2], row[3], row[4] = time_ns, identifier, flags, lo, hi
        robot.recorder.add_frames(number, row, 1)
        bus.frames += 1

    external.sinks.append(note)
    robot.attach(external)
