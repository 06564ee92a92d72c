# cython: boundscheck=False, wraparound=False
# (every index below is a channel, 0 ... 4)
"""Frames per millisecond on each bus, as the router counts them: sent and received, its own sync included."""

import cython


@cython.final
@cython.cclass
class CanLoad:
    """Counters of the four buses, index 1-4; index 0 counts the SSP link and is not reported."""

    counts: cython.longlong[5]
    peaks: cython.longlong[5]
    last_counts: cython.longlong[5]

    def __init__(self) -> None:
        self.counts = [0] * 5
        self.peaks = [0] * 5
        self.last_counts = [0] * 5

    @cython.ccall
    def count(self, channel: cython.longlong) -> cython.void:
        """One frame more on `channel` in this millisecond."""
        self.counts[channel] += 1

    @cython.ccall
    def end_of_millisecond(self) -> cython.void:
        """Keep the largest count and start the next millisecond."""
        i: cython.longlong
        count: cython.longlong
        for i in range(5):
            count = self.counts[i]
            if count > self.peaks[i]:
                self.peaks[i] = count
            self.last_counts[i] = count
            self.counts[i] = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def report_peak(self, channel: cython.longlong) -> cython.double:
        """Largest frame count of one millisecond since the last report, as a float (robot.md N3.7)."""
        peak: cython.double = self.peaks[channel]
        self.peaks[channel] = 0
        return peak
