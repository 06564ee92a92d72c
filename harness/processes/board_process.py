"""The process of one board."""

import os
import sys
from typing import Any

from ranger_sim.can_bus.edge.peers import reasons_text
from ranger_sim.firmware_sim.gdb.server import GdbServer
from ranger_sim.firmware_sim.native import confinement, coverage
from ranger_sim.firmware_sim.native.sanitizers import place_of_findings
from ranger_sim.firmware_sim.native.trial import needs_of
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import BoardFailure, raised
from ranger_sim.harness.firmware.fresh_board import connected, first_outputs, fresh_board, pass_on, take_edges
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.block import Block
from ranger_sim.harness.processes.channel import Bell
from ranger_sim.harness.processes.endpoint import Endpoint
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.stage import Audience

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

    def on_wait(self, waits: bool) -> None:
        """Note that the board begins or ends to wait for a debugger."""
        now_ns = wallclock.monotonic_ns()
        if waits:
            self.since_ns = now_ns
        else:
            self.pace[places.PACE_WALL_NS] += now_ns - max(self.since_ns, self.pace[places.PACE_BEGUN_NS])
            self.pace[places.PACE_BEGUN_NS] = now_ns
        self.words[places.HELD] = int(waits)

    def ends(self) -> bool:
        """Whether the run is to end."""
        return bool(self.words[places.LET_GO])


def is_confined(robot: Any, name: str) -> bool:
    """Whether board `name` runs a program in C in a process that can have separate process numbers."""
    return name in robot.firmware and robot.boards[name].out_of_process and place_of_findings() is None


def serve(
    robot: Any, name: str, block: Block, stage: tuple, settings: Settings, fresh: bool, server: GdbServer | None = None
) -> int:
    """Run board `name` of the wired, never run `robot` until ordered to stop; returns the exit code.

    fresh: not the board that was built with the robot but a new one, powered up when the plant's process orders it.
    server: the endpoint for a debugger of this board; the board that was built waits for one.
    """
    kernel.begin_process(f"ranger-{name}", settings)
    place = list(robot.boards).index(name)
    board = robot.boards[name]
    if robot.printed is not None and name in robot.firmware:
        robot.printed.lead(name)
    sent = []
    from_ns = 0
    crash_record = block.words[places.CRASH : places.CRASH + places.CRASH_WORDS]
    is_elsewhere = name in robot.firmware and board.out_of_process  # its program has not been loaded
    if is_elsewhere:
        firmware = robot.firmware[name]
        from ranger_sim.firmware_sim.native import library  # only here: it loads cffi

        library.runs_one_program = True
        needs = needs_of(firmware.library, firmware.folder, firmware.counts)
        lacks = confinement.confine(needs, [block.ask_descriptor, block.answer_descriptor])
        sys.stderr = sys.__stderr__  # what Python reports here is the board's output as well
        if set(lacks) - set(robot.programs_in_c.lacks(name) or ()):
            block.leave_fault(f"it cannot be confined as its trial was: {confinement.describe(lacks)}")
            return FAILED
        robot.programs_in_c.load_here()
    if fresh:
        bell = Bell(block.words, places.ASKED, places.BOARD_SLEEPS, block.ask_descriptor)
        turns = block.words[places.ASKED]
        # a turn may have begun already: then the other side is one ahead of the answers
        first = turns + 1 if turns == block.words[places.ANSWERED] else turns
        while not bell.wait(first):
            pass
        record = crash_record if name in robot.firmware else None
        board = fresh_board(robot, name, block.words[places.POWER_UP], record)
        sent = first_outputs(board)
    elif is_elsewhere:
        board = connected(robot, name, robot.confined_board(name, crash_record))
        sent, from_ns = first_outputs(board), robot.start_ns
    if is_elsewhere:
        take_edges(robot, name, board)
    if name in robot.firmware:
        board.leave_record_in(crash_record)
        if board.counts is not None:
            os.environ[coverage.PREFIX] = str(board.counts)  # for a crash, which writes them as well
    if block.table_words:
        board.move_memory(block.table())
    in_slots = name in robot.wiring.receive_in_slots
    wires = [
        (number, wire.word) for number, wire in enumerate(robot.loop.word_wires) if wire.board is robot.boards[name]
    ]
    plant = robot.plant
    words, doubles = stage
    audience = Audience(words, doubles, robot.loop.step_times, plant.analog_start, plant.analog_end, board.words, wires)
    try:
        endpoint = Endpoint(board, block, stage, audience, place, in_slots)  # gives the board another outbox
        pass_on(sent, board.outbox, from_ns)
        if server is not None:
            hold = Hold(block, stage)
            server.ends, server.on_wait = hold.ends, hold.on_wait
            server.leads_to(board)
            if fresh:
                server.begin()
            else:
                server.wait_for_debugger()
        endpoint.serve()
        if server is not None:
            server.close()
            if away := reasons_text(server.sent_away):
                print(f"gdb for {name}: {away}", file=sys.stderr, flush=True)
    except BaseException as error:  # noqa: BLE001  (the supervisor reports any error of a board's program)
        text = error.text if isinstance(error, BoardFailure) else raised(error)
        block.leave_fault(text)
        return FAILED
    return 0
