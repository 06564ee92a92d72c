"""How long the slots take: the variables EXECUTION_TIME and MAX_EXECUTION_TIME
(robot.md N3.1)."""

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.microcontroller import Microcontroller

if not cython.compiled:
    from ranger_sim.foundation.numbers import float32

    ANEW_MASK = 255  # ms of the network time: the longest slot is looked for anew

SECONDS_PER_CYCLE = 0.0000000166667  # of 60 MHz, as the firmware has it


class ExecutionTimer:
    """`longest_ns` and `longest_ever_ns`: from the slot's start to the last entry of its row; `longest` and
    `longest_ever`: the same in cycles of the core, as the slot timer counts them.

    `longest` starts anew while the low 8 bits of the network time are 0, about every 256 ms.
    """

    def __init__(self, chip: Microcontroller, time: NetworkTime) -> None:
        self.chip = chip
        self.time = time
        self.longest_ns = 0
        self.longest_ever_ns = 0
        self.seconds_per_cycle = float32(SECONDS_PER_CYCLE)

    def record(self) -> None:
        """Last entry of every row: read the slot timer's count."""
        since: cython.longlong = self.chip.now - self.chip.match_time
        if since > self.longest_ns or self.time.ms & ANEW_MASK == 0:
            self.longest_ns = since
            if since > self.longest_ever_ns:
                self.longest_ever_ns = since

    @property
    def longest(self):
        """Cycles."""
        return self.cycles(self.longest_ns)

    @property
    def longest_ever(self):
        """Cycles."""
        return self.cycles(self.longest_ever_ns)

    def cycles(self, time_ns: cython.longlong) -> cython.longlong:
        """What the slot timer counts in `time_ns`."""
        return int(time_ns * self.chip.cycles_per_ns)

    def seconds(self) -> cython.double:
        """EXECUTION_TIME, s."""
        return float32(self.cycles(self.longest_ns) * self.seconds_per_cycle)

    def longest_seconds(self) -> cython.double:
        """MAX_EXECUTION_TIME, s."""
        return float32(self.cycles(self.longest_ever_ns) * self.seconds_per_cycle)
