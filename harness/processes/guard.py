"""Watches the processes of boards for the one that passes the robot's time, so that it waits for none that hangs.

A process shows that it is alive with every turn that it ends. One that owes an answer for the deadline is asked for its
program's position (a program in C reports it when it ends, crash.py), then killed; its block keeps the reason.
"""

import dataclasses
import os
import signal
from collections.abc import Mapping
from typing import Any

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation import descriptors
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.settings import DEADLINE_S

CHECKS = 10  # checks in a deadline, each after a wait: a suspended machine costs one of them
TRACED = "t"  # state of a process that a debugger holds
STOPPED = ("T", TRACED)


def is_awaited(block: Any) -> bool:
    """True when a board owes an answer, or when it answered and the plant's process, which sleeps, was not woken."""
    if block.words[places.ASKED] != block.words[places.ANSWERED]:
        return True
    return bool(block.words[places.PLANT_SLEEPS]) and not descriptors.wait([block.answer_descriptor], [], 0.0)[0]


@dataclasses.dataclass
class Watched:
    """The last state of a board's process: its turn, for how many checks, and its processor time then."""

    turn: tuple[int, int] = (-1, -1)
    checks: int = 0
    used_s: float = 0.0
    was_asked: bool = False


class Guard:
    """Watches the processes `numbers`, each by its pidfd in `watches`; the parent process is the one that waits.

    deadline_s: without a sign of life, s; 0: for ever, for debugging a program. in_c: boards with a program in C.
    """

    def __init__(
        self,
        blocks: Mapping[str, Any],
        numbers: Mapping[str, int],
        watches: Mapping[str, int],
        in_c: frozenset[str],
        deadline_s: float,
    ) -> None:
        self.blocks = blocks
        self.numbers = numbers
        self.watches = {descriptor: name for name, descriptor in watches.items()}
        self.in_c = in_c
        self.deadline_s = deadline_s
        self.seen = {name: Watched() for name in blocks}

    def watch(self) -> int:
        """Watch until all have ended; returns the exit code of the watching process."""
        while self.watches:
            ready, _ = descriptors.wait(list(self.watches), [], (self.deadline_s or DEADLINE_S) / CHECKS)
            for descriptor in ready:
                block = self.blocks[self.watches.pop(descriptor)]
                block.words[places.FATE] = places.GONE
                os.eventfd_write(block.answer_descriptor, 1)
            if not ready and self.deadline_s and kernel.state_of(os.getppid()) not in STOPPED:
                for name in self.watches.values():
                    self.check(name)
        return 0

    def check(self, name: str) -> None:
        """End the process of a board that has given no sign of life for the deadline."""
        seen, block, process = self.seen[name], self.blocks[name], self.numbers[name]
        turn = (block.words[places.ASKED], block.words[places.ANSWERED])
        if turn != seen.turn or not is_awaited(block):
            self.seen[name] = Watched(turn, used_s=kernel.processor_time_s(process))
            return
        state = kernel.state_of(process)
        used_s = kernel.processor_time_s(process) - seen.used_s
        if state == TRACED or (state == "R" and used_s < self.deadline_s / 2):
            return  # a debugger has it, or the machine is busy with other processes
        seen.checks += 1
        if seen.checks < CHECKS:
            return
        if not seen.was_asked:
            block.leave_fault(self.cause(turn, state))
        if seen.was_asked or name not in self.in_c or turn[0] == turn[1]:
            os.kill(process, signal.SIGKILL)
        else:
            seen.was_asked, seen.checks = True, CHECKS - 1  # killed at the next check
            os.kill(process, crash.ASKED)
            os.kill(process, signal.SIGCONT)

    def cause(self, turn: tuple[int, int], state: str) -> str:
        """The reason for killing it."""
        if turn[0] == turn[1]:
            return f"its answers no longer arrive (descriptors of its process are closed) for {self.deadline_s:g} s"
        what = "its process was stopped (SIGSTOP)" if state in STOPPED else "no answer"
        return f"{what} for {self.deadline_s:g} s"
