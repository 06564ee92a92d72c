# cython: boundscheck=False, wraparound=False
# (channels are 0 ... 3, checked when a pin is connected)
"""A timer with four capture channels, as Timer0 and Timer1 of the LPC2194 (T0CR0, T0CCR, T0IR, T0MR0 ...).

The timer counts 0 ... MR0 and starts again. An edge that T0CCR asks for copies the count into the channel's
capture register, sets the channel's bit in T0IR and raises the interrupt of the pin, source (PIN_EDGE, pin). A
channel holds ONE capture: a second edge before the firmware clears the bit overwrites it. An edge of the
direction that is not armed is not captured at all. Both are counted in `lost`, ground truth for tests; those
captured are counted by their interrupt's source.
"""

from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.firmware_sim.clock import TickTrain
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import TIMER_MATCH, InterruptSource
from ranger_sim.foundation.user_error import FirmwareError

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.alarm import Alarm

IR_MR0: Final = 0x1  # TxIR: the match that restarts the timer
IR_CR0: Final = 0x10  # capture 0; those of channels 1 ... 3 follow
# TxCCR, per channel CCR_BITS apart
CCR_RISING: Final = 0x1
CCR_FALLING: Final = 0x2
CCR_INTERRUPT: Final = 0x4
CCR_MASK: Final = 0x7
CCR_BITS: Final = 3


@cython.cclass
class TimerCapture(Peripheral):
    """Timer `number` that wraps every `period` counts of `hz` (core clock unless given), from `phase_ns` on.

    `match_interrupt=True` raises (TIMER_MATCH, number) at every wrap. Edges `lost` per channel.
    """

    # what an edge touches
    IR: cython.longlong
    CCR: cython.longlong
    wrap_time: cython.longlong
    next_wrap_time: cython.longlong
    counts_per_ns: cython.double
    MR0: cython.longlong
    captures: cython.longlong[4]
    # what a wrap touches besides
    alarm: "Alarm"
    match_source: InterruptSource
    ticks: TickTrain
    # the rest
    period_ns: cython.longlong
    lost: cython.longlong[4]
    pins: cython.longlong[4]
    number: cython.longlong
    phase_ns: cython.longlong
    hz: cython.longlong
    match_interrupt: cython.bint

    def __init__(self, chip, number=0, period=30000, hz=0, phase_ns=0, match_interrupt=False) -> None:
        Peripheral.__init__(self, chip)
        if period <= 0:
            raise FirmwareError(f"{chip.name}: timer {number}: period {period} counts must be above 0")
        self.number = number
        self.MR0 = period - 1
        self.hz = hz if hz else chip.hz
        if period * 1_000_000_000 % self.hz:
            raise FirmwareError(
                f"{chip.name}: timer {number}: {period} counts at {self.hz} Hz are no whole number of ns"
            )
        self.period_ns = period * 1_000_000_000 // self.hz
        self.counts_per_ns = chip.crystal.cycles_per_ns(self.hz)
        self.phase_ns = phase_ns
        self.captures = [0] * 4  # CR0 ... CR3
        self.CCR = 0
        self.IR = 0
        self.ticks = TickTrain(chip.crystal, self.period_ns, phase_ns)
        self.wrap_time = phase_ns
        self.next_wrap_time = self.ticks.next()
        self.match_interrupt = match_interrupt
        self.match_source = chip.vic.source(TIMER_MATCH, number)
        self.pins = [-1] * 4
        self.lost = [0] * 4
        self.alarm = chip.new_alarm(self, 0)
        if match_interrupt:
            self.alarm.set(self.next_wrap_time)

    def retune(self, now, before) -> None:
        """The count goes on where it is."""
        crystal = self.chip.crystal
        self.counts_per_ns = crystal.cycles_per_ns(self.hz)
        if now >= self.next_wrap_time:
            self._wrap_to(now)
        self.wrap_time = now - crystal.in_its_time(now - self.wrap_time, before)
        self.next_wrap_time = now + crystal.in_its_time(self.next_wrap_time - now, before)
        self.ticks = self.ticks.moved(crystal, self.next_wrap_time)
        self.phase_ns = self.ticks.phase_ns
        if self.match_interrupt:
            self.alarm.set(self.next_wrap_time)

    def use_channel(self, channel, pin, rising=True, falling=True, source=None):
        """Connect `pin` to capture `channel` 0 ... 3 and arm it; returns the interrupt source that its captures raise.

        `source`: another one than that of the pin.
        """
        if not 0 <= channel <= 3:
            raise FirmwareError(f"{self.chip.name}: timer {self.number}: channel {channel} is not 0 ... 3")
        source = self.chip.claim_pin(pin, channel, self, source)
        self.pins[channel] = pin
        self.arm(channel, rising, falling)
        return source

    @cython.ccall
    def arm(self, channel: cython.longlong, rising: cython.bint, falling: cython.bint) -> None:
        """Choose the edges that channel captures (its three bits of T0CCR, interrupt on)."""
        bits: cython.longlong = CCR_INTERRUPT
        mask: cython.longlong = CCR_MASK
        if rising:
            bits |= CCR_RISING
        if falling:
            bits |= CCR_FALLING
        self.CCR = self.CCR & ~(mask << CCR_BITS * channel) | bits << CCR_BITS * channel

    @cython.ccall
    @cython.exceptval(check=False)
    def clear(self, mask: cython.longlong) -> cython.longlong:
        """Write T0IR: the bits of `mask` are cleared, the channels may capture again. Returns what is left."""
        self.IR &= ~mask
        return self.IR

    @property
    def wraps(self):
        """How often the timer has started again, as far as it has been looked at."""
        return self.ticks.number - 1

    @cython.ccall
    def CR(self, channel: cython.longlong) -> cython.longlong:
        """Capture register of a channel by number."""
        return self.captures[channel]

    @property
    def CR0(self):
        """Capture register of channel 0."""
        return self.captures[0]

    @property
    def CR1(self):
        """Capture register of channel 1."""
        return self.captures[1]

    @property
    def CR2(self):
        """Capture register of channel 2."""
        return self.captures[2]

    @property
    def CR3(self):
        """Capture register of channel 3."""
        return self.captures[3]

    @cython.ccall
    def TC(self) -> cython.longlong:
        """The count at `now`."""
        return self.count_at(self.chip.now)

    @cython.ccall
    def count_at(self, time: cython.longlong) -> cython.longlong:
        """The count (0 ... MR0) at an instant not before the present wrap."""
        count: cython.longlong
        if time >= self.next_wrap_time:
            self._wrap_to(time)
        count = int((time - self.wrap_time) * self.counts_per_ns)
        if count > self.MR0:
            return self.MR0
        return count

    @cython.cfunc
    def _wrap_to(self, time: cython.longlong) -> cython.longlong:
        """Bring the wrap that precedes `time` up to date, however far away; returns its instant."""
        self.wrap_time = self.next_wrap_time
        self.next_wrap_time = self.ticks.next()
        if time >= self.next_wrap_time:
            return self._skip_to(time)
        return self.wrap_time

    @cython.cfunc
    def _skip_to(self, time: cython.longlong) -> cython.longlong:
        """The same over wraps that nobody has looked at."""
        self.ticks.go_to(self.chip.crystal.local_ns(time - self.phase_ns) // self.period_ns)
        while self.ticks.time <= time:
            self.wrap_time = self.ticks.time
            self.next_wrap_time = self.ticks.next()
        return self.wrap_time

    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """An edge at a capture pin; 1 when it asks for the interrupt."""
        asked: cython.longlong = self.CCR >> CCR_BITS * channel
        flag: cython.longlong = IR_CR0
        count: cython.longlong
        if time >= self.next_wrap_time:
            return self._late_pin(channel, level, time)
        if asked & (CCR_RISING if level else CCR_FALLING) == 0:
            self.lost[channel] += 1
            return 0
        count = int((time - self.wrap_time) * self.counts_per_ns)
        self.captures[channel] = count if count < self.MR0 else self.MR0
        flag <<= channel
        if self.IR & flag:
            self.lost[channel] += 1
            return 0
        self.IR |= flag
        return 1 if asked & CCR_INTERRUPT else 0

    @cython.cfunc
    def _late_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """An edge after a wrap that has not been looked at."""
        self._wrap_to(time)
        return self.on_pin(channel, level, time)

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The timer matched MR0 and restarted (an edge at this very instant may have told already)."""
        if time >= self.next_wrap_time:
            self._wrap_to(time)
        self.alarm.set(self.next_wrap_time)
        self.IR |= IR_MR0
        return self.match_source
