"""What the calls of firmware.h do on the models of the devices.

A program in C reaches them by one function, `answered`, which gets the number of the call.
"""

import os
from typing import Final

import cython

from ranger_sim.can_bus.fd_frame import LONGEST
from ranger_sim.can_bus.frame import HIGHEST_EXTENDED, HIGHEST_STANDARD, LENGTH_CODE
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.native.functions import function
from ranger_sim.firmware_sim.native.library import Library, ffi, text
from ranger_sim.firmware_sim.native.program import answer_by, pointer
from ranger_sim.firmware_sim.native.started import Started
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller import TABLE_BYTES, CanController, table_bytes
from ranger_sim.firmware_sim.peripherals.can_fd_controller import CanFdController
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
from ranger_sim.foundation.events import FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import FirmwareError

CMR_AT: Final = 0x2  # CxCMR
CMR_CDO: Final = 0x8
CMR_STB1: Final = 0x20
EXTENDED: Final = 0x8000_0000  # FW_CAN_EXTENDED
REMOTE: Final = 0x4000_0000  # FW_CAN_REMOTE
# flags of fw_canfd_frame, and how far they are from FLAG_FD, and from FLAG_BRS and FLAG_ESI
CANFD_FLAGS: Final = 7
CANFD_BRS_ESI: Final = 3
CANFD_FDF: Final = 4
FDF_SHIFT: Final = 6
BRS_SHIFT: Final = 9
WORD: Final = 0xFFFF_FFFF
HOSTS: set[int] = set()  # addresses that programs may call with; those of ended boards stay, a number each
_latest: cython.ulonglong = 0  # the address that was called with last: one of HOSTS
USUAL_LATENCY: Final = -1
TIMERS: Final = 2  # of the chip, in fw_timers
# numbers of the calls, as in runtime.c
CALL_ATTACH: Final = 0
CALL_DETACH: Final = 1
CALL_REQUEST: Final = 2
CALL_SPEND: Final = 3
CALL_IDLE: Final = 4
CALL_SLOT_CYCLES: Final = 5
CALL_CYCLES: Final = 6
CALL_PIN_WRITE: Final = 7
CALL_PIN_TOGGLE: Final = 8
CALL_IOPIN: Final = 9
CALL_IOSET: Final = 10
CALL_IOCLR: Final = 11
CALL_TIMER_START: Final = 12
CALL_CAPTURE_CONNECT: Final = 13
CALL_TIMER_CCR: Final = 14
CALL_TIMER_WRITE_CCR: Final = 15
CALL_TIMER_CR: Final = 16
CALL_TIMER_IR: Final = 17
CALL_TIMER_CLEAR_IR: Final = 18
CALL_TIMER_TC: Final = 19
CALL_PWM_START: Final = 20
CALL_PWM_MR: Final = 21
CALL_PWM_WRITE_MR: Final = 22
CALL_PWM_LATCH: Final = 23
CALL_PWM_WRITE: Final = 24
CALL_ADC_START_CLOCK: Final = 25
CALL_ADC_START: Final = 26
CALL_ADC_RESULT: Final = 27
CALL_ADC_BURST: Final = 28
CALL_ADC_DR: Final = 29
CALL_ADCX_START_SSP: Final = 30
CALL_ADCX_WRITE: Final = 31
CALL_ADCX_BUSY: Final = 32
CALL_ADCX_RESULT: Final = 33
CALL_SPI_START: Final = 34
CALL_SPI_TRANSFER: Final = 35
CALL_SPI_SPSR: Final = 36
CALL_SPI_SPDR: Final = 37
CALL_SSP_START: Final = 38
CALL_SSP_EXCHANGE: Final = 39
CALL_SSP_LOAD: Final = 40
CALL_SSP_TAKE: Final = 41
CALL_UART_START: Final = 42
CALL_UART_RBR: Final = 43
CALL_UART_THR: Final = 44
CALL_UART_LSR: Final = 45
CALL_UART_IIR: Final = 46
CALL_CAN_START: Final = 47
CALL_CAN_TRANSMIT: Final = 48
CALL_CAN_BUFFER_FREE: Final = 49
CALL_CAN_ABORT: Final = 50
CALL_CAN_READ: Final = 51
CALL_CAN_RELEASE: Final = 52
CALL_CAN_CLEAR_OVERRUN: Final = 53
CALL_CAN_GSR: Final = 54
CALL_CAN_SR: Final = 55
CALL_CAN_ICR: Final = 56
CALL_CAN_MOD: Final = 57
CALL_CAN_WRITE_MOD: Final = 58
CALL_CAN_WRITE_IER: Final = 59
CALL_SSP_START_WORDS: Final = 60
CALL_SSP_WORD: Final = 61
CALL_CAN_ACCEPT: Final = 62
CALL_CANFD_START: Final = 63
CALL_CANFD_TRANSMIT: Final = 64
CALL_CANFD_BUFFER_FREE: Final = 65
CALL_CANFD_ABORT: Final = 66
CALL_CANFD_RECEIVE: Final = 67
CALL_CANFD_CLEAR_OVERRUN: Final = 68
CALL_CANFD_GSR: Final = 69
CALL_CANFD_ICR: Final = 70
CALL_CANFD_MOD: Final = 71
CALL_CANFD_WRITE_MOD: Final = 72
CALL_CANFD_WRITE_IER: Final = 73
NAMES = (
    "attach detach request spend idle slot_cycles cycles pin_write pin_toggle IOPIN IOSET IOCLR timer_start "
    "capture_connect timer_CCR timer_write_CCR timer_CR timer_IR timer_clear_IR timer_TC pwm_start pwm_MR "
    "pwm_write_MR pwm_latch pwm_write adc_start_clock adc_start adc_result adc_burst adc_DR adcx_start_ssp "
    "adcx_write adcx_busy adcx_result spi_start spi_transfer spi_SPSR spi_SPDR ssp_start ssp_exchange ssp_load "
    "ssp_take uart_start uart_RBR uart_THR uart_LSR uart_IIR can_start can_transmit can_buffer_free can_abort "
    "can_read can_release can_clear_overrun can_GSR can_SR can_ICR can_MOD can_write_MOD can_write_IER "
    "ssp_start_words ssp_word "
    "can_accept canfd_start canfd_transmit canfd_buffer_free canfd_abort canfd_receive canfd_clear_overrun canfd_GSR "
    "canfd_ICR canfd_MOD canfd_write_MOD canfd_write_IER"
).split()


@cython.final
@cython.cclass
class Calls:
    """What the calls of firmware.h do: a method for each, with whole numbers in and out."""

    board: object
    chip: Microcontroller
    gpio: Gpio
    mail: cython.p_longlong
    phase_ns: cython.longlong
    library: object
    hardware: object
    timers: Started
    pwms: Started
    adcs: Started
    adcxs: Started
    spis: Started
    ssps: Started
    masters: Started
    uarts: Started
    cans: Started
    fds: Started
    canfd_mail: object
    accepted: object

    def __init__(self, board, library: Library, hardware, phase_ns) -> None:
        self.board = board
        self.chip = board
        self.library = library
        if cython.compiled:
            self.mail = cython.cast(cython.p_longlong, pointer(library.place("fw_mail")))
        else:
            self.mail = library.code.fw_mail
        self.hardware = hardware
        self.phase_ns = phase_ns
        self.gpio = Gpio(board)
        self.timers = Started("timer")
        self.pwms = Started("PWM")
        self.adcs = Started("internal converter")
        self.adcxs = Started("external converter")
        self.spis = Started("SPI")
        self.ssps = Started("SSP")
        self.masters = Started("SSP as a master of words")
        self.uarts = Started("UART")
        self.cans = Started("CAN controller")
        self.fds = Started("CAN FD controller")
        self.canfd_mail = library.code.fw_canfd_mail
        self.accepted = None  # by controller, what its filter lets through; None: the filter is in bypass

    @cython.ccall
    def answer(
        self,
        call: cython.longlong,
        a: cython.longlong,
        b: cython.longlong,
        c: cython.longlong,
        d: cython.longlong,
        e: cython.longlong,
    ) -> cython.longlong:
        """The result of call number `call` with its numbers; 0 for one without a result.

        The function is long because every call of the header is a case of one switch.
        """
        if call == CALL_ATTACH:
            self.attach(a)
        elif call == CALL_DETACH:
            self.detach(a, b)
        elif call == CALL_REQUEST:
            return self.request(a, b)
        elif call == CALL_SPEND:
            self.spend(a)
        elif call == CALL_IDLE:
            self.idle()
        elif call == CALL_SLOT_CYCLES:
            return self.slot_cycles()
        elif call == CALL_CYCLES:
            return self.cycles()
        elif call == CALL_PIN_WRITE:
            self.pin_write(a, b)
        elif call == CALL_PIN_TOGGLE:
            self.pin_toggle(a)
        elif call == CALL_IOPIN:
            return self.IOPIN(a)
        elif call == CALL_IOSET:
            self.IOSET(a, b)
        elif call == CALL_IOCLR:
            self.IOCLR(a, b)
        elif call == CALL_TIMER_START:
            self.timer_start(a, b, c)
        elif call == CALL_CAPTURE_CONNECT:
            self.capture_connect(a, b, c)
        elif call == CALL_TIMER_CCR:
            return self.timer_CCR(a)
        elif call == CALL_TIMER_WRITE_CCR:
            self.timer_write_CCR(a, b)
        elif call == CALL_TIMER_CR:
            return self.timer_CR(a, b)
        elif call == CALL_TIMER_IR:
            return self.timer_IR(a)
        elif call == CALL_TIMER_CLEAR_IR:
            self.timer_clear_IR(a, b)
        elif call == CALL_TIMER_TC:
            return self.timer_TC(a)
        elif call == CALL_PWM_START:
            self.pwm_start(a)
        elif call == CALL_PWM_MR:
            return self.pwm_MR(a)
        elif call == CALL_PWM_WRITE_MR:
            self.pwm_write_MR(a, b)
        elif call == CALL_PWM_LATCH:
            self.pwm_latch(a)
        elif call == CALL_PWM_WRITE:
            self.pwm_write(a, b)
        elif call == CALL_ADC_START_CLOCK:
            self.adc_start_clock(a)
        elif call == CALL_ADC_START:
            return self.adc_start(a)
        elif call == CALL_ADC_RESULT:
            return self.adc_result()
        elif call == CALL_ADC_BURST:
            self.adc_burst(a)
        elif call == CALL_ADC_DR:
            return self.adc_DR(a)
        elif call == CALL_ADCX_START_SSP:
            self.adcx_start_ssp()
        elif call == CALL_ADCX_WRITE:
            return self.adcx_write(a, b)
        elif call == CALL_ADCX_BUSY:
            return self.adcx_busy()
        elif call == CALL_ADCX_RESULT:
            return self.adcx_result()
        elif call == CALL_SPI_START:
            self.spi_start(a)
        elif call == CALL_SPI_TRANSFER:
            return self.spi_transfer(a)
        elif call == CALL_SPI_SPSR:
            return self.spi_SPSR(a)
        elif call == CALL_SPI_SPDR:
            return self.spi_SPDR(a)
        elif call == CALL_SSP_START:
            self.ssp_start(a)
        elif call == CALL_SSP_EXCHANGE:
            self.ssp_exchange(a)
        elif call == CALL_SSP_LOAD:
            self.ssp_load(a)
        elif call == CALL_SSP_TAKE:
            return self.ssp_take(a)
        elif call == CALL_UART_START:
            self.uart_start(a, b, c, d, e)
        elif call == CALL_UART_RBR:
            return self.uart_RBR(a)
        elif call == CALL_UART_THR:
            return self.uart_THR(a, b)
        elif call == CALL_UART_LSR:
            return self.uart_LSR(a)
        elif call == CALL_UART_IIR:
            return self.uart_IIR(a)
        elif call == CALL_CAN_START:
            self.can_start(a, b, c)
        elif call == CALL_CAN_TRANSMIT:
            return self.can_transmit(a, b, c, d, e)
        elif call == CALL_CAN_BUFFER_FREE:
            return self.can_buffer_free(a, b)
        elif call == CALL_CAN_ABORT:
            self.can_abort(a, b)
        elif call == CALL_CAN_READ:
            self.can_read(a)
        elif call == CALL_CAN_RELEASE:
            self.can_release(a)
        elif call == CALL_CAN_CLEAR_OVERRUN:
            self.can_clear_overrun(a)
        elif call == CALL_CAN_GSR:
            return self.can_GSR(a)
        elif call == CALL_CAN_SR:
            return self.can_SR(a)
        elif call == CALL_CAN_ICR:
            return self.can_ICR(a)
        elif call == CALL_CAN_MOD:
            return self.can_MOD(a)
        elif call == CALL_CAN_WRITE_MOD:
            self.can_write_MOD(a, b)
        elif call == CALL_CAN_WRITE_IER:
            self.can_write_IER(a, b)
        elif call == CALL_SSP_START_WORDS:
            self.ssp_start_words(a, b)
        elif call == CALL_SSP_WORD:
            return self.ssp_word(a)
        elif call == CALL_CAN_ACCEPT:
            return self.can_accept(a, b)
        elif call == CALL_CANFD_START:
            self.canfd_start(a, b, c, d)
        elif call == CALL_CANFD_TRANSMIT:
            return self.canfd_transmit(a, b)
        elif call == CALL_CANFD_BUFFER_FREE:
            return self.fds.at(a).buffer_free(self.buffer(b))
        elif call == CALL_CANFD_ABORT:
            self.fds.at(a).abort(self.buffer(b))
        elif call == CALL_CANFD_RECEIVE:
            return self.canfd_receive(a)
        elif call == CALL_CANFD_CLEAR_OVERRUN:
            self.fds.at(a).clear_overrun()
        elif call == CALL_CANFD_GSR:
            return self.fds.at(a).GSR()
        elif call == CALL_CANFD_ICR:
            return self.fds.at(a).read_ICR()
        elif call == CALL_CANFD_MOD:
            return self.fds.at(a).MOD
        elif call == CALL_CANFD_WRITE_MOD:
            self.fds.at(a).write_MOD(b)
        elif call == CALL_CANFD_WRITE_IER:
            self.fds.at(a).write_IER(b)
        return 0

    @cython.ccall
    def fail(self, call: cython.longlong, error: object) -> cython.void:
        """End the run with what a call raised, unless an earlier one has failed."""
        if self.board.failure is None:
            self.board.failure = FirmwareError(f"{self.chip.name}: fw_{NAMES[call]}: {error}")
            self.chip.stop_at(self.chip.now)

    def new(self, started, number) -> None:
        """Check that device `number` can be started."""
        if number in started:
            raise FirmwareError(f"{started.what} {number} is started twice")

    # --- the devices, of which C knows the class ----------------------------------------------------------

    @cython.cfunc
    def timer(self, number: cython.longlong) -> TimerCapture:
        return self.timers.at(number)

    @cython.cfunc
    def pwm(self) -> Pwm:
        return self.pwms.at(0)

    @cython.cfunc
    def adc(self) -> AdcInternal:
        return self.adcs.at(0)

    @cython.cfunc
    def adcx(self) -> Ads7871:
        return self.adcxs.at(0)

    @cython.cfunc
    def spi(self, number: cython.longlong) -> SpiEncoder:
        return self.spis.at(number)

    @cython.cfunc
    def can(self, number: cython.longlong) -> CanController:
        return self.cans.at(number)

    # --- interrupts, time ---------------------------------------------------------------------------------

    @cython.ccall
    def attach(self, address: cython.longlong) -> None:
        it = ffi.cast("fw_interrupt *", address)
        handler = it.handler
        if handler == ffi.NULL:
            raise FirmwareError(f"interrupt {it.kind}/{it.index}: no handler")
        self.chip.vic.attach(
            it.kind,
            it.index,
            function(handler).serve,
            it.cost,
            it.per_item,
            it.vic_slot,
            None if it.latency == USUAL_LATENCY else it.latency,
            text(it.name) or None,
        )

    @cython.ccall
    def detach(self, kind: cython.longlong, index: cython.longlong) -> None:
        self.chip.vic.detach(self.chip.vic.source(kind, index))

    @cython.ccall
    def request(self, kind: cython.longlong, index: cython.longlong) -> cython.longlong:
        return self.chip.request(self.chip.vic.source(kind, index))

    @cython.ccall
    def spend(self, cycles: cython.longlong) -> None:
        self.chip.spend(cycles)

    @cython.ccall
    def idle(self) -> None:
        raise FirmwareError("only a board's own main loop can sleep, not a task or a handler")

    @cython.ccall
    def slot_cycles(self) -> cython.longlong:
        return self.chip.cycles_since_tick()

    @cython.ccall
    def cycles(self) -> cython.longlong:
        return int((self.chip.now - self.phase_ns) * self.chip.cycles_per_ns)

    # --- pins ---------------------------------------------------------------------------------------------

    @cython.ccall
    def pin_write(self, pin: cython.longlong, level: cython.longlong) -> None:
        self.gpio.write(self.pin(pin), int(level != 0))

    @cython.ccall
    def pin_toggle(self, pin: cython.longlong) -> None:
        self.gpio.toggle(self.pin(pin))

    @cython.ccall
    def pin(self, pin: cython.longlong) -> cython.longlong:
        """The number of a pin that exists: the models take any."""
        if pin > 63:
            raise FirmwareError(f"pin {pin} is not 0 ... 63")
        return pin

    @cython.ccall
    def port(self, port: cython.longlong) -> cython.longlong:
        """The number of a port that exists."""
        if port > 1:
            raise FirmwareError(f"port {port} is neither 0 nor 1")
        return port

    @cython.ccall
    def IOPIN(self, port: cython.longlong) -> cython.longlong:
        return self.gpio.IOPIN(self.port(port))

    @cython.ccall
    def IOSET(self, port: cython.longlong, mask: cython.longlong) -> None:
        self.gpio.IOSET(self.port(port), mask)

    @cython.ccall
    def IOCLR(self, port: cython.longlong, mask: cython.longlong) -> None:
        self.gpio.IOCLR(self.port(port), mask)

    # --- timers -------------------------------------------------------------------------------------------

    @cython.ccall
    def timer_start(self, timer: cython.longlong, period: cython.longlong, match_interrupt: cython.longlong) -> None:
        self.new(self.timers, timer)
        device: TimerCapture = TimerCapture(
            self.chip, timer, period, phase_ns=self.phase_ns, match_interrupt=match_interrupt != 0
        )
        self.timers.add(timer, device)
        if cython.compiled and timer < TIMERS and self.library.has("fw_timers"):
            near = self.library.code.fw_timers[timer]
            near.IR = ffi.cast("int64_t *", cython.cast(cython.ulonglong, cython.address(device.IR)))
            near.CCR = ffi.cast("int64_t *", cython.cast(cython.ulonglong, cython.address(device.CCR)))
            near.CR = ffi.cast("int64_t *", cython.cast(cython.ulonglong, cython.address(device.captures[0])))

    @cython.ccall
    def capture_connect(self, timer: cython.longlong, channel: cython.longlong, pin: cython.longlong) -> None:
        device = self.timer(timer)
        bits = device.CCR  # connecting arms a channel; here the program does
        device.use_channel(channel, pin)
        device.CCR = bits

    @cython.ccall
    def timer_CCR(self, timer: cython.longlong) -> cython.longlong:
        return self.timer(timer).CCR

    @cython.ccall
    def timer_write_CCR(self, timer: cython.longlong, value: cython.longlong) -> None:
        self.timer(timer).CCR = value & 0xFFF

    @cython.ccall
    def timer_CR(self, timer: cython.longlong, channel: cython.longlong) -> cython.longlong:
        return self.timer(timer).CR(channel & 3)

    @cython.ccall
    def timer_IR(self, timer: cython.longlong) -> cython.longlong:
        return self.timer(timer).IR

    @cython.ccall
    def timer_clear_IR(self, timer: cython.longlong, mask: cython.longlong) -> None:
        self.timer(timer).clear(mask)

    @cython.ccall
    def timer_TC(self, timer: cython.longlong) -> cython.longlong:
        return self.timer(timer).TC()

    # --- PWM ----------------------------------------------------------------------------------------------

    @cython.ccall
    def pwm_start(self, period: cython.longlong) -> None:
        self.new(self.pwms, 0)
        self.pwms.add(0, Pwm(self.chip, period=period, phase_ns=self.phase_ns))

    def match(self, number) -> str:
        """The name of a match register."""
        if number > 6:
            raise FirmwareError(f"PWM: match register {number} is not 0 ... 6")
        return f"MR{number}"

    @cython.ccall
    def pwm_MR(self, match: cython.longlong) -> cython.longlong:
        return getattr(self.pwm(), self.match(match))

    @cython.ccall
    def pwm_write_MR(self, match: cython.longlong, counts: cython.longlong) -> None:
        setattr(self.pwm(), self.match(match), counts)

    @cython.ccall
    def pwm_latch(self, mask: cython.longlong) -> None:
        self.pwm().latch(mask)

    @cython.ccall
    def pwm_write(self, MR2: cython.longlong, MR6: cython.longlong) -> None:
        self.pwm().write(MR2, MR6)

    # --- converters ---------------------------------------------------------------------------------------

    @cython.ccall
    def adc_start_clock(self, clkdiv: cython.longlong) -> None:
        self.new(self.adcs, 0)
        it = self.hardware.internal
        adc = AdcInternal(
            self.chip, clkdiv=clkdiv, reference_V=it.reference_V, scale=it.scale, offset_counts=it.offset_counts
        )
        adc.inputs = [it.inputs.get(channel, channel) for channel in range(8)]
        self.adcs.add(0, adc)

    @cython.ccall
    def channel(self, channel: cython.longlong) -> cython.longlong:
        """A channel of the internal converter that exists."""
        if channel > 7:
            raise FirmwareError(f"internal converter: channel {channel} is not 0 ... 7")
        return channel

    @cython.ccall
    def adc_start(self, channel: cython.longlong) -> cython.longlong:
        return self.adc().start(self.channel(channel))

    @cython.ccall
    def adc_result(self) -> cython.longlong:
        return self.adc().result

    @cython.ccall
    def adc_burst(self, mask: cython.longlong) -> None:
        self.adc().start_burst(*[channel for channel in range(8) if mask >> channel & 1])

    @cython.ccall
    def adc_DR(self, channel: cython.longlong) -> cython.longlong:
        return self.adc().DR(self.channel(channel))

    @cython.ccall
    def adcx_start_ssp(self) -> None:
        self.new(self.adcxs, 0)
        it = self.hardware.external
        if it is None:
            raise FirmwareError("this board has no external converter")
        if 0 in self.masters:
            raise FirmwareError("the SSP is a master of words already, so the external converter cannot have it")
        adc = Ads7871(self.chip, it.eint, it.reference_V, it.conversion_ns, it.scale, it.offset_counts)
        adc.inputs = [it.inputs.get(code, code) for code in range(16)]
        self.adcxs.add(0, adc)

    @cython.ccall
    def adcx_write(self, register4: cython.longlong, later_ns: cython.longlong) -> cython.longlong:
        return self.adcx().write(register4, self.chip.now + later_ns)

    @cython.ccall
    def adcx_busy(self) -> cython.longlong:
        return self.adcx().busy

    @cython.ccall
    def adcx_result(self) -> cython.longlong:
        return self.adcx().read_result()

    # --- serial ports -------------------------------------------------------------------------------------

    @cython.ccall
    def spi_start(self, number: cython.longlong) -> None:
        self.new(self.spis, number)
        if number not in self.hardware.spi:
            raise FirmwareError(f"nothing hangs on SPI {number} of this board")
        it = self.hardware.spi[number]
        self.spis.add(number, SpiEncoder(self.chip, number, it.word, it.bits, it.bit_rate, it.value_bits))

    @cython.ccall
    def spi_transfer(self, number: cython.longlong) -> cython.longlong:
        return self.spi(number).start()

    @cython.ccall
    def spi_SPSR(self, number: cython.longlong) -> cython.longlong:
        return self.spi(number).SPSR

    @cython.ccall
    def spi_SPDR(self, number: cython.longlong) -> cython.longlong:
        return self.spi(number).read()

    @cython.ccall
    def ssp_start(self, number: cython.longlong) -> None:
        self.new(self.ssps, number)
        self.ssps.add(number, SspPort(self.chip, number))

    def posted_segment(self) -> object:
        """The half-words in the mail."""
        segment = SspSegment()
        segment.words = [self.mail[place] for place in range(SEGMENT_WORDS)]
        return segment

    @cython.ccall
    def ssp_exchange(self, number: cython.longlong) -> None:
        self.ssps.at(number).start(self.posted_segment())

    @cython.ccall
    def ssp_load(self, number: cython.longlong) -> None:
        self.ssps.at(number).load(self.posted_segment())

    @cython.ccall
    def ssp_take(self, number: cython.longlong) -> cython.longlong:
        segment = self.ssps.at(number).take()
        if segment is None:
            return 0
        for place, word in enumerate(segment.words):
            self.mail[place] = word
        return 1

    @cython.ccall
    def ssp_start_words(self, bits: cython.longlong, divider: cython.longlong) -> None:
        self.new(self.masters, 0)
        if 0 in self.adcxs:
            raise FirmwareError("the external converter has the SSP")
        if not 4 <= bits <= LONGEST_WORD:
            raise FirmwareError(f"SSP: words of {bits} bits: 4 to {LONGEST_WORD} are possible")
        if divider % 2 or not 2 <= divider <= 512:
            raise FirmwareError(f"SSP: divider {divider}: even, 2 to 512 is possible")
        device = self.chip.panel.ssp if self.chip.panel is not None else SspDevice(self.chip)
        self.masters.add(0, SspMaster(self.chip, device, bits))

    @cython.ccall
    def ssp_word(self, word: cython.longlong) -> cython.longlong:
        return self.masters.at(0).word(word)

    @cython.ccall
    def uart_start(
        self,
        number: cython.longlong,
        divisor: cython.longlong,
        divaddval: cython.longlong,
        mulval: cython.longlong,
        trigger: cython.longlong,
    ) -> None:
        self.new(self.uarts, number)
        self.uarts.add(number, Uart(self.chip, number, divisor, divaddval, mulval, trigger))

    @cython.ccall
    def uart_RBR(self, number: cython.longlong) -> cython.longlong:
        return self.uarts.at(number).RBR()

    @cython.ccall
    def uart_THR(self, number: cython.longlong, byte: cython.longlong) -> cython.longlong:
        return self.uarts.at(number).THR(byte)

    @cython.ccall
    def uart_LSR(self, number: cython.longlong) -> cython.longlong:
        return self.uarts.at(number).LSR()

    @cython.ccall
    def uart_IIR(self, number: cython.longlong) -> cython.longlong:
        return self.uarts.at(number).IIR

    # --- CAN ----------------------------------------------------------------------------------------------

    @cython.ccall
    def can_start(self, controller: cython.longlong, BTR: cython.longlong, IER: cython.longlong) -> None:
        if self.hardware.can == "fd":
            raise FirmwareError("this board has CAN FD controllers: fw_canfd_start starts one")
        self.new(self.cans, controller)
        self.cans.add(controller, CanController(self.chip, controller, BTR, IER))
        if self.accepted is not None:
            self.can(controller).accept(*self.accepted[controller])

    @cython.ccall
    def can_transmit(
        self,
        place: cython.longlong,
        TFI: cython.longlong,
        TID: cython.longlong,
        TDA: cython.longlong,
        TDB: cython.longlong,
    ) -> cython.longlong:
        # DLC in bits 16-19, RTR bit 30, FF bit 31; as the flags of foundation/events.py: bits 0-3, 4, 6
        flags: cython.longlong = TFI >> 16 & 15 | TFI >> 26 & 16 | TFI >> 25 & 64
        return self.can(place >> 32).transmit_if_free(place & WORD, TID, flags, TDA, TDB)

    @cython.ccall
    def buffer(self, buffer: cython.longlong) -> cython.longlong:
        """A transmit buffer that exists."""
        if not 1 <= buffer <= 3:
            raise FirmwareError(f"CAN: transmit buffer {buffer} is not 1 ... 3")
        return buffer

    @cython.ccall
    def can_buffer_free(self, controller: cython.longlong, buffer: cython.longlong) -> cython.longlong:
        return self.can(controller).buffer_free(self.buffer(buffer))

    @cython.ccall
    def can_abort(self, controller: cython.longlong, buffer: cython.longlong) -> None:
        self.can(controller).write_CMR(CMR_AT | CMR_STB1 << self.buffer(buffer) - 1)

    @cython.ccall
    def can_read(self, controller: cython.longlong) -> None:
        can: CanController = self.can(controller)
        self.mail[0] = can.RFS
        self.mail[1] = can.RID
        self.mail[2] = can.RDA
        self.mail[3] = can.RDB

    @cython.ccall
    def can_release(self, controller: cython.longlong) -> None:
        self.can(controller).release()

    @cython.ccall
    def can_clear_overrun(self, controller: cython.longlong) -> None:
        self.can(controller).write_CMR(CMR_CDO)

    @cython.ccall
    def can_GSR(self, controller: cython.longlong) -> cython.longlong:
        return self.can(controller).GSR()

    @cython.ccall
    def can_SR(self, controller: cython.longlong) -> cython.longlong:
        return self.can(controller).SR()

    @cython.ccall
    def can_ICR(self, controller: cython.longlong) -> cython.longlong:
        return self.can(controller).read_ICR()

    @cython.ccall
    def can_MOD(self, controller: cython.longlong) -> cython.longlong:
        return self.can(controller).MOD

    @cython.ccall
    def can_write_MOD(self, controller: cython.longlong, value: cython.longlong) -> None:
        self.can(controller).write_MOD(value)

    @cython.ccall
    def can_write_IER(self, controller: cython.longlong, value: cython.longlong) -> None:
        self.can(controller).write_IER(value)

    @cython.ccall
    def can_accept(self, address: cython.longlong, count: cython.longlong) -> cython.longlong:
        if count == 0:
            self.accepted = None
            for can in (*self.cans.by_number.values(), *self.fds.by_number.values()):
                can.accept_all()
            return 1
        if count > TABLE_BYTES // 2:
            raise FirmwareError(f"{count} ranges, at most {TABLE_BYTES // 2} fit into the filter's table")
        ranges = ffi.cast("fw_can_range *", address)
        rows = [(ranges[row].controller, ranges[row].first, ranges[row].last) for row in range(count)]
        self.accepted = accepted_by_controller(rows)
        for number, can in (*self.cans.by_number.items(), *self.fds.by_number.items()):
            can.accept(*self.accepted[number])
        return 1

    # --- CAN FD -------------------------------------------------------------------------------------------

    def canfd_start(self, controller, bit_rate, data_bit_rate, IER) -> None:
        if self.hardware.can != "fd":
            raise FirmwareError(
                'this board has the classic CAN controllers of an LPC2194 (can = "fd" in boards.toml, or without a '
                "master table in firmware.toml, gives it CAN FD)"
            )
        self.new(self.fds, controller)
        self.fds.add(controller, CanFdController(self.chip, controller, bit_rate, data_bit_rate, IER))
        if self.accepted is not None:
            self.fds.at(controller).accept(*self.accepted[controller])

    def canfd_transmit(self, controller, buffer) -> int:
        frame = self.canfd_mail
        can: CanFdController = self.fds.at(controller)
        if frame.flags & ~CANFD_FLAGS:
            raise FirmwareError(f"frame {frame.ID:#x}: flags {frame.flags:#x} do not exist")
        if frame.length > LONGEST:
            raise FirmwareError(f"frame {frame.ID:#x}: length {frame.length} is above {LONGEST}")
        flags = (frame.flags & CANFD_FDF) << FDF_SHIFT | (frame.flags & CANFD_BRS_ESI) << BRS_SHIFT
        flags |= (FLAG_EXTENDED if frame.ID & EXTENDED else 0) | (FLAG_REMOTE if frame.ID & REMOTE else 0)
        data = bytes(ffi.buffer(frame.data, frame.length))
        return int(can.transmit(self.buffer(buffer), frame.ID & ~(EXTENDED | REMOTE), flags, data))

    def canfd_receive(self, controller) -> int:
        found = self.fds.at(controller).receive()
        if found is None:
            return 0
        identifier, flags, data = found
        frame = self.canfd_mail
        frame.ID = identifier | (EXTENDED if flags & FLAG_EXTENDED else 0) | (REMOTE if flags & FLAG_REMOTE else 0)
        frame.length = flags & LENGTH_CODE if flags & FLAG_REMOTE else len(data)
        frame.flags = flags >> FDF_SHIFT & CANFD_FDF | flags >> BRS_SHIFT & CANFD_BRS_ESI
        ffi.memmove(frame.data, data + bytes(LONGEST - len(data)), LONGEST)
        return 1


def accepted_by_controller(rows: list[tuple[int, int, int]]) -> dict[int, tuple[list, list]]:
    """By controller 1 ... 4, the identifiers of 11 and of 29 bits in the rows of `fw_can_range`.

    FirmwareError for what the chip's table cannot hold, by the number of the range.
    """
    accepted: dict[int, tuple[list, list]] = {number: ([], []) for number in range(1, 5)}
    before = [(0, -1), (0, -1)]  # controller and last identifier, of 11 and of 29 bits
    for row, (controller, first, last) in enumerate(rows):
        extended = int(bool(first & EXTENDED))
        if not 1 <= controller <= 4:
            raise FirmwareError(f"range {row}: CAN controller {controller} is not 1 ... 4")
        if bool(last & EXTENDED) != bool(extended):
            raise FirmwareError(f"range {row}: {first:#x} to {last:#x}: FW_CAN_EXTENDED is set in one of the two")
        first, last = first & ~EXTENDED, last & ~EXTENDED
        if not first <= last <= (HIGHEST_EXTENDED if extended else HIGHEST_STANDARD):
            raise FirmwareError(
                f"range {row}: {first:#x} to {last:#x} is not a range of {29 if extended else 11}-bit identifiers"
            )
        if (controller, first) <= before[extended]:
            raise FirmwareError(
                f"range {row}: {first:#x} of controller {controller} does not follow the range before it"
            )
        before[extended] = (controller, last)
        accepted[controller][extended].append(first if first == last else (first, last))
    used = table_bytes(*([each for pair in accepted.values() for each in pair[kind]] for kind in (0, 1)))
    if used > TABLE_BYTES:
        raise FirmwareError(f"the ranges take {used} bytes of the filter's table, which has {TABLE_BYTES}")
    return accepted


@cython.cfunc
@cython.exceptval(check=False)
def answered(
    host: cython.p_void,
    call: cython.longlong,
    a: cython.longlong,
    b: cython.longlong,
    c: cython.longlong,
    d: cython.longlong,
    e: cython.longlong,
) -> cython.longlong:
    """Carry out a call of the program; what it raises ends the run. A program that has changed the address it calls
    with (fw_host) ends as by abort(): anything may be there.
    """
    global _latest
    if cython.compiled and cython.cast(cython.ulonglong, host) != _latest:
        if cython.cast(cython.ulonglong, host) not in HOSTS:
            os.abort()
        _latest = cython.cast(cython.ulonglong, host)
    calls: Calls = cython.cast(Calls, host)
    try:
        return calls.answer(call, a, b, c, d, e)
    except BaseException as error:  # noqa: BLE001  (nothing may pass through the program)
        calls.fail(call, error)
        return 0


def connect(calls: Calls, library: Library) -> None:
    """Let the calls of the program in `library` arrive at `calls`, which must be kept with it."""
    if library.call_names() != NAMES:
        unknown = ", ".join(f"fw_{name}" for name in library.call_names() if name not in NAMES) or "fewer calls"
        raise FirmwareError(f"{library.path}: it has {unknown}, unlike this version: build it again")
    if cython.compiled:
        HOSTS.add(id(calls))
        library.code.fw_host = ffi.cast("void *", id(calls))
        library.code.fw_answer = ffi.cast("host_call", answer_by(answered))
    else:
        library.answer_by(answered, calls)
