# cython: boundscheck=False, wraparound=False, cdivision=True
# (entries of the sequence are 0 ... 15, codes are masked to their registers; the reference is above 0)
"""The external 14-bit converter ADS7871 on the SSP, its BUSY pin on an external interrupt.

Writing register 4 with bit 7 set starts a conversion of the channel (bits 0-3) at the gain (bits 4-6); BUSY
falls one conversion later, which raises (EXTERNAL_INTERRUPT, eint). The handler reads the result, a signed
14-bit number right-justified, -8192 ... 8191, and starts the next channel.

Sources: Texas Instruments SLAS370C: gains, multiplexer codes, register numbers, 48 kSamples/s at most. A
conversion is therefore modelled as 1/48 ms = 20.83 us from the write, unless a board says otherwise. The input is
sampled at its start.
The SSP transfers (16 bits at 10 MHz) are part of the cost of the code that does them.
"""

from typing import TYPE_CHECKING, Final

import cython
from cython.cimports.libc.math import copysign

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import EXTERNAL_INTERRUPT, InterruptSource
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

# register 4
START: Final = 0x80
GAIN_SHIFT: Final = 4
GAIN_MASK: Final = 7
CHANNEL_MASK: Final = 15

COUNTS: Final = 8192  # of full scale at gain 1; results have 14 bits with the sign
LEAST_COUNT: Final = -8192
LAST_COUNT: Final = 8191

# From a handler's start to its next start word, after two registers were read over the SSP: fitted by us to the
# times at which the images' frames are asked for (the handler takes 66 to 70 instructions, robot.md T2)
RESTART_NS: Final = 2_500

CONVERSION_NS = 20_833  # 48 kSamples/s, SLAS370C
GAINS = (1, 2, 4, 5, 8, 10, 16, 20)  # by gain code 0 ... 7, SLAS370C
REFERENCE_V = 2.5  # full scale at gain 1; external reference of the usual 2.5 V (chosen by us, as the internal one)


def register4(channel_code, gain_code) -> int:
    """Start word: bit 7, gain code in bits 4-6, multiplexer code in bits 0-3."""
    if not 0 <= channel_code <= 15:
        raise FirmwareError(f"ADS7871: channel code {channel_code} is not 0 ... 15")
    if not 0 <= gain_code <= 7:
        raise FirmwareError(f"ADS7871: gain code {gain_code} is not 0 ... 7")
    return START | gain_code << GAIN_SHIFT | channel_code


@cython.final
@cython.cclass
class Ads7871(Peripheral):
    """One converter. `inputs[code]`: the analog pin behind each multiplexer code (differential: one pin that
    carries the difference); `results[i]`: last result of entry i of the sequence.

    counts = round(scale * gain * V / reference_V * 8192) + offset_counts, clipped to 14 bits.
    """

    # what a conversion touches
    busy: cython.bint
    done: cython.bint
    step: cython.longlong
    length: cython.longlong
    register4: cython.longlong
    alarm: "Alarm"
    source: InterruptSource
    conversion_ns: cython.longlong
    offset_counts: cython.longlong
    sequence: cython.longlong[16]
    inputs: cython.longlong[16]
    gains: cython.double[8]
    count_V: cython.double
    result: cython.longlong
    results: cython.longlong[16]
    # the rest
    eint: cython.longlong
    not_finished: cython.longlong

    def __init__(
        self, chip, eint=1, reference_V=REFERENCE_V, conversion_ns=CONVERSION_NS, scale=1.0, offset_counts=0
    ) -> None:
        Peripheral.__init__(self, chip)
        if reference_V <= 0.0:
            raise FirmwareError(f"{chip.name}: ADS7871: reference_V {reference_V} must be above 0")
        self.eint = eint
        self.conversion_ns = conversion_ns
        self.alarm = chip.new_alarm(self, 0)
        self.count_V = reference_V / COUNTS
        self.gains = [scale * gain for gain in GAINS]
        self.offset_counts = offset_counts
        self.source = chip.vic.source(EXTERNAL_INTERRUPT, eint)
        self.register4 = 0
        self.inputs = list(range(16))
        self.busy = False
        self.result = 0
        self.length = 0
        self.step = 0
        self.sequence = [0] * 16
        self.results = [0] * 16
        self.done = True
        self.not_finished = 0

    def set_sequence(self, *entries) -> None:
        """What `start_sequence` converts: entries (channel code, gain code, analog pin), at most 16."""
        if not 1 <= len(entries) <= 16:
            raise FirmwareError(f"{self.chip.name}: ADS7871: {len(entries)} sequence entries; 1 ... 16 are possible")
        for place, (channel_code, gain_code, pin) in enumerate(entries):
            self.sequence[place] = register4(channel_code, gain_code)
            self.inputs[channel_code] = pin
        self.length = len(entries)

    @cython.ccall
    @cython.exceptval(check=False)
    def convert(self, volts: cython.double, gain_code: cython.longlong) -> cython.longlong:
        """Counts for a voltage at the input."""
        scaled: cython.double = self.gains[gain_code] * volts / self.count_V
        counts: cython.longlong
        if not 2.0 * LEAST_COUNT <= scaled <= 2.0 * COUNTS:
            if scaled != scaled:
                return 0
            scaled = copysign(2.0 * COUNTS, scaled)
        counts = int(scaled + copysign(0.5, scaled))
        counts += self.offset_counts
        if LEAST_COUNT <= counts <= LAST_COUNT:
            return counts
        return LAST_COUNT if counts > 0 else LEAST_COUNT

    @cython.ccall
    def start(self, register4: cython.longlong) -> cython.bint:
        """Write register 4; False when a conversion is under way (the write is lost)."""
        return self.write(register4, self.chip.now)

    @cython.ccall
    def write(self, register4: cython.longlong, time: cython.longlong) -> cython.bint:
        """The same, the word being there at `time` (ns): behind the code before it and the transfers."""
        if self.busy:
            return False
        self._take(register4, time)
        return True

    @cython.cfunc
    @cython.final
    def _take(self, register4: cython.longlong, time: cython.longlong) -> cython.void:
        """The start word is there at `time` (ns)."""
        self.register4 = register4
        if register4 & START:
            self.busy = True
            self.alarm.set(time + self.conversion_ns)

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The conversion is over: result registers 1 and 0 are loaded, BUSY falls."""
        volts: cython.double = self.chip.analog.volts(
            self.inputs[self.register4 & CHANNEL_MASK], time - self.conversion_ns
        )
        self.result = self.convert(volts, self.register4 >> GAIN_SHIFT & GAIN_MASK)
        self.busy = False
        return self.source

    @property
    def registers(self):
        """The 32 registers: result in 0 and 1, what was written in 4."""
        return [self.result << 2 & 255, self.result >> 6 & 255, 0, 0, self.register4 & 127] + [0] * 27

    @cython.ccall
    @cython.exceptval(check=False)
    def read_result(self) -> cython.longlong:
        """Registers 1 and 0 as one signed number, -8192 ... 8191."""
        return self.result

    # The firmware's side of a sequence: start it once per slot, let on_busy serve EINT, then wait for it.

    @cython.ccall
    def start_sequence(self) -> cython.bint:
        """Start at the first entry; False (and `not_finished` counts) while the last sequence still runs."""
        if not self.done or self.busy:
            self.not_finished += 1
            return False
        self.done = False
        self.step = 0
        self.start(self.sequence[0])
        return True

    def on_busy(self, queue) -> object:
        """Interrupt handler: store the result, start the next entry."""
        step: cython.longlong = self.step
        self.results[step] = self.result
        step += 1
        if step < self.length:
            self.step = step
            self._take(self.sequence[step], self.chip.now + RESTART_NS)
        else:
            self.step = 0
            self.done = True
        return None

    @cython.ccall
    @cython.exceptval(check=False)
    def sequence_done(self) -> cython.bint:
        """True when no sequence runs: the condition of a Wait."""
        return self.done

    def unplug(self) -> None:
        """A dead converter: the conversion under way never ends."""
        self.alarm.set(NEVER)
