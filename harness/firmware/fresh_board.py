"""A board that replaces one that is gone: same wires, its own program from the start."""

from typing import Any

from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.harness.outside import bus_schedule

Message = tuple[Any, ...]


def fresh_board(robot: Any, name: str, power_up_ns: int, record: Any = None) -> Any:
    """A new board `name` at the sensors of `robot`; gets its power at `power_up_ns`.

    A power-up clears its state: the router's time begins at 0, the main brain has its parameter set again.
    record: memory in which a program in C leaves its position when it ends this process.
    What its program puts out while it starts waits in its outbox (`first_outputs`).
    """
    return connected(robot, name, robot.new_board(name, power_up_ns, record))


def connected(robot: Any, name: str, board: Any) -> Any:
    """The new board `name`, at the sensors of `robot`, with the schedules of its profile."""
    if robot.profile is not None:
        bus_schedule.apply(board, robot.profile.schedules())
    loop, plant = robot.loop, robot.plant
    for analog in robot.wiring.analog:
        if analog.board == name:
            channel = robot.wiring.number(name, analog.input)
            board.analog.follow(channel, loop.step_times, plant.analog_start, plant.analog_end, analog.voltage)
    return board


def take_edges(robot: Any, name: str, board: Any) -> None:
    """Let a board take the edges of its encoders as messages, also where its program does not capture the pins."""
    for wire in robot.wiring.encoders:
        if wire.board == name:
            pins = (robot.wiring.number(name, wire.pin_a), robot.wiring.number(name, wire.pin_b))
            board.connect_edges(EdgeBuffer(1), *pins)


def first_outputs(board: Any) -> list[Message]:
    """The outputs of a board since it was made, from its first outbox."""
    out = board.outbox
    sent = []
    while out.take():
        sent.append((out.time, out.order, out.kind, out.a, out.b, out.c, out.d, out.e, out.f, out.ref))
    return sent


def pass_on(sent: list[Message], outbox: Any, not_before_ns: int) -> None:
    """Put messages into another outbox, none with a stamp before `not_before_ns`."""
    for message in sent:
        outbox.push(max(message[0], not_before_ns), *message[1:])
