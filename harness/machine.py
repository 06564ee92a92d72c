"""Any machine: boards, buses and a plant, wired by tables, on one clock. Ranger is one (ranger/robot.py).

    machine = Machine(
        plant=Servo(),
        boards={"DRIVE": NativeBoard("DRIVE", library), "CONTROL": ...},
        buses={"can1": 500_000},
        wiring=Wiring(can=[CanWire("DRIVE", 1, 1), CanWire("CONTROL", 1, 1)], ...),
    )
    machine.until("angle_rad > 0.5", within="2 s")

examples/servo is a whole one.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from ranger_sim.can_bus.bus import Bus
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER, STAGE_BUS
from ranger_sim.foundation.quantities import Duration, duration_ns, duration_text
from ranger_sim.foundation.user_error import BoardFailure, UserError, unknown
from ranger_sim.harness import lockstep, waiting
from ranger_sim.harness.faults import network_places
from ranger_sim.harness.faults.catalogue import Catalogue
from ranger_sim.harness.faults.error_rows import ErrorRows, StateWord
from ranger_sim.harness.faults.fault import Fault, Place
from ranger_sim.harness.firmware.fresh_board import first_outputs, pass_on
from ranger_sim.harness.names import Names
from ranger_sim.harness.outside.machine import leave_out
from ranger_sim.harness.processes.modes import InProcess
from ranger_sim.harness.records.logbook import Logbook
from ranger_sim.harness.records.recorder import Recorder
from ranger_sim.harness.records.sampler import Sampler
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.harness.waiting import Condition, ConditionNotMetError, Waiting, Wanted
from ranger_sim.harness.wiring.wires import CanWire, Wiring

GRID_NS = 20_000_000  # actions from outside happen on this grid, so that a run does not depend on how it is sliced


class Machine:
    """One machine. Same parts and seed, same bytes. Close it when done (or use contextlib.closing).

    boards: {name: Board}, in the order in which they run and are sorted within one time. buses: {name: bit/s}, or of a
    CAN FD bus {name: (bit/s, bit/s of the data)}, with names can1, can2, ...; seed: of crystals, noise and faults, as
    far as the parts take it from here; log: "none", "window" (the last seconds in memory) or "full" (on disk),
    `logbook`'s frames and samples.
    words: (how many, board): the memory of a board that the log keeps as well. names: of frames and errors, as
    `Names.of(load_table(folder))` has them; without, frames have only numbers. places: where faults can be.
    mode: where its boards run.

    `deaths`: of each board whose process or program has ended by itself, in order: {"board", "time_s", "how" it ended,
    "why"}, the last as far as its program or its records report it.
    """

    firmware: Mapping[str, Any] = MappingProxyType({})  # programs in C whose crashes are located, by board
    printed: Any = None  # takes what these print
    lost = False  # a part of it that runs elsewhere is gone: it can pass no more time

    def __init__(
        self,
        plant: Any,
        boards: Mapping[str, Any],
        buses: Mapping[str, int | tuple[int, int]],
        wiring: Wiring,
        seed: int = 0,
        log: str = "none",
        words: tuple[int, Any] = (0, None),
        names: Names | None = None,
        places: Iterable[Place] = (),
        mode: InProcess | None = None,
    ) -> None:
        self.plant = plant
        self.boards: dict[str, Any] = dict(boards)
        self.seed = seed
        self.mode = mode if mode is not None else InProcess()
        self.backend = self.mode.backend  # harness/testing/backends.py
        self.deaths: list[dict[str, Any]] = []
        self.start_ns: int = plant.time_ns
        for number, name in enumerate(buses, start=1):
            if name != f"can{number}":
                raise UserError(f"machine: bus {number} is called {name!r}, expected is can{number}")
        for name, board in self.boards.items():
            if board.name != name:
                raise UserError(f"machine: board {name!r} is named {board.name!r}")
        self.recorder = Recorder(len(buses), len(plant.sample_names), words[0])
        self.buses: list[Any] = [bus_of(name, rates, seed) for name, rates in buses.items()]
        for bus, stream in zip(self.buses, self.recorder.frames, strict=True):
            bus.log.stream = stream
            bus.reset_statistics(self.start_ns)  # loads count from the start of the run
        self.logbook = Logbook(self.recorder, log)
        kept = self.recorder.words if self.logbook.records_words and words[1] is not None else None
        accept_lists(plant)
        sampler = Sampler(plant, words[1], self.recorder.samples, kept, self.start_ns)
        started = {name: first_outputs(board) for name, board in self.boards.items()}
        self.loop: Any = lockstep.Lockstep(plant, list(self.boards.values()), self.buses, sampler, self.start_ns)
        self.wiring = wiring
        try:
            self._connect()
        except BaseException:
            self.logbook.close()
            raise
        for name, messages in started.items():  # what the boards' programs put out while they started
            pass_on(messages, self.boards[name].outbox, self.start_ns)
        self.faults: list[Any] = []  # armed so far
        self.pace: Any = None  # an `outside.Pace` slows virtual time down to the wall clock's
        self.polled: list[Any] = []  # ends of wires that leave the simulation
        self.poll_due: list[int] = []  # when each of them wants the next poll, ns
        self.next_poll_ns = self.start_ns
        self.names = names if names is not None else Names()
        self.catalogue = Catalogue(
            [*places, *network_places.controllers(wiring.can), *network_places.buses(len(buses))], self.condition
        )
        self.slot_views: dict[str, Any] = {}  # of boards whose slots are recorded
        self.observed: Any = None  # what harness.testing keeps with it: the last frames, what was measured
        self.cpu_s = 0.0
        self.wall_s = 0.0
        self.ended = ""

    def _connect(self) -> None:
        """Connect every wire of the tables."""
        loop, wiring = self.loop, self.wiring
        place = {name: number for number, name in enumerate(self.boards)}
        for name in wiring.receive_in_slots:
            if self.waits_for_slots(self._wired(name)):
                loop.receives_in_its_slots(self.boards[name])
        for wire in wiring.encoders:
            pins = (wiring.number(wire.board, wire.pin_a), wiring.number(wire.board, wire.pin_b))
            loop.connect_encoder(self._part("encoders", wire.encoder), self._wired(wire.board), *pins)
        for analog in wiring.analog:
            board = self._wired(analog.board)
            loop.connect_voltage(analog.voltage, board, wiring.number(analog.board, analog.input))
        for word in wiring.words:
            loop.connect_word(word.word, self._wired(word.board), wiring.number(word.board, word.register))
        for can_wire in wiring.can:
            board = self._wired(can_wire.board)
            if not 1 <= can_wire.bus <= len(self.buses):
                raise UserError(f"wiring: {can_wire}: there are buses 1 to {len(self.buses)}")
            bus = self.buses[can_wire.bus - 1]
            order = STAGE_BUS * 256 + 16 * place[can_wire.board] + can_wire.controller
            node = bus.add_node(can_wire.board, board.inbox, can_wire.controller, order)
            if bus.is_fd:
                self._check_rates(can_wire, bus, node)
            loop.wires[place[can_wire.board]].connect_bus(can_wire.controller, bus, node)
        for bridge in wiring.bridges:
            self._wired(bridge.board)
            pins3 = [wiring.number(bridge.board, pin) for pin in bridge[2:]]
            loop.wires[place[bridge.board]].connect_drive(self._part("bridges", bridge.bridge), *pins3)
        if (link := wiring.link) is not None:
            loop.connect_link(self._wired(link.master), self._wired(link.slave), link.exchange_ns, link.idle())
        if (imu := wiring.imu) is not None:
            from ranger_sim.harness.wiring.imu_wire import ImuWire  # only here: it loads the unit of the body

            board = self._wired(imu.board)
            loop.connect_serial_device(ImuWire(self.plant.imu, board, imu.uart), board, imu.uart)

    def _check_rates(self, wire: CanWire, bus: Any, node: int) -> None:
        """Compare the bit rates of a controller on a CAN FD bus with the bus's; a classic one is a classic node."""
        rates = self.boards[wire.board].can_rates(wire.controller)
        if rates is None:
            bus.set_classic(node)
        elif rates != (bus.bitrate, bus.data_bitrate):
            raise UserError(
                f"wiring: {wire.board} starts its CAN FD controller {wire.controller} with {rates[0]} and {rates[1]} "
                f"bit/s, and {bus.name} has {bus.bitrate} and {bus.data_bitrate}"
            )

    def waits_for_slots(self, board: Any) -> bool:
        """Whether a board in `receive_in_slots` has a program that is known to wait for its tasks."""
        return True

    def _wired(self, name: str) -> Any:
        """A board that the wiring names."""
        if name not in self.boards:
            raise UserError(f"wiring: {unknown('board', name, self.boards)}")
        return self.boards[name]

    def _part(self, kind: str, number: int) -> Any:
        """Part `number` of a list of the plant."""
        parts = getattr(self.plant, kind)
        if not 0 <= number < len(parts):
            raise UserError(f"wiring: {kind} {number}: the plant has {len(parts)} of them")
        return parts[number]

    # --- passing time -------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start a process for each board that is to have its own, if that has not been done."""
        self.mode.start(self)

    def act(self, end_ns: int) -> None:
        """Act from outside; subclasses override it. Called once before each 20 ms of virtual time."""

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass up to `slice_s` of virtual time; True when the stop rule is met or the machine can go no further."""
        __tracebackhide__ = True
        self.start()
        with self.mode.passing_time(self):
            done = self._run(stop, slice_s)
        self.mode.after_run(self)
        return done

    def _run(self, stop: StopRule, slice_s: float) -> bool:
        if self.ended:
            return True
        loop = self.loop
        loop.stop_at(stop.steps, stop.distance_m)
        limit = NEVER if stop.time_s is None else self.start_ns + round(stop.time_s * 1e9)
        until = min(loop.time + round(slice_s * 1e9), limit)
        cpu, wall = wallclock.process_cpu_s(), wallclock.monotonic_s()
        reason = lockstep.REACHED_TIME
        if self.pace is not None:
            self.pace.begin(loop.time)
        while loop.time < until and reason == lockstep.REACHED_TIME:
            end = self.start_ns + ((loop.time - self.start_ns) // GRID_NS + 1) * GRID_NS
            self.act(end)
            if self.pace is not None:
                end = min(end, self.pace.release(loop.time))
            if self.polled:
                end = min(end, self._poll())
            reason = self._pass_time(min(end, until))
        self.cpu_s += wallclock.process_cpu_s() - cpu
        self.wall_s += wallclock.monotonic_s() - wall
        if reason == lockstep.FELL:
            self.ended = self.plant.fall_cause or "fell"
        elif reason != lockstep.REACHED_TIME or loop.time >= limit:
            return True
        return bool(self.ended)

    def _pass_time(self, until: int) -> int:
        """Run the loop; a board whose program cannot go on loses its power, and the rest goes on."""
        while True:
            try:
                return int(self.loop.run(until))
            except BoardFailure as failure:
                leave_out(self, failure.board)
                self.deaths.append(
                    {"board": failure.board, "time_s": self.time_s, "how": "stopped", "why": failure.text}
                )

    def run_for(self, duration: Duration) -> None:
        """Pass this much virtual time ("20 ms", or a number of seconds), or less when the machine can go no further."""
        seconds = duration_ns(duration, "run_for") * 1e-9
        self.run(StopRule(time_s=self.time_s + seconds), seconds)

    def condition(self, wanted: Wanted) -> Condition:
        """The condition described by `wanted` (harness/waiting.py)."""
        return waiting.condition(wanted, self.plant.sample_names, self.names, tuple(self.boards))

    def until(self, wanted: Wanted, within: Duration = "60 s") -> float:
        """Pass time until a condition holds; returns the virtual time since power-up, s.

        ConditionNotMetError, an AssertionError, when it does not hold `within` this time from now, or the machine can
        go no further before. It is checked between two steps of the plant.
        """
        __tracebackhide__ = True
        wanted = self.condition(wanted)
        begun_ns, patience_ns = self.loop.time, duration_ns(within, "until: within")
        stop = StopRule(time_s=(begun_ns + patience_ns - self.start_ns) * 1e-9) if patience_ns else None
        with self.mode.waiting_for(self, wanted):
            waited = Waiting(self, wanted)
            self.loop.watchers.append(waited)
            try:
                if stop is not None:
                    self.run(stop, patience_ns * 1e-9)
            finally:
                self.loop.watchers.remove(waited)
        if not waited.met and not waited.wanted.met():
            passed = duration_text(self.loop.time - begun_ns)
            why = f"{self.end_word} ({self.ended}) after" if self.ended else "not within"
            raise ConditionNotMetError(f"{waited.wanted.text}: {why} {passed}; {waited.wanted.nearest()}")
        return self.time_s

    end_word, end_name = "the machine stopped", "its end"

    def whereabouts(self) -> str:
        """Its progress in addition to the time, as the end of a message; empty where the time suffices."""
        return ""

    @property
    def time_s(self) -> float:
        """Virtual time since power-up, s."""
        return (self.loop.time - self.start_ns) * 1e-9

    def realtime_factor(self) -> float:
        """Virtual seconds per wall-clock second of the stepping loop."""
        return self.time_s / self.wall_s if self.wall_s > 0.0 else 0.0

    # --- external connections------------------------------------------------------------------------------

    def attach(self, end: Any) -> None:
        """Call `end.poll(now_ns)` from now on as often as it requests; it returns the time of its next poll."""
        self.polled.append(end)
        self.poll_due.append(self.loop.time)
        self.next_poll_ns = self.loop.time

    def _poll(self) -> int:
        """Poll every external connection that is due; returns until when the loop may run."""
        now: int = self.loop.time
        if now >= self.next_poll_ns:
            for place, end in enumerate(self.polled):
                if now >= self.poll_due[place]:
                    self.poll_due[place] = end.poll(now)
            self.next_poll_ns = max(now + lockstep.WINDOW_NS, min(self.poll_due))
        return self.next_poll_ns

    def poll_now(self) -> None:
        """Poll every external connection at once: something waits at one of them."""
        self.next_poll_ns = self.loop.time
        self.poll_due = [self.loop.time] * len(self.polled)
        self._poll()

    # --- inspection and changes ---------------------------------------------------------------------------

    def board(self, name: str) -> Any:
        """The board of this name. UserError for any other, or a board whose memory is in another process."""
        if name not in self.boards:
            raise UserError(unknown("board", name, self.boards))
        self.mode.check_reach(name)
        return self.boards[name]

    def quantities(self) -> dict[str, float]:
        """What the body shows now, by name (`Plant.sample_names` has the units)."""
        row = self.loop.sampler.row
        self.plant.fill_sample(row)
        return dict(zip(self.plant.sample_names, row, strict=False))

    def replace(
        self, board: Any, task: str, function: Callable[[], int | None], cost: int, limit: int | None = None
    ) -> None:
        """Put your own function in a schedule entry of a board; it declares its cost in cycles."""
        self.mode.check_replace(board, task)
        self.board(board).scheduler.replace(task, function, cost=cost, limit=limit)

    def counters(self) -> dict[str, Any]:
        """Every board's counters until now, by its name; also of a board that runs in another process."""
        self.mode.fetch_counters()
        return {name: self.loop.board(name).counters() for name in self.boards}

    def slots(self, board: Any) -> Any:
        """The slots of a board from the first request for them on: a
        `harness.timing.machine_slots.MachineSlots`.
        """
        if board not in self.slot_views:
            from ranger_sim.harness.timing.machine_slots import slot_view  # numpy: only where slots are used

            self.slot_views[board] = slot_view(self, board)
        return self.slot_views[board]

    def wire(self, bus: str = "can1", since_s: float | None = None) -> Any:
        """Frames on a bus, their periods and latencies, as assertions: a `harness.testing.wire.Wire`.

        Frames of the last 20 s are kept from the first call on, or from power-up with log="full" and in a machine that
        harness.testing made. since_s: in time since power-up; UserError where no frames are kept that far back.
        """
        from ranger_sim.harness.testing.wire import wire_of

        return wire_of(self, bus, since_s)

    def timeline(self, last_s: float | None = None, detail_s: float | None = None) -> Any:
        """A `MachineTimeline` that keeps the last `last_s` seconds of virtual time, or everything (None).

        detail_s: what processors, buses and links do is kept for so long before the end, and around the first faults.
        """
        from ranger_sim.harness.timeline.machine_timeline import MachineTimeline

        return MachineTimeline(self, last_s, detail_s)

    def inject(
        self,
        place: str | Place,
        mode: str | type[Fault],
        at: Wanted | None = None,
        until: Wanted | None = None,
        proof: bool = False,
        **parameters: Any,
    ) -> Fault:
        """Arm a fault: `mode` at `place` from the condition `at` on (None: at once) `until` another one or for a
        length, as "+50 ms" (None: it stays). UserError for an unknown place, mode, parameter or value. The
        Fault reports its result: `acted`, the stamps, the largest difference at its place.

        Both are names of the machine's catalogue, or a `Place` and a class of faults (harness/faults/fault.py).

        proof: it then also has `detected`, `detection_ms`, `reaction` and the rest of its `proof()`: a forked
        process is the machine without it, both are recorded from now on (2 MB a second each of Ranger), until `close`.

        Processes of boards start now, so that a fault that would have to be inside one is refused.
        """
        self.start()
        if isinstance(mode, str):
            fault = self.catalogue.fault(place, mode, at, until, parameters)
        else:
            where = self.catalogue.find(place) if isinstance(place, str) else place
            fault = mode.asked(where, at, until, parameters, self.condition)
        if proof:
            from ranger_sim.harness.faults.twin import Twin

            fault.twin = Twin(self)
        return self.arm(fault)

    def arm(self, fault: Any) -> Any:
        """Arm a fault (harness/faults/fault.py)."""
        fault.arm(self)
        self.faults.append(fault)
        return fault

    def machines(self) -> dict[str, StateWord]:
        """The state machines of the board whose memory the log keeps, by name."""
        return {}

    def fell_ns(self) -> int:
        """When the plant could go no further, ns; -1: it can."""
        return int(self.loop.time) if self.plant.fell else -1

    def error_watch(self) -> Any:
        """A StepWatch whose `rows` hold each board's errors and their times from now on."""
        return ErrorRows(self.loop.boards, max(self.names.errors, default=-1) + 1)

    def trace_digest(self) -> str:
        """BLAKE2b-256 of the canonical trace so far."""
        digest: str = self.recorder.trace_digest()
        return digest

    def close(self) -> None:
        """Close the log's files, external connections, processes of boards, and the golden runs of faults."""
        self.mode.close()
        self.logbook.close()
        for end in self.polled:
            end.close()
        for fault in self.faults:
            if fault.twin is not None:
                fault.twin.close()


def bus_of(name: str, rates: int | tuple[int, int], seed: int) -> Bus:
    """A bus of `rates` bit/s, or, with two of them, a CAN FD bus. UserError for rates that a bus cannot have."""
    nominal, data = rates if isinstance(rates, tuple) else (rates, 0)
    try:
        return Bus(name, nominal, seed, log_capacity=0, data_bitrate=data)
    except ValueError as error:
        raise UserError(f"machine: {error}") from None


def accept_lists(plant: Any) -> None:
    """Give a body's `fill_sample` in Python a numpy array: a buffer refuses `row[:2] = [angle, rate]`."""
    fill = plant.fill_sample
    # a body of the package has no __dict__, neither compiled nor interpreted
    if inspect.isfunction(getattr(type(plant), "fill_sample", None)) and hasattr(plant, "__dict__"):
        plant.fill_sample = lambda row: fill(np.asarray(row))
