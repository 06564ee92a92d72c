"""The process of one board."""

import os
import sys
import traceback
from typing import Any

from ranger_sim.can_bus.edge.peers import told
from ranger_sim.firmware_sim.gdb.server import GdbServer
from ranger_sim.firmware_sim.native import coverage
from ranger_sim.foundation import wallclock
from ranger_sim.harness.firmware.fresh_board import first_outputs, fresh_board, pass_on
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.block import Block
from ranger_sim.harness.processes.channel import Bell
from ranger_sim.harness.processes.endpoint import Endpoint
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.stage import Audience
from ranger_sim.harness.wiring import ranger as wiring

FAILED = 4  # exit code: the board's program raised


class Hold:
    """Reports to the other processes that a debugger has the board: it does not hang, and the pace waits for it.

    The process that held the board moves the pace on: its only other writer, the plant's process, waits for this
    board's answer. Of several boards held at once each moves it on by the time that the others have not covered.
    """

    def __init__(self, block: Block, stage: tuple) -> None:
        self.words = block.words
        self.pace = stage[0]
        self.since_ns = 0

    def stands(self, stands: bool) -> None:
        """Note that the board begins or ends to wait for a debugger."""
        now_ns = wallclock.monotonic_ns()
        if stands:
            self.since_ns = now_ns
        else:
            self.pace[places.PACE_WALL_NS] += now_ns - max(self.since_ns, self.pace[places.PACE_BEGUN_NS])
            self.pace[places.PACE_BEGUN_NS] = now_ns
        self.words[places.HELD] = int(stands)

    def ends(self) -> bool:
        """Whether the run is to end."""
        return bool(self.words[places.LET_GO])


def serve(
    robot: Any, name: str, block: Block, stage: tuple, settings: Settings, fresh: bool, door: GdbServer | None = None
) -> int:
    """Run board `name` of the wired, never run `robot` until ordered to stop; returns the exit code.

    fresh: not the board that was built with the robot but a new one, powered up when the plant's process orders it.
    door: the endpoint for a debugger of this board; the board that was built waits for one.
    """
    kernel.begin_process(f"ranger-{name}", settings)
    place = wiring.BOARDS.index(name)
    board = robot.boards[name]
    if robot.printed is not None and name in robot.firmware:
        robot.printed.lead(name)
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
        if board.counts is not None:
            os.environ[coverage.PREFIX] = str(board.counts)  # for a crash, which writes them as well
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
        if door is not None:
            hold = Hold(block, stage)
            door.ends, door.stands = hold.ends, hold.stands
            door.leads_to(board)
            if fresh:
                door.begin()
            else:
                door.wait_for_debugger()
        endpoint.serve()
        if door is not None:
            door.close()
            if away := told(door.sent_away):
                print(f"gdb for {name}: {away}", file=sys.stderr, flush=True)
    except BaseException as error:  # noqa: BLE001  (the supervisor reports any error of a board's program)
        where = traceback.extract_tb(error.__traceback__)[-1:]
        place_text = f" ({os.path.basename(where[0].filename)}:{where[0].lineno})" if where else ""
        block.leave_fault(f"{type(error).__name__}: {error}{place_text}")
        return FAILED
    return 0
