"""The common part of the robot's boards: their part of the master table, switches, network time, error module.

Below, in the order of building: FirmwareBoard (all), SatelliteBoard (one CAN bus), MotorBoard (a motor), AnkleBoard.
"""

import cython

from ranger_sim.boards import counters
from ranger_sim.boards.modules.can_link import CanLink
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.execution_timer import ExecutionTimer
from ranger_sim.boards.modules.mcu_led import Heartbeat
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import (
    ICR_BUS_ERROR,
    ICR_ERROR_PASSIVE,
    ICR_ERROR_WARNING,
    CanController,
)
from ranger_sim.firmware_sim.peripherals.can_controller_base import ICR_DOI, ICR_RI
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import IRQ_LATENCY
from ranger_sim.foundation.user_error import FirmwareError

ALL_CAN_INTERRUPTS = ICR_RI | ICR_ERROR_WARNING | ICR_DOI | ICR_ERROR_PASSIVE | ICR_BUS_ERROR
# From the tick to the first function of its row, 3 us (robot.md T2): the interrupt's 27 instructions, two cycles each,
# and the main loop's way to the row; latency included.
TICK_CYCLES = 180 - IRQ_LATENCY
CAN_RECEIVE_SLOT = 0  # of the VIC, on every satellite (robot.md N4.16)


@cython.cclass
class FirmwareBoard(Microcontroller):
    """A board with firmware. `table`: generated module of the board; `quirks`: switches, None for the defaults.

    `one_late`: the firmware's slip in the error rings of router and main brain, each report carries the one before.
    """

    errors: ErrorModule
    time: NetworkTime
    errors_one_late: cython.bint
    error_before: cython.longlong
    table: object
    quirks: object

    def __init__(self, table, crystal, quirks, one_late=False) -> None:
        board: object = self  # bound methods are looked up dynamically
        quirks = quirks if quirks is not None else Quirks()
        Microcontroller.__init__(self, table.BOARD, table.CLOCK_HZ, crystal)
        self.table = table
        self.quirks = quirks
        self.time = NetworkTime()
        self.errors = ErrorModule(
            table.BOARD_NUMBER,
            self.time,
            per_event=quirks.errors_counted_per_event,
            lose_new_after_repeat=quirks.new_errors_lost_after_repeat,
        )
        self.errors_one_late = one_late
        self.error_before = codes.DEFAULT
        self.on_overrun = board.note_overrun
        if quirks.warn_near_slot_limit:
            self.on_limit = board.note_limit
            self.on_near_limit = board.note_near_limit

    def schedule(self) -> Schedule:
        """The board's table; every board's module has its own."""
        raise FirmwareError(f"{self.name}: this board has no schedule")

    @cython.ccall
    def report(self, code: cython.longlong) -> None:
        """Note an error; one late, the first one is 0."""
        if self.errors_one_late:
            self.errors.report(self.error_before)
            self.error_before = code
        else:
            self.errors.report(code)

    def note_overrun(self) -> None:
        """A tick found the row unfinished."""
        self.report(codes.ASCHED_DNF)

    def note_limit(self, task: Task) -> None:
        """A task took longer than its limit."""
        self.report(codes.SCHED_TASK_LIMIT)

    def note_near_limit(self) -> None:
        """A slot took more than 90 % of its length."""
        self.report(codes.SCHED_SLOT_NEAR_LIMIT)


@cython.cclass
class SatelliteBoard(FirmwareBoard):
    """A board on one CAN bus, an LPC2194: lights, execution times, and the link to its bus.

    `error_slot` of the VIC; `interrupts` that its CAN controller raises.
    """

    can: CanLink
    can_controller: CanController
    execution: ExecutionTimer
    heartbeat: Heartbeat
    gpio: Gpio

    def __init__(self, table, crystal, quirks, error_slot, interrupts=ALL_CAN_INTERRUPTS) -> None:
        FirmwareBoard.__init__(self, table, crystal, quirks)
        self.gpio = Gpio(self)
        self.heartbeat = Heartbeat(self.time, self.gpio, table.SLOT_US)
        self.execution = ExecutionTimer(self, self.time)
        self.can_controller = CanController(self, table.CONTROLLER, IER=interrupts)
        self.can = CanLink(
            self,
            self.can_controller,
            self.time,
            self.errors,
            self.quirks.full_queues_reported,
            self.quirks.full_receive_ring_kills,
        )
        self.can.attach(receive_slot=CAN_RECEIVE_SLOT, error_slot=error_slot)

    def filter_frames(self) -> None:
        """Set the acceptance filter where the board has one: its receive list is complete."""
        if self.quirks.acceptance_filter:
            self.can.filter_frames()

    def counters(self) -> object:
        """What the board counted, by name."""
        return counters.of_board(self, [counters.of_can_link(self.can)])
