"""Buses of a machine on interfaces outside: the boards' controllers leave the emulated bus and become peers there."""

from typing import Any

from ranger_sim.foundation.events import STAGE_BUS


def move_bus(robot: Any, external: Any, openers: dict, boards: tuple) -> None:
    """Unplug every controller of `boards` on bus `external.name` from the emulated bus, and give it a peer instead.

    `external`: an object with add_peer, poll, sinks (can_bus.edge.external_bus.ExternalBus). `openers`: {board: opener
    of its peer}, for those that have their own place. UserError when an interface cannot be opened. Its
    frames go into the robot's record like those of an emulated bus.
    """
    loop = robot.loop
    number = next(place for place, bus in enumerate(robot.buses) if bus.name == external.name)
    for wire in robot.wiring.can:
        if wire.bus != number + 1:
            continue
        place = list(robot.boards).index(wire.board)
        wires = loop.wires[place]
        is_fd = bool(external.is_fd) and robot.buses[number].knows_fd(wires.nodes[wire.controller])
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
            is_fd,
        )
    external.sinks.append(robot.buses[number].note_outside)
    robot.attach(external)
