"""The whole robot, wired: seven boards, four buses, one link, one body.

`Ranger.__init__` takes the body from `plant_of` and the boards from a factory (board_programs.py); harness/machine.py
connects them and the buses by the tables of
ranger/wiring.py; `harness/lockstep.py` then passes time and carries what goes over the wires.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import tempfile
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, overload

from ranger_sim import datatable
from ranger_sim.boards.can_router import CanRouterBoard
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
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.firmware_sim.native import coverage, crash
from ranger_sim.firmware_sim.native.trial import tried
from ranger_sim.foundation.quantities import Duration
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.faults.error_rows import StateWord
from ranger_sim.harness.firmware.fresh_board import first_outputs, pass_on
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.firmware.printed import Printed
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.outside import bus_schedule
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.processes.guard import DEADLINE_S
from ranger_sim.harness.processes.kinds import SET_WORD
from ranger_sim.harness.timing.machine_slots import MachineSlots
from ranger_sim.harness.waiting import Wanted
from ranger_sim.harness.wiring.imu_wire import ImuWire
from ranger_sim.plant import body_files
from ranger_sim.plant.ranger import RangerPlant
from ranger_sim.ranger import wiring
from ranger_sim.ranger.board_programs import BOARD_CLASSES, BoardFactory, Emulated, InC, OfImage
from ranger_sim.ranger.conditions import STATE_VARIABLES, Condition, ErrorNoted, condition
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.faults.error_watch import ErrorWatch
from ranger_sim.ranger.firmware import image_boards, native_boards
from ranger_sim.ranger.names import RANGER
from ranger_sim.ranger.operator import Operator
from ranger_sim.ranger.records.strike_watch import StrikeWatch
from ranger_sim.ranger.scenario import Scenario, StopRule

if TYPE_CHECKING:
    from ranger_sim.harness.processes.remote_boards import RemoteBoards

BUS_BIT_RATE = 3_000_000  # bit/s, appendix 3.11
GRID_NS = 20_000_000  # the operator acts on this grid, so that a run does not depend on how it is sliced

BoardName = Literal["MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"]


def plant_of(scenario: Scenario, body: body_files.BodyFile) -> RangerPlant:
    """The body of a scenario, with its sensors."""
    return RangerPlant(
        seed=scenario.seed,
        slope_rad=scenario.slope_rad,
        floor_roughness_m=scenario.floor_roughness_m,
        model_file=scenario.model_file,
        start_ns=scenario.start_uptime_ms * 1_000_000,
        parameters=body.parameters,
        electrics=scenario.electrics(body.electrics),
    )


def with_counts(firmware: dict[str, Firmware]) -> tuple[dict[str, Firmware], tempfile.TemporaryDirectory[str] | None]:
    """The programs, each compiled for coverage with a folder for its counts; and the folder made for them, if any."""
    if not any(each.coverage and each.counts is None for each in firmware.values()):
        return firmware, None
    folder = tempfile.TemporaryDirectory(prefix="ranger-sim-counts-")
    place = pathlib.Path(folder.name)
    found = {
        name: dataclasses.replace(each, counts=each.counts or place / name) if each.coverage else each
        for name, each in firmware.items()
    }
    return found, folder


class Ranger(Machine):
    """One robot in one scenario. Same scenario, same bytes. Close it when done (or use contextlib.closing)."""

    end_word, end_name = "the robot fell", "a fall"

    def whereabouts(self) -> str:
        return f", in step {self.steps}"

    def __init__(
        self,
        scenario: Scenario | None = None,
        log: str = "none",
        quirks: Quirks | None = None,
        profile: Profile | None = None,  # its bit rates and schedules; boards that it has outside are emulated here
        firmware: Mapping[str, Firmware | str | os.PathLike] | None = None,  # boards that run C, by folder
        in_process: bool = False,  # their programs run here: faster, but a crash of one of them ends this process
        images: Mapping[str, Image | str | os.PathLike] | None = None,  # boards that run a firmware image, by file
        board_deadline_s: float = DEADLINE_S,  # without an answer of a board's own process; 0: never (debuggers)
        printed: Printed | None = None,  # takes what programs in C print; without it they print on standard output
    ) -> None:
        self.scenario = scenario if scenario is not None else Scenario()
        self.controller = controllers.load(self.scenario.controller)
        # the controller's program has its own estimator
        self.quirks = program(self.controller.program).switches(quirks if quirks is not None else Quirks())
        start_ns = self.scenario.start_uptime_ms * 1_000_000
        seed = self.scenario.seed

        # plant -> sensors
        self.body = body_files.load(self.scenario.body)
        datatable.check_own_table()
        plant = plant_of(self.scenario, self.body)
        self.is_watched = False
        self.firmware, self.counts = with_counts(native_boards.built(firmware if firmware is not None else {}))
        self.printed = printed
        self.factory = BoardFactory(seed, Emulated(self.quirks, self.controller))
        self.factory.programs |= {name: InC(each, self._printing) for name, each in self.firmware.items()}
        self._try_firmware(start_ns)
        self.in_own_process: tuple[str, ...] = () if in_process else tuple(self.firmware)
        self.board_deadline_s = board_deadline_s
        self.processes: RemoteBoards | None = None
        self.deaths: list[dict[str, Any]] = []  # boards whose process has ended (harness/processes/remote_boards.py)
        self.images: dict[str, Image] = image_boards.loaded(images if images is not None else {})
        for name in self.images:
            if name in self.firmware:
                raise UserError(f"{name} is to run both {self.firmware[name].folder} and {self.images[name].path}")
        self.factory.programs |= {name: OfImage(each) for name, each in self.images.items()}
        # interrupts and slots: each board on its own crystal, powered up at its own time
        boards = {name: self.new_board(name, self.factory.first_power_up_ns(name, start_ns)) for name in BOARD_CLASSES}
        if "CSR" not in self.images:
            boards["CSR"].time.ms = self.scenario.start_uptime_ms
        sent = {name: first_outputs(boards[name]) for name in self.firmware}  # while their programs started
        # CAN
        self.profile = profile
        rates = {name: bus.bit_rate for name, bus in profile.buses.items()} if profile is not None else {}
        Machine.__init__(
            self,
            plant,
            {name: boards[name] for name in wiring.BOARDS},
            {name: rates.get(name, BUS_BIT_RATE) for name in ("can1", "can2", "can3", "can4")},
            wiring.RANGER,
            seed,
            log,
            (all_variables.TABLE_SIZE, boards["MB"]),
            RANGER,
        )
        for name, messages in sent.items():
            pass_on(messages, self.boards[name].outbox, self.start_ns)
        if profile is not None:
            for board in self.boards.values():
                bus_schedule.apply(board, profile.schedules())
        self.operator = Operator(self.controller.operator, self.plant, self.boards["UI"], self.start_ns, seed)
        self.catalogue = CATALOGUE

    def _try_firmware(self, start_ns: int) -> None:
        """Start each program once in a process that it may crash. UserError where it does."""
        for name, firmware in self.firmware.items():

            def start(record: Any, name: str = name) -> None:
                board = self.new_board(name, self.factory.first_power_up_ns(name, start_ns), record)
                board.counters()

            with self._printing(name):
                tried(f"{firmware.folder}: {name}", firmware.library, firmware.folder, start)
            if self.printed is not None:
                self.printed.drop(name)  # its program will print that again

    def _printing(self, board: str) -> contextlib.AbstractContextManager[None]:
        """Within it, output of programs in C in this process counts as output of `board`."""
        return self.printed.during(board) if self.printed is not None else contextlib.nullcontext()

    def new_board(self, name: str, power_up_ns: int, record: Any = None) -> Any:
        """A new, unwired board with its own crystal, powered up at `power_up_ns`.

        record: memory in which a program in C leaves its position when it ends this process.
        """
        board = self.factory.board(name, power_up_ns, record)
        if name in self.firmware and record is None and self.is_watched:  # it replaces another board
            self._watch(board)
        return board

    def waits_for_slots(self, board: Any) -> bool:
        return self.factory.program(board.name).waits_for_slots(board)

    def _connect(self) -> None:
        """Connect every wire of the tables, and what only Ranger has: the serial link and the inertial unit."""
        Machine._connect(self)
        loop, boards = self.loop, self.boards
        loop.connect_link(boards["CSR"], boards["MB"], EXCHANGE_NS, empty_segment())
        board = boards[wiring.IMU_BOARD]
        loop.connect_serial_device(ImuWire(self.plant.imu, board, wiring.IMU_UART), board, wiring.IMU_UART)
        loop.strikes = StrikeWatch(self.plant, boards["MB"])

    # --- passing time -------------------------------------------------------------------------------------

    def start(self) -> RemoteBoards | None:
        """Start a process for each board that is to have its own, if that has not been done.

        A program in C that runs in this process is monitored from now on.
        """
        if self.processes is None and self.in_own_process:
            from ranger_sim.harness.processes.remote_boards import RemoteBoards

            self.processes = RemoteBoards(self, self.in_own_process)
            self.deaths = self.processes.deaths
        if not self.is_watched:
            self.is_watched = True
            for name in self.firmware:
                if not self.loop.board(name).out_of_process:
                    self._watch(self.loop.board(name))
        return self.processes

    def _watch(self, board: Any) -> None:
        """Let the program of a board in this process record its position if it ends the process."""
        firmware = self.firmware[board.name]
        if board.counts is not None:
            os.environ[coverage.PREFIX] = str(board.counts)  # for a crash, which writes them as well
        board.leave_record_in(*crash.record_of(board.name, firmware.library, firmware.folder))

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass up to `slice_s` of virtual time; True when the stop rule is met, the robot fell or has no charge left.

        A board whose process ends meanwhile is off its buses from then on, and is listed in `deaths`.
        """
        __tracebackhide__ = True
        remote = self.start()
        here = "+".join(name for name in self.firmware if not self.loop.board(name).out_of_process)
        try:
            with self._printing(here) if here else contextlib.nullcontext():
                if remote is None:
                    return Machine.run(self, stop, slice_s)
                with remote.processor():
                    return Machine.run(self, stop, slice_s)
        finally:
            if self.printed is not None:
                self.printed.poll()

    def until(self, wanted: Wanted, within: Duration = "60 s") -> float:
        """Pass time until a condition holds, as for any machine.

        Boards in separate processes are then asked for their errors at each step, which takes time.
        """
        __tracebackhide__ = True
        wanted = self.condition(wanted)
        remote = self.start()
        if remote is None or not isinstance(wanted, ErrorNoted):
            return Machine.until(self, wanted, within)
        asking = remote.asking(wanted.boards)
        self.loop.watchers.append(asking)
        try:
            return Machine.until(self, wanted, within)
        finally:
            self.loop.watchers.remove(asking)

    def counters(self) -> dict[str, Any]:
        """Every board's counters until now, by its name."""
        if self.processes is not None:
            self.processes.fetch_counters()
        return Machine.counters(self)

    def inject(self, *place_and_mode: Any, **more: Any) -> Any:
        """Arm a fault, as for any machine.

        Board processes start now, so that a fault that would have to be inside one is refused.
        """
        self.start()
        return Machine.inject(self, *place_and_mode, **more)

    def act(self, end_ns: int) -> None:
        """Act as the operator: hold the robot, let it go, press keys."""
        self.operator.act(end_ns)

    def condition(self, wanted: Wanted) -> Condition:
        """The condition described by `wanted` (ranger/conditions.py)."""
        return condition(wanted)

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

    def fraction_done(self, stop: StopRule) -> float:
        """How much of the stop rule is done, 0 ... 1."""
        shares = [0.0]
        if stop.steps is not None:
            shares.append(self.steps / stop.steps)
        if stop.time_s is not None:
            shares.append(self.time_s / stop.time_s)
        if stop.distance_m is not None:
            shares.append(self.distance_m / stop.distance_m)
        return min(1.0, max(shares))

    # --- inspection and changes ---------------------------------------------------------------------------

    @overload  # type: ignore[override]  # here an unknown name is a type error, too
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
        """The board MCH, MCFO, MCFI, MCSI, UI, CSR or MB. UserError for another name, or a board elsewhere."""
        board = Machine.board(self, name)
        if self.processes is not None and name in self.processes.names:
            raise UserError(
                f"{name} runs in a separate process, its memory is out of reach: variable(), counters(), wire() and "
                "until() see it; or Ranger(in_process=True)"
            )
        return board

    def set_parameter(self, name: str, value: float) -> None:
        """Write a parameter into the main brain's table now, as the computer's link does.

        UserError for a name that is not a parameter, and for a value beyond its limits or that is not a number.
        """
        row = parameters.parameter(name)
        self.write_word(row.id, parameters.checked_word(row, value))

    def write_word(self, number: int, word: int) -> None:
        """Write to the main brain's table, stamped by its clock; through the channel if in another process."""
        if self.loop.board("MB").out_of_process:
            self.loop.board("MB").send(SET_WORD, self.loop.time, number, word)
            return
        board = self.boards["MB"]
        board.store.set_word(number, word, board.time.ms)

    def variable(self, name: str) -> float:
        """Value of a variable as the main brain's data table has it. UserError for a name that is not in the table."""
        from ranger_sim.datatable.packing import value_of_word

        number = all_variables.ID_OF.get(name)
        if number is None:
            raise UserError(f"{unknown('variable', name, all_variables.ID_OF)}; `ranger-sim table list` shows all")
        return value_of_word(all_variables.TYPES[number], self.loop.board("MB").memory[number])

    def replace(
        self, board: BoardName, task: str, function: Callable[[], int | None], cost: int, limit: int | None = None
    ) -> None:
        """Put your own function in a schedule entry; it declares its cost in cycles."""
        if self.processes is not None and board in self.processes.names:
            raise UserError(f"replace {task} of {board}: its process runs already; replace before time passes")
        Machine.replace(self, board, task, function, cost, limit)

    def slots(self, board: BoardName) -> MachineSlots:
        """The slots of a board from the first request for them on (harness/timing)."""
        view: MachineSlots = Machine.slots(self, board)
        return view

    def timeline(self, last_s: float | None = None) -> Any:
        """A `ranger.timeline.Timeline` that keeps the last `last_s` seconds of virtual time, or everything."""
        from ranger_sim.ranger.timeline import Timeline

        return Timeline(self, last_s)

    def recorded(self) -> Any:
        """What the log kept, as arrays: a `ranger.records.recorded.Recorded`."""
        from ranger_sim.ranger.records.recorded import Recorded

        return Recorded(self)

    def error_meaning(self, name: str) -> str:
        """The meaning of an error code, from the master table."""
        return self.names.descriptions.get(self.names.codes.get(name, -1), "")

    def machines(self) -> dict[str, StateWord]:
        """The main brain's machines."""
        modes = self.boards["MB"].modes
        return {
            machine: StateWord(
                all_variables.ID_OF[variable],
                {state.number: state.name for state in getattr(modes, machine).machine.states},
            )
            for machine, variable in STATE_VARIABLES.items()
        }

    def admitted(self, line: bytes) -> Any:
        """The request in a line of JSON (ranger/requests.py). UserError, of one line, for any other line."""
        from ranger_sim.ranger import requests

        return requests.admitted(line)

    def fell_ns(self) -> int:
        return int(self.plant.record.fall_time_ns) if self.plant.fell else -1

    def error_watch(self) -> Any:
        return ErrorWatch(self.loop.boards, max(self.names.errors) + 1)

    def write_counts(self) -> None:
        """Boards with programs compiled for coverage write which of their lines ran."""
        for name, firmware in self.firmware.items():
            board = self.loop.board(name)
            if firmware.coverage and not board.out_of_process:
                board.write_counts()
            elif firmware.coverage and self.processes is not None and not self.processes.ended:
                self.processes.fetch_counters((name,))

    def close(self) -> None:
        """Close the log's files, external connections, golden runs and the processes of boards."""
        if self.counts is None and not self.lost:  # another process reads them
            self.write_counts()
        if self.processes is not None:
            self.processes.close()
        if self.counts is not None:
            self.counts.cleanup()
        Machine.close(self)

    def summary(self) -> dict:
        """The walk in numbers: what `--json` prints."""
        from ranger_sim.ranger.records import summary

        return summary.of(self)
