"""The process the user starts: it makes the others, monitors them, and ends last.

It builds the robot once and never runs it. Every other process is a fork of it: the plant's process takes the robot
over, a board's process one of its boards; a restarted board is a fork as well. When the supervisor dies, however it
dies, the kernel kills the others; their memory is anonymous and their sockets have no names, so nothing remains.
"""

import contextlib
import dataclasses
import gc
import json
import os
import signal
import socket
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ranger_sim.can_bus.edge.peers import REASONS
from ranger_sim.firmware_sim.gdb.server import GdbServer
from ranger_sim.firmware_sim.native import confinement, crash
from ranger_sim.foundation import descriptors, systems, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import board_process, kernel, places, plant_process
from ranger_sim.harness.processes.block import Block, StageMemory, alone, words_shown
from ranger_sim.harness.processes.control import ControlServer
from ranger_sim.harness.processes.guard import Use, cause, is_starved, use_of
from ranger_sim.harness.processes.lateness import figures
from ranger_sim.harness.processes.settings import DEADLINE_S, ON_FAILURE, Settings
from ranger_sim.harness.stop_rule import StopRule

PLANT = "plant"
POLL_S = 0.2  # between two polls of boards and updates of the screen
ASK_S = 0.005  # between two polls of requests, however many there are: it limits a client that never stops
MOST_POLL_S = 5 * POLL_S  # how much of a process's stop one poll counts: a suspended machine or terminal counts once
EXIT_LOST = 2  # as where a file cannot be finished; 1 is a robot that fell or a board that failed, with a summary
HANG_S = 1.0  # a board that keeps its turn this long is checked, and named well within 2 s
RESTART_LIMIT = 5  # per board with --restart on-failure, so that a broken board does not keep us busy

RUNNING, STOPPED, GONE, RESTARTING, ELSEWHERE = "running", "stopped", "gone", "restarting", "elsewhere"


class View:
    """What the supervisor shows; tools/ has one for a terminal and one for a pipe."""

    def show(self, state: dict) -> None:
        """The state of the run, a few times a second."""

    def say(self, text: str) -> None:
        """Report an event in one line."""

    def close(self) -> None:
        """Release the terminal."""


@dataclasses.dataclass
class Child:
    """A process of the robot. `turn`: the turn it had at the last poll, since `turn_since_s`.

    stopped_s: for how long it has been stopped while a reply was awaited from it.
    """

    name: str
    process: int
    state: str = RUNNING
    turn: int = -1
    turn_since_s: float = 0.0
    turn_use: Use = Use()
    turn_use_of_plant: Use = Use()
    stopped_s: float = 0.0
    was_asked: bool = False  # for its position while it keeps its turn: a program in C reports it when it ends


class Supervisor:
    """Runs `robot` as processes.

    The plant's process calls `begin(robot)` before time passes, to open external connections, and
    `finish(robot, run, interrupted)` at the end; the exit code is what that returns.
    """

    def __init__(
        self,
        robot: Any,
        settings: Settings,
        stop: StopRule,
        finish: Callable[[Any, Any, bool], int],
        view: View,
        begin: Callable[[Any], None] = lambda _robot: None,
        servers: Sequence[GdbServer] = (),
    ) -> None:
        self.robot = robot
        self.debug_servers = {
            server.board.name: server for server in servers
        }  # of debuggers; each is its board's process's
        self.held: set[str] = set()  # boards that a debugger has, as far as reported
        self.begin = begin
        self.settings = settings if settings.boards else dataclasses.replace(settings, boards=tuple(robot.boards))
        self.stop_rule = stop
        self.finish = finish
        self.view = view
        self.control = ControlServer(settings.name, robot.admitted, self.obey)
        self.next_ask_s = self.next_check_s = 0.0
        self.polled_s = 0.0
        self.sent_away: dict[str, dict[str, int]] = {}  # clients by endpoint and reason, as far as reported
        self.stage = StageMemory()
        self.blocks = {
            name: Block(name, place, words_shown(robot.boards[name])) for place, name in enumerate(robot.boards)
        }
        self.children: dict[str, Child] = {}
        self.link, self.plant_link = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.wakeup_read, self.wakeup_write = socket.socketpair()
        self.signals: list[int] = []
        self.interrupts = 0
        self.ending = False  # the plant's process has reported the end
        self.has_given_up = False  # a stopped process has ended the run
        self.status: dict = {}
        self.restarts: dict[str, int] = {}
        self.exit_code: int | None = None
        self.failure = ""  # what the plant's process could not open
        self.scheduling = self.try_scheduling()
        self.plant_seen = (0, 0.0)

    # --- processes ----------------------------------------------------------------------------------------

    def fork(self, name: str, body: Callable[[], int], has_own_numbers: bool = False) -> int:
        """A child that runs `body` and leaves with what it returns; confinement.fork has `has_own_numbers`."""
        parent = os.getpid()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            # numerical libraries keep threads for matrices; no process of ours uses them
            warnings.simplefilter("ignore", DeprecationWarning)
            process = confinement.fork(has_own_numbers, lambda: kernel.schedule(self.settings))
        if process:
            self.children[name] = Child(name, process)
            return process
        code = board_process.FAILED
        try:
            kernel.die_with_parent(parent)
            signal.set_wakeup_fd(-1)
            for number in (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_IGN if number != signal.SIGCHLD else signal.SIG_DFL)
            for each in (self.link, self.wakeup_read, self.wakeup_write):
                each.close()
            self.control.close()
            gc.freeze()
            code = body()
        except BaseException as error:  # noqa: BLE001  (a child must never return into the parent's program)
            with contextlib.suppress(Exception):
                print(f"ranger-sim: {name}: {type(error).__name__}: {error}", file=sys.stderr)
        finally:
            with contextlib.suppress(Exception):
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(code)

    def start_board(self, name: str, fresh: bool = False) -> None:
        """Start a process for a board: for the one that was built, or for a new, unwired one."""
        block = self.blocks[name]
        is_held = name in self.debug_servers
        stage = self.stage.written if is_held else self.stage.shown

        def body() -> int:
            self.plant_link.close()
            self.robot.logbook.close()
            server = self.debug_servers.pop(name, None)
            self.close_servers()
            return board_process.serve(self.robot, name, block, stage, self.settings, fresh, server)

        block.private[places.FATE] = places.ALIVE
        block.words[places.FAULT_TEXT] = 0
        block.words[places.CRASH] = 0
        block.words[places.HELD] = 0
        with alone(block, self.blocks.values(), self.stage, is_held):
            self.fork(name, body, board_process.is_confined(self.robot, name))

    def close_servers(self) -> None:
        """Close the endpoints in a process that does not use them."""
        for server in self.debug_servers.values():
            server.close()
        self.debug_servers.clear()

    def start_plant(self) -> None:
        """The plant's process."""

        def body() -> int:
            self.close_servers()
            return plant_process.serve(
                self.robot,
                self.blocks,
                self.stage.written,
                self.settings,
                self.plant_link,
                self.stop_rule,
                self.begin,
                self.finish,
            )

        self.fork(PLANT, body)
        self.plant_link.close()

    # --- the life of a run --------------------------------------------------------------------------------

    def describe(self) -> str:
        """The pace, and what the kernel granted."""
        pace = "as fast as it goes" if self.settings.speed is None else f"{self.settings.speed:g} x real time"
        return f"{pace}; {self.scheduling}"

    def run(self) -> int:
        """Start everything, supervise it, and return the exit code."""
        with self.signals_noted():
            try:
                for name in self.settings.boards:
                    self.start_board(name)
                self.start_plant()
                while self.exit_code is None:
                    self.turn()
            finally:
                self.view.close()
                self.kill_all()
                self.close()
        if self.failure:
            raise UserError(self.failure)
        return self.exit_code

    def close(self) -> None:
        """Close the connections to clients and children; the children have ended."""
        self.control.close()
        for each in (self.link, self.plant_link, self.wakeup_read, self.wakeup_write):
            each.close()
        for block in self.blocks.values():
            block.close()
        self.close_servers()

    @contextlib.contextmanager
    def signals_noted(self) -> Iterator[None]:
        """Signals wake the loop and are handled there; also those that the parent process had blocked."""

        def note(number: int, _frame: Any) -> None:
            self.signals.append(number)

        self.wakeup_write.setblocking(False)
        self.wakeup_read.setblocking(False)
        watched = (signal.SIGCHLD, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        before = {number: signal.signal(number, note) for number in watched}
        wakeup = signal.set_wakeup_fd(self.wakeup_write.fileno(), warn_on_full_buffer=False)
        mask = signal.pthread_sigmask(signal.SIG_UNBLOCK, watched)
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
            signal.set_wakeup_fd(wakeup)
            for number, handler in before.items():
                signal.signal(number, handler)

    def try_scheduling(self) -> str:
        """Real-time scheduling and locked memory that the children will get, tried in one that ends at once."""
        if not self.settings.real_time:
            return "ordinary scheduling, memory not locked (as asked for)"
        read, write = os.pipe()
        process = os.fork()
        if process == 0:
            fifo = kernel.real_time_scheduling() if self.settings.wants_fifo else "no pace to keep"
            locked = kernel.lock_memory()
            os.write(write, f"{fifo}\n{locked}".encode())
            os._exit(0)
        os.close(write)
        with os.fdopen(read) as pipe:
            fifo, _, locked = pipe.read().partition("\n")
        os.waitpid(process, 0)
        scheduling = f"ordinary scheduling (SCHED_FIFO: {fifo})" if fifo else "SCHED_FIFO"
        memory = f"memory not locked ({locked})" if locked else "memory locked"
        place = "all processors" if self.settings.processor is None else f"processor {self.settings.processor}"
        return f"{scheduling}, {memory}, on {place}"

    def turn(self) -> None:
        """Wait for an event, or a fifth of a second, and handle it."""
        read, write = [self.wakeup_read.fileno(), self.link.fileno()], []
        patience_s = POLL_S
        if (wait_s := self.next_ask_s - wallclock.monotonic_s()) > 0.0:
            patience_s = wait_s
        else:
            read, write = read + self.control.filenos(), self.control.filenos_to_write()
        ready, _ = descriptors.wait(read, write, patience_s)
        if self.wakeup_read.fileno() in ready:
            with contextlib.suppress(BlockingIOError):
                while self.wakeup_read.recv(4096):
                    pass
        signals, self.signals = self.signals, []
        self.receive_from_plant()  # before the ends of children: the plant's process may have ordered them
        if signal.SIGCHLD in signals:
            self.reap()
        if any(number != signal.SIGCHLD for number in signals):
            self.interrupt()
        now_s = wallclock.monotonic_s()
        if now_s >= self.next_ask_s:
            self.next_ask_s = now_s + ASK_S
            self.control.poll()
        if signals or now_s >= self.next_check_s:
            self.next_check_s = now_s + POLL_S
            self.check()

    def interrupt(self) -> None:
        """Ctrl-C: once to stop and finish the files, twice to abort."""
        self.interrupts += 1
        if self.interrupts > 1:
            self.view.say("broken off: no files are finished")
            self.exit_code = 130
            return
        self.order({"do": "stop"})
        for block in self.blocks.values():
            block.words[places.LET_GO] = 1
        for child in self.children.values():
            if child.state == STOPPED:
                os.kill(child.process, signal.SIGCONT)  # it has to finish as well

    def order(self, content: dict, listening: bool = False) -> bool:
        """Send the plant's process an order; False when it is gone, or has left hundreds of orders unread.

        It does not wait, unless the process is known to be reading: it may hang, and the supervisor must notice that.
        """
        try:
            self.link.send(json.dumps(content).encode(), 0 if listening else socket.MSG_DONTWAIT)
        except OSError:  # `reap` handles it
            return False
        return True

    def receive_from_plant(self) -> None:
        """What the plant's process has sent."""
        while True:
            try:
                data = self.link.recv(1 << 20, socket.MSG_DONTWAIT)
            except (BlockingIOError, ConnectionResetError):
                return
            if not data:
                return
            news = json.loads(data)
            if "status" in news:
                self.status = news["status"]
            if news.get("answer") is not None:
                self.answered(news)
            if "gone" in news:
                self.view.say(f"{news['gone']} is off its bus since {news['time_s']:.3f} s of the robot's time")
            if "said" in news:
                self.view.say(news["said"])
            if "printed" in news:
                self.robot.printed.show(news["printed"])
            if "failed" in news:
                self.failure, self.ending = news["failed"], True
            if "collecting" in news:  # from here on boards end because they are ordered to
                self.ending = True
            if "over" in news:
                self.check()
                self.view.close()
                self.order({"do": "finish"}, listening=True)

    def answered(self, news: dict) -> None:
        """Handle the plant's reply to an order: carried out, or why not."""
        number = news["answer"]
        if isinstance(number, str):  # a restart: "restart MCH"
            name = number.partition(" ")[2]
            self.start_board(name, fresh=True)
            self.order({"do": "revive", "board": name})
            self.view.say(f"{name} restarted at {news['time_s']:.3f} s of the robot's time")
            return
        self.control.answer(number, {"error": news["error"]} if "error" in news else {"time_s": news["time_s"]})

    # --- what becomes of the processes --------------------------------------------------------------------

    def reap(self) -> None:
        """Note every child that ended, stopped or continued."""
        while True:
            try:
                process, status = os.waitpid(-1, os.WNOHANG | os.WUNTRACED | os.WCONTINUED)
            except ChildProcessError:
                return
            if process == 0:
                return
            self.receive_from_plant()  # it may have ordered this child to end since the last read
            child = next((each for each in self.children.values() if each.process == process), None)
            if child is None:
                continue
            if os.WIFSTOPPED(status):
                child.state = STOPPED
                self.view.say(f"{child.name} (process {process}) is stopped by signal {os.WSTOPSIG(status)}: all wait")
            elif os.WIFCONTINUED(status):
                child.state = RUNNING
                self.view.say(f"{child.name} (process {process}) goes on")
            else:
                self.ended(child, os.waitstatus_to_exitcode(status))

    def ended(self, child: Child, code: int) -> None:
        """Handle the end of a child."""
        before, child.state = child.state, GONE
        if child.name == PLANT:
            self.plant_ended(child, code)
            return
        if self.ending and code == 0:
            return
        how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        why = self.why_ended(child.name)
        if before != RESTARTING:
            self.view.say(f"{child.name} (process {child.process}) {how}{': ' + why if why else ''}")
        self.blocks[child.name].private[places.FATE] = places.GONE
        os.eventfd_write(self.blocks[child.name].answer_descriptor, 1)
        if self.ending or self.interrupts or self.has_given_up:
            return
        if before == RESTARTING:
            self.make_room(child)
        elif self.settings.restart == ON_FAILURE:
            self.restarts[child.name] = self.restarts.get(child.name, 0) + 1
            if self.restarts[child.name] > RESTART_LIMIT:
                self.view.say(f"{child.name} ended {RESTART_LIMIT + 1} times: not restarted any more")
            else:
                self.make_room(child)

    def why_ended(self, name: str) -> str:
        """The last report of its board process, or where its program in C was; kept for the summary."""
        block = self.blocks[name]
        if name in self.robot.firmware and block.words[places.CRASH]:
            record = block.words[places.CRASH : places.CRASH + places.CRASH_WORDS].tolist()
            firmware = self.robot.firmware[name]
            block.leave_fault(crash.describe(firmware.library, firmware.folder, record))
        return block.fault()

    def make_room(self, child: Child) -> None:
        """Have the plant's process set the channel back; `answered` starts the new process."""
        child.state = RESTARTING
        self.order({"do": "make_room", "board": child.name, "number": f"restart {child.name}"})

    def plant_ended(self, child: Child, code: int) -> None:
        """Handle the end of the run, normal or not."""
        if self.ending and code >= 0:
            self.exit_code = code
            return
        how = f"was killed by signal {-code}" if code < 0 else f"ended with code {code}"
        self.view.say(f"{PLANT} (process {child.process}) {how}: the run is lost, no files are finished")
        self.exit_code = EXIT_LOST

    def check(self) -> None:
        """Find processes that keep their turn, or are stopped, too long, and show the state."""
        now = wallclock.monotonic_s()
        passed_s, self.polled_s = min(now - self.polled_s, MOST_POLL_S), now
        for each in self.children.values():
            self.check_stopped(each, passed_s)
        for name, block in self.blocks.items():
            child = self.children.get(name)
            if child is None or child.state != RUNNING:
                continue
            turn, awaited = block.private[places.WAITS], block.private[places.AWAITED]
            if not awaited or turn != child.turn:
                child.turn, child.turn_since_s = turn, now
                child.turn_use = use_of(child.process) if awaited else Use()
                child.turn_use_of_plant = self.use_of_plant() if awaited else Use()
                continue
            if self.is_held(name, block.words):
                child.turn_since_s = now
                continue
            held_s = now - child.turn_since_s
            if held_s < HANG_S or kernel.state_of(child.process) in ("T", "t", "Z", ""):
                continue
            plant = self.children.get(PLANT)
            if is_starved(child.process, child.turn_use, HANG_S) or (
                plant is not None and is_starved(plant.process, child.turn_use_of_plant, HANG_S)
            ):
                continue
            used_s = use_of(child.process).time_s - child.turn_use.time_s
            why = cause(block, child.process, held_s, used_s)
            if not child.was_asked:
                block.leave_fault(why)
            self.view.say(f"{name} (process {child.process}) hangs: {why}; it is killed")
            reports_place = name in self.robot.firmware and not child.was_asked
            os.kill(child.process, crash.ASKED if reports_place else signal.SIGKILL)
            child.was_asked = True
            child.turn_since_s = now
        plant = self.children.get(PLANT)
        if not self.ending and plant is not None and plant.state == RUNNING:
            self.check_plant(plant, now)
        self.report_disconnected()
        if not self.ending:
            self.view.show(self.state())

    def use_of_plant(self) -> Use:
        """What the plant's process has had of the processors."""
        return use_of(self.children[PLANT].process) if PLANT in self.children else Use()

    def check_stopped(self, child: Child, passed_s: float) -> None:
        """End the run when a process that is stopped has owed a reply for the deadline.

        The body's process finishes the files; when it is itself the stopped one, none are finished.
        """
        block = self.blocks.get(child.name)
        if child.state != STOPPED or (block is not None and not block.private[places.AWAITED]):
            child.stopped_s = 0.0
            return
        child.stopped_s += passed_s
        if child.stopped_s < DEADLINE_S:
            return
        child.stopped_s = 0.0
        self.has_given_up = True
        self.view.say(
            f"{child.name} (process {child.process}) is stopped and has not replied for {DEADLINE_S:g} s: "
            "it is killed, and the run ends"
        )
        if block is not None:
            block.leave_fault(f"its process was stopped (SIGSTOP) for {DEADLINE_S:g} s")
            self.order({"do": "stop", "lost": child.name})
        os.kill(child.process, signal.SIGKILL)

    def is_held(self, name: str, words: Any) -> bool:
        """Whether a debugger has the board, or is awaited; reported when that begins."""
        if not words[places.HELD] or name in self.robot.firmware:  # in C: it has no endpoint, but can write the word
            self.held.discard(name)
            return False
        if name not in self.held:
            self.held.add(name)
            self.view.say(f"{name} is held by its debugger, or waits for it: all wait")
        return True

    def report_disconnected(self) -> None:
        """Print a line when an endpoint first sends clients away for a reason; the total is reported at the end."""
        endpoints = {**self.status.get("sent_away", {}), "control": dict(self.control.sent_away)}
        for endpoint, counts in endpoints.items():
            reported = self.sent_away.setdefault(endpoint, {})
            for reason in counts.keys() - reported.keys():
                self.view.say(
                    f"{endpoint}: a client {REASONS[reason]}, and was sent away; others of this kind are counted"
                )
            reported.update(counts)

    def check_plant(self, plant: Child, now: float) -> None:
        """Report the plant's process when it makes no progress although no board delays it."""
        progress = self.stage.shown[0][places.HEARTBEAT_NS]
        waits = any(block.private[places.AWAITED] for block in self.blocks.values())
        if progress != self.plant_seen[0] or waits:
            self.plant_seen = (progress, now)
            plant.turn = 0
        elif now - self.plant_seen[1] > HANG_S and plant.turn == 0 and kernel.state_of(plant.process) not in ("T", "t"):
            plant.turn = 1
            self.view.say(f"{PLANT} (process {plant.process}) hangs: no progress for {now - self.plant_seen[1]:.1f} s")

    def state(self) -> dict:
        """Everything the view shows."""
        boards = {}
        for name, block in self.blocks.items():
            words, child, board = block.words, self.children.get(name), self.robot.boards[name]
            bins = words[places.LATENESS : places.LATENESS + places.LATENESS_WORDS]
            boards[name] = {
                "state": child.state if child is not None else ELSEWHERE,
                "process": child.process if child is not None else 0,
                "slots": words[places.SLOT_COUNT],
                "overruns": words[places.OVERRUNS],
                "max_slot_us": words[places.MAX_SLOT_CYCLES] * 1e6 / board.hz,
                "errors": words[places.ERRORS],
                "damaged": words[places.DAMAGED] + self.status.get("damaged", {}).get(name, 0),
                "lateness": figures(bins, words[places.LATE_MAX] / 1000.0),
            }
        return {
            "name": self.settings.name,
            "speed": self.settings.speed,
            "scheduling": self.scheduling,
            "plant": self.children[PLANT].process if PLANT in self.children else 0,
            "boards": boards,
            "requests": self.control.counters(),
            **self.status,
        }

    def obey(self, number: int, request: Any) -> None:
        """Carry out an admitted request of `ranger-sim ctl`; the reply comes at once, or after the plant's."""
        if request.do == "status":
            self.control.answer(number, self.state())
        elif request.do == "restart":
            self.restart(number, request.board)
        else:
            stopped = [child.name for child in self.children.values() if child.state == STOPPED]
            if stopped:
                self.control.answer(number, {"error": f"{', '.join(stopped)} is stopped: all wait for it"})
            elif not self.order({**dataclasses.asdict(request), "number": number}):
                self.control.answer(number, {"error": f"{request.do}: the body's process takes no orders now"})

    def restart(self, number: int, board: str) -> None:
        """Start a new process for a board."""
        child = self.children.get(board)
        if child is None:
            self.control.answer(number, {"error": f"restart: {board} has no process here"})
        elif child.state == RESTARTING:
            self.control.answer(number, {"error": f"restart: {board} is being restarted already"})
        else:
            if child.state == GONE:
                self.make_room(child)
            else:
                child.state = RESTARTING
                os.kill(child.process, signal.SIGKILL)
            self.control.answer(number, {"restarting": child.name})

    def kill_all(self) -> None:
        """Kill all processes that still run."""
        for child in self.children.values():
            if child.state != GONE:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(child.process, signal.SIGKILL)
        for child in self.children.values():
            if child.state != GONE:
                with contextlib.suppress(ChildProcessError):
                    confinement.wait_for(child.process)


def check_platform() -> None:
    """UserError on a platform without processes of this kind."""
    systems.require_linux("up: boards as processes", "eventfd, abstract sockets", "`walk` runs everywhere")
