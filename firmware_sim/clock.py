"""Each board's own oscillator: true time and the board's time, exact for any length of run.

A crystal that runs `ppb` parts per billion fast makes 10^9 + ppb of its nanoseconds in 10^9 true ones.
Conversions take quotient and remainder, because a product of nanoseconds and 10^9 leaves 64 bits after
nine seconds. Results are rounded down, always from absolute counts, so no error accumulates.
"""

import cython

from ranger_sim.foundation.user_error import FirmwareError

# chosen by us: a crystal outside this is broken, and the remainders below still fit into 63 bits
LARGEST_PPB = 100_000_000


@cython.final
@cython.cclass
class Crystal:
    """An oscillator of `nominal_hz` that runs `ppb` parts per billion fast (negative: slow)."""

    nominal_hz: cython.longlong
    ppb: cython.longlong

    def __init__(self, nominal_hz=10_000_000, ppb=0) -> None:
        if nominal_hz <= 0:
            raise FirmwareError(f"crystal: nominal_hz {nominal_hz} must be above 0")
        if abs(ppb) > LARGEST_PPB:
            raise FirmwareError(f"crystal: {ppb} ppb is outside +/-{LARGEST_PPB} ppb")
        self.nominal_hz = nominal_hz
        self.ppb = ppb

    @cython.ccall
    def tick_time_ns(
        self, n: cython.longlong, period_ns: cython.longlong, phase_ns: cython.longlong
    ) -> cython.longlong:
        """True time (ns) of tick `n` of a timer with `period_ns` on this clock; tick 0 is at `phase_ns`."""
        return phase_ns + self.true_ns(n * period_ns)

    @cython.ccall
    def true_ns(self, local_ns: cython.longlong) -> cython.longlong:
        """True duration (ns) in which this clock counts `local_ns`."""
        rate: cython.longlong = 1000000000 + self.ppb
        quotient: cython.longlong = local_ns // rate
        return quotient * 1000000000 + (local_ns - quotient * rate) * 1000000000 // rate

    @cython.ccall
    def local_ns(self, true_ns: cython.longlong) -> cython.longlong:
        """What this clock counts (ns) in `true_ns`."""
        rate: cython.longlong = 1000000000 + self.ppb
        quotient: cython.longlong = true_ns // 1000000000
        return quotient * rate + (true_ns - quotient * 1000000000) * rate // 1000000000

    def in_its_time(self, true_ns, before) -> int:
        """True duration (ns) in which this clock counts what `before` counts in `true_ns`."""
        return self.true_ns(before.local_ns(true_ns))

    @cython.ccall
    def cycles_to_ns(self, cycles: cython.longlong, hz: cython.longlong) -> cython.longlong:
        """True duration (ns) of `cycles` of a clock of nominally `hz` derived from this crystal."""
        seconds: cython.longlong = cycles // hz
        return self.true_ns(seconds * 1000000000 + (cycles - seconds * hz) * 1000000000 // hz)

    @cython.ccall
    def ns_to_cycles(self, ns: cython.longlong, hz: cython.longlong) -> cython.longlong:
        """Whole cycles of a clock of nominally `hz` (below 9 GHz) in `ns` of true time."""
        local: cython.longlong = self.local_ns(ns)
        seconds: cython.longlong = local // 1000000000
        return seconds * hz + (local - seconds * 1000000000) * hz // 1000000000

    @cython.ccall
    def ns_per_cycle(self, hz: cython.longlong) -> cython.double:
        """True ns per cycle, for durations so short that a double is exact to far below 1 ns."""
        return 1e18 / (float(hz) * (1e9 + self.ppb))

    @cython.ccall
    def cycles_per_ns(self, hz: cython.longlong) -> cython.double:
        """Cycles per true ns, for durations so short that a double is exact to far below a cycle."""
        return float(hz) * (1e9 + self.ppb) / 1e18


@cython.final
@cython.cclass
class TickTrain:
    """The instants of a timer's ticks on a crystal, one after another: exactly `Crystal.tick_time_ns`, by addition.

    `number` and `time` (true ns) are those of the present tick; tick 0 is at `phase_ns`. The crystal's `ppb` is taken
    when the train is made.
    """

    rate: cython.longlong
    period_ns: cython.longlong
    phase_ns: cython.longlong
    step_ns: cython.longlong
    step_rest: cython.longlong
    number: cython.longlong
    time: cython.longlong
    rest: cython.longlong

    def __init__(self, crystal: Crystal, period_ns, phase_ns) -> None:
        self.rate = 1_000_000_000 + crystal.ppb
        self.period_ns = period_ns
        self.phase_ns = phase_ns
        self.step_ns, self.step_rest = divmod(period_ns * 1_000_000_000, self.rate)
        self.number = 0
        self.time = phase_ns
        self.rest = 0

    def go_to(self, number) -> None:
        """Make tick `number` the present one."""
        whole, self.rest = divmod(number * self.period_ns * 1_000_000_000, self.rate)
        self.number = number
        self.time = self.phase_ns + whole

    def moved(self, crystal: Crystal, time) -> object:
        """A train of the same period and present number on another crystal, of which the present tick is at `time`."""
        train = TickTrain(crystal, self.period_ns, time - crystal.true_ns(self.number * self.period_ns))
        train.go_to(self.number)
        return train

    @cython.ccall
    @cython.exceptval(check=False)
    def next(self) -> cython.longlong:
        """Go to the next tick; returns its time."""
        self.number += 1
        self.time += self.step_ns
        self.rest += self.step_rest
        if self.rest >= self.rate:
            self.rest -= self.rate
            self.time += 1
        return self.time


def seeded_crystal(stream, nominal_hz=10_000_000, spread_ppm=30.0) -> Crystal:
    """A crystal as bought: its error uniform within +/-`spread_ppm`, drawn from the RandomStream `stream`.

    30 ppm: the usual tolerance of microprocessor crystals (chosen by us; the robot's were never measured).
    """
    return Crystal(nominal_hz, int(1000.0 * spread_ppm * (2.0 * stream.uniform() - 1.0)))
