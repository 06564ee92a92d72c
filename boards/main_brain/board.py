"""The main brain (MB, LPC3250 at 208 MHz): all data, estimator, state machines. Slots of 2 ms, 11 rows.

Source: robot.md N1.6, N3.1, N3.8, N4.12, N4.13; appendix 4.3, 4.4. Its tick comes from its own crystal,
not from the router: phase and drift against the rest of the robot are arbitrary; its time is that of the
last frame of identifier 0.

The line to the computer is one of two ports (robot.md N4.15): HS-UART1 with a wire, 928.6 kbaud, or HS-UART2 with the
Bluetooth module, 464.3 kbaud and hardware flow control; `quirks.computer_link` says which.
"""

from typing import Final, NamedTuple

import cython

from ranger_sim.boards import counters
from ranger_sim.boards.firmware_board import FirmwareBoard
from ranger_sim.boards.main_brain import controllers
from ranger_sim.boards.main_brain.data_link import DataLink
from ranger_sim.boards.main_brain.error_distribution import ErrorDistribution
from ranger_sim.boards.main_brain.estimator import Estimator
from ranger_sim.boards.main_brain.io_data import IoData
from ranger_sim.boards.main_brain.mode_machine import ModeMachine
from ranger_sim.boards.main_brain.programs import program
from ranger_sim.boards.modules.ssp_link import MainBrainSspLink
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import mb as table
from ranger_sim.datatable.generated.all_variables import ID_OF_LAST, TABLE_SIZE
from ranger_sim.datatable.store import DataStore
from ranger_sim.firmware_sim.peripherals.ssp import SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import DMA_DONE, FIQ, SOFTWARE
from ranger_sim.foundation.events import SSP_SEGMENT, EventQueue
from ranger_sim.foundation.user_error import FirmwareError

EXECUTION_TIMER_HZ: Final = 13_000_000  # Timer0 counts the peripheral clock (robot.md N3.8)
EXECUTION_TIMER_MHZ: Final = 13
HEARTBEAT_BIT: Final = 8  # of the network time
HEARTBEAT_MS: Final = 50

# Both edges of slave select: stop and restart two DMA channels; about 300 instructions of C (chosen by us).
SEGMENT_CYCLES = 450


class ComputerPort(NamedTuple):
    """One of the two ports for the computer. `cts_pin`: clear to send, low; -1: no flow control."""

    uart: int
    rate: int  # HSU_RATE
    cts_pin: int


COMPUTER_PORTS = {"wired": ComputerPort(1, 0, -1), "bluetooth": ComputerPort(2, 1, 0)}
LIGHTS = [getattr(table, f"UI_SET_LED_{light}") for light in range(1, 7)]
TRANSMIT_CHANNEL = 3  # GPDMA (robot.md N4.15)
RESTART_SLOT, DMA_SLOT = 1, 2  # after the timer; tested in this order (robot.md N4.16)
# Acknowledge, find the next segment, write four registers of the channel: about as many instructions as an exchange
# of the link to the router takes (chosen by us).
DMA_CYCLES = 450
RESTART_CYCLES = 500


@cython.cclass
class MainBrainBoard(FirmwareBoard):
    """`controller`: name of a parameter set, path of a .toml file, or a loaded Controller.

    Open to the harness and to tests: `store` (the data table), `estimator`, `modes`, `errors`, `distribution`.
    """

    distribution: object
    controller: object
    program: str
    store: DataStore
    ssp: SspPort
    link: MainBrainSspLink
    io: IoData
    computer_uart: HsUart
    computer: DataLink
    estimator: Estimator
    modes: ModeMachine
    heartbeat_on: cython.bint
    execution_time_folds: cython.bint
    heartbeat_bit: cython.longlong
    heartbeat_until: cython.longlong
    execution_time_id: cython.longlong

    def __init__(self, crystal, quirks, phase_ns=0, controller="record-2011") -> None:
        board: object = self  # a compiled class would hand out wrappers of inherited methods
        if not isinstance(controller, controllers.Controller):
            controller = controllers.load(controller)
        quirks = program(controller.program).switches(quirks)
        FirmwareBoard.__init__(self, table, crystal, quirks, quirks.errors_reported_one_late)
        self.store = DataStore(TABLE_SIZE)
        self.memory = self.store.words
        self.store.on_out_of_range = self.id_out_of_range
        for number, value in table.INITIAL.items():
            if table.TYPES[number] == "f32":
                self.store.set_float(number, value)
            else:
                self.store.set_int(number, int(value))

        self.ssp = SspPort(self, 0)
        self.link = MainBrainSspLink(board.report, ID_OF_LAST)
        self.io = IoData(self.store, self.link, self.time, table.SEND)
        port = COMPUTER_PORTS[quirks.computer_link]
        self.computer_uart = HsUart(self, port.uart, TRANSMIT_CHANNEL, port.rate, cts_pin=port.cts_pin)
        self.computer = DataLink(
            self,
            self.computer_uart,
            self.store,
            board.report,
            checked=quirks.parameter_writes_checked,
            dma_off_at_start=quirks.serial_dma_off_at_start,
        )
        self.estimator = Estimator(self.store, quirks, board.report)
        self.program = controller.program
        self.modes = ModeMachine(self.store, quirks, self.estimator, self.program)
        self.distribution = ErrorDistribution(self.store, self.errors, quirks.error_distribution_inverted)
        self.controller = None
        self.load_controller(controller)

        self.heartbeat_on = False
        self.heartbeat_bit = 0
        self.heartbeat_until = 0
        self.execution_time_folds = quirks.main_brain_execution_time_folds
        self.execution_time_id = table.MB_EXECUTION_TIME
        self.vic.attach(SSP_SEGMENT, 0, self.on_segment, SEGMENT_CYCLES, slot=FIQ, name="ssp")
        self.vic.attach(SOFTWARE, 0, self.computer.on_restart, RESTART_CYCLES, slot=RESTART_SLOT, name="serial restart")
        self.vic.attach(
            DMA_DONE, TRANSMIT_CHANNEL, self.computer.on_sent, DMA_CYCLES, slot=DMA_SLOT, name="serial sent"
        )
        self.computer.build_lists()
        if not quirks.main_brain_overrun_check:
            self.on_overrun = None
        self.on_limit = self.note_limit  # on this board also in 2016
        self.ssp.load(self.link.next_segment())
        self.start(self.schedule(), phase_ns)

    @cython.ccall
    def load_controller(self, controller) -> object:
        """Take over a parameter set; also while walking, as the computer's parameter page could.

        UserError for a set of another program: that one is chosen at power-up, as code would be loaded.
        """
        if not isinstance(controller, controllers.Controller):
            controller = controllers.load(controller)
        if controller.program != self.program:
            raise FirmwareError(
                f"controller {controller.name}: for program {controller.program!r}, this board runs {self.program!r}"
            )
        self.controller = controller
        controller.apply(self.store)

    def move_memory(self, words) -> None:
        """The data table stands in `words` from now on."""
        self.store.move(words)
        self.memory = words

    def watched(self) -> cython.longlong:
        """The swing leg, as the estimator has it."""
        return self.estimator.swing_leg

    def counters(self) -> object:
        """What the board counted, by name."""
        return counters.of_board(self, [], self.link)

    def schedule(self) -> Schedule:
        """Source: robot.md N3.8.

        Costs are chosen by us, because no execution times of this board are known: the ARM926 has no
        floating point unit, so about 60 cycles per operation, 1500 per sine or root, 30 per table access.
        """
        # untyped names: a compiled class would hand out wrappers of its parts' methods instead of the methods
        errors: object = self.errors
        io: object = self.io
        computer: object = self.computer
        estimator: object = self.estimator
        modes: object = self.modes
        errors_of_all: object = self.distribution.distribute
        execution_time: object = self.store_execution_time
        refresh: tuple = ()
        if self.quirks.lights_in_every_slot:
            lights: object = self.refresh_lights
            refresh = (Task(lights, name="refresh_lights", cost=180, limit=300),)
        return Schedule(
            slot_us=2000,
            divider=2,  # Timer0 ticks every 1 ms
            tick_slot=0,
            completion_flag=self.quirks.main_brain_overrun_check,
            every=(
                #    function            name                      cost (cycles) limit
                Task(errors.update,      name="update_errors",     cost=300,   limit=6000,  per_item=200, item="error"),
                Task(self.beat,          name="heartbeat",         cost=150,   limit=300),
                Task(io.receive,         name="parse_ssp",         cost=2500,  limit=30000, per_item=220, item="frame"),
                Task(estimator.update,   name="estimator",         cost=38000, limit=60000),
                Task(modes.update,       name="controller",        cost=16000, limit=30000),
                *refresh,
                Task(io.send,            name="send_ssp",          cost=2000,  limit=12000, per_item=160, item="frame"),
                Task(computer.send_data, name="send_data",         cost=300,   limit=4000,  per_item=250, item="step"),
            ),
            rows=(
                (Task(computer.parse,    name="parse_packets",     cost=200,   limit=60000, per_item=110,
                      item="place"),),
                (Task(computer.swap_buffers, name="swap_receive_dma", cost=400, limit=9000, per_item=15, item="byte"),),
                (Task(computer.build_lists, name="build_lists",    cost=6000,  limit=9000),),
                (Task(errors_of_all,     name="distribute_errors", cost=900,  limit=6000, per_item=500, item="error"),),
                (),  # test of the user interface: empty on the robot as well
                (), (), (), (), (),
                (Task(execution_time,    name="execution_time",    cost=200,   limit=400),),
            ),
        )  # fmt: skip

    # --- interrupt --------------------------------------------------------------------------------------

    def on_segment(self, queue: EventQueue) -> None:
        """An exchange with the router is over: keep what came, load what goes next."""
        segment: SspSegment = self.ssp.take()
        if segment is not None:
            self.ssp.load(self.link.exchanged(segment))

    # --- tasks of our own -------------------------------------------------------------------------------

    def beat(self) -> None:
        """The heartbeat light: on for 50 ms when bit 8 of the network time rises (robot.md N1.8)."""
        bit: cython.longlong = self.time.ms >> HEARTBEAT_BIT & 1
        if bit == 1 and self.heartbeat_bit == 0:
            self.heartbeat_on = True
            self.heartbeat_until = self.time.ms + HEARTBEAT_MS
        elif self.heartbeat_on and (self.time.ms - self.heartbeat_until) >> 31 & 1 == 0:
            self.heartbeat_on = False
        self.heartbeat_bit = bit

    def refresh_lights(self) -> None:
        """The six lights are new in every slot, as in 2016 (robot.md N2.5)."""
        number: cython.longlong
        for number in LIGHTS:
            self.store.set_int(number, self.store.get_int(number))

    def store_execution_time(self) -> None:
        """Seconds since the slot began, by Timer0; with the firmware's quirk since the latest tick of 1 ms."""
        since: cython.longlong = self.scheduler.slot_time
        counts: cython.longlong
        if self.execution_time_folds:
            since = self.match_time
        counts = (self.now - since) * EXECUTION_TIMER_MHZ // 1000
        self.store.set_float(self.execution_time_id, counts / EXECUTION_TIMER_HZ)

    def id_out_of_range(self) -> None:
        """The store was asked for an identifier that no variable has."""
        self.report(codes.MB_IO_ID_OOR)
