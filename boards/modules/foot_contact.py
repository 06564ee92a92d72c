"""Foot contact and limit switches: hysteresis on a raw reading, then a number of equal samples in a row
(appendix 4.10; robot.md N4.9)."""

import cython


@cython.cclass
class Debounce:
    """A level is believed after `equal_samples` equal readings in a row (the first one counts).

    `settled`: the level whose next reading would change nothing, -1 without one: readings of it may be left out.
    """

    settled: cython.longlong
    state: cython.longlong
    last: cython.longlong
    run: cython.longlong
    equal_samples: cython.longlong

    def __init__(self, equal_samples) -> None:
        self.equal_samples = equal_samples
        self.last = 0
        self.run = 0
        self.state = 0
        self.settled = 0

    @cython.ccall
    def sample(self, level: cython.longlong) -> cython.void:
        """One reading per slot, 0 or 1."""
        if level != self.last:
            self.last = level
            self.run = 1
        elif self.run < self.equal_samples:
            self.run += 1
        if self.run >= self.equal_samples:
            self.state = level
        self.settled = level if level == self.state else -1

    @cython.ccall
    @cython.exceptval(check=False)
    def contact(self) -> cython.longlong:
        """The level that is believed, as published."""
        return self.state


@cython.final
@cython.cclass
class FootContact(Debounce):
    """A foot sensor's reading (counts) made into contact 0/1 (`state`): above `on_level` on, below `off_level`
    off."""

    level: cython.longlong
    on_level: cython.longlong
    off_level: cython.longlong

    def __init__(self, on_level, off_level, equal_samples) -> None:
        Debounce.__init__(self, equal_samples)
        self.on_level = on_level
        self.off_level = off_level
        self.level = 0

    @cython.ccall
    def read(self, counts: cython.longlong) -> cython.void:
        """One reading per slot; between the two levels the old level stays."""
        if counts > self.on_level:
            self.level = 1
        elif counts < self.off_level:
            self.level = 0
        if self.level != self.settled:
            self.sample(self.level)
