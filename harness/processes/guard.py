"""Watches the processes of boards for the one that passes the robot's time, so that it waits for none that hangs.

A process shows that it is alive with every turn that it ends; the process that waits counts them, in memory that the
board's process does not have. One that owes an answer for the deadline is asked for its program's position (a program
in C reports it when it ends, crash.py), then killed; its block keeps the reason.
"""

import dataclasses
import os
import signal
from collections.abc import Mapping
from typing import Any, NamedTuple

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation import descriptors
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.settings import DEADLINE_S

CHECKS = 10  # checks in a deadline, each after a wait: a suspended machine costs one of them
MOST_SLICES = 1000  # of a processor in one turn: it takes microseconds, and a slice some milliseconds. Chosen by us
TRACED = "t"  # state of a process that a debugger holds
STOPPED = ("T", TRACED)


class Use(NamedTuple):
    """What a process has had of the processors: time (s), and how often it got one."""

    time_s: float = 0.0
    slices: int = 0


def use_of(process: int) -> Use:
    """Its use up to now."""
    return Use(kernel.processor_time_s(process), kernel.slices_of(process))


def is_starved(process: int, since: Use, limit_s: float) -> bool:
    """Whether a process is ready to run, but the machine is busy with others: since then it has had less than half of
    `limit_s`, and few slices. One that gives the processor away again and again has had many.
    """
    if kernel.state_of(process) != "R":
        return False
    now = use_of(process)
    return now.time_s - since.time_s < limit_s / 2 and now.slices - since.slices < MOST_SLICES


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
    """The last state of a board's process: its turn, for how many checks, its and the waiting process's use of
    processors then.
    """

    turn: int = -1
    checks: int = 0
    use: Use = Use()
    use_of_waiter: Use = Use()
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
            self.seen[name] = Watched(turn, use=use_of(process), use_of_waiter=use_of(waiter))
            return
        limit_s = self.deadline_s
        if kernel.state_of(process) == TRACED or (
            is_starved(process, seen.use, limit_s) or is_starved(waiter, seen.use_of_waiter, limit_s)
        ):
            return
        seen.checks += 1
        if seen.checks < CHECKS:
            return
        if not seen.was_asked:
            block.leave_fault(cause(block, process, limit_s, use_of(process).time_s - seen.use.time_s))
        if seen.was_asked or name not in self.in_c or block.words[places.ASKED] == block.words[places.ANSWERED]:
            os.kill(process, signal.SIGKILL)
        else:
            seen.was_asked, seen.checks = True, CHECKS - 1  # killed at the next check
            os.kill(process, crash.ASKED)
            os.kill(process, signal.SIGCONT)
