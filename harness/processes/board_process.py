"""What runs in the process of one board."""

import os
import traceback
from typing import Any

from ranger_sim.harness import wiring
from ranger_sim.harness.fresh_board import first_outputs, fresh_board, pass_on
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.block import Block
from ranger_sim.harness.processes.channel import Bell
from ranger_sim.harness.processes.endpoint import Endpoint
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.stage import Audience

FAILED = 4  # exit code: the board's program raised


def serve(robot: Any, name: str, block: Block, stage: tuple, settings: Settings, fresh: bool) -> int:
    """Run board `name` of the wired, never run `robot` until told to stop; returns the exit code.

    fresh: not the board that was built with the robot but a new one, powered up when the plant's process says.
    """
    kernel.begin_process(f"ranger-{name}", settings)
    place = wiring.BOARDS.index(name)
    board = robot.boards[name]
    said = []
    crash_record = block.words[places.CRASH : places.CRASH + places.CRASH_WORDS]
    if fresh:
        bell = Bell(block.words, places.ASKED, places.BOARD_SLEEPS, block.ask_descriptor)
        turns = block.words[places.ASKED]
        # a turn may have begun already: then the other side is one ahead of the answers
        first = turns + 1 if turns == block.words[places.ANSWERED] else turns
        while not bell.wait(first):
            pass
        record = crash_record if name in robot.firmware else None
        board = fresh_board(robot, name, block.words[places.POWER_UP], record)
        said = first_outputs(board)
    if name in robot.firmware:
        board.leave_record_in(crash_record)
    if block.table_words:
        board.move_memory(block.table())
    wires = [
        (number, wire.word) for number, wire in enumerate(robot.loop.word_wires) if wire.board is robot.boards[name]
    ]
    plant = robot.plant
    words, doubles = stage
    audience = Audience(words, doubles, robot.loop.step_times, plant.analog_start, plant.analog_end, board.words, wires)
    try:
        endpoint = Endpoint(board, block, stage, audience, place)  # gives the board another outbox
        pass_on(said, board.outbox, 0)
        endpoint.serve()
    except BaseException as error:  # noqa: BLE001  (whatever a program on a board raises is said by the supervisor)
        where = traceback.extract_tb(error.__traceback__)[-1:]
        place_text = f" ({os.path.basename(where[0].filename)}:{where[0].lineno})" if where else ""
        block.leave_fault(f"{type(error).__name__}: {error}{place_text}")
        return FAILED
    return 0
