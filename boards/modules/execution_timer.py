"""How long the slots take: the variables EXECUTION_TIME and MAX_EXECUTION_TIME
(facts network-and-boards 3.1)."""

import cython

from boards.modules.network_time import NetworkTime
from firmware_sim.microcontroller import Microcontroller


class ExecutionTimer:
    """`longest` and `longest_ever`: cycles from the slot's start to the last entry of its row.

    `longest` starts anew while the low 8 bits of the network time are 0, about every 256 ms.
    """

    def __init__(self, chip: Microcontroller, time: NetworkTime) -> None:
        self.chip = chip
        self.time = time
        self.longest = 0
        self.longest_ever = 0

    def record(self) -> None:
        """Last entry of every row: read the slot timer's count."""
        cycles: cython.longlong = self.chip.cycles_since_tick()
        if self.time.ms & 255 == 0 or cycles > self.longest:
            self.longest = cycles
        if cycles > self.longest_ever:
            self.longest_ever = cycles

    def seconds(self) -> cython.double:
        """EXECUTION_TIME, s."""
        return self.longest * (1.0 / self.chip.hz)

    def longest_seconds(self) -> cython.double:
        """MAX_EXECUTION_TIME, s."""
        return self.longest_ever * (1.0 / self.chip.hz)
