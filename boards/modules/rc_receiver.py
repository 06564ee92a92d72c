"""Radio-control pulses: high time of four channels in 1/60 us, smoothed by 1/16 per pulse.

A timer that wraps every 10 ms (600 000 ticks of 60 MHz) is captured at both edges; a pulse of 1.5 ms is
90 000 ticks. A channel that shows the same level at two captures raises RCX_BAD_LVLS and forgets the pulse. Source:
robot.md N4.11.
"""

import array

import cython

from ranger_sim.datatable.generated import errors

TIMER_TICKS = 600_000
CHANNELS = 4
FILTER = 16.0  # a pulse moves the smoothed width by this part of the difference


@cython.cclass
class RcReceiver:
    """`capture` is the work of the timer interrupt, `width` what the schedule sends."""

    report: object
    levels: cython.longlong[::1]
    rising: cython.longlong[::1]
    seen: cython.longlong[::1]
    measured: cython.longlong[::1]
    pulses: cython.longlong[::1]
    filtered: cython.double[::1]
    code_levels: cython.longlong
    code_channel: cython.longlong
    bad_levels: cython.longlong

    def __init__(self, report) -> None:
        self.report = report
        self.levels = array.array("q", [0]) * CHANNELS
        self.rising = array.array("q", [0]) * CHANNELS
        self.seen = array.array("q", [0]) * CHANNELS
        self.measured = array.array("q", [0]) * CHANNELS
        self.pulses = array.array("q", [0]) * CHANNELS
        self.filtered = array.array("d", [0.0]) * CHANNELS
        self.code_levels = errors.RCX_BAD_LVLS
        self.code_channel = errors.RCX_BAD_CHAN
        self.bad_levels = 0

    @cython.ccall
    def capture(self, channel: cython.longlong, level: cython.longlong, ticks: cython.longlong) -> cython.longlong:
        """An edge of `channel` 0-3 at timer count `ticks`; `level` is the pin after it. Returns 1.

        The first pulse of a channel sets the filter (a start at 0 would take some 60 pulses to arrive;
        chosen by us, because the firmware gives only the filter).
        """
        width: cython.longlong
        if channel < 0 or channel >= CHANNELS:
            self.report(self.code_channel)
            return 0
        if self.seen[channel] and self.levels[channel] == level:
            self.bad_levels += 1
            self.report(self.code_levels)
            self.seen[channel] = 0
            return 1
        self.levels[channel] = level
        if level:
            self.rising[channel] = ticks
            self.seen[channel] = 1
            return 1
        if self.seen[channel]:
            width = (ticks - self.rising[channel]) % TIMER_TICKS
            self.measured[channel] = width
            if self.pulses[channel] == 0:
                self.filtered[channel] = width
            else:
                self.filtered[channel] += (width - self.filtered[channel]) / FILTER
            self.pulses[channel] += 1
        self.seen[channel] = 1
        return 1

    @cython.ccall
    def width(self, channel: cython.longlong) -> cython.double:
        """Smoothed high time of `channel` 0-3 in ticks; 0.0 before its first pulse, RCX_BAD_CHAN outside."""
        if channel < 0 or channel >= CHANNELS:
            self.report(self.code_channel)
            return 0.0
        return self.filtered[channel]
