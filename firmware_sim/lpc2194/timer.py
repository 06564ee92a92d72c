# cython: boundscheck=False, wraparound=False
# (channels and match registers are 0 ... 3)
"""Timer 0 or 1 as a program sets it up: the capture unit of peripherals/timer_capture.py, and its registers.

LPC2194 user manual, Timer 0 and 1. The count goes up with every PR + 1 clocks of the peripherals; a match acts one
count later, when a reset would show. Not modelled: counting of edges at a pin (TxCTCR), match outputs at pins (TxEMR).
The program reads the count at the time at which its instruction begins, rounded down to whole ns: it may be one less
than the clock's edge would give.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.clock import TickTrain
from ranger_sim.firmware_sim.lpc2194.block import Block, Clocks
from ranger_sim.firmware_sim.peripherals.timer_capture import CCR_BITS, CCR_INTERRUPT, IR_CR0, TimerCapture
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import NEVER

# TxTCR
TCR_ENABLE: Final = 1
TCR_RESET: Final = 2
# TxMCR, three bits per match register
MCR_INTERRUPT: Final = 1
MCR_RESET: Final = 2
MCR_STOP: Final = 4
MCR_BITS: Final = 3

FULL_COUNT = 1 << 32
CLOCK_OF_BEGIN = 60_000_000  # with a period of one millisecond: the device is built before its program sets it up


@cython.final
@cython.cclass
class ProgrammedTimer(TimerCapture):
    """A timer whose period is the program's: TCR, PR, TC, MCR and MR0 ... MR3 at run time.

    While it runs, `wrap_time` is the time of the count 0 and `next_wrap_time` that at which the count begins anew.
    `planned`: the time of the next match that interrupts or stops, or of the wrap before it.
    """

    clocks: "Clocks"
    TCR: cython.longlong
    PR: cython.longlong
    MCR: cython.longlong
    held: cython.longlong
    passed: cython.longlong
    planned: cython.longlong
    matches: cython.longlong
    match_time: cython.longlong
    match: cython.longlong[4]

    def __init__(self, chip, clocks, number) -> None:
        TimerCapture.__init__(self, chip, number, 60_000, CLOCK_OF_BEGIN)
        self.clocks = clocks
        self.TCR = 0
        self.PR = 0
        self.MCR = 0
        self.match = [0] * 4
        self.held = 0  # the count while it is stopped
        self.passed = 0  # matches of smaller counts have acted in this period
        self.planned = NEVER
        self.matches = 0  # that asked for an interrupt
        self.match_time = 0  # the latest of them
        self.hold_at(0)

    # --- what the program does ----------------------------------------------------------------------------

    @cython.ccall
    def hold_at(self, count) -> object:
        """Hold the count at `count` from now on."""
        self.held = count
        self.counts_per_ns = 0.0
        self.wrap_time = 0
        self.next_wrap_time = NEVER
        self.planned = NEVER
        self.MR0 = FULL_COUNT - 1
        self.alarm.set(NEVER)

    @cython.ccall
    @cython.exceptval(check=False)
    def running(self) -> cython.bint:
        """True while it counts."""
        return self.TCR & (TCR_ENABLE | TCR_RESET) == TCR_ENABLE

    @cython.ccall
    def count(self) -> cython.longlong:
        """TxTC."""
        return self.count_at(self.chip.now) if self.running() else self.held

    def prescale_count(self) -> int:
        """TxPC."""
        if not self.running():
            return 0
        self.count_at(self.chip.now)
        clocks: cython.double = (self.chip.now - self.wrap_time) * self.counts_per_ns * (self.PR + 1)
        return int(clocks) % (self.PR + 1)

    def go_on_from(self, count) -> None:
        """Count from `count` on, the present count, with the registers as they are."""
        now = self.chip.now
        if not self.running():
            self.hold_at(0 if self.TCR & TCR_RESET else count)
            return
        pclk = self.clocks.pclk
        crystal = self.chip.crystal
        self.hz = pclk
        self.counts_per_ns = crystal.cycles_per_ns(pclk) / (self.PR + 1)
        self.wrap_time = now - crystal.cycles_to_ns(count * (self.PR + 1), pclk)
        self.passed = count
        resets = [self.match[n] for n in range(4) if self.MCR >> MCR_BITS * n & MCR_RESET]
        ahead = [match for match in resets if match >= count]
        # a count above all of them first wraps through all 32 bits
        self.MR0 = min(ahead) if ahead else FULL_COUNT - 1
        self._lay_out(self.wrap_time)

    def _lay_out(self, begin) -> None:
        """Periods of MR0 + 1 counts, the present one since `begin` (ns)."""
        rate = self.hz * (1_000_000_000 + self.chip.crystal.ppb)
        train = TickTrain(self.chip.crystal, 1, begin)
        train.rate = rate
        train.step_ns, train.step_rest = divmod((self.MR0 + 1) * (self.PR + 1) * 10**18, rate)
        train.step_ns = min(train.step_ns, NEVER // 2)
        self.ticks = train
        self.period_ns = train.step_ns
        self.next_wrap_time = train.next()
        self._plan()

    def continue_count(self) -> None:
        """Continue from the present count after a change of the registers."""
        self.go_on_from(self.count())

    def retune(self, now, before) -> None:
        """Continue from the present count."""
        if self.running():
            count = self.count_at(now)
            self.chip.now = now
            self.go_on_from(count)

    # --- what time does -----------------------------------------------------------------------------------

    @cython.cfunc
    def _plan(self) -> cython.longlong:
        """Find the next match that acts; returns its time."""
        n: cython.longlong
        acts: cython.longlong = 0
        next_count: cython.longlong = self.MR0
        for n in range(4):
            if self.MCR >> MCR_BITS * n & (MCR_INTERRUPT | MCR_STOP):
                acts = 1
                if self.passed <= self.match[n] < next_count:
                    next_count = self.match[n]
        if acts == 0:
            self.planned = NEVER
        elif next_count == self.MR0:
            self.planned = self.next_wrap_time
        else:
            self.planned = self.wrap_time + self.chip.crystal.cycles_to_ns((next_count + 1) * (self.PR + 1), self.hz)
        self.alarm.set(self.planned)
        return self.planned

    def _wrap_to(self, time: cython.longlong) -> cython.longlong:
        """Let every match and wrap up to `time` act; returns the time of the latest wrap."""
        if self.planned < NEVER:
            while self.planned <= time:
                self._act()
        elif self.next_wrap_time <= time:
            self._skip_wraps(time)
        return self.wrap_time

    def _skip_wraps(self, time) -> None:
        """The same where nothing acts."""
        self._shorten()
        train = self.ticks
        ahead = (time - train.time) // (train.step_ns + 1)
        if ahead > 0:
            whole, train.rest = divmod(train.rest + ahead * train.step_rest, train.rate)
            train.time += ahead * train.step_ns + whole
        while train.time <= time:
            self.wrap_time = train.time
            self.next_wrap_time = train.next()

    def _shorten(self) -> None:
        """From the next period on the first match that resets counts, also one that was behind the count."""
        resets = [self.match[n] for n in range(4) if self.MCR >> MCR_BITS * n & MCR_RESET]
        top = min(resets) if resets else FULL_COUNT - 1
        if top != self.MR0:
            begin = self.next_wrap_time
            self.MR0 = top
            self.passed = 0
            self.wrap_time = begin
            self._lay_out(begin)

    @cython.cfunc
    @cython.exceptval(check=True)
    def _act(self) -> cython.void:
        """The planned match, or the wrap."""
        n: cython.longlong
        at: cython.longlong = self.planned
        flag: cython.longlong = 1
        count: cython.longlong = self.MR0
        stops: cython.bint = False
        if at < self.next_wrap_time:
            count = self._count_before(at)
        for n in range(4):
            if self.match[n] == count:
                if self.MCR >> MCR_BITS * n & MCR_INTERRUPT:
                    self.IR |= flag << n
                    self.matches += 1
                    self.match_time = at
                if self.MCR >> MCR_BITS * n & MCR_STOP:
                    stops = True
        if at == self.next_wrap_time:
            self.wrap_time = at
            self.next_wrap_time = self.ticks.next()
            self.passed = 0
            count = -1
            if not stops:
                self._new_period()
        else:
            self.passed = count + 1
        if stops:
            self._stop_at(count)
        else:
            self._plan()

    @cython.cfunc
    @cython.exceptval(check=True)
    def _new_period(self) -> cython.void:
        """A period begins; it may be another one than that before, which a match register was written in."""
        n: cython.longlong
        for n in range(4):
            if self.MCR >> MCR_BITS * n & MCR_RESET and self.match[n] < self.MR0:
                self.next_wrap_time = self.wrap_time
                self._shorten()
                return

    @cython.cfunc
    @cython.exceptval(check=False)
    def _count_before(self, at: cython.longlong) -> cython.longlong:
        """The count whose match acts at `at`: the smallest that has not acted yet."""
        n: cython.longlong
        best: cython.longlong = self.MR0
        for n in range(4):
            if self.MCR >> MCR_BITS * n & (MCR_INTERRUPT | MCR_STOP) and self.passed <= self.match[n] < best:
                best = self.match[n]
        return best

    @cython.ccall
    def _stop_at(self, count) -> object:
        """A match stops the timer: TCR's enable bit falls, the count stops."""
        self.TCR &= ~TCR_ENABLE
        self.hold_at(max(count, 0))

    def on_pin(self, channel: cython.longlong, level: cython.longlong, time: cython.longlong) -> cython.longlong:
        """An edge at a capture pin; the flag comes only where the program wants the interrupt."""
        flag: cython.longlong = IR_CR0
        bits: cython.longlong = self.CCR >> CCR_BITS * channel
        if not self.running():
            return 0
        TimerCapture.on_pin(self, channel, level, time)
        if bits & CCR_INTERRUPT == 0:
            self.IR &= ~(flag << channel)
        return 0

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """A match acts."""
        self._wrap_to(time)
        return None


@cython.final
@cython.cclass
class TimerBlock(Block):
    """Timer `number`, 0 or 1."""

    timer: ProgrammedTimer

    REGISTERS = {
        0x00: ("IR", "rw"),
        0x04: ("TCR", "rw"),
        0x08: ("TC", "rw"),
        0x0C: ("PR", "rw"),
        0x10: ("PC", "r"),
        0x14: ("MCR", "rw"),
        0x18: ("MR0", "rw"),
        0x1C: ("MR1", "rw"),
        0x20: ("MR2", "rw"),
        0x24: ("MR3", "rw"),
        0x28: ("CCR", "rw"),
        0x2C: ("CR0", "r"),
        0x30: ("CR1", "r"),
        0x34: ("CR2", "r"),
        0x38: ("CR3", "r"),
        0x3C: ("EMR", "rw"),
        0x70: ("CTCR", "rw"),
    }

    def __init__(self, chip, clocks, number) -> None:
        Block.__init__(self, chip, clocks, f"timer {number}", 0xE0004000 + 0x4000 * number, 1 << (4 + number))
        self.timer = ProgrammedTimer(chip, clocks, number)

    def requests(self) -> cython.longlong:
        return self.mask if self.timer.IR else 0

    def clocked(self) -> None:
        self.timer.continue_count()

    def read(self, offset: cython.longlong) -> cython.longlong:
        timer: ProgrammedTimer = self.timer
        if offset == 0x08:
            return timer.count()
        if offset == 0x10:
            return timer.prescale_count()
        self.steady = True
        if offset == 0x00:
            return timer.IR
        if offset == 0x04:
            return timer.TCR
        if offset == 0x0C:
            return timer.PR
        if offset == 0x14:
            return timer.MCR
        if 0x18 <= offset <= 0x24:
            return timer.match[(offset - 0x18) >> 2]
        if offset == 0x28:
            return timer.CCR
        if 0x2C <= offset <= 0x38:
            return timer.captures[(offset - 0x2C) >> 2]
        if offset == 0x3C or offset == 0x70:
            return 0
        return self.unknown(offset, False)

    def write(self, offset: cython.longlong, value: cython.longlong) -> cython.int:
        timer: ProgrammedTimer = self.timer
        count: cython.longlong
        if offset == 0x00:
            timer.clear(value)
        elif offset == 0x28:
            timer.CCR = value & 0xFFF
        elif offset == 0x04:
            if value & 3 != timer.TCR:
                count = timer.count()
                timer.TCR = value & 3
                timer.go_on_from(count)
        elif offset == 0x08:
            if timer.running():
                timer.go_on_from(value)
            else:
                timer.hold_at(value)
        elif offset == 0x0C:
            count = timer.count()
            timer.PR = value
            timer.go_on_from(count)
        elif offset == 0x14:
            timer.MCR = value & 0xFFF
            timer.continue_count()
        elif 0x18 <= offset <= 0x24:
            timer.match[(offset - 0x18) >> 2] = value
            timer.continue_count()
        elif offset == 0x3C:
            if value & 0xFF0:
                self.not_modelled("a match output at a pin (EMR)")
        elif offset == 0x70:
            if value & 3:
                self.not_modelled("counting edges at a pin (CTCR)")
        else:
            self.unknown(offset, True)
        return 0
