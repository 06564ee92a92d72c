"""Watches the processes of boards for the one that passes the robot's time, so that it waits for none that hangs.

A process shows that it is alive with every turn that it ends; the process that waits counts them, in memory that the
board's process does not have. One that owes an answer for the deadline is asked for its program's position (a program
in C reports it when it ends, crash.py), then killed; its block keeps the reason.
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


def is_starved(process: int, since_s: float, limit_s: float) -> bool:
    """Whether a process is ready to run, but the machine is busy with others: it has had less than half of `limit_s`
    since it had used `since_s` of processor time.
    """
    return kernel.state_of(process) == "R" and kernel.processor_time_s(process) - since_s < limit_s / 2


def cause(block: Any, process: int, waited_s: float, used_s: float) -> str:
    """Why a board's process owes an answer: what the system lists about it, after `waited_s`, `used_s` of computing."""
    state = kernel.state_of(process)
    if state in STOPPED:
        return f"its process was stopped (SIGSTOP) for {waited_s:.3g} s"
    if kernel.EVENTFD not in kernel.open_files(process):
        return f"its answers no longer arrive (descriptors of its process are closed) for {waited_s:.3g} s"
    if block.words[places.ASKED] == block.words[places.ANSWERED]:
        return f"its answers no longer arrive (its program writes over the memory of its channel) for {waited_s:.3g} s"
    if state == "R" or used_s > waited_s / 2:
        return f"no answer for {waited_s:.3g} s, {used_s:.1f} s of them computing"
    return f"no answer for {waited_s:.3g} s, waiting in the kernel{kernel.waiting_in(process)}"


@dataclasses.dataclass
class Watched:
    """The last state of a board's process: its turn, for how many checks, its and the waiting process's processor time
    then.
    """

    turn: int = -1
    checks: int = 0
    used_s: float = 0.0
    used_by_waiter_s: float = 0.0
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
                block.private[places.FATE] = places.GONE
                os.eventfd_write(block.answer_descriptor, 1)
            if not ready and self.deadline_s and kernel.state_of(os.getppid()) not in STOPPED:
                for name in self.watches.values():
                    self.check(name)
        return 0

    def check(self, name: str) -> None:
        """End the process of a board that has given no sign of life for the deadline."""
        seen, block, process, waiter = self.seen[name], self.blocks[name], self.numbers[name], os.getppid()
        turn = block.private[places.WAITS]
        if turn != seen.turn or not block.private[places.AWAITED]:
            used_s, used_by_waiter_s = kernel.processor_time_s(process), kernel.processor_time_s(waiter)
            self.seen[name] = Watched(turn, used_s=used_s, used_by_waiter_s=used_by_waiter_s)
            return
        limit_s = self.deadline_s
        if kernel.state_of(process) == TRACED or (
            is_starved(process, seen.used_s, limit_s) or is_starved(waiter, seen.used_by_waiter_s, limit_s)
        ):
            return
        seen.checks += 1
        if seen.checks < CHECKS:
            return
        if not seen.was_asked:
            block.leave_fault(cause(block, process, limit_s, kernel.processor_time_s(process) - seen.used_s))
        if seen.was_asked or name not in self.in_c or block.words[places.ASKED] == block.words[places.ANSWERED]:
            os.kill(process, signal.SIGKILL)
        else:
            seen.was_asked, seen.checks = True, CHECKS - 1  # killed at the next check
            os.kill(process, crash.ASKED)
            os.kill(process, signal.SIGCONT)
