"""A board in a separate process without a plant: the caller gives its turns. For tests and the damaged channel.

It has no supervisor, so the waiting caller watches its process as well, and every wait has a limit.
"""

import gc
import os
import signal
from typing import Any

from ranger_sim.firmware_sim.native import confinement
from ranger_sim.foundation import descriptors
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import board_process, kernel, places
from ranger_sim.harness.processes.block import Block, StageMemory, alone
from ranger_sim.harness.processes.channel import Bell
from ranger_sim.harness.processes.settings import Settings

PATIENCE_S = 60.0  # a turn takes some microseconds; the rest is for a busy machine


class LoneBoard:
    """Board `name` of the wired, never run `robot`, served by a process, and the other end of its channel."""

    def __init__(self, robot: Any, name: str, patience_s: float = PATIENCE_S) -> None:
        self.name = name
        self.patience_s = patience_s
        place = list(robot.boards).index(name)
        self.block = Block(name, place, 0)
        self.words = self.block.words
        self.code: int | None = None
        stage = StageMemory()
        parent = os.getpid()
        with alone(self.block, [self.block], stage):
            self.process = confinement.fork(board_process.is_confined(robot, name))
            if self.process == 0:
                code = board_process.FAILED
                try:
                    kernel.die_with_parent(parent)
                    gc.freeze()  # this process must not finalize the parent's objects
                    code = board_process.serve(robot, name, self.block, stage.shown, Settings(real_time=False), False)
                finally:
                    os._exit(code)
        self.watch = os.pidfd_open(self.process)
        self.ask = Bell(self.words, places.ASKED, places.BOARD_SLEEPS, self.block.ask_descriptor)

    def turn(self, until: int, command: int = places.COMMAND_ADVANCE) -> None:
        """Ask the board and wait for its answer; UserError when it has ended instead, or does not answer."""
        self._ring(command, until)
        answer = self.block.answer_descriptor
        ready = descriptors.wait([answer, self.watch], [], self.patience_s)[0]
        if answer in ready:
            os.eventfd_read(answer)
        elif ready:
            code = self._reap()
            how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
            why = self.block.fault()
            raise UserError(f"{self.name} (process {self.process}) {how}{': ' + why if why else ''}")
        else:
            self._hangs("no answer")

    def end(self) -> int:
        """Order its process to end, and return the exit code; UserError when it does not end."""
        if self.code is None:
            self._ring(places.COMMAND_STOP, 0)
            if not descriptors.wait([self.watch], [], self.patience_s)[0]:
                self._hangs("no end")
        return self._reap()

    def close(self) -> None:
        """End its process in any state, and release the channel."""
        if self.code is None:
            os.kill(self.process, signal.SIGKILL)
        self._reap()
        os.close(self.watch)
        self.block.close()

    def _ring(self, command: int, until: int) -> None:
        self.words[places.COMMAND] = command
        self.words[places.UNTIL] = until
        self.words[places.PLANT_SLEEPS] = 1  # set before it is asked, so that every answer is posted
        self.ask.ring()

    def _hangs(self, missing: str) -> None:
        os.kill(self.process, signal.SIGKILL)
        self._reap()
        raise UserError(
            f"{self.name} (process {self.process}) hangs: {missing} for {self.patience_s:g} s; it is killed"
        )

    def _reap(self) -> int:
        """The exit code of the process, which has ended or is about to."""
        if self.code is None:
            self.code = confinement.wait_for(self.process)
        return self.code
