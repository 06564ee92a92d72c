"""Virtual time released by the wall clock.

A slice of virtual time may run as soon as the wall clock has reached its beginning. Falling behind changes
only the lateness: the run goes on as fast as it can until it has caught up. The results of a run never depend
on the pace.
"""

from typing import Any

from ranger_sim.foundation import wallclock
from ranger_sim.harness.processes import places


class Pace:
    """`speed`: virtual seconds per wall-clock second; None as fast as possible. The boards read it from the stage."""

    def __init__(self, words: Any, doubles: Any, speed: float | None) -> None:
        self.words = words
        self.doubles = doubles
        self.speed = speed

    def start(self, time_ns: int) -> None:
        """Set the present wall clock as that of virtual time `time_ns`: at the start, and after a pause."""
        self.words[places.PACE_TIME_NS] = time_ns
        self.words[places.PACE_WALL_NS] = self.words[places.PACE_BEGUN_NS] = wallclock.monotonic_ns()
        if self.speed is not None:
            self.doubles[places.PACE_WALL_PER_TIME] = 1.0 / self.speed
            self.words[places.PACED] = 1

    def ahead_s(self, time_ns: int) -> float:
        """Wall-clock seconds until virtual time `time_ns` is due; negative when it is late."""
        if self.speed is None:
            return 0.0
        since = (time_ns - self.words[places.PACE_TIME_NS]) * self.doubles[places.PACE_WALL_PER_TIME]
        return (self.words[places.PACE_WALL_NS] + since - wallclock.monotonic_ns()) * 1e-9
