"""A board whose firmware is C: the chip and its devices are the emulated ones, tasks and handlers are C functions.

What the program calls (firmware.h) arrives at the methods of `Calls`, one for each call.
"""

import array
import contextlib
import pathlib
from collections.abc import Iterator
from typing import Any

from ranger_sim.firmware_sim.counters import CanCounters, ProgramCounters
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.native.hardware import DEFAULT_HZ, Hardware
from ranger_sim.firmware_sim.native.library import Library, ffi, text
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from ranger_sim.firmware_sim.peripherals.ssp import (
    LONGEST_WORD,
    SEGMENT_WORDS,
    SspDevice,
    SspMaster,
    SspPort,
    SspSegment,
)
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Occasional, Schedule, Task, Wait
from ranger_sim.foundation.user_error import FirmwareError, UserError

# fw_schedule_flags and fw_kind of firmware.h
TRANSMITTERS_NAMED, NO_COMPLETION_FLAG, NO_IDLE_CALL = 1, 2, 4
WAIT = 1
LER_OF_MATCH = 1  # PWMLER: bit n is match register n
CMR_AT, CMR_CDO, CMR_STB1 = 0x2, 0x8, 0x20  # CxCMR
USUAL_LATENCY = -1
WORD = 0xFFFF_FFFF
LONGEST_TURN_NS = 10_000_000  # of a program that is not stopped earlier; chosen by us: some slots
MAIN_ENDED, NO_STACK = -1, -2  # further results of a turn of a main loop, next to cycles


class NotStartedError(Exception):
    """The program uses a device that it has not started."""


class Started(dict):
    """Devices by number, those that the program has started."""

    def __init__(self, what: str) -> None:
        self.what = what

    def __missing__(self, number: int) -> Any:
        there = ", ".join(str(each) for each in sorted(self)) or "none"
        raise NotStartedError(f"{self.what} {number} is not started (started: {there})")


class StartUp(Peripheral):
    """The steps of the start-up, each at its time."""

    def __init__(self, chip: Any, steps: list[tuple[int, Any]]) -> None:
        Peripheral.__init__(self, chip)
        self.functions = [function for _, function in steps]
        for number, (time, _) in enumerate(steps):
            chip.new_alarm(self, number).set(time)

    def on_alarm(self, alarm: int, time: int) -> None:
        self.functions[alarm]()


class PlainPin(Peripheral):
    """A pin with an encoder that the program does not capture: its level can be read, no more."""

    def on_pin(self, channel: int, level: int, time: int) -> int:
        return 0


class Calls:
    """What the calls of firmware.h do: a method for each, with whole numbers in and out."""

    def __init__(self, chip: Any, library: Library, hardware: Hardware, phase_ns: int) -> None:
        self.chip = chip
        self.code = library.code
        self.mail = library.code.fw_mail
        self.hardware = hardware
        self.phase_ns = phase_ns
        self.gpio = Gpio(chip)
        self.timers = Started("timer")
        self.pwms = Started("PWM")
        self.adcs = Started("internal converter")
        self.adcxs = Started("external converter")
        self.spis = Started("SPI")
        self.ssps = Started("SSP")
        self.masters = Started("SSP as a master of words")
        self.uarts = Started("UART")
        self.cans = Started("CAN controller")

    def new(self, started: Started, number: int) -> None:
        """Check that device `number` can be started."""
        if number in started:
            raise FirmwareError(f"{started.what} {number} is started twice")

    # --- interrupts, time ---------------------------------------------------------------------------------

    def attach(self, address: int) -> None:
        it = ffi.cast("fw_interrupt *", address)
        handler = it.handler
        if handler == ffi.NULL:
            raise FirmwareError(f"interrupt {it.kind}/{it.index}: no handler")
        self.chip.vic.attach(
            it.kind,
            it.index,
            lambda queue: handler(),
            it.cost,
            it.per_item,
            it.vic_slot,
            None if it.latency == USUAL_LATENCY else it.latency,
            text(it.name) or None,
        )

    def detach(self, kind: int, index: int) -> None:
        self.chip.vic.detach(self.chip.vic.source(kind, index))

    def request(self, kind: int, index: int) -> int:
        return self.chip.request(self.chip.vic.source(kind, index))

    def spend(self, cycles: int) -> None:
        self.chip.spend(cycles)

    def idle(self) -> None:
        raise FirmwareError("only a board's own main loop can sleep, not a task or a handler")

    def slot_cycles(self) -> int:
        return self.chip.cycles_since_tick()

    def cycles(self) -> int:
        return int((self.chip.now - self.phase_ns) * self.chip.cycles_per_ns)

    # --- pins ---------------------------------------------------------------------------------------------

    def pin_write(self, pin: int, level: int) -> None:
        self.gpio.write(self.pin(pin), int(level != 0))

    def pin_toggle(self, pin: int) -> None:
        self.gpio.toggle(self.pin(pin))

    def pin(self, pin: int) -> int:
        """The number of a pin that exists: the models take any."""
        if pin > 63:
            raise FirmwareError(f"pin {pin} is not 0 ... 63")
        return pin

    def port(self, port: int) -> int:
        """The number of a port that exists."""
        if port > 1:
            raise FirmwareError(f"port {port} is neither 0 nor 1")
        return port

    def IOPIN(self, port: int) -> int:
        return self.gpio.IOPIN(self.port(port))

    def IOSET(self, port: int, mask: int) -> None:
        self.gpio.IOSET(self.port(port), mask)

    def IOCLR(self, port: int, mask: int) -> None:
        self.gpio.IOCLR(self.port(port), mask)

    # --- timers -------------------------------------------------------------------------------------------

    def timer_start(self, timer: int, period: int, match_interrupt: int) -> None:
        self.new(self.timers, timer)
        self.timers[timer] = TimerCapture(
            self.chip, timer, period, phase_ns=self.phase_ns, match_interrupt=match_interrupt != 0
        )

    def capture_connect(self, timer: int, channel: int, pin: int) -> None:
        device = self.timers[timer]
        bits = device.CCR  # connecting arms a channel; here the program does
        device.use_channel(channel, pin)
        device.CCR = bits

    def timer_CCR(self, timer: int) -> int:
        return self.timers[timer].CCR

    def timer_write_CCR(self, timer: int, value: int) -> None:
        self.timers[timer].CCR = value & 0xFFF

    def timer_CR(self, timer: int, channel: int) -> int:
        return self.timers[timer].CR(channel & 3)

    def timer_IR(self, timer: int) -> int:
        return self.timers[timer].IR

    def timer_clear_IR(self, timer: int, mask: int) -> None:
        self.timers[timer].clear(mask)

    def timer_TC(self, timer: int) -> int:
        return self.timers[timer].TC()

    # --- PWM ----------------------------------------------------------------------------------------------

    def pwm_start(self, period: int) -> None:
        self.new(self.pwms, 0)
        self.pwms[0] = Pwm(self.chip, period=period, phase_ns=self.phase_ns)

    def match(self, number: int) -> str:
        """The name of a match register."""
        if number > 6:
            raise FirmwareError(f"PWM: match register {number} is not 0 ... 6")
        return f"MR{number}"

    def pwm_MR(self, match: int) -> int:
        return getattr(self.pwms[0], self.match(match))

    def pwm_write_MR(self, match: int, counts: int) -> None:
        setattr(self.pwms[0], self.match(match), counts)

    def pwm_latch(self, mask: int) -> None:
        self.pwms[0].latch(mask)

    def pwm_write(self, MR2: int, MR6: int) -> None:
        self.pwms[0].write(MR2, MR6)

    # --- converters ---------------------------------------------------------------------------------------

    def adc_start_clock(self, clkdiv: int) -> None:
        self.new(self.adcs, 0)
        it = self.hardware.internal
        adc = AdcInternal(
            self.chip, clkdiv=clkdiv, reference_V=it.reference_V, scale=it.scale, offset_counts=it.offset_counts
        )
        adc.inputs = [it.inputs.get(channel, channel) for channel in range(8)]
        self.adcs[0] = adc

    def channel(self, channel: int) -> int:
        """A channel of the internal converter that exists."""
        if channel > 7:
            raise FirmwareError(f"internal converter: channel {channel} is not 0 ... 7")
        return channel

    def adc_start(self, channel: int) -> int:
        return self.adcs[0].start(self.channel(channel))

    def adc_result(self) -> int:
        return self.adcs[0].result

    def adc_burst(self, mask: int) -> None:
        self.adcs[0].start_burst(*(channel for channel in range(8) if mask >> channel & 1))

    def adc_DR(self, channel: int) -> int:
        return self.adcs[0].DR(self.channel(channel))

    def adcx_start_ssp(self) -> None:
        self.new(self.adcxs, 0)
        it = self.hardware.external
        if it is None:
            raise FirmwareError("this board has no external converter")
        if 0 in self.masters:
            raise FirmwareError("the SSP is a master of words already, so the external converter cannot have it")
        adc = Ads7871(self.chip, it.eint, it.reference_V, it.conversion_ns, it.scale, it.offset_counts)
        adc.inputs = [it.inputs.get(code, code) for code in range(16)]
        self.adcxs[0] = adc

    def adcx_write(self, register4: int, later_ns: int) -> int:
        return self.adcxs[0].write(register4, self.chip.now + later_ns)

    def adcx_busy(self) -> int:
        return self.adcxs[0].busy

    def adcx_result(self) -> int:
        return self.adcxs[0].read_result()

    # --- serial ports -------------------------------------------------------------------------------------

    def spi_start(self, number: int) -> None:
        self.new(self.spis, number)
        if number not in self.hardware.spi:
            raise FirmwareError(f"nothing hangs on SPI {number} of this board")
        it = self.hardware.spi[number]
        self.spis[number] = SpiEncoder(self.chip, number, it.word, it.bits, it.bit_rate, it.value_bits)

    def spi_transfer(self, number: int) -> int:
        return self.spis[number].start()

    def spi_SPSR(self, number: int) -> int:
        return self.spis[number].SPSR

    def spi_SPDR(self, number: int) -> int:
        return self.spis[number].read()

    def ssp_start(self, number: int) -> None:
        self.new(self.ssps, number)
        self.ssps[number] = SspPort(self.chip, number)

    def posted_segment(self) -> SspSegment:
        """The half-words in the mail."""
        segment = SspSegment()
        segment.words = list(self.mail[0:SEGMENT_WORDS])
        return segment

    def ssp_exchange(self, number: int) -> None:
        self.ssps[number].start(self.posted_segment())

    def ssp_load(self, number: int) -> None:
        self.ssps[number].load(self.posted_segment())

    def ssp_take(self, number: int) -> int:
        segment = self.ssps[number].take()
        if segment is None:
            return 0
        self.mail[0:SEGMENT_WORDS] = segment.words
        return 1

    def ssp_start_words(self, bits: int, divider: int) -> None:
        self.new(self.masters, 0)
        if 0 in self.adcxs:
            raise FirmwareError("the external converter has the SSP")
        if not 4 <= bits <= LONGEST_WORD:
            raise FirmwareError(f"SSP: words of {bits} bits: 4 to {LONGEST_WORD} are possible")
        if divider % 2 or not 2 <= divider <= 512:
            raise FirmwareError(f"SSP: divider {divider}: even, 2 to 512 is possible")
        device = self.chip.panel.ssp if self.chip.panel is not None else SspDevice(self.chip)
        self.masters[0] = SspMaster(self.chip, device, bits)

    def ssp_word(self, word: int) -> int:
        return self.masters[0].word(word)

    def uart_start(self, number: int, divisor: int, divaddval: int, mulval: int, trigger: int) -> None:
        self.new(self.uarts, number)
        self.uarts[number] = Uart(self.chip, number, divisor, divaddval, mulval, trigger)

    def uart_RBR(self, number: int) -> int:
        return self.uarts[number].RBR()

    def uart_THR(self, number: int, byte: int) -> int:
        return self.uarts[number].THR(byte)

    def uart_LSR(self, number: int) -> int:
        return self.uarts[number].LSR()

    def uart_IIR(self, number: int) -> int:
        return self.uarts[number].IIR

    # --- CAN ----------------------------------------------------------------------------------------------

    def can_start(self, controller: int, BTR: int, IER: int) -> None:
        self.new(self.cans, controller)
        self.cans[controller] = CanController(self.chip, controller, BTR, IER)

    def can_transmit(self, place: int, TFI: int, TID: int, TDA: int, TDB: int) -> int:
        # DLC in bits 16-19, RTR bit 30, FF bit 31; as the flags of foundation/events.py: bits 0-3, 4, 6
        flags = TFI >> 16 & 15 | TFI >> 26 & 16 | TFI >> 25 & 64
        return self.cans[place >> 32].transmit_if_free(place & WORD, TID, flags, TDA, TDB)

    def buffer(self, buffer: int) -> int:
        """A transmit buffer that exists."""
        if not 1 <= buffer <= 3:
            raise FirmwareError(f"CAN: transmit buffer {buffer} is not 1 ... 3")
        return buffer

    def can_buffer_free(self, controller: int, buffer: int) -> int:
        return self.cans[controller].buffer_free(self.buffer(buffer))

    def can_abort(self, controller: int, buffer: int) -> None:
        self.cans[controller].write_CMR(CMR_AT | CMR_STB1 << self.buffer(buffer) - 1)

    def can_read(self, controller: int) -> None:
        can, mail = self.cans[controller], self.mail
        mail[0] = can.RFS
        mail[1] = can.RID
        mail[2] = can.RDA
        mail[3] = can.RDB

    def can_release(self, controller: int) -> None:
        self.cans[controller].release()

    def can_clear_overrun(self, controller: int) -> None:
        self.cans[controller].write_CMR(CMR_CDO)

    def can_GSR(self, controller: int) -> int:
        return self.cans[controller].GSR()

    def can_SR(self, controller: int) -> int:
        return self.cans[controller].SR()

    def can_ICR(self, controller: int) -> int:
        return self.cans[controller].read_ICR()

    def can_MOD(self, controller: int) -> int:
        return self.cans[controller].MOD

    def can_write_MOD(self, controller: int, value: int) -> None:
        self.cans[controller].write_MOD(value)

    def can_write_IER(self, controller: int, value: int) -> None:
        self.cans[controller].write_IER(value)


class NativeBoard(Microcontroller):
    """A chip with the devices of `hardware` that runs the firmware in the library `path` from `phase_ns` (ns) on.

    A misuse of a device that the chip would not survive ends the run with a UserError
    that names the call. `devices` has what the program has started. record: as for `leave_record_in`, from the start.
    """

    def __init__(
        self,
        name: str,
        path: str | pathlib.Path,
        crystal: Any = None,
        phase_ns: int = 0,
        hardware: Hardware | None = None,
        record: Any = None,
    ) -> None:
        hardware = hardware if hardware is not None else Hardware()
        Microcontroller.__init__(self, name, hardware.hz or DEFAULT_HZ, crystal)
        self.library = Library(pathlib.Path(path))
        if record is not None:
            self.leave_record_in(record)
        self.failure: UserError | None = None
        self.phase_ns = phase_ns
        self.now = phase_ns
        if hardware.panel is not None:
            self.carry(hardware.panel(self))
        self.devices = Calls(self, self.library, hardware, phase_ns)
        levels = array.array("q", bytes(8 * len(self.pins)))  # where the program reads them without a call
        self.pins = levels
        self.pin_levels = ffi.from_buffer("int64_t[]", levels)
        self.library.code.fw_pin_levels = self.pin_levels
        self.callbacks = [self._callback(call, name) for call, name in enumerate(self.library.call_names())]
        self.counts: pathlib.Path | None = None  # folder for coverage
        self.turn = 0
        self.reached = phase_ns
        with self._running():
            self.library.code.firmware_start()
        self._raise_failure()
        with self._running():
            self.error_counts = self.library.code.firmware_errors() if self.library.has("firmware_errors") else None
        if self.library.schedule:
            self._take_schedule()
        else:
            self.background = self._turn
            self.input_time = self.code_time = phase_ns
            self.next_time = phase_ns

    def _callback(self, number: int, name: str) -> Any:
        """Execute a call of the program."""
        method = getattr(self.devices, name, None)
        if method is None:
            raise FirmwareError(f"{self.library.path}: it calls fw_{name}, which is not known here: build it again")
        count = method.__code__.co_argcount - 1
        functions = (
            lambda a, b, c, d, e: method() or 0,
            lambda a, b, c, d, e: method(a) or 0,
            lambda a, b, c, d, e: method(a, b) or 0,
            lambda a, b, c, d, e: method(a, b, c) or 0,
            None,
            method if name == "can_transmit" else lambda a, b, c, d, e: method(a, b, c, d, e) or 0,
        )

        def fails(kind: Any, error: Any, trace: Any) -> None:
            if self.failure is None:
                self.failure = FirmwareError(f"{self.name}: fw_{name}: {error}")
                self.stop_at(self.now)

        callback = ffi.callback("host_call", functions[count], error=0, onerror=fails)
        self.library.code.fw_calls[number] = callback
        return callback

    def _raise_failure(self) -> None:
        if self.failure is not None:
            raise self.failure

    @contextlib.contextmanager
    def _running(self) -> Iterator[None]:
        """Inside, the program runs: a turn of it, which is not endless (`leave_record_in`)."""
        self.turn = (self.turn + 2) & WORD
        self.library.turns[0] = self.turn | 1
        try:
            yield
        finally:
            self.library.turns[0] = self.turn

    def advance(self, until: int) -> int:
        """Run everything before `until` (ns); UserError for what the program did wrong."""
        while until - self.reached > LONGEST_TURN_NS:
            end = self.reached + LONGEST_TURN_NS
            self._turn_until(end)
            if self.horizon < end:
                return self.next_time
        return self._turn_until(until)

    def _turn_until(self, until: int) -> int:
        turns = self.library.turns
        self.turn = (self.turn + 2) & WORD
        turns[0] = self.turn | 1
        try:
            next_time: int = Microcontroller.advance(self, until)
        finally:
            turns[0] = self.turn
        self.reached = max(self.reached, until)  # it is asked before its power comes, too
        if self.failure is not None:
            raise self.failure
        return next_time

    def write_counts(self) -> None:
        """Add which lines of its program ran to the counts below `counts`; nothing where that is not asked for."""
        if self.counts is not None:
            self.library.write_counts(self.counts)

    def leave_record_in(self, words: Any, message: str = "") -> None:
        """From now on a signal that ends this process leaves in `words` where the program was (library.py)."""
        self.library.leave_record_in(words, message)

    def connect_edges(self, buffer: Any, pin: int, partner_pin: int) -> None:
        """As the chip's; the program need not capture the pin."""
        if self.pin_owners[pin] is None:
            self.claim_pin(pin, 0, PlainPin(self))
        Microcontroller.connect_edges(self, buffer, pin, partner_pin)

    # --- the schedule -------------------------------------------------------------------------------------

    def _take_schedule(self) -> None:
        """Ask the program for its schedule and start it."""
        with self._running():
            given = self.library.code.firmware_schedule()
        self._raise_failure()
        if given == ffi.NULL:
            raise FirmwareError(f"{self.library.path}: firmware_schedule() returned NULL")
        every, last = self._tasks(given.every, "every"), self._tasks(given.last, "last")
        rows = [self._tasks(given.rows[row], f"row {row}") for row in range(given.row_count)] or [[]]
        occasional = None
        if given.occasional.count:
            occasional = Occasional(
                self._tasks(given.occasional, "occasional"),
                cost=given.occasional_cost,
                limit=given.occasional_limit,
                extra_idle_call=not given.flags & NO_IDLE_CALL,
            )
        transmitters = None
        if given.flags & TRANSMITTERS_NAMED:
            tasks = [each.tasks[i] for each in (given.every, given.last) for i in range(each.count)]
            transmitters = [text(task.name) for task in tasks if task.transmits]
        schedule = Schedule(
            slot_ns=given.slot_ns,
            every=every,
            rows=rows,
            last=last,
            occasional=occasional,
            occasional_row=given.occasional_row,
            divider=given.divider or 1,
            completion_flag=not given.flags & NO_COMPLETION_FLAG,
            tick_cost=given.tick_cost,
            tick_slot=given.tick_vic_slot,
            transmitters=transmitters,
        )
        hooks = {name: getattr(given, name) for name in ("on_tick", "on_overrun", "on_limit", "on_near_limit")}
        called = {name: hook for name, hook in hooks.items() if hook != ffi.NULL}
        self.on_timer_tick = called.get("on_tick")
        self.on_overrun = called.get("on_overrun")
        self.on_near_limit = called.get("on_near_limit")
        if "on_limit" in called:
            self.on_limit = lambda task: called["on_limit"]()
        steps = [given.steps[number] for number in range(given.step_count)]
        self.start_up = StartUp(self, [(self.phase_ns + step.after_ns, step.function) for step in steps])
        self.start(schedule, self.phase_ns + given.first_slot_ns)

    def _tasks(self, given: Any, where: str) -> list[Task]:
        """A list of the program's tasks."""
        return [self._task(given.tasks[number], f"{where}[{number}]") for number in range(given.count)]

    def _task(self, given: Any, where: str) -> Task:
        if given.function == ffi.NULL:
            raise FirmwareError(f"{self.library.path}: schedule: {where} {text(given.name)!r} has no function")
        name = text(given.name) or where
        if given.kind == WAIT:
            return Wait(given.function, cost=given.cost, limit=given.limit, name=name)
        return Task(given.function, given.cost, given.limit, given.per_item, text(given.item), name)

    # --- the main loop ------------------------------------------------------------------------------------

    def _turn(self) -> int:
        """Run one turn of the program's main loop, until it lets time pass. Returns the time at which it goes on."""
        cycles = self.library.code.fw_turn()
        if cycles == NO_STACK:
            self.failure = FirmwareError(f"{self.name}: no memory for the stack of the main loop")
        if cycles in (MAIN_ENDED, NO_STACK):
            self.background = None  # as on the chip, where start-up code spins behind it
            return 0
        return self.now + int(cycles * self.ns_per_cycle) if cycles else 0

    # --- looking in ---------------------------------------------------------------------------------------

    def counters(self) -> object:
        """What the board counted, by name. Its program's own queues are not known."""
        return ProgramCounters(
            hz=self.hz,
            unclaimed=self.unclaimed,
            slots=self.scheduler.counters(),
            can=self.can_counters(),
            time_ms=self.network_time_ms(),
            errors=list(self.error_totals(self.error_counts.count if self.error_counts is not None else 0)),
        )

    def network_time_ms(self) -> int:
        """The robot's time as the program has it (ms); 0 where it does not say."""
        if not self.library.has("firmware_time_ms"):
            return 0
        with self._running():
            return self.library.code.firmware_time_ms()

    def error_totals(self, count: int) -> Any:
        """How often the program noted the errors 0 ... count - 1; zeros where it does not say."""
        totals = array.array("q", bytes(8 * count))
        if self.error_counts is not None:
            for code, times in enumerate(ffi.unpack(self.error_counts.counts, min(count, self.error_counts.count))):
                totals[code] = times
        return totals

    def can_counters(self) -> list[CanCounters]:
        """Of each controller that the program has started."""
        return [
            CanCounters(number, can.received, can.sent, can.data_overruns, receive_lost=0, queue_full=0)
            for number, can in sorted(self.devices.cans.items())
        ]
