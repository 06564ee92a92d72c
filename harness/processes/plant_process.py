"""The plant's process: the lockstep, released by the wall clock, with boards in other processes."""

import json
import socket
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import kernel, places
from ranger_sim.harness.processes.pace import Pace
from ranger_sim.harness.processes.remote_board import RemoteBoard
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.stage import Stage
from ranger_sim.harness.stop_rule import StopRule

SLICE_S = 0.0005  # virtual time between two readings of the wall clock: one slot of a motor board
FAST_SLICE_S = 0.005  # the same when there is no pace to keep
STATUS_S = 0.1  # wall clock between two reports to the supervisor
NAP_S = 0.002  # after serving an external connection, before polling it again while virtual time waits
LONGEST_WAIT_S = 0.1  # so that the supervisor sees that the process is alive
ORDERS_LIMIT = 64  # keys and parameters at one time of the robot: a paused robot keeps them; chosen by us
MOST_FAULTS = 255  # of one run, by request; chosen by us: each that waits is checked in every step of the body
KEY_HOLD_NS = 200_000_000  # a firm press
MISUSE = 2  # exit code when something outside cannot be opened
RESET, OPERATING = 1, 0  # modes of a bus node
MOST_REPORTED = 10  # superseded faults in one status; chosen by us: a status stays short
POWER_UP_NS = 1_000_000  # from the start of a restarted process to its board's power


class PlantRun:
    """Runs the wired, never run `robot` against board processes; `link`: the socket to the supervisor."""

    def __init__(self, robot: Any, blocks: dict, stage: tuple, settings: Settings, link: socket.socket) -> None:
        self.robot = robot
        self.blocks = blocks
        self.settings = settings
        self.link = link
        words, doubles = stage
        self.pace = Pace(words, doubles, settings.speed)
        self.stage_words = words
        self.paused = False
        self.stopping = False
        self.lost = ""  # the board whose stopped process ended the run
        self.mourned: set[str] = set()
        self.deaths: list[dict] = []
        self.gave_way: dict[int, str] = {}  # by the fault's number
        robot.deaths = self.deaths
        if robot.printed is not None:
            robot.printed.show = lambda line: self.report(printed=line)  # the supervisor owns the terminal
        self.next_status_s = 0.0
        self.orders = 0  # that changed the robot at `orders_ns` of its time
        self.orders_ns = -1
        self.wall_s = 0.0  # wall clock since the pace began, pauses included
        loop = robot.loop
        show = Stage(words, doubles, robot.plant, loop.step_times, loop.word_wires)
        self.remotes = {
            name: RemoteBoard(board, blocks[name], show, place, board is loop.sampler.board)
            for place, (name, board) in enumerate(robot.boards.items())
        }
        for remote in self.remotes.values():
            loop.replace(remote)
        for name, remote in self.remotes.items():
            if name not in settings.boards:  # it has no process: it is outside, or absent
                remote.leave()
                self.mourned.add(name)
                self.unplug(name)

    # --- passing time -------------------------------------------------------------------------------------

    def run(self, stop: StopRule) -> None:
        """Run until the stop rule, a fall or the supervisor ends it; pausing stops virtual time."""
        robot = self.robot
        slice_s = FAST_SLICE_S if self.settings.speed is None else SLICE_S
        if robot.run(stop, slice_s):  # the first slice starts when all processes are ready
            return
        self.pace.start(robot.loop.time)
        while not self.stopping:
            ahead_s = LONGEST_WAIT_S if self.paused else self.pace.ahead_s(robot.loop.time)
            self.wait(min(ahead_s, LONGEST_WAIT_S))
            if self.paused or ahead_s > LONGEST_WAIT_S or self.stopping:
                continue
            done = robot.run(stop, slice_s)
            self.check_faults()
            if done:
                return
            self.reap()

    def wait(self, seconds: float) -> None:
        """Sleep (not at all when not above 0), and serve the supervisor and external connections meanwhile."""
        now = wallclock.monotonic_s()
        end = now + seconds
        self.stage_words[places.HEARTBEAT_NS] = wallclock.monotonic_ns()
        while True:
            ends = self.robot.polled
            read = [self.link.fileno()]
            write: list[int] = []
            for each in ends:
                read += each.filenos()
                write += each.filenos_to_write() if hasattr(each, "filenos_to_write") else []
            left_over = any(
                getattr(each, "left_over", False) or getattr(each, "connections_wait", False) for each in ends
            )
            ready, writable = descriptors.wait(read, write, min(end - now, NAP_S) if left_over else end - now)
            if read[0] in ready:
                self.receive_orders()
                return
            now = wallclock.monotonic_s()
            if writable or ready or left_over:
                self.robot.poll_now()
                # what a connection cannot accept at this virtual time stays there: no busy loop on it
                if descriptors.wait(read[:1], [], min(NAP_S, end - now))[0]:
                    self.receive_orders()
                    return
                now = wallclock.monotonic_s()
            if now >= self.next_status_s:
                self.next_status_s = now + STATUS_S
                self.report(status=self.status())
            if now >= end:
                return

    # --- the supervisor -----------------------------------------------------------------------------------

    def report(self, **content: Any) -> None:
        """Send a dictionary; while the supervisor is busy a status may be lost, but nothing more."""
        data = json.dumps(content).encode()
        try:
            self.link.send(data, socket.MSG_DONTWAIT if "status" in content else 0)
        except BlockingIOError:
            pass
        except OSError:  # the supervisor has ended, and the kernel is about to end this process
            self.stopping = True

    def receive_orders(self) -> None:
        """Read everything the supervisor has sent."""
        while True:
            try:
                data = self.link.recv(65536, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            except OSError:
                data = b""
            if not data:
                self.stopping = True
                return
            self.obey(json.loads(data))

    def obey(self, order: dict) -> None:
        """Carry out one order; the reply to one that cannot be carried out is the reason."""
        robot, what = self.robot, order["do"]
        if robot.loop.time != self.orders_ns:
            self.orders_ns, self.orders = robot.loop.time, 0
        try:
            if what in ("key", "set", "fault", "clear", "radio"):
                self.orders += 1
                if self.orders > ORDERS_LIMIT:
                    raise UserError(f"{what}: {ORDERS_LIMIT} requests wait for the robot's time to pass")
            if what == "stop":
                self.stopping, self.lost = True, self.lost or order.get("lost", "")
            elif what == "pause":
                self.paused = True
            elif what == "resume":
                if self.paused:
                    self.paused = False
                    self.pace.start(robot.loop.time)
            elif what == "key":
                robot.operator.press(order["key"], robot.loop.time, KEY_HOLD_NS)
            elif what == "set":
                self.set_parameter(order["name"], order["word"])
            elif what == "radio":
                robot.operator.stick = order["stick"]
            elif what == "fault":
                self.arm(order["fault"])
            elif what == "clear":
                self.clear(order["which"])
            elif what == "make_room":
                self.make_room(order["board"])
            elif what == "revive":
                self.revive(order["board"])
            answer = {"answer": order.get("number"), "time_s": robot.time_s}
        except UserError as mistake:
            answer = {"answer": order.get("number"), "error": str(mistake)}
        if order.get("number") is not None:
            self.report(**answer)

    def set_parameter(self, name: str, word: int) -> None:
        """Write a parameter into the main brain's table now; the supervisor's endpoint has checked it."""
        self.robot.write_word(self.robot.names.ids[name], word)

    def arm(self, text: str) -> None:
        """Arm a fault that the supervisor's endpoint has admitted. UserError where it cannot act on this robot."""
        if len(self.robot.faults) > MOST_FAULTS:
            raise UserError(f"fault: {MOST_FAULTS + 1} faults of one run are enough")
        fault = self.robot.catalogue.typed(text)
        fault.gives_way = True
        self.robot.arm(fault)

    def clear(self, which: int) -> None:
        """End a fault with the next step of the body."""
        faults = self.robot.faults
        if which >= len(faults):
            raise UserError(f"clear: there is no fault {which}; {len(faults)} were armed, counted from 0")
        faults[which].stop()

    def check_faults(self) -> None:
        """Report a requested fault that another has superseded since the last poll: it never begins."""
        for number, fault in enumerate(self.robot.faults):
            if fault.gave_way_ns >= 0 and number not in self.gave_way:
                at_s = (fault.gave_way_ns - self.robot.start_ns) * 1e-9
                self.gave_way[number] = f"fault {number}, {fault.text()}, gave way at {at_s:.3f} s: {fault.gave_way_to}"
                self.report(said=self.gave_way[number])

    def status(self) -> dict:
        """What the live view shows."""
        robot = self.robot
        return {
            "time_s": robot.time_s,
            "time_ns": robot.loop.time,
            "at_s": wallclock.monotonic_s(),
            "steps": robot.steps,
            "distance_m": robot.distance_m,
            "speed_m_per_s": robot.mean_speed_m_per_s(),
            "behind_s": max(0.0, -self.pace.ahead_s(robot.loop.time)),
            "paused": self.paused,
            "gave_way": list(self.gave_way.values())[-MOST_REPORTED:],
            "buses": self.loads(),
            "ends": [end.counters() for end in robot.polled],
            "sent_away": sent_away(robot.polled),
            "damaged": {name: remote.from_board.damaged for name, remote in self.remotes.items()},
            "damage": [remote.from_board.last_damage for remote in self.remotes.values() if remote.from_board.damaged],
        }

    def loads(self) -> dict:
        """Load in the latest 10 ms and error frames of every bus, inside and outside."""
        outside = {end.name: end for end in self.robot.polled if hasattr(end, "window_load")}
        found = {}
        for bus in self.robot.buses:
            if bus.name in outside:
                found[bus.name] = {"load": outside[bus.name].window_load, "errors": outside[bus.name].errors}
            else:
                load = bus.load.windows()[-1] if bus.load.count else 0.0
                found[bus.name] = {"load": load, "errors": bus.counters.errors}
        return found

    # --- boards that are gone -----------------------------------------------------------------------------

    def nodes_of(self, name: str) -> list:
        """Return (bus, node) of every controller of a board."""
        wires = self.robot.loop.wires[self.robot.loop.place(name)]
        return [(bus, wires.nodes[controller]) for controller, bus in enumerate(wires.buses) if bus is not None]

    def reap(self) -> None:
        """Take lost boards off their buses; their pins keep their levels, so their watchdog lines stay constant."""
        for name, remote in self.remotes.items():
            if remote.gone and name not in self.mourned:
                self.mourned.add(name)
                self.deaths.append({"board": name, "time_s": self.robot.time_s, "why": self.blocks[name].fault()})
                self.unplug(name)
                self.report(gone=name, time_s=self.robot.time_s)

    def unplug(self, name: str) -> None:
        """Take the controllers of a board off the emulated buses."""
        for bus, node in self.nodes_of(name):
            bus.set_mode(node, RESET, self.robot.loop.time)

    def make_room(self, name: str) -> None:
        """Reset the channel of a board whose old process has ended, for a new one."""
        remote = self.remotes[name]
        remote.leave()
        self.reap()
        remote.reset_channel()

    def revive(self, name: str) -> None:
        """Power up a board that has a process again, a millisecond from now."""
        remote = self.remotes[name]
        power_up_ns = self.robot.loop.time + POWER_UP_NS
        self.blocks[name].words[places.POWER_UP] = power_up_ns
        remote.come_back(self.robot.loop.time, power_up_ns)
        self.mourned.discard(name)
        for bus, node in self.nodes_of(name):
            bus.set_mode(node, OPERATING, self.robot.loop.time)
        if remote.activity().sinks:  # its new process keeps a log from here on
            remote.activity().flush()

    # --- the end ------------------------------------------------------------------------------------------

    def collect(self) -> None:
        """Bring every board to the plant's time, fetch its counters, and let its process end."""
        if self.robot.polled:
            self.robot.poll_now()
        for end in self.robot.polled:
            if hasattr(end, "drain"):
                end.drain(self.robot.loop.time)
        for remote in self.remotes.values():
            remote.catch_up(self.robot.loop.time)
            remote.fetch_counters()
            if remote.activity().sinks:
                remote.activity().flush()
            remote.dismiss()


def sent_away(ends: list) -> dict[str, dict[str, int]]:
    """Clients that were sent away, by endpoint and reason."""
    found: dict[str, dict[str, int]] = {}
    for end in ends:
        for reason, count in getattr(end, "sent_away", {}).items():
            counts = found.setdefault(end.kind, {})
            counts[reason] = counts.get(reason, 0) + count
    return found


def serve(
    robot: Any,
    blocks: dict,
    stage: tuple,
    settings: Settings,
    link: socket.socket,
    stop: StopRule,
    begin: Callable[[Any], None],
    finish: Callable[[Any, "PlantRun", bool], int],
) -> int:
    """Run the plant's process from start to end; returns its exit code: that of `finish`.

    `begin(robot)` opens external connections in the process that will use them; its UserError ends the run with code 2.
    """
    kernel.begin_process("ranger-plant", settings)
    run = PlantRun(robot, blocks, stage, settings, link)
    try:
        begin(robot)
    except UserError as mistake:
        run.report(failed=str(mistake))
        return MISUSE
    started = wallclock.monotonic_s()
    run.run(stop)
    run.wall_s = wallclock.monotonic_s() - started
    interrupted = run.stopping and not run.lost
    run.report(collecting=True)
    run.collect()
    kernel.be_ordinary()
    run.report(over=True, status=run.status())
    link.setblocking(True)
    while True:  # the supervisor owns the terminal until it releases it
        data = link.recv(65536)
        if not data or json.loads(data)["do"] == "finish":
            break
    return finish(robot, run, interrupted)
