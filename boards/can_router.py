# cython: boundscheck=False, wraparound=False
# (every index below is a bus, a place of its rings, or a number of frames that one turn can move)
"""The CAN router (CSR, board B10A): four buses, the link to the main brain, the robot's time.

Source: robot.md N1.4-N1.6, N3.7, N4.16; appendix 3.7, 3.11. Interrupts fill rings and keep the time; the
main loop moves frames whenever no slot runs: run the scheduler, then four times "route, flush one bus".
"""

from typing import Final

import cython

from ranger_sim.boards import counters
from ranger_sim.boards.firmware_board import ALL_CAN_INTERRUPTS, FirmwareBoard
from ranger_sim.boards.modules.can_errors import CanErrors
from ranger_sim.boards.modules.can_link import FIRST_BUFFER, SECOND_BUFFER
from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.mcu_led import Heartbeat
from ranger_sim.boards.modules.network_clock import CYCLES_PER_SYNC, NetworkClock
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.publishing import Send, laid_out
from ranger_sim.boards.modules.routing import TO_SEND, TRANSMIT_MASK, TRANSMIT_RING, Router, RoutingTable
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.boards.modules.ssp_link import SEGMENT_HALF_WORDS, RouterSspLink
from ranger_sim.datatable.generated import csr as table
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.datatable.generated import routes
from ranger_sim.firmware_sim.board import EVERY_KIND
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller import EIGHT_BYTES, RFS_EIGHT_BYTES, CanController
from ranger_sim.firmware_sim.peripherals.can_controller_base import MOD_RESET
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.ssp import SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.timer_capture import IR_MR0, TimerCapture
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import FIQ, FIQ_LATENCY, TIMER_MATCH
from ranger_sim.foundation.events import CAN_RX, CAN_STATUS, CAN_TX_DONE, SSP_SEGMENT
from ranger_sim.foundation.numbers import float32

BUSES: Final = 4
# lights of a bus, and from how many frames per ms on they show it (robot.md N1.10)
LED_OFF: Final = 0
LED_TRAFFIC: Final = 1
LED_WARNING: Final = 2
LED_FULL: Final = 3
WARNING_FRAMES_PER_MS: Final = 20
FULL_FRAMES_PER_MS: Final = 30

# Cycles of the interrupts and of the main loop, chosen by us, because no cycle count of this firmware is
# known; each is an estimate of instructions and of accesses over the slow peripheral bus.
RECEIVE_CYCLES = 2 * 27 - FIQ_LATENCY  # as counted on the motor boards (robot.md T2)
SEGMENT_TIMER_CYCLES = 140  # counters, segment bookkeeping, transmit interrupt on
# 31 half-words pass a FIFO of eight: about eight entries of 30 cycles, and 14 cycles per half-word both ways
SEGMENT_CYCLES = 240
HALF_WORD_CYCLES = 14
ROUTE_IDLE_CYCLES = 60  # three empty rings checked
ROUTE_FRAME_CYCLES = 220  # table, learning, one push
FLUSH_IDLE_CYCLES = 25
FLUSH_FRAME_CYCLES = 110  # status, four registers, command
ERROR_CYCLES = 150  # the capture registers of four controllers
LOOP_CYCLES = 20  # the scheduler's check of its flag, once per turn of four
ERROR_SLOT = 10  # of the VIC (robot.md N4.16)
SEGMENT_PERIOD_CYCLES = 12_000  # of Timer1: 200 us
# Supply of the electronics (robot.md N5): ten-bit readings, gain and offset
CURRENT_GAIN_A, CURRENT_OFFSET = 0.000501, 6
VOLTAGE_GAIN_V, VOLTAGE_OFFSET = 0.03046, 5
# Places on `chip.analog`, in volts at the converter's input: AIN0 and AIN1.
ANALOG = {"supply_current": 0, "supply_voltage": 1}


def supply_pins_V(current_A, voltage_V):
    """Voltages at AIN0, AIN1 for a supply of `current_A` and `voltage_V`: inverse of robot.md N5, 3.3 V full scale."""
    lsb = 3.3 / 1024.0
    return (
        (current_A / CURRENT_GAIN_A - CURRENT_OFFSET) * lsb,
        (voltage_V / VOLTAGE_GAIN_V - VOLTAGE_OFFSET) * lsb,
    )


@cython.final
@cython.cclass
class BusReceiver:
    """The receive interrupt of one bus: its frames into the ring that all four share."""

    controller: CanController
    router: Router

    def __init__(self, controller: CanController, router: Router) -> None:
        self.controller = controller
        self.router = router

    def on_frame(self, queue) -> None:
        """Copy the older receive buffer and release it."""
        controller: CanController = self.controller
        flags: cython.longlong = EIGHT_BYTES
        if controller.rx_count == 0:
            return
        if controller.RFS != RFS_EIGHT_BYTES:
            flags = (controller.RFS >> 16 & 15) | (controller.RFS >> 30 & 1) << 4
        self.router.receive(controller.number, controller.RID, flags, controller.RDA, controller.RDB)
        controller.release()


@cython.final
@cython.cclass
class OwnFrames(Sender):
    """The router's own variables, stamped with its own time, into its own ring. `lost`: frames that found it full."""

    router: Router
    report: object
    report_full: cython.bint
    lost: cython.longlong

    def __init__(self, router: Router, time: NetworkTime, report, report_full) -> None:
        Sender.__init__(self, time)
        self.router = router
        self.report = report
        self.report_full = report_full
        self.lost = 0

    def send_words(
        self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong
    ) -> cython.bint:
        """A frame into the ring; False when it is lost."""
        if self.router.send(identifier, value_word, time_word):
            return True
        self.lost += 1
        if self.report_full:
            self.report(codes.CAN_TX_QUEUE_FULL)
        return False


@cython.final
@cython.cclass
class CanRouterBoard(FirmwareBoard):
    """Slots of 1 ms, 10 rows. `phase_ns`: when its program starts; the first sync comes 1 ms later."""

    # what the main loop and the interrupts touch
    router: Router
    link: RouterSspLink
    controllers: list
    load: CanLoad
    idle_since: cython.longlong
    flush_next: cython.longlong
    pair_ns: cython.longlong
    idle: cython.bint
    route_ns: cython.longlong[4]
    flush_ns: cython.longlong[3]
    ssp: SspPort
    timer1: TimerCapture
    clock: NetworkClock
    # tasks
    own: OwnFrames
    adc: AdcInternal
    lost_before: cython.longlong
    sync_cycles: cython.longlong
    can_leds: cython.longlong[5]
    # the rest
    gpio: Gpio
    heartbeat: Heartbeat
    can1: CanController
    can2: CanController
    can3: CanController
    can4: CanController
    can_errors: list

    def __init__(self, crystal, quirks, phase_ns=0) -> None:
        board: object = self  # a compiled class would hand out wrappers of inherited methods
        FirmwareBoard.__init__(self, table, crystal, quirks, quirks.errors_reported_one_late)
        self.lost_before = 0

        self.gpio = Gpio(self)
        self.heartbeat = Heartbeat(self.time, self.gpio, table.SLOT_US)
        self.adc = AdcInternal(self, clkdiv=182)
        self.can1 = CanController(self, 1, IER=ALL_CAN_INTERRUPTS)
        self.can2 = CanController(self, 2, IER=ALL_CAN_INTERRUPTS)
        self.can3 = CanController(self, 3, IER=ALL_CAN_INTERRUPTS)
        self.can4 = CanController(self, 4, IER=ALL_CAN_INTERRUPTS)
        self.controllers = [self.can1, self.can2, self.can3, self.can4]
        self.ssp = SspPort(self, 0)
        self.timer1 = TimerCapture(self, 1, period=SEGMENT_PERIOD_CYCLES, phase_ns=phase_ns, match_interrupt=True)
        self.load = CanLoad()
        self.clock = NetworkClock(self.time, self.controllers, self.load)
        self.link = RouterSspLink(board.report, quirks.ssp_frames_may_straddle)
        self.router = Router(
            RoutingTable(enumerate(routes.DESTINATIONS)),
            self.link,
            self.load,
            board.report,
            quirks.router_one_frame_lag,
        )
        self.can_leds = [0] * 5
        self.own = OwnFrames(self.router, self.time, board.report, quirks.full_queues_reported)
        self.can_errors = [CanErrors(controller, board.report) for controller in self.controllers]
        errors_line = self.vic.source(CAN_STATUS, 0)  # the chip has one error line for all controllers
        for controller in self.controllers:
            controller.error_source = errors_line

        attach = self.vic.attach
        attach(TIMER_MATCH, 1, self.on_segment_timer, SEGMENT_TIMER_CYCLES, slot=FIQ, name="timer1")
        attach(SSP_SEGMENT, 0, self.on_segment, SEGMENT_CYCLES, HALF_WORD_CYCLES, slot=FIQ, name="ssp")
        for controller in self.controllers:
            number = controller.number
            receiver: object = BusReceiver(controller, self.router)
            attach(CAN_RX, number, receiver.on_frame, RECEIVE_CYCLES, slot=FIQ, name=f"can{number} receive")
        attach(CAN_STATUS, 0, self.on_can_error, ERROR_CYCLES, slot=ERROR_SLOT, name="can error")

        self.sync_cycles = BUSES * CYCLES_PER_SYNC
        self._time_turns()
        self.idle = True
        self.idle_since = phase_ns
        self.flush_next = 0
        self.background = self.main_loop
        self.adc.start_burst(ANALOG["supply_current"], ANALOG["supply_voltage"])
        self.start(self.schedule(), phase_ns)

    def _time_turns(self) -> None:
        """Cycles of a turn of the main loop, by the frames it moves: one each from three sources; into two buffers."""
        route_cycles = [ROUTE_IDLE_CYCLES + ROUTE_FRAME_CYCLES * moved for moved in range(4)]
        flush_cycles = [FLUSH_IDLE_CYCLES + FLUSH_FRAME_CYCLES * moved for moved in range(3)]
        self.route_ns = [int(cycles * self.ns_per_cycle) for cycles in route_cycles]
        self.flush_ns = [int(cycles * self.ns_per_cycle) for cycles in flush_cycles]
        self.pair_ns = int((ROUTE_IDLE_CYCLES + FLUSH_IDLE_CYCLES + LOOP_CYCLES // BUSES) * self.ns_per_cycle)

    def retune(self, ppb, now) -> None:
        """`Microcontroller.retune`, and the turns of the main loop with it."""
        FirmwareBoard.retune(self, ppb, now)
        self._time_turns()

    def counters(self) -> object:
        """What the board counted, by name."""
        router, skipped = self.router, self.clock.skipped
        can = [
            counters.of_controller(each, router.receive_lost_from[n], router.transmit_lost[n], skipped[n])
            for n, each in enumerate(self.controllers, start=1)
        ]
        return counters.of_board(self, can, self.link, router)

    def schedule(self) -> Schedule:
        """Source: robot.md N3.7.

        No execution times of this board are known: functions that the motor boards have cost what was counted there
        (robot.md T2), lines that send a variable what theirs cost, the rest is chosen by us. A limit is a third above
        the most that a call was counted to take, or is thought to.
        """
        board: object = self  # a compiled class would hand out wrappers of its parts' methods
        load: object = self.load
        return Schedule(
            slot_us=1000,
            tick_slot=0,
            every=(
                #    function              cost (cycles)  limit
                Task(self.send_time,       cost=2 * 60,   limit=300),
                Task(self.update_errors,   cost=2 * 39,   limit=5500, per_item=2 * 213, item="error"),
                Task(self.count_load,      cost=110,      limit=200),
                Task(board.heartbeat.update, cost=2 * 31, limit=130),
                Task(self.show_load,       cost=100,      limit=200),
                Task(board.heartbeat.beat, cost=2 * 21,   limit=90),
            ),
            **laid_out(table, self.own, (
                #    variable           value                         cost limit
                Send("ERROR_CSR",       board.errors,                  2 * 8, 2 * 300, 2 * 196),
                Send("CSR_MCU_POWER",   board.power_W,                 2 * 265, 2 * 360),
                Send("CSR_MCU_CURRENT", board.current_A,               2 * 322, 2 * 440),
                Send("CSR_MCU_VOLTAGE", board.voltage_V,               2 * 310, 2 * 420),
                Send("CSR_CAN1_LOAD",   lambda: load.report_peak(1),   2 * 174, 2 * 240),
                Send("CSR_CAN2_LOAD",   lambda: load.report_peak(2),   2 * 174, 2 * 240),
                Send("CSR_CAN3_LOAD",   lambda: load.report_peak(3),   2 * 174, 2 * 240),
                Send("CSR_CAN4_LOAD",   lambda: load.report_peak(4),   2 * 174, 2 * 240),
            )),
            extra_idle_call=self.quirks.occasional_idle_call,
        )  # fmt: skip

    # --- interrupts -------------------------------------------------------------------------------------

    def on_segment_timer(self, queue) -> None:
        """Timer1, every 200 us: the time, and the next exchange with the main brain."""
        self.timer1.clear(IR_MR0)
        if self.clock.tick():
            self.extra_cycles += self.sync_cycles
        self.ssp.start(self.link.tick(self.now))

    def on_segment(self, queue) -> object:
        """An exchange is over; returns its half-words, whose FIFO service is charged here in one."""
        segment: SspSegment = self.ssp.take()
        if segment is None:
            return None
        self.link.receive(segment)
        if self.idle and self.nothing_waits():  # the segment waits for the timer's next interrupt
            self.background_wanted = False
        return SEGMENT_HALF_WORDS

    def on_can_error(self, queue) -> None:
        """Check every controller: read its capture register, restart it when it is bus-off."""
        for controller in self.can_errors:
            controller.check()

    # --- main loop --------------------------------------------------------------------------------------

    def urgent_kinds(self) -> cython.longlong:
        """Any kind, except that a transmit buffer becomes free when nothing waits for it."""
        return EVERY_KIND if self.router.waiting else EVERY_KIND & ~(1 << CAN_TX_DONE)

    @cython.ccall
    @cython.exceptval(check=False)
    def nothing_waits(self) -> cython.bint:
        """True while the main loop has nothing to move, now or when a buffer gets free."""
        return (
            self.router.to_route == 0
            and self.router.waiting == 0
            and self.link.received_read == self.link.received_write
        )

    @cython.ccall
    def flush(self, controller: CanController, began: cython.longlong) -> cython.longlong:
        """Fill transmit buffers 1 and 2, those free when the turn `began` (ns), from the ring of the controller's bus.

        Returns frames moved.
        """
        router: Router = self.router
        channel: cython.longlong = controller.number
        buffer: cython.longlong
        row: cython.longlong
        read: cython.longlong = router.tx_read[channel]
        moved: cython.longlong = 0
        while read != router.tx_write[channel]:
            if controller.free_at(FIRST_BUFFER, began):
                buffer = FIRST_BUFFER
            elif controller.free_at(SECOND_BUFFER, began):
                buffer = SECOND_BUFFER
            else:
                break
            row = TO_SEND * (channel * TRANSMIT_RING + read)
            if not controller.transmit_if_free(
                buffer, router.tx_rows[row], router.tx_rows[row + 1], router.tx_rows[row + 2], router.tx_rows[row + 3]
            ):
                break
            read = (read + 1) & TRANSMIT_MASK
            moved += 1
        if moved > 0:
            router.tx_read[channel] = read
            router.waiting -= moved
            self.load.counts[channel] += moved
        return moved

    @cython.ccall
    def can_flush(self, at: cython.longlong) -> cython.bint:
        """True when at `at` (ns) a frame waits for a bus that has a free transmit buffer and is not in reset.

        Where both buffers are taken, the end of a transmission will wake the main loop.
        """
        controller: CanController
        channel: cython.longlong
        for channel in range(1, BUSES + 1):
            if self.router.tx_read[channel] != self.router.tx_write[channel]:
                controller = self.controllers[channel - 1]
                if not controller.free_at(FIRST_BUFFER, at) and not controller.free_at(SECOND_BUFFER, at):
                    controller.report_first_end()
                elif not controller.MOD & MOD_RESET:
                    return True
        return False

    def main_loop(self) -> cython.longlong:
        """Move waiting frames, until none waits or something else is due; returns the time reached, 0 when it idles.

        An idle loop spins through its four pairs of "route, flush", so work that comes up waits for the
        pair in progress to end and is met wherever the loop happens to be.
        """
        at: cython.longlong = self.now
        began: cython.longlong
        passed: cython.longlong
        pairs: cython.longlong
        moved: cython.longlong
        channel: cython.longlong
        to_route: cython.bint
        to_flush: cython.bint = False
        router: Router = self.router
        while True:
            to_route = router.to_route > 0 or self.link.received_read != self.link.received_write
            if not to_route and not to_flush:
                to_flush = router.waiting > 0 and self.can_flush(at)
                if not to_flush:
                    break
            began = at
            if self.idle:
                self.idle = False
                passed = at - self.idle_since
                pairs = passed // self.pair_ns  # floored: the first work may come before `phase_ns`
                passed -= pairs * self.pair_ns
                if passed > 0:
                    pairs += 1
                    at += self.pair_ns - passed
                self.flush_next = (self.flush_next + pairs) % BUSES
            moved = router.route_step(at) if to_route else 0
            at += self.route_ns[moved]
            moved = 0
            channel = self.flush_next + 1
            if router.waiting > 0 and router.tx_read[channel] != router.tx_write[channel]:
                self.now = at
                moved = self.flush(self.controllers[self.flush_next], began)
                to_flush = False  # not known any more
            at += self.flush_ns[moved]
            self.flush_next = channel % BUSES
            if at >= self.horizon or at >= self.alarm_time or at >= self.inbox.head_time:
                return at
        if self.idle:
            return 0
        self.idle = True
        self.idle_since = at
        self.background_wanted = False
        return at

    # --- slot tasks -------------------------------------------------------------------------------------

    def send_time(self) -> None:
        """The main brain's copy of the time.

        ROBOT PARITY: on the robot the first word of this copy is the count as a float; the table has the
        variable as a whole number, so here both words are the count, as on the buses.
        """
        self.own.send_words(table.TIMESTAMP, self.time.ms, self.time.ms)

    def update_errors(self) -> object:
        """Collect the errors of the slot; frames lost to full transmit rings since the last call are one."""
        lost: cython.longlong = 0
        i: cython.longlong
        if self.own.report_full:
            for i in range(1, BUSES + 1):
                lost += self.router.transmit_lost[i]
            while self.lost_before < lost:
                self.lost_before += 1
                self.report(codes.CAN_TX_QUEUE_FULL)
        return self.errors.update()

    def count_load(self) -> None:
        """The millisecond's frame counts."""
        self.load.end_of_millisecond()

    def show_load(self) -> None:
        """One light per bus: 0 silent, 1 traffic, 2 from 20 frames/ms, 3 from 30.

        ROBOT PARITY: their pins are not known, so they are state only.
        """
        i: cython.longlong
        count: cython.longlong
        for i in range(1, BUSES + 1):
            count = self.load.last_counts[i]
            if count == 0:
                self.can_leds[i] = LED_OFF
            elif count < WARNING_FRAMES_PER_MS:
                self.can_leds[i] = LED_TRAFFIC
            elif count < FULL_FRAMES_PER_MS:
                self.can_leds[i] = LED_WARNING
            else:
                self.can_leds[i] = LED_FULL

    @cython.ccall
    def current_A(self) -> cython.double:
        """Supply current of the electronics by the converter."""
        return float32(CURRENT_GAIN_A * (self.adc.DR(0) + CURRENT_OFFSET))

    @cython.ccall
    def voltage_V(self) -> cython.double:
        """Supply voltage of the electronics by the converter."""
        return float32(VOLTAGE_GAIN_V * (self.adc.DR(1) + VOLTAGE_OFFSET))

    @cython.ccall
    def power_W(self) -> cython.double:
        """Power of the electronics: the product of both."""
        return self.current_A() * self.voltage_V()
