# cython: boundscheck=False, wraparound=False
# (channels are 0 ... 7)
"""The internal 10-bit converter (ADCR, ADGDR, ADDR0 ... ADDR7): single conversions, or burst over channels.

A conversion takes 11 clocks of core clock / clkdiv: 60 MHz / 200 = 300 kHz gives 36.7 us. The input is
sampled at the start. A single conversion ends with the interrupt (ADC_DONE, 0). Burst mode converts its
channels in turn for ever and is polled: `DR(channel)` is the newest finished conversion.
counts = floor(scale * 1024 V / reference_V) + offset_counts, clipped to 0 ... 1023 (LPC2194 user manual: result =
V / VDDA * 1024; scale and offset are those of a board's own divider and converter).
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import ADC_DONE, InterruptSource
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

CONVERSION_CLOCKS: Final = 11
COUNTS: Final = 1024  # of the reference
LAST_COUNT: Final = 1023

# ADCR; bits 0-7 select the channels
CR_CLKDIV_SHIFT: Final = 8
CR_BURST: Final = 0x10000
CR_PDN: Final = 0x200000  # power on
CR_START: Final = 0x1000000  # now

# ADGDR
GDR_RESULT_SHIFT: Final = 6
GDR_CHN_SHIFT: Final = 24
GDR_DONE_ABOVE_CHN: Final = 0x80  # bit 31, counted from where the channel stands


@cython.final
@cython.cclass
class AdcInternal(Peripheral):
    """One converter. `inputs[channel]`: the analog pin of the chip behind AIN0 ... AIN7."""

    # what a conversion touches
    busy: cython.bint
    channel: cython.longlong
    alarm: "Alarm"
    source: InterruptSource
    conversion_ns: cython.longlong
    single: cython.longlong
    CR: cython.longlong
    GDR: cython.longlong
    scale: cython.double
    count_V: cython.double
    result: cython.longlong
    offset_counts: cython.longlong
    inputs: cython.longlong[8]
    # burst mode, and the rest
    channels: cython.longlong[8]
    burst_count: cython.longlong
    burst_start: cython.longlong
    hz: cython.longlong
    clkdiv: cython.longlong
    not_finished: cython.longlong

    def __init__(self, chip, clkdiv=200, hz=0, reference_V=3.3, scale=1.0, offset_counts=0) -> None:
        Peripheral.__init__(self, chip)
        if clkdiv <= 0 or reference_V <= 0.0:
            raise FirmwareError(f"{chip.name}: ADC: clkdiv {clkdiv} and reference_V {reference_V} must be above 0")
        self.clkdiv = clkdiv
        self.hz = hz if hz else chip.hz
        self.conversion_ns = CONVERSION_CLOCKS * clkdiv * 1_000_000_000 // self.hz
        self.count_V = reference_V / COUNTS
        self.scale = scale
        self.offset_counts = offset_counts
        self.alarm = chip.new_alarm(self, 0)
        self.source = chip.vic.source(ADC_DONE, 0)
        self.inputs = list(range(8))
        self.single = (clkdiv - 1) << CR_CLKDIV_SHIFT | CR_PDN | CR_START  # ADCR without the channel
        self.CR = 0
        self.GDR = 0
        self.result = 0
        self.channel = 0
        self.busy = False
        self.not_finished = 0
        self.channels = [0] * 8
        self.burst_count = 0
        self.burst_start = 0

    @cython.ccall
    @cython.exceptval(check=False)
    @cython.cdivision(True)  # the reference is above 0
    def convert(self, volts: cython.double) -> cython.longlong:
        """Counts for a voltage at the pin."""
        scaled: cython.double = self.scale * volts / self.count_V
        counts: cython.longlong
        if not scaled > 0.0:
            scaled = 0.0
        if scaled > 2.0 * COUNTS:
            scaled = 2.0 * COUNTS
        counts = int(scaled)
        counts += self.offset_counts
        if 0 <= counts <= LAST_COUNT:
            return counts
        return LAST_COUNT if counts > 0 else 0

    @cython.ccall
    def start(self, channel: cython.longlong) -> cython.bint:
        """Start one conversion; False (and `not_finished` counts) while one is under way."""
        if self.busy:
            self.not_finished += 1
            return False
        self.busy = True
        self.channel = channel
        self.CR = self.single | 1 << channel
        self.alarm.set(self.chip.now + self.conversion_ns)
        return True

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The conversion is over: ADGDR holds result, channel and the DONE bit."""
        done: cython.longlong = GDR_DONE_ABOVE_CHN
        self.result = self.convert(self.chip.analog.volts(self.inputs[self.channel], time - self.conversion_ns))
        self.GDR = self.result << GDR_RESULT_SHIFT | (done | self.channel) << GDR_CHN_SHIFT
        self.busy = False
        return self.source

    def start_burst(self, *channels) -> None:
        """Convert `channels` in turn from `now` on, without interrupts."""
        if not 1 <= len(channels) <= 8 or not all(0 <= channel <= 7 for channel in channels):
            raise FirmwareError(f"{self.chip.name}: ADC: burst channels {channels} are not 1 ... 8 of 0 ... 7")
        for place, channel in enumerate(channels):
            self.channels[place] = channel
        self.burst_count = len(channels)
        self.burst_start = self.chip.now
        self.CR = sum(1 << channel for channel in channels)
        self.CR |= (self.clkdiv - 1) << CR_CLKDIV_SHIFT | CR_BURST | CR_PDN

    @cython.ccall
    def DR(self, channel: cython.longlong) -> cython.longlong:
        """Newest finished burst result of a channel, 0 ... 1023; 0 before the first."""
        finished: cython.longlong = (self.chip.now - self.burst_start) // self.conversion_ns
        back: cython.longlong
        sampled: cython.longlong
        if self.burst_count == 0:
            return 0
        for back in range(1, self.burst_count + 1):
            if finished - back < 0:
                return 0
            if self.channels[(finished - back) % self.burst_count] == channel:
                sampled = self.burst_start + (finished - back) * self.conversion_ns
                return self.convert(self.chip.analog.volts(self.inputs[channel], sampled))
        return 0
