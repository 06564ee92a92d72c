"""A board that takes the place of one that is gone: same wires, its own program from the start."""

from typing import Any

from ranger_sim.harness import bus_schedule, wiring


def wire_fresh_board(robot: Any, name: str, power_up_ns: int) -> Any:
    """A new board `name` on the wires of the never run `robot`; gets its power at `power_up_ns`.

    What a power-up forgets is forgotten: the router's time begins at 0, the main brain has its parameter set again.
    """
    board = robot.new_board(name, power_up_ns)
    if robot.profile is not None:
        bus_schedule.apply(board, robot.profile.schedules())
    loop, plant = robot.loop, robot.plant
    for analog in wiring.ANALOG:
        if analog.board == name:
            channel = wiring.ANALOG_INPUTS[name][analog.input]
            board.analog.follow(channel, loop.step_times, plant.analog_start, plant.analog_end, analog.voltage)
    return board
