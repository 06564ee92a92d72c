"""The whole robot, wired: seven boards, four buses, one link, one body.

Follow the loop here: `Ranger.__init__` builds the plant, the boards and the buses and connects them by the
tables of harness/wiring.py; `harness/lockstep.py` then passes time and carries what goes over the wires.
"""

import difflib
import os
from collections.abc import Callable, Mapping
from typing import Any, Literal, overload

from ranger_sim import datatable
from ranger_sim.boards.can_router import CanRouterBoard
from ranger_sim.boards.counters import RangerCounters
from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.inner_feet import InnerFeetBoard
from ranger_sim.boards.main_brain import controllers
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.main_brain.programs import program
from ranger_sim.boards.modules.ssp_link import EXCHANGE_NS, empty_segment
from ranger_sim.boards.outer_feet import OuterFeetBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.steering import SteeringBoard
from ranger_sim.boards.user_interface import UserInterfaceBoard
from ranger_sim.can_bus.bus import Bus
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.firmware_sim.clock import seeded_crystal
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import NEVER, STAGE_BUS
from ranger_sim.foundation.quantities import duration_text, nanoseconds
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import bus_schedule, lockstep, native_boards, wiring
from ranger_sim.harness.conditions import Condition, ConditionNotMetError, Waiting, condition
from ranger_sim.harness.faults import catalogue
from ranger_sim.harness.faults.fault import Fault
from ranger_sim.harness.fresh_board import first_outputs, pass_on
from ranger_sim.harness.logbook import Logbook
from ranger_sim.harness.native_boards import Firmware
from ranger_sim.harness.operator import Operator
from ranger_sim.harness.profile import Profile
from ranger_sim.harness.recorder import Recorder
from ranger_sim.harness.sampler import Sampler
from ranger_sim.harness.scenario import Scenario, StopRule
from ranger_sim.harness.timing.robot_slots import RobotSlots, slot_view
from ranger_sim.plant import body_files
from ranger_sim.plant.ranger import RangerPlant

BUS_BIT_RATE = 3_000_000  # bit/s, appendix 3.11
# Boards get their power together but their resets and start-up code differ: first slots spread over 2 ms.
POWER_UP_SPREAD_NS = 2_000_000
GRID_NS = 20_000_000  # the operator acts on this grid, so that a run does not depend on how it is sliced

BoardName = Literal["MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"]
BOARD_CLASSES: dict[str, Any] = {
    "MCH": HipBoard,
    "MCFO": OuterFeetBoard,
    "MCFI": InnerFeetBoard,
    "MCSI": SteeringBoard,
    "UI": UserInterfaceBoard,
    "CSR": CanRouterBoard,
    "MB": MainBrainBoard,
}


class Ranger:
    """One robot in one scenario. Same scenario, same bytes. Close it when done (or use contextlib.closing)."""

    backend = "sim"  # what it runs on; harness/testing/backends.py has the others
    lost = False  # a part of it that runs elsewhere is gone: it can pass no more time

    def __init__(
        self,
        scenario: Scenario | None = None,
        log: str = "none",
        quirks: Quirks | None = None,
        profile: Profile | None = None,  # its bit rates and schedules; boards that it has outside are emulated here
        firmware: Mapping[str, Firmware | str | os.PathLike] | None = None,  # boards that run C, by folder
    ) -> None:
        self.scenario = scenario if scenario is not None else Scenario()
        self.controller = controllers.load(self.scenario.controller)
        # the controller's program brings its estimator with it
        self.quirks = program(self.controller.program).switches(quirks if quirks is not None else Quirks())
        self.start_ns = self.scenario.start_uptime_ms * 1_000_000
        seed = self.scenario.seed

        # plant -> sensors
        self.body = body_files.load(self.scenario.body)
        datatable.check_own_table()
        self.plant = RangerPlant(
            seed=seed,
            slope_rad=self.scenario.slope_rad,
            floor_roughness_m=self.scenario.floor_roughness_m,
            model_file=self.scenario.model_file,
            start_ns=self.start_ns,
            parameters=self.body.parameters,
            electrics=self.scenario.electrics(self.body.electrics),
        )
        self.firmware: dict[str, Firmware] = native_boards.built(firmware if firmware is not None else {})
        # interrupts and slots: each board on its own crystal, powered up in its own moment
        self.boards: dict[str, Any] = {
            name: self.new_board(name, self.start_ns + self._stream(name)[1]) for name in BOARD_CLASSES
        }
        self.boards["CSR"].time.ms = self.scenario.start_uptime_ms
        said = {name: first_outputs(self.boards[name]) for name in self.firmware}  # while their programs started
        # CAN
        self.profile = profile
        rates = {name: bus.bit_rate for name, bus in profile.buses.items()} if profile is not None else {}
        names = ("can1", "can2", "can3", "can4")
        self.recorder = Recorder(len(names), len(self.plant.sample_names), all_variables.TABLE_SIZE)
        self.buses: list[Any] = [Bus(name, rates.get(name, BUS_BIT_RATE), seed, log_capacity=0) for name in names]
        for bus, stream in zip(self.buses, self.recorder.frames, strict=True):
            bus.log.stream = stream
            bus.reset_statistics(self.start_ns)  # loads count from the start of the run
        self.logbook = Logbook(self.recorder, log)
        words = self.recorder.words if self.logbook.records_words else None
        sampler = Sampler(self.plant, self.boards["MB"], self.recorder.samples, words, self.start_ns)
        boards = [self.boards[name] for name in wiring.BOARDS]
        self.loop: Any = lockstep.Lockstep(self.plant, boards, self.buses, sampler, self.start_ns)
        self._connect()
        for name, messages in said.items():
            pass_on(messages, self.boards[name].outbox, self.start_ns)
        if profile is not None:
            for board in self.boards.values():
                bus_schedule.apply(board, profile.schedules())
        self.operator = Operator(self.controller.operator, self.plant, self.boards["UI"], self.start_ns, seed)
        self.faults: list[Fault] = []  # armed so far
        self.slot_views: dict[str, RobotSlots] = {}  # of boards whose slots are recorded
        self.observed: Any = None  # what harness.testing keeps beside it: the last frames, what was measured
        self.polled: list[Any] = []  # ends of wires that lead out of the simulation
        self.poll_due: list[int] = []  # when each of them asked to be looked at next, ns
        self.next_poll_ns = self.start_ns
        self.cpu_s = 0.0
        self.wall_s = 0.0
        self.ended = ""

    def _stream(self, board: str) -> tuple[Any, int]:
        """(crystal, power-up instant after the robot's in ns) of a board, drawn from the scenario's seed."""
        stream = RandomStream(self.scenario.seed, f"board {board}")
        return seeded_crystal(stream), stream.integer(POWER_UP_SPREAD_NS)

    def new_board(self, name: str, power_up_ns: int) -> Any:
        """A board fresh from the shelf, with its own crystal, powered up at `power_up_ns`; not wired."""
        crystal = self._stream(name)[0]
        if name in self.firmware:
            from ranger_sim.harness.robot_native_board import RobotNativeBoard  # only here: it loads cffi

            return RobotNativeBoard(name, self.firmware[name], crystal, power_up_ns)
        if name == "MB":
            return MainBrainBoard(crystal, self.quirks, power_up_ns, controller=self.controller)
        return BOARD_CLASSES[name](crystal, self.quirks, power_up_ns)

    def _connect(self) -> None:
        """Solder every wire of the tables."""
        loop, boards = self.loop, self.boards
        place = {name: number for number, name in enumerate(wiring.BOARDS)}
        for name in wiring.HEAR_IN_SLOTS:
            if name not in self.firmware or boards[name].scheduler.announces:  # else its handlers may send
                loop.hears_in_its_slots(boards[name])
        for wire in wiring.ENCODERS:
            pins = wiring.PINS[wire.board]
            encoder = self.plant.encoders[wire.encoder]
            loop.connect_encoder(encoder, boards[wire.board], pins[wire.pin_a], pins[wire.pin_b])
        for analog in wiring.ANALOG:
            channel = wiring.ANALOG_INPUTS[analog.board][analog.input]
            loop.connect_voltage(analog.voltage, boards[analog.board], channel)
        for word in wiring.WORDS:
            loop.connect_word(word.word, boards[word.board], wiring.WORD_REGISTERS[word.register])
        for can_wire in wiring.CAN:
            board, bus = boards[can_wire.board], self.buses[can_wire.bus - 1]
            node = bus.add_node(
                can_wire.board,
                board.inbox,
                can_wire.controller,
                STAGE_BUS * 256 + 16 * place[can_wire.board] + can_wire.controller,
            )
            loop.wires[place[can_wire.board]].connect_bus(can_wire.controller, bus, node)
        pins = wiring.MOTOR_PINS
        for name, motor in wiring.MOTORS.items():
            loop.wires[place[name]].connect_drive(
                self.plant.motors[motor].drive, pins["motor_watchdog"], pins["low_side_2"], pins["low_side_6"]
            )
        loop.connect_link(boards["CSR"], boards["MB"], EXCHANGE_NS, empty_segment())
        loop.connect_imu(self.plant.imu, boards[wiring.IMU_BOARD], wiring.IMU_UART)
        loop.watch_strikes(boards["MB"])

    # --- passing time -------------------------------------------------------------------------------------

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass up to `slice_s` of virtual time; True when the stop rule is met or the robot fell."""
        if self.ended:
            return True
        loop = self.loop
        loop.stop_at(stop.steps, stop.distance_m)
        limit = NEVER if stop.time_s is None else self.start_ns + round(stop.time_s * 1e9)
        until = min(loop.time + round(slice_s * 1e9), limit)
        cpu, wall = wallclock.process_cpu_s(), wallclock.monotonic_s()
        reason = lockstep.REACHED_TIME
        while loop.time < until and reason == lockstep.REACHED_TIME:
            end = self.start_ns + ((loop.time - self.start_ns) // GRID_NS + 1) * GRID_NS
            self.operator.act(end)
            if self.polled:
                end = min(end, self._poll())
            reason = loop.run(min(end, until))
        self.cpu_s += wallclock.process_cpu_s() - cpu
        self.wall_s += wallclock.monotonic_s() - wall
        if reason == lockstep.FELL:
            self.ended = self.plant.fall_cause or "fell"
        elif reason != lockstep.REACHED_TIME or loop.time >= limit:
            return True
        return bool(self.ended)

    def until(self, wanted: str | Condition | Callable[[Any], Any], within: str = "60 s") -> float:
        """Pass time until a condition holds (harness/conditions.py); returns the virtual time since power-up, s.

        ConditionNotMetError, an AssertionError, when it does not hold `within` this time from now, or the robot falls
        before. It is looked at every 250 us, between two steps of the plant.
        """
        __tracebackhide__ = True
        waiting = Waiting(self, condition(wanted))
        begun_ns, patience_ns = self.loop.time, nanoseconds(within, "until: within")
        stop = StopRule(time_s=(begun_ns + patience_ns - self.start_ns) * 1e-9) if patience_ns else None
        self.loop.watchers.append(waiting)
        try:
            if stop is not None:
                self.run(stop, patience_ns * 1e-9)
        finally:
            self.loop.watchers.remove(waiting)
        if not waiting.met and not waiting.wanted.met():
            passed = duration_text(self.loop.time - begun_ns)
            why = f"the robot fell ({self.ended}) after" if self.ended else "not within"
            raise ConditionNotMetError(f"{waiting.wanted.text}: {why} {passed}; {waiting.wanted.nearest()}")
        return self.time_s

    def inject(
        self,
        place: str,
        mode: str,
        at: str | Condition | Callable[[Any], Any] | None = None,
        until: str | Condition | Callable[[Any], Any] | None = None,
        proof: bool = False,
        **parameters: float,
    ) -> Fault:
        """Arm a fault: `mode` at `place` from the condition `at` on (None: at once) `until` another one (None: stays).

        `ranger-sim faults` lists places, modes and parameters. UserError for what is not in that list. The Fault
        tells what became of it: `acted`, the stamps, the largest difference at its place.

        proof: it can also be asked for `detected`, `detection_ms`, `reaction` and the rest of its `proof()`: a forked
        process is the robot without it, both are recorded from now on (2 MB a second each), until `close`.
        """
        fault = catalogue.fault(place, mode, at, until, parameters)
        if proof:
            from ranger_sim.harness.faults.twin import Twin

            fault.twin = Twin(self)
        return self.arm(fault)

    def arm(self, fault: Fault) -> Fault:
        """Arm a fault that has been made already, as by `catalogue.typed`."""
        fault.arm(self)
        self.faults.append(fault)
        return fault

    def attach(self, end: Any) -> None:
        """From now on `end.poll(now_ns)` is called as often as it asks for; it returns when it wants to be next."""
        self.polled.append(end)
        self.poll_due.append(self.loop.time)
        self.next_poll_ns = self.loop.time

    def _poll(self) -> int:
        """Poll every end that leads outside, when it is time; returns until when the loop may run."""
        now: int = self.loop.time
        if now >= self.next_poll_ns:
            for place, end in enumerate(self.polled):
                if now >= self.poll_due[place]:
                    self.poll_due[place] = end.poll(now)
            self.next_poll_ns = max(now + lockstep.WINDOW_NS, min(self.poll_due))
        return self.next_poll_ns

    def poll_now(self) -> None:
        """Poll every end at once: something waits at one of them."""
        self.next_poll_ns = self.loop.time
        self.poll_due = [self.loop.time] * len(self.polled)
        self._poll()

    def run_for(self, seconds: float) -> None:
        """Pass `seconds` of virtual time, or less when the robot falls."""
        self.run(StopRule(time_s=self.time_s + seconds), seconds)

    @property
    def time_s(self) -> float:
        """Virtual time since power-up, s."""
        return (self.loop.time - self.start_ns) * 1e-9

    @property
    def walked_s(self) -> float:
        """Virtual time since the robot was let go, s."""
        return max(0.0, self.time_s - self.controller.operator.release_time_s)

    @property
    def steps(self) -> int:
        """Steps walked so far."""
        return self.plant.steps

    @property
    def distance_m(self) -> float:
        """Distance walked so far, m."""
        return self.plant.distance_m

    def mean_speed_m_per_s(self) -> float:
        """Distance over the time since the robot was let go."""
        return self.distance_m / self.walked_s if self.walked_s > 0.0 else 0.0

    def realtime_factor(self) -> float:
        """Virtual seconds per wall-clock second of the stepping loop."""
        return self.time_s / self.wall_s if self.wall_s > 0.0 else 0.0

    def fraction_done(self, stop: StopRule) -> float:
        """How much of the stop rule is reached, 0 ... 1."""
        shares = [0.0]
        if stop.steps is not None:
            shares.append(self.steps / stop.steps)
        if stop.time_s is not None:
            shares.append(self.time_s / stop.time_s)
        if stop.distance_m is not None:
            shares.append(self.distance_m / stop.distance_m)
        return min(1.0, max(shares))

    # --- looking in, reaching in --------------------------------------------------------------------------

    @overload
    def board(self, name: Literal["MCH"]) -> HipBoard: ...
    @overload
    def board(self, name: Literal["MCFO"]) -> OuterFeetBoard: ...
    @overload
    def board(self, name: Literal["MCFI"]) -> InnerFeetBoard: ...
    @overload
    def board(self, name: Literal["MCSI"]) -> SteeringBoard: ...
    @overload
    def board(self, name: Literal["UI"]) -> UserInterfaceBoard: ...
    @overload
    def board(self, name: Literal["CSR"]) -> CanRouterBoard: ...
    @overload
    def board(self, name: Literal["MB"]) -> MainBrainBoard: ...
    def board(self, name: str) -> Any:
        """The board MCH, MCFO, MCFI, MCSI, UI, CSR or MB. UserError for any other name."""
        if name not in self.boards:
            raise UserError(f"board {name!r}: there is none of this name, but {', '.join(self.boards)}")
        return self.boards[name]

    def set_parameter(self, name: str, value: float) -> None:
        """Write a parameter into the main brain's table now, as the computer's link would.

        UserError for what is no parameter, and for a value beyond its limits or that is no number.
        """
        row = parameters.parameter(name)
        self._write_word(row.id, parameters.checked_word(row, value))

    def _write_word(self, number: int, word: int) -> None:
        """Into the main brain's table, as of its own clock."""
        board = self.boards["MB"]
        board.store.set_word(number, word, board.time.ms)

    def variable(self, name: str) -> float:
        """Value of a variable as the main brain's data table has it. UserError for a name that is not in the table."""
        from ranger_sim.datatable.packing import value_of_word

        number = all_variables.ID_OF.get(name)
        if number is None:
            near = difflib.get_close_matches(name, all_variables.ID_OF, 3)
            instead = f"meant was perhaps {' or '.join(near)}; " if near else ""
            raise UserError(
                f"variable {name!r}: none of the table's {len(all_variables.ID_OF)} has this name; "
                f"{instead}`ranger-sim table list` shows them"
            )
        return value_of_word(all_variables.TYPES[number], self.loop.board("MB").memory[number])

    def replace(
        self, board: BoardName, task: str, function: Callable[[], int | None], cost: int, limit: int | None = None
    ) -> None:
        """Put your own function in a schedule entry; it declares its cost in cycles."""
        self.board(board).scheduler.replace(task, function, cost=cost, limit=limit)

    def slots(self, board: BoardName) -> RobotSlots:
        """The slots of a board from now on, or from the first time on that they were asked for (harness/timing)."""
        if board not in self.slot_views:
            self.slot_views[board] = slot_view(self, board)
        return self.slot_views[board]

    def counters(self) -> dict[str, RangerCounters]:
        """What every board counted, by its name; also of a board that runs in another process."""
        return {name: self.loop.board(name).counters() for name in self.boards}

    def wire(self, bus: str = "can1", since_s: float = 0.0) -> Any:
        """Frames on a bus, their periods and latencies, as assertions: a `harness.testing.wire.Wire`.

        Frames are kept from the first call on, or from power-up in a robot that harness.testing made.
        """
        from ranger_sim.harness.testing.wire import wire_of

        return wire_of(self, bus, since_s)

    def trace_digest(self) -> str:
        """BLAKE2b-256 of the canonical trace so far."""
        return self.recorder.trace_digest()

    def recorded(self) -> Any:
        """What the log kept, as arrays: a `harness.recorded.Recorded`."""
        from ranger_sim.harness.recorded import Recorded

        return Recorded(self)

    def error_meaning(self, name: str) -> str:
        """What an error code means, in the words of the master table."""
        return next((row.description for row in datatable.load().errors if row.name == name), "")

    def close(self) -> None:
        """Give back the log's files and the ends that lead outside."""
        self.logbook.close()
        for fault in self.faults:
            if fault.twin is not None:
                fault.twin.close()
        for end in self.polled:
            end.close()

    def summary(self) -> dict:
        """The walk in numbers: what `--json` prints."""
        from ranger_sim.harness import summary

        return summary.of(self)
