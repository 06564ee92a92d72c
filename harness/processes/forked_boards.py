"""Some boards of a machine, or all, each in a forked process; the rest of the machine is in this one and passes time.

It is the lockstep of this folder without a supervisor: virtual time, the same bytes as in one process. The processes
start when time first passes, so that the boards may be changed before. A further process watches them
(guard.py): a board that is gone or does not answer is not waited for. They end with `close`, or with this process,
in whatever way that ends.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn

from ranger_sim.firmware_sim.native import confinement, crash
from ranger_sim.foundation import descriptors, systems
from ranger_sim.harness.processes import board_process, kernel, places
from ranger_sim.harness.processes.block import Block, StageMemory, alone, words_shown
from ranger_sim.harness.processes.board_process import is_confined
from ranger_sim.harness.processes.guard import Guard
from ranger_sim.harness.processes.remote_board import RemoteBoard
from ranger_sim.harness.processes.settings import DEADLINE_S, Settings
from ranger_sim.harness.processes.stage import Stage
from ranger_sim.harness.step_watch import StepWatch

RESET = 1  # mode of a bus node


class ForkedBoards:
    """The boards `names` of the wired, never run `robot`, each in its process; one that ends goes into `robot.deaths`.

    deadline_s: without an answer, after which a board's process is ended; 0: never.
    """

    def __init__(self, robot: Any, names: tuple[str, ...], deadline_s: float = DEADLINE_S) -> None:
        self.robot = robot
        systems.require_linux(
            f"{', '.join(names)}: boards as processes", "eventfd, pidfd", "--in-process, Ranger(in_process=True) work"
        )
        self.names = names
        self.used = processor_for_this_worker()
        self.settings = Settings(speed=None, real_time=False, processor=self.used)
        stage = StageMemory()
        place = {name: number for number, name in enumerate(robot.boards)}
        self.blocks = {name: Block(name, place[name], words_shown(robot.boards[name])) for name in names}
        self.ended = False
        self.children = {}
        for name in names:
            with alone(self.blocks[name], self.blocks.values(), stage):
                self.children[name] = fork(self._board(name, stage.shown), is_confined(robot, name))
        self.numbers = tuple(self.children.values())  # of the processes, also of those that have ended
        self.watches = {name: os.pidfd_open(process) for name, process in self.children.items()}
        in_c = frozenset(robot.firmware)
        self.guard = fork(Guard(self.blocks, self.children, self.watches, in_c, deadline_s).watch)
        loop = robot.loop
        show = Stage(*stage.written, robot.plant, loop.step_times, loop.word_wires)
        self.remotes = {}
        for name in names:
            board = robot.boards[name]
            follows_steps = board is loop.sampler.board  # its memory is sampled
            self.remotes[name] = RemoteBoard(board, self.blocks[name], show, place[name], follows_steps)
        for name, remote in self.remotes.items():
            loop.replace(remote)
            robot.boards[name].out_of_process = True  # it does not run here
        loop.watchers.append(ProcessReaper(self))

    def _board(self, name: str, stage: tuple[Any, Any]) -> Callable[[], int]:
        def body() -> int:
            return board_process.serve(self.robot, name, self.blocks[name], stage, self.settings, False)

        return body

    @contextlib.contextmanager
    def processor(self) -> Iterator[None]:
        """Body and boards take turns, which is fastest on one processor (README.md)."""
        allowed = os.sched_getaffinity(0)
        kernel.stay_on(self.used)
        try:
            yield
        finally:
            os.sched_setaffinity(0, allowed)

    def reap(self) -> None:
        """Take lost boards off their buses; their pins stay, so that the watchdogs of bridges expire."""
        for name, remote in self.remotes.items():
            if remote.gone and name in self.children and not self.ended:
                code = confinement.wait_for(self.children.pop(name))
                how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
                why = ": ".join(filter(None, (self.blocks[name].fault(), self._where(name))))
                loop = self.robot.loop
                self.robot.deaths.append({"board": name, "time_s": self.robot.time_s, "how": how, "why": why})
                wires = loop.wires[loop.place(name)]
                for controller, bus in enumerate(wires.buses):
                    if bus is not None:
                        bus.set_mode(wires.nodes[controller], RESET, loop.time)

    def _where(self, name: str) -> str:
        """The position of its program in C when it ended its process; empty when it did not."""
        block = self.blocks[name]
        if name in self.robot.firmware and block.words[places.CRASH]:
            firmware = self.robot.firmware[name]
            record = block.words[places.CRASH : places.CRASH + places.CRASH_WORDS].tolist()
            return crash.describe(firmware.library, firmware.folder, record)
        return ""

    @contextlib.contextmanager
    def asking(self, names: Sequence[str]) -> Iterator[None]:
        """Within it, the counters of these boards are fetched before each step."""
        asking = Asking(self, names)
        self.robot.loop.watchers.append(asking)
        try:
            yield
        finally:
            self.robot.loop.watchers.remove(asking)

    def fetch_counters(self, names: Sequence[str] | None = None) -> None:
        """Bring boards to the present time and fetch their counters."""
        for name in names if names is not None else self.names:
            if name in self.remotes and not self.ended:
                self.remotes[name].catch_up(self.robot.loop.time)
                self.remotes[name].fetch_counters()
        self.reap()

    def dismiss(self) -> None:
        """Let all processes finish writing and end by themselves; wait for that."""
        for name, remote in self.remotes.items():
            if name in self.children and not remote.gone:
                remote.catch_up(self.robot.loop.time)
                remote.fetch_counters()
        self.reap()
        for name, process in list(self.children.items()):
            self.remotes[name].dismiss()
            descriptors.wait([self.watches[name]], [], DEADLINE_S)
            del self.children[name]
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
            confinement.wait_for(process)

    def close(self) -> None:
        """End all processes."""
        if self.ended:
            return
        self.ended = True
        for process in (self.guard, *self.children.values()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        for process in (self.guard, *self.children.values()):
            confinement.wait_for(process)
        self.children.clear()
        for descriptor in self.watches.values():
            os.close(descriptor)
        for block in self.blocks.values():
            block.close()


class ProcessReaper(StepWatch):
    """Checks before each step for boards that are gone, so that they leave their buses by virtual time."""

    def __init__(self, remote: ForkedBoards) -> None:
        StepWatch.__init__(self)
        self.remote = remote

    def before_step(self, now_ns: int) -> None:
        self.remote.reap()


class Asking(StepWatch):
    """Fetches these boards' counters before each step."""

    def __init__(self, remote: ForkedBoards, names: Sequence[str]) -> None:
        StepWatch.__init__(self)
        self.remote = remote
        self.names = names

    def before_step(self, now_ns: int) -> None:
        self.remote.fetch_counters(self.names)


def processor_for_this_worker() -> int:
    """The processor for a robot of processes; workers of pytest-xdist get different ones, as far as possible."""
    allowed = sorted(os.sched_getaffinity(0), reverse=True)
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    return allowed[int(number) % len(allowed) if number.isdecimal() else 0]


def fork(body: Callable[[], int], has_own_numbers: bool = False) -> int:
    """Fork a process that exits with the result of `body` and does not outlive this one; returns its number.

    has_own_numbers: it is in a namespace of process numbers, where the kernel grants it.
    """
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
        process = confinement.fork(has_own_numbers)
    if process:
        return process
    _live(parent, body)


def _live(parent: int, body: Callable[[], int]) -> NoReturn:
    code = board_process.FAILED
    try:
        kernel.die_with_parent(parent)
        gc.freeze()  # this process must not finalize the parent's objects
        code = body()
    except BaseException as error:  # noqa: BLE001  (a child must never return into the parent's program)
        print(f"ranger-sim: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
    finally:
        os._exit(code)
