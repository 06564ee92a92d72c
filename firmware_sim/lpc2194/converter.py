"""The internal converter's registers: single conversions by software, and burst without interrupts.

LPC2194 user manual (LPC2194/01), A/D converter. Not modelled: starts by a pin or a match, and interrupts in burst mode.
The converter is peripherals/adc_internal.py.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.vic import ADC_INPUT
from ranger_sim.firmware_sim.peripherals.adc_internal import CONVERSION_CLOCKS, CR_BURST, GDR_RESULT_SHIFT, AdcInternal

CR_PDN_BIT: Final = 0x200000
START_SHIFT: Final = 24
GLOBAL_INTERRUPT: Final = 0x100  # ADINTEN: any conversion's end

DONE: cython.longlong = 2147483648


@cython.final
@cython.cclass
class ConverterBlock(Block):
    """`inten`: ADINTEN. `done`: channels whose ADDR has a result that was not read."""

    adc: AdcInternal
    control: cython.longlong
    inten: cython.longlong
    done: cython.longlong
    seen: cython.bint
    data: cython.longlong[8]
    burst_read: cython.longlong[8]

    READ_ACTS = frozenset({0x04, *range(0x10, 0x30, 4)})
    REGISTERS = {
        0x00: ("ADCR", "rw"),
        0x04: ("ADGDR", "r"),
        0x0C: ("ADINTEN", "rw"),
        **{0x10 + 4 * channel: (f"ADDR{channel}", "r") for channel in range(8)},
        0x30: ("ADSTAT", "r"),
    }

    def __init__(self, chip, clocks, hardware) -> None:
        Block.__init__(self, chip, clocks, "A/D converter", 0xE0034000, 1 << ADC_INPUT)
        self.adc = AdcInternal(
            chip,
            clkdiv=1,
            reference_V=hardware.reference_V,
            scale=hardware.scale,
            offset_counts=hardware.offset_counts,
        )
        self.adc.inputs = [hardware.inputs.get(channel, channel) for channel in range(8)]
        self.control = 1  # reset value
        self.inten = 0x100
        self.seen = True  # the end of the present conversion has been taken in
        self.done = 0
        self.data = [0] * 8
        self.burst_read = [0] * 8  # by channel, the number of the conversion that was read last, from 1

    @cython.cfunc
    def take_result(self) -> cython.void:
        """Take the result of a conversion that has ended."""
        adc: AdcInternal = self.adc
        if not self.seen and not adc.busy:
            self.seen = True
            self.data[adc.channel] = adc.result << GDR_RESULT_SHIFT
            self.done |= 1 << adc.channel

    def requests(self) -> cython.longlong:
        self.take_result()
        if self.control & CR_BURST:
            return 0
        if self.inten & GLOBAL_INTERRUPT:
            return self.mask if self.adc.GDR & DONE else 0
        return self.mask if self.done & self.inten else 0

    def clocked(self) -> None:
        self._set_clock()

    @cython.ccall
    def _set_clock(self) -> object:
        """Set the conversion's clock from ADCR's divider and the peripherals' clock."""
        adc: AdcInternal = self.adc
        adc.clkdiv = (self.control >> 8 & 0xFF) + 1
        adc.hz = self.clocks.pclk
        adc.conversion_ns = self.chip.crystal.true_ns(CONVERSION_CLOCKS * adc.clkdiv * 1_000_000_000 // adc.hz)

    def read(self, offset: cython.longlong) -> cython.longlong:
        adc: AdcInternal = self.adc
        value: cython.longlong
        channel: cython.longlong
        if offset == 0x04:
            if self.control & CR_BURST:
                self.not_modelled("ADGDR in burst mode (ADDRn is)")
            value = adc.GDR
            adc.GDR &= ~DONE
            self.done &= ~(1 << adc.channel)
            return value
        if 0x10 <= offset < 0x30:
            channel = (offset - 0x10) >> 2
            if self.control & CR_BURST:
                return self._burst_result(channel)
            value = self.data[channel]
            if self.done >> channel & 1:
                value |= DONE
                self.done &= ~(1 << channel)
            return value
        if offset == 0x30:
            return self.done | (0x10000 if self.requests() else 0)
        self.steady = True
        if offset == 0x00:
            return self.control
        if offset == 0x0C:
            return self.inten
        return self.unknown(offset, False)

    @cython.ccall
    def _burst_result(self, channel) -> cython.longlong:
        """ADDRn in burst mode: the newest result, DONE when it was not read before."""
        adc: AdcInternal = self.adc
        finished = (self.chip.now - adc.burst_start) // adc.conversion_ns
        newest = -1
        for back in range(1, adc.burst_count + 1):
            if finished - back >= 0 and adc.channels[(finished - back) % adc.burst_count] == channel:
                newest = finished - back
                break
        value = adc.DR(channel) << GDR_RESULT_SHIFT
        if newest + 1 > self.burst_read[channel]:
            self.burst_read[channel] = newest + 1
            value |= DONE
        return value

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        if offset == 0x00:
            self._control(value)
        elif offset == 0x0C:
            self.inten = value & 0x1FF
        else:
            self.unknown(offset, True)
        return 0

    @cython.ccall
    def _control(self, value) -> object:
        """Write ADCR: clock, power, and what is to be converted."""
        adc: AdcInternal = self.adc
        start = value >> START_SHIFT & 7
        if start > 1:
            self.not_modelled("the start of a conversion by a pin or a match (ADCR START)")
        self.control = value & ~(7 << START_SHIFT)
        self._set_clock()
        chosen = [channel for channel in range(8) if value >> channel & 1]
        if not value & CR_PDN_BIT:
            adc.burst_count = 0
            return
        if value & CR_BURST:
            if self.inten & 0xFF:
                self.not_modelled("interrupts of conversions in burst mode (ADINTEN)")
            if chosen:
                adc.start_burst(*chosen)
                self.burst_read = [0] * 8
            return
        adc.burst_count = 0
        if start == 1 and chosen:
            adc.GDR &= ~DONE
            if adc.busy:  # a start word takes back the conversion under way
                adc.alarm.set(self.chip.now + adc.conversion_ns)
                adc.channel = chosen[0]
            else:
                adc.start(chosen[0])
            self.seen = False
