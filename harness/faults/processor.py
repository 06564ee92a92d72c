"""Faults of a board's processor: time that a function takes, resets, crystal, interrupts, a full ring.

No fault here writes firmware memory: a function takes longer, a clock runs differently, a line requests again.
"""

from typing import Any, ClassVar

from ranger_sim.boards.firmware_board import SatelliteBoard
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.scheduler import NORMAL_TASK
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, Place, WholeNumber
from ranger_sim.harness.faults.names import chosen, name_parameter
from ranger_sim.harness.faults.power import Restart
from ranger_sim.harness.faults.ranger_catalogue import CATALOGUE
from ranger_sim.harness.faults.reach import emulated, reaching_into
from ranger_sim.harness.wiring import ranger as wiring

PROCESSOR = "processor"
RECEIVE_RING = 63  # frames that a satellite's ring holds (robot.md N4.14: 64 places, of which one stays empty)
RECEIVE_TASK = "can_rx_dispatch_all"
POWER_CYCLE = "a power cycle of the board: the mode brown_out at its supply, or reset at its processor"

CATALOGUE.add_places(
    Place(f"{name}.processor", PROCESSOR, f"the processor of {name}", {"board": name}) for name in wiring.BOARDS
)


class ProcessorFault(Fault):
    """A fault in the processor of an emulated board."""

    kinds = (PROCESSOR,)
    needs = "a processor"

    def connect(self) -> None:
        self.name = self.inside = self.place.details["board"]
        emulated(self.robot, self.name, f"fault {self.text()}")

    @property
    def board(self) -> Any:
        """The board that is there now."""
        return self.robot.loop.board(self.name)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether a slot that began after the end is finished: the row before it was not cut off."""
        scheduler = getattr(self.board, "scheduler", None)  # a board without power has none
        return bool(scheduler is not None and scheduler.done and scheduler.slot_time > self.ended_ns)


class TaskFault(ProcessorFault):
    """A fault in one function of the schedule."""

    parameters: ClassVar[tuple[Parameter, ...]] = (
        name_parameter("task", "", "the function, as the schedule calls it", "has to be given"),
    )

    def connect(self) -> None:
        ProcessorFault.connect(self)
        self.task = self.found(self.values["task"])

    def claims(self) -> tuple[str, ...]:
        """One function of the board."""
        return (f"{self.place.name}, {self.task.name}",)

    def found(self, name: str) -> Any:
        """The task of this name. UserError for a missing one, or one that calls others."""
        tasks = [task for task in self.board.scheduler.schedule.all_tasks() if task.kind == NORMAL_TASK]
        chosen(name, [task.name for task in tasks], "task", f"fault {self.place.name}:{self.mode}")
        return next(task for task in tasks if task.name == name)


@mode
class ExtraCycles(TaskFault):
    """A function that takes longer than its cost: another path through it, a slower memory."""

    mode = "extra_cycles"
    meaning = "takes more cycles in one function"
    unit = "cycles"
    parameters = (
        *TaskFault.parameters,
        WholeNumber("cycles", "1", 6000, 1, 1e9, "more, in each call", "chosen by us: 100 us at 60 MHz"),
    )

    def begin(self, now_ns: int) -> None:
        self._add(int(self.values["cycles"]), now_ns)
        self.calls = self.task.calls

    def before(self, now_ns: int) -> None:
        if self.task.calls > self.calls:
            self.calls = self.task.calls
            self.note(now_ns, self.values["cycles"])

    def finish(self, now_ns: int) -> None:
        self.before(now_ns)
        self._add(-int(self.values["cycles"]), now_ns)

    def _add(self, cycles: int, now_ns: int) -> None:
        with reaching_into(self.robot, self.name, now_ns):
            self.task.cost += cycles


class Hold(TaskFault):
    """One call of a function that does not return before it is released: the processor stays in it.

    Interrupts are served meanwhile, slots pass, and their rows are dropped.
    """

    unit = "ns"

    def begin(self, now_ns: int) -> None:
        self.held_since = -1
        self.kept_cost = self.task.cost
        self.calls = self.task.calls
        # long enough to last until the step in which its call is noticed, and the one after it
        self.reach_ns = 2 * self.robot.plant.step_ns
        with reaching_into(self.robot, self.name, now_ns) as board:
            self.task.cost = self.kept_cost + int(2 * self.reach_ns * board.cycles_per_ns)

    def before(self, now_ns: int) -> None:
        if self.held_since < 0 and self.task.calls > self.calls:
            self.held_since = now_ns
            with reaching_into(self.robot, self.name, now_ns):
                self.task.cost = self.kept_cost
        if self.held_since >= 0:
            with reaching_into(self.robot, self.name, now_ns) as board:
                if self.is_over(board, now_ns):
                    self.ended_ns = now_ns
                    self.finish(now_ns)
                    return
                board.code_time = max(board.code_time, now_ns + self.reach_ns)
                self.note(now_ns, now_ns + self.reach_ns - self.held_since)

    def is_over(self, board: Any, now_ns: int) -> bool:
        """Whether the call returns by itself."""
        return False

    def finish(self, now_ns: int) -> None:
        with reaching_into(self.robot, self.name, now_ns) as board:
            if self.held_since < 0:
                self.task.cost = self.kept_cost
            elif board.code_time <= now_ns + self.reach_ns:
                board.code_time = now_ns  # it returns


@mode
class Stall(Hold):
    """A function that waits for an event that does not come, for a given time or until the fault's end."""

    mode = "stall"
    meaning = "stays in one function, which returns late"
    parameters = (
        *TaskFault.parameters,
        Parameter("ms", "ms", 4.0, 0.0, 1e6, "that its call lasts; 0: until the fault ends", "chosen by us: 8 slots"),
    )

    def is_over(self, board: Any, now_ns: int) -> bool:
        return 0.0 < self.values["ms"] * 1e6 <= now_ns - self.held_since


@mode
class FullRing(Hold):
    """The task that empties a satellite's receive ring does not run until the ring is full and a frame does not fit.

    Then it goes on; with the quirk `full_receive_ring_kills`, as on the robot, the board never does (robot.md T4.1).
    """

    mode = "full_ring"
    meaning = "does not empty its receive ring until it is full"
    unit = "frames"
    parameters = ()

    def connect(self) -> None:
        ProcessorFault.connect(self)
        if not isinstance(self.board, SatelliteBoard):
            raise FaultError(
                f"fault {self.text()}: {self.name} has no ring of a satellite; the router's rings only lose frames, the"
                " main brain has no CAN, and a program in C keeps its ring to itself"
            )
        self.task = self.found(RECEIVE_TASK)
        if self.robot.quirks.full_receive_ring_kills:
            self.permanent = POWER_CYCLE

    def begin(self, now_ns: int) -> None:
        Hold.begin(self, now_ns)
        self.lost = self.board.can.receive_lost

    def before(self, now_ns: int) -> None:
        count = self.acted_count
        Hold.before(self, now_ns)
        if self.acted_count > count and self.board.can.receive_lost == self.lost:
            self.acted_count = count  # it acts when the ring is full, not while it fills
            if count == 0:
                self.acted_ns, self.largest_difference = -1, 0.0

    def is_over(self, board: Any, now_ns: int) -> bool:
        if board.can.receive_lost > self.lost:
            self.note(now_ns, RECEIVE_RING)
            return True
        return False


@mode
class Reset(Restart):
    """The processor is reset, as by its watchdog or a glitch on its reset pin; its supply stays.

    Its pins are inputs until its program sets them: the bridge's low sides are off, the watchdog line stays constant.
    """

    mode = "reset"
    kinds = (PROCESSOR,)
    needs = "a processor"
    meaning = "is reset: its program begins anew"

    def down_ns(self) -> int:
        return 0

    def stop_motor(self, now_ns: int) -> None:
        motor = wiring.MOTORS.get(self.name)
        if motor is not None:
            self.robot.plant.motors[motor].drive.low_side(now_ns, False, False)


@mode
class CrystalOff(ProcessorFault):
    """The crystal runs at another rate: slots, timers, PWM, serial lines and cycles with it.

    Its CAN controller runs on it as well. Up to a per cent its synchronisation compensates for that; beyond, use the
    mode bit_rate at the controller.
    """

    mode = "crystal"
    meaning = "runs on a crystal that is far off"
    unit = "ppm"
    parameters = (
        Parameter(
            "ppm", "1e-6", 5000.0, -10_000.0, 10_000.0, "fast, beyond what the crystal is off by itself",
            "chosen by us: a hundred times a good one; limits: what CAN's synchronisation makes up for (ISO 11898-1)",
        ),
    )  # fmt: skip

    def claims(self) -> tuple[str, ...]:
        """The crystal: functions and interrupts continue."""
        return (f"{self.place.name}, its crystal",)

    def begin(self, now_ns: int) -> None:
        self.slots = self.board.scheduler.slot_count
        self._set(round(1000 * self.values["ppm"]), now_ns)

    def before(self, now_ns: int) -> None:
        if self.values["ppm"] and self.board.scheduler.slot_count > self.slots:
            self.slots = self.board.scheduler.slot_count
            self.note(now_ns, self.values["ppm"])

    def finish(self, now_ns: int) -> None:
        self._set(0, now_ns)

    def _set(self, more_ppb: int, now_ns: int) -> None:
        bought: Crystal = self.robot._stream(self.name)[0]
        with reaching_into(self.robot, self.name, now_ns) as board:
            board.retune(bought.ppb + more_ppb, now_ns)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether it runs at its own rate."""
        return bool(self.board.crystal.ppb == self.robot._stream(self.name)[0].ppb)


@mode
class StuckInterrupt(ProcessorFault):
    """An interrupt line that stays asserted: as soon as a service ends it requests again.

    Interrupts of higher priority continue; its own handler runs each time, and those of lower priority do not.
    """

    mode = "stuck_interrupt"
    meaning = "has an interrupt that asks again as soon as it was served"
    unit = "services"
    parameters = (name_parameter("interrupt", "", "the interrupt, as the board calls it", "has to be given"),)

    def connect(self) -> None:
        ProcessorFault.connect(self)
        there = {source.name: source for source in self.board.vic.sources.values() if source.attached}
        name = chosen(self.values["interrupt"], there, "interrupt", f"fault {self.place.name}:{self.mode}")
        self.source = there[name]
        if name == "can_receive" and self.robot.quirks.full_receive_ring_kills:
            self.permanent = POWER_CYCLE  # its handler fills the ring with copies of the last frame

    def claims(self) -> tuple[str, ...]:
        """One interrupt of it."""
        return (f"{self.place.name}, {self.source.name}",)

    def begin(self, now_ns: int) -> None:
        with reaching_into(self.robot, self.name, now_ns) as board:
            self.chip = board
            self.service = self.source.service
            self.source.serve_by(self._serve)
            self.asking = True
            board.now = board.instant = now_ns
            board.request(self.source)

    def _serve(self, queue: Any) -> Any:
        """Run the handler, and request again."""
        items = self.service(queue)
        if self.asking:
            self.note(self.chip.now, 1.0)
            self.chip.request(self.source)
        return items

    def finish(self, now_ns: int) -> None:
        with reaching_into(self.robot, self.name, now_ns):
            self.asking = False
            self.source.serve_by(self.service)
