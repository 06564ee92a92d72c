# cython: boundscheck=False, wraparound=False
# (places in the FIFOs are 0 ... 7)
"""The SSP's registers as a master: two FIFOs of eight words, sent one after another, and the device on its wires.

LPC2194 user manual (LPC2194/01), SSP. Not modelled: slave mode. Words follow each other without a gap while the
transmit FIFO has some. The device is an `SspDevice`: the external converter, or the end of a link of segments.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.vic import SSP_INPUT
from ranger_sim.firmware_sim.peripherals.adc_external import START, Ads7871
from ranger_sim.firmware_sim.peripherals.ssp import SspDevice, SspSegment
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import NEVER, SSP_SEGMENT, SSP_START

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

DEPTH: Final = 8
WORD_ALARM: Final = 0
SILENCE_ALARM: Final = 1
SILENT_BITS: Final = 32  # bit times without a read, after which received words raise the time-out interrupt

# SSPSR
SR_TFE: Final = 1
SR_TNF: Final = 2
SR_RNE: Final = 4
SR_RFF: Final = 8
SR_BSY: Final = 16
# SSPIMSC, SSPRIS, SSPMIS, SSPICR
ROR: Final = 1  # receive overrun
RT: Final = 2  # receive time-out
RX: Final = 4  # receive FIFO at least half full
TX: Final = 8  # transmit FIFO at least half empty
CR1_LOOPBACK: Final = 1
CR1_ENABLE: Final = 2
CR1_SLAVE: Final = 4

SEGMENT_WORDS = 31


@cython.final
@cython.cclass
class SerialConverter(SspDevice):
    """The ADS7871's serial side: an instruction byte, and a byte that is written or read (SLAS370C).

    Bit 7 of the instruction: direct mode, it starts a conversion; else bit 6: read, bit 5: 16 bits, bits 0-4: register.
    Of 16-bit accesses in register mode only the first byte fits into a word of the SSP.
    """

    adc: Ads7871

    def __init__(self, chip, adc) -> None:
        SspDevice.__init__(self, chip)
        self.adc = adc

    def exchange(self, word: cython.longlong, time: cython.longlong) -> cython.longlong:
        adc: Ads7871 = self.adc
        register: cython.longlong = word >> 8 & 31
        if word & 0x8000:
            adc.write(word >> 8 & 0xFF, time)
        elif word & 0x4000:
            if register == 0:
                return adc.result << 2 & 0xFC
            if register == 1:
                return adc.result >> 6 & 0xFF
            if register == 4:
                return adc.register4 & 0x7F | adc.busy << 7
        elif register == 4:
            if word & START:
                adc.write(word & 0xFF, time)
        return 0


@cython.final
@cython.cclass
class SegmentLink(SspDevice):
    """The master's end of a link of segments (peripherals/ssp.py), word by word.

    Both ends of the link take a segment as a whole, the other end at the end of an exchange. So a segment of ours
    starts when its last word is out, at least `interval_ns` after the one before, and a received segment reaches the
    program with the words of the next segment.
    ROBOT PARITY: each way takes one segment, 200 us on Ranger, longer than on the robot.
    """

    sent: cython.longlong
    interval_ns: cython.longlong
    earliest: cython.longlong
    words: list
    coming: list
    words_in: list
    going: SspSegment
    alarm: "Alarm"

    def __init__(self, chip, interval_ns) -> None:
        SspDevice.__init__(self, chip)
        self.interval_ns = interval_ns
        self.earliest = 0  # start of the next exchange
        self.going = None  # a segment that waits for that time
        self.alarm = chip.new_alarm(self, 0)
        self.sent = 0  # words of the present segment
        self.words = [0] * 31
        self.coming = [0] * 30 + [1]  # an empty segment: zeros, and its checksum
        self.words_in = None  # half-words of the last received segment, until the program starts to read them
        chip.claim(SSP_SEGMENT, 0, self)

    def on_message(self, queue) -> InterruptSource | None:
        """Receive the other end's segment. It is copied at once, because the other end may fill it anew."""
        self.words_in = queue.ref.words
        return None

    def begin(self, time: cython.longlong) -> cython.int:
        if self.sent == 0:
            self.coming = self.words_in if self.words_in is not None else [0] * 30 + [1]
            self.words_in = None
        return 0

    def exchange(self, word: cython.longlong, time: cython.longlong) -> cython.longlong:
        word_in: cython.longlong = self.coming[self.sent]
        self.words[self.sent] = word & 0xFFFF
        self.sent += 1
        if self.sent == SEGMENT_WORDS:
            self.sent = 0
            segment = SspSegment()
            segment.words = self.words
            segment.used = used_of(self.words)
            self.going = segment
            if time < self.earliest:
                self.alarm.set(self.earliest)
            else:
                self._start(time)
        return word_in

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """Start the segment that waits."""
        self._start(time)
        return None

    @cython.ccall
    def _start(self, time) -> object:
        """Begin the exchange."""
        self.earliest = time + self.interval_ns
        self.chip.outbox.push(time, 0, SSP_START, 0, 0, 0, 0, 0, 0, self.going)


def used_of(words) -> int:
    """Half-words of a segment that are filled in: frames of five, up to the first without a header."""
    used = 0
    while used < 30 and words[used] >> 11 & 15 == 15:
        used += 5
    return used


@cython.final
@cython.cclass
class SspBlock(Block):
    """The words waiting to be sent and the received words, the oldest first."""

    device: SspDevice
    CR0: cython.longlong
    CR1: cython.longlong
    CPSR: cython.longlong
    IMSC: cython.longlong
    flags: cython.longlong
    going: cython.longlong[8]
    words_in: cython.longlong[8]
    going_count: cython.longlong
    words_in_count: cython.longlong
    word: cython.longlong
    word_ns: cython.longlong
    bit_ns: cython.longlong
    words: cython.longlong
    busy: cython.bint
    word_alarm: "Alarm"
    silence_alarm: "Alarm"

    READ_ACTS = frozenset({0x08})
    REGISTERS = {
        0x00: ("SSPCR0", "rw"),
        0x04: ("SSPCR1", "rw"),
        0x08: ("SSPDR", "rw"),
        0x0C: ("SSPSR", "r"),
        0x10: ("SSPCPSR", "rw"),
        0x14: ("SSPIMSC", "rw"),
        0x18: ("SSPRIS", "r"),
        0x1C: ("SSPMIS", "r"),
        0x20: ("SSPICR", "w"),
    }

    def __init__(self, chip, clocks, device) -> None:
        Block.__init__(self, chip, clocks, "SSP", 0xE005C000, 1 << SSP_INPUT)
        self.device = device
        self.CR0 = 0
        self.CR1 = 0
        self.CPSR = 0
        self.IMSC = 0
        self.flags = 0  # ROR and RT
        self.going = [0] * 8
        self.going_count = 0
        self.words_in = [0] * 8
        self.words_in_count = 0
        self.busy = False
        self.word = 0
        self.word_ns = 0
        self.bit_ns = 0
        self.words = 0  # words sent so far
        self.word_alarm = chip.new_alarm(self, WORD_ALARM)
        self.silence_alarm = chip.new_alarm(self, SILENCE_ALARM)

    @cython.cfunc
    @cython.exceptval(check=False)
    def raw(self) -> cython.longlong:
        """SSPRIS."""
        value: cython.longlong = self.flags
        if self.words_in_count >= DEPTH // 2:
            value |= RX
        if self.going_count <= DEPTH // 2:
            value |= TX
        return value

    def requests(self) -> cython.longlong:
        return self.mask if self.IMSC and self.raw() & self.IMSC else 0

    def clocked(self) -> None:
        self._set_rate()

    @cython.ccall
    def _set_rate(self) -> object:
        """Set the duration of a word from the divisors."""
        if self.CPSR:
            clocks = self.CPSR * ((self.CR0 >> 8 & 0xFF) + 1)
            bits = (self.CR0 & 15) + 1
            self.word_ns = self.chip.crystal.true_ns(clocks * bits * 1_000_000_000 // self.clocks.pclk)
            self.bit_ns = self.chip.crystal.true_ns(clocks * 1_000_000_000 // self.clocks.pclk)

    @cython.cfunc
    def _start(self, time: cython.longlong) -> cython.int:
        """Send the oldest word from `time` on."""
        i: cython.longlong
        self.word = self.going[0]
        self.going_count -= 1
        for i in range(self.going_count):
            self.going[i] = self.going[i + 1]
        self.busy = True
        cython.cast(SspDevice, self.device).bits = (self.CR0 & 15) + 1
        cython.cast(SspDevice, self.device).begin(time)
        self.word_alarm.set(time + self.word_ns)
        return 0

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """End a word, or signal that received words were not read in time."""
        word_in: cython.longlong
        if alarm == SILENCE_ALARM:
            if self.words_in_count > 0:
                self.flags |= RT
            return None
        self.words += 1
        word_in = cython.cast(SspDevice, self.device).exchange(self.word, time)
        if self.CR1 & CR1_LOOPBACK:
            word_in = self.word
        if self.words_in_count == DEPTH:
            self.flags |= ROR
        else:
            self.words_in[self.words_in_count] = word_in
            self.words_in_count += 1
        self.silence_alarm.set(time + SILENT_BITS * self.bit_ns)
        self.busy = False
        if self.going_count > 0:
            self._start(time)
        return None

    def read(self, offset: cython.longlong) -> cython.longlong:
        value: cython.longlong
        i: cython.longlong
        if offset == 0x08:
            value = self.words_in[0]
            if self.words_in_count > 0:
                self.words_in_count -= 1
                for i in range(self.words_in_count):
                    self.words_in[i] = self.words_in[i + 1]
                if self.words_in_count:
                    self.silence_alarm.set(self.chip.now + SILENT_BITS * self.bit_ns)
                else:
                    self.silence_alarm.set(NEVER)
                    self.flags &= ~RT
            return value
        self.steady = True
        if offset == 0x0C:
            value = SR_BSY if self.busy else 0
            if self.going_count == 0:
                value |= SR_TFE
            if self.going_count < DEPTH:
                value |= SR_TNF
            if self.words_in_count > 0:
                value |= SR_RNE
            if self.words_in_count == DEPTH:
                value |= SR_RFF
            return value
        if offset == 0x00:
            return self.CR0
        if offset == 0x04:
            return self.CR1
        if offset == 0x10:
            return self.CPSR
        if offset == 0x14:
            return self.IMSC
        if offset == 0x18:
            return self.raw()
        if offset == 0x1C:
            return self.raw() & self.IMSC
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x08:
            if self.going_count < DEPTH:  # else it is lost, as on the chip
                if self.word_ns == 0:
                    self.not_modelled("a word of the SSP without a rate (SSPCPSR 0)")
                self.going[self.going_count] = value & ((2 << (self.CR0 & 15)) - 1)
                self.going_count += 1
                if not self.busy and self.CR1 & CR1_ENABLE:
                    self._start(self.chip.now)
        elif offset == 0x00:
            if value >> 4 & 3:
                self.not_modelled("a frame format of the SSP other than SPI (SSPCR0 FRF)")
            self.CR0 = value & 0xFFFF
            self._set_rate()
        elif offset == 0x04:
            if value & CR1_SLAVE:
                self.not_modelled("the SSP as a slave (SSPCR1)")
            self.CR1 = value & 15
            if self.CR1 & CR1_ENABLE and self.going_count > 0 and not self.busy:
                self._start(self.chip.now)
        elif offset == 0x10:
            self.CPSR = value & 0xFE
            self._set_rate()
        elif offset == 0x14:
            self.IMSC = value & 15
        elif offset == 0x20:
            self.flags &= ~(value & (ROR | RT))
        else:
            self.unknown(offset, True)
        return 0
