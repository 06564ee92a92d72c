"""The whole robot, wired: seven boards, four buses, one link, one body.

Its parts are made in `assembly.py` (boards: `board_programs.py`); harness/machine.py connects them by the tables of
ranger/wiring.py, and `harness/lockstep.py` then passes time and carries what goes over the wires.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, overload

from ranger_sim.boards.can_router import CanRouterBoard
from ranger_sim.boards.hip import HipBoard
from ranger_sim.boards.inner_feet import InnerFeetBoard
from ranger_sim.boards.main_brain import controllers
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.main_brain.programs import program
from ranger_sim.boards.outer_feet import OuterFeetBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.boards.steering import SteeringBoard
from ranger_sim.boards.user_interface import UserInterfaceBoard
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.firmware_sim.lpc2194.image import Image
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.faults.error_rows import StateWord
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.firmware.printed import Printed
from ranger_sim.harness.machine import Machine
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.processes.kinds import SET_WORD
from ranger_sim.harness.processes.modes import InProcess, OwnProcesses
from ranger_sim.harness.processes.settings import DEADLINE_S
from ranger_sim.harness.timing.machine_slots import MachineSlots
from ranger_sim.harness.waiting import Wanted
from ranger_sim.plant import body_files
from ranger_sim.ranger import wiring
from ranger_sim.ranger.assembly import factory_of, parts_of
from ranger_sim.ranger.board_programs import Emulated
from ranger_sim.ranger.conditions import STATE_VARIABLES, Condition, condition
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.faults.error_watch import ErrorWatch
from ranger_sim.ranger.firmware import image_boards, native_boards
from ranger_sim.ranger.firmware.programs_in_c import ProgramsInC
from ranger_sim.ranger.names import RANGER
from ranger_sim.ranger.operator import Operator
from ranger_sim.ranger.records.strike_watch import StrikeWatch
from ranger_sim.ranger.scenario import Scenario, StopRule

if TYPE_CHECKING:
    from ranger_sim.harness.processes.forked_boards import ForkedBoards

BoardName = Literal["MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"]


class Ranger(Machine):
    """One robot in one scenario. Same scenario, same bytes. Close it when done (or use contextlib.closing).

    quirks: of the emulated firmware; the controller's program has its own estimator. profile: its bit rates and
    schedules; boards that it has outside are emulated here. firmware: boards that run C, by folder, each in its own
    process, or `in_process`: faster, but a crash of one of them ends this process. images: boards that run a
    firmware image, by file. board_deadline_s: how long a board's own process may leave a request unanswered, and its
    trial may take; 0: for ever (debuggers), 10 s for the trial. printed: takes what programs in C print; without it
    they print on standard output. mode: where the boards run, instead of what `board_deadline_s` chooses.
    require_confined: UserError where the kernel does not grant every confinement of a program in C.
    """

    end_word, end_name = "the robot fell", "a fall"

    def __init__(
        self,
        scenario: Scenario | None = None,
        log: str = "none",
        quirks: Quirks | None = None,
        profile: Profile | None = None,
        firmware: Mapping[str, Firmware | str | os.PathLike] | None = None,
        in_process: bool = False,
        images: Mapping[str, Image | str | os.PathLike] | None = None,
        board_deadline_s: float = DEADLINE_S,
        printed: Printed | None = None,
        mode: InProcess | None = None,
        require_confined: bool = False,
    ) -> None:
        self.scenario = scenario if scenario is not None else Scenario()
        self.profile = profile
        self.printed = printed

        # the programs of the boards
        self.controller = controllers.load(self.scenario.controller)
        self.quirks = program(self.controller.program).switches(quirks if quirks is not None else Quirks())
        self.programs_in_c = ProgramsInC(
            native_boards.built(firmware if firmware is not None else {}),
            printed,
            elsewhere=not in_process,
            patience_s=board_deadline_s,
        )
        self.firmware = self.programs_in_c.firmware
        self.images: dict[str, Image] = image_boards.loaded(images if images is not None else {})
        emulated = Emulated(self.quirks, self.controller)
        self.factory = factory_of(self.scenario, emulated, self.programs_in_c, self.images, profile)
        if require_confined:
            self.programs_in_c.require_confined()

        # body, boards, buses; then the wires and the recorders
        self.body = body_files.load(self.scenario.body)
        plant, boards, buses = parts_of(self.scenario, self.body, self.factory, profile)
        if mode is None and self.firmware and not in_process:
            mode = OwnProcesses(tuple(self.firmware), board_deadline_s)
        seed, memory = self.scenario.seed, (all_variables.TABLE_SIZE, boards["MB"])
        Machine.__init__(self, plant, boards, buses, wiring.RANGER, seed, log, memory, RANGER, mode=mode)

        # the operator at the keys, and what observes the walk
        self.operator = Operator(self.controller.operator, self.plant, self.boards["UI"], self.start_ns, seed)
        self.loop.strikes = StrikeWatch(self.plant, self.boards["MB"])
        self.catalogue = CATALOGUE

    def new_board(self, name: str, power_up_ns: int, record: Any = None) -> Any:
        """A new, unwired board with its own crystal, powered up at `power_up_ns` (board_programs.py)."""
        return self.factory.board(name, power_up_ns, record)

    def confined_board(self, name: str, record: Any) -> Any:
        """In the process of a board with a program in C: the board, whose program is loaded now."""
        self.programs_in_c.load_here()
        return self.factory.first_board(name, record)

    def waits_for_slots(self, board: Any) -> bool:
        return self.factory.program(board.name).waits_for_slots(board)

    @property
    def processes(self) -> ForkedBoards | None:
        """The boards that run in separate processes, once time has passed."""
        return self.mode.forked

    # --- passing time -------------------------------------------------------------------------------------

    def run(self, stop: StopRule, slice_s: float = 1.0) -> bool:
        """Pass up to `slice_s` of virtual time; True when the stop rule is met, the robot fell or has no charge left.

        A board whose process ends meanwhile is off its buses from then on, and is listed in `deaths`.
        """
        __tracebackhide__ = True
        self.start()  # so that its processes exist before programs of this one run
        with self.programs_in_c.running(self.loop):
            return Machine.run(self, stop, slice_s)

    def whereabouts(self) -> str:
        return f", in step {self.steps}"

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
        return Machine.board(self, name)

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
        Machine.replace(self, board, task, function, cost, limit)

    def slots(self, board: BoardName) -> MachineSlots:
        """The slots of a board from the first request for them on (harness/timing)."""
        view: MachineSlots = Machine.slots(self, board)
        return view

    def timeline(self, last_s: float | None = None, detail_s: float | None = None) -> Any:
        """A `ranger.timeline.Timeline` that keeps the last `last_s` seconds of virtual time, or everything.

        detail_s: as of `harness.timeline.machine_timeline.MachineTimeline`.
        """
        from ranger_sim.ranger.timeline import Timeline

        return Timeline(self, last_s, detail_s)

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

    def close(self) -> None:
        """Close the log's files, external connections, golden runs and the processes of boards."""
        self.programs_in_c.finish(self)
        Machine.close(self)
        self.programs_in_c.close()

    def summary(self) -> dict:
        """The walk in numbers: what `--json` prints."""
        from ranger_sim.ranger.records import summary

        return summary.of(self)
