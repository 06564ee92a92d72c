"""The robot of the backend `processes`: every board a process of its own, this one has body, buses and the test.

It is the lockstep of harness/processes, with the test in the place of the plant's process: virtual time, the same
bytes as `sim`. The processes begin when time first passes, so that a test may replace functions before; they end with
`close`, or with this process, however that ends. A process beside them watches: the test waits for no board that is
gone or stands still.
"""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import warnings
from collections.abc import Callable
from typing import Any, NoReturn

from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation import descriptors
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import wiring
from ranger_sim.harness.conditions import Condition, ErrorNoted, condition
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.harness.processes import board_process, kernel, places
from ranger_sim.harness.processes.block import Block, new_stage
from ranger_sim.harness.processes.kinds import SET_WORD
from ranger_sim.harness.processes.remote_board import RemoteBoard
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.stage import Stage
from ranger_sim.harness.profile import Profile
from ranger_sim.harness.ranger import Ranger
from ranger_sim.harness.scenario import Scenario, StopRule
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.testing.backends import PROCESSES, MissingError

PATIENCE_S = 60.0  # a turn takes some microseconds; the rest is for a busy machine


class BoardLostError(AssertionError):
    """The process of a board has ended during a test."""


class ProcessRobot(Ranger):
    """Like Ranger; what a board has in its memory is out of reach, except for the main brain's data table."""

    backend = PROCESSES

    def __init__(self, scenario: Scenario, log: str, quirks: Quirks | None, profile: Profile | None) -> None:
        if not sys.platform.startswith("linux"):
            raise MissingError("backend processes needs Linux (eventfd, pidfd)")
        Ranger.__init__(self, scenario, log, quirks, profile)
        self.processes: Processes | None = None

    def start(self) -> Processes:
        """Give each board its process, if that has not been done."""
        if self.processes is None:
            self.processes = Processes(self)
        return self.processes

    def inject(self, *place_and_mode: Any, **more: Any) -> Fault:
        """Arm a fault. The processes begin now, so that one that would have to be inside a board is refused."""
        self.start()
        return Ranger.inject(self, *place_and_mode, **more)

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass time; BoardLostError when a board's process has ended meanwhile."""
        __tracebackhide__ = True
        processes = self.start()
        with processes.processor():
            done = Ranger.run(self, stop, slice_s)
        processes.check()
        return done

    def until(self, wanted: str | Condition | Callable[[Any], Any], within: str = "60 s") -> float:
        """As of a robot in this process; what boards noted is asked of them at each step then, which takes time."""
        __tracebackhide__ = True
        wanted = condition(wanted)
        if not isinstance(wanted, ErrorNoted):
            return Ranger.until(self, wanted, within)
        asking = Asking(self, wanted.boards)
        self.loop.watchers.append(asking)
        try:
            return Ranger.until(self, wanted, within)
        finally:
            self.loop.watchers.remove(asking)

    def board(self, name: str) -> Any:
        """The board as it was built, before time passes; afterwards it is in another process: MissingError."""
        built: Any = Ranger.board(self, name)  # type: ignore[call-overload]
        if self.processes is not None:
            raise MissingError(
                f"backend processes has no board memory: {name} runs in a process of its own; "
                "variable(), counters(), wire() and until() see it"
            )
        return built

    def replace(
        self, board: Any, task: str, function: Callable[[], int | None], cost: int, limit: int | None = None
    ) -> None:
        """Put your own function in a schedule entry, before time passes."""
        if self.processes is not None:
            raise UserError(f"replace {task} of {board}: its process runs already; replace before time passes")
        Ranger.replace(self, board, task, function, cost, limit)

    def _write_word(self, number: int, word: int) -> None:
        """Through the channel, once the main brain is in another process."""
        if self.processes is None:
            Ranger._write_word(self, number, word)
        else:
            self.loop.board("MB").send(SET_WORD, self.loop.time, number, word)

    def counters(self) -> dict[str, RangerCounters]:
        """What every board counted by now."""
        if self.processes is not None:
            self.processes.fetch_counters()
        return Ranger.counters(self)

    def close(self) -> None:
        """End the processes."""
        if self.processes is not None:
            self.processes.close()
        Ranger.close(self)


class Asking(StepWatch):
    """Before each step it fetches what these boards have counted."""

    def __init__(self, robot: ProcessRobot, boards: tuple[str, ...]) -> None:
        StepWatch.__init__(self)
        self.robot = robot
        self.boards = boards

    def before_step(self, now_ns: int) -> None:
        if self.robot.processes is not None:
            self.robot.processes.fetch_counters(self.boards)


class Processes:
    """The boards of the wired, never run `robot`, each in its process."""

    def __init__(self, robot: Ranger) -> None:
        self.robot = robot
        self.used = processor_for_this_worker()
        self.settings = Settings(speed=None, real_time=False, processor=self.used)
        words, doubles = stage = new_stage()
        table_words = len(robot.boards["MB"].store.words)
        self.blocks = {
            name: Block(name, place, table_words if name == "MB" else 0) for place, name in enumerate(wiring.BOARDS)
        }
        self.ended = False
        self.children = {name: fork(self._board(name, stage)) for name in wiring.BOARDS}
        self.watches = {name: os.pidfd_open(process) for name, process in self.children.items()}
        self.guard = fork(self._look_after)
        loop = robot.loop
        show = Stage(words, doubles, robot.plant, loop.step_times, loop.word_wires)
        self.remotes = {
            name: RemoteBoard(robot.boards[name], self.blocks[name], show, place, name == "MB")
            for place, name in enumerate(wiring.BOARDS)
        }
        for name, remote in self.remotes.items():
            loop.replace(remote)
            robot.boards[name].apart = True  # it will not run here

    def _board(self, name: str, stage: tuple[Any, Any]) -> Callable[[], int]:
        def body() -> int:
            return board_process.serve(self.robot, name, self.blocks[name], stage, self.settings, False)

        return body

    def _look_after(self) -> int:
        """In a process of its own: mark the block of a board that has ended, and wake who waits for it."""
        open_watches = {descriptor: name for name, descriptor in self.watches.items()}
        turns: dict[str, int] = {}
        while open_watches:
            ready, _ = descriptors.wait(list(open_watches), [], PATIENCE_S)
            for descriptor in ready:
                block = self.blocks[open_watches.pop(descriptor)]
                block.words[places.FATE] = places.GONE
                os.eventfd_write(block.answer_descriptor, 1)
            for name, block in self.blocks.items() if not ready else ():
                turn = block.words[places.ASKED]
                if turn != block.words[places.ANSWERED] and turns.get(name) == turn:
                    block.leave_fault(f"no answer for {PATIENCE_S:g} s; it is killed")
                    os.kill(self.children[name], signal.SIGKILL)
                turns[name] = turn
        return 0

    @contextlib.contextmanager
    def processor(self) -> Any:
        """Body and boards take turns, which is fastest on one processor (harness/processes/README.md)."""
        allowed = os.sched_getaffinity(0)
        kernel.stay_on(self.used)
        try:
            yield
        finally:
            os.sched_setaffinity(0, allowed)

    def check(self) -> None:
        """BoardLostError when a board is gone."""
        __tracebackhide__ = True
        for name, remote in self.remotes.items():
            if remote.gone and not self.ended:
                code = os.waitstatus_to_exitcode(os.waitpid(self.children[name], 0)[1])
                del self.children[name]
                why = self.blocks[name].fault()
                self.robot.lost = True
                self.close()
                how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
                raise BoardLostError(
                    f"{name}: its process {how} before {self.robot.time_s:.6f} s{': ' + why if why else ''}"
                )

    def fetch_counters(self, names: tuple[str, ...] = wiring.BOARDS) -> None:
        """Bring boards to the present instant and ask them what they counted."""
        for remote in (self.remotes[name] for name in names if not self.ended):
            remote.catch_up(self.robot.loop.time)
            remote.fetch_counters()
        self.check()

    def close(self) -> None:
        """End all processes; they are gone after this."""
        if self.ended:
            return
        self.ended = True
        for process in (self.guard, *self.children.values()):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        for process in (self.guard, *self.children.values()):
            os.waitpid(process, 0)
        self.children.clear()
        for descriptor in self.watches.values():
            os.close(descriptor)
        for block in self.blocks.values():
            block.close()


def processor_for_this_worker() -> int:
    """The processor for a robot of processes; workers of pytest-xdist get different ones, as far as there are."""
    allowed = sorted(os.sched_getaffinity(0), reverse=True)
    number = os.environ.get("PYTEST_XDIST_WORKER", "").removeprefix("gw")
    return allowed[int(number) % len(allowed) if number.isdecimal() else 0]


def fork(body: Callable[[], int]) -> int:
    """A process that runs `body`, leaves with what that returns, and does not outlive this one; its number."""
    parent = os.getpid()
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
        process = os.fork()
    if process:
        return process
    _live(parent, body)


def _live(parent: int, body: Callable[[], int]) -> NoReturn:
    code = board_process.FAILED
    try:
        kernel.die_with_parent(parent)
        gc.freeze()  # what lies about in the parent's program is not for this process to finalize
        code = body()
    except BaseException as error:  # noqa: BLE001  (a child must never return into the parent's program)
        print(f"ranger-sim: {type(error).__name__}: {error}", file=sys.stderr, flush=True)
    finally:
        os._exit(code)
