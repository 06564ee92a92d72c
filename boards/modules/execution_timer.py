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
    """`longest` and `longest_ever`: from the slot's start to the last entry of its row, as the slot timer counts it, in
    cycles of the core.

    `longest` starts anew while the low 8 bits of the network time are 0, about every 256 ms.
    """

    def __init__(self, chip: Microcontroller, time: NetworkTime) -> None:
        self.chip = chip
        self.time = time
        self.longest = 0
        self.longest_ever = 0
        self.seconds_per_cycle = float32(SECONDS_PER_CYCLE)

    def record(self) -> None:
        """Last entry of every row: read the slot timer's count."""
        since: cython.longlong = self.chip.cycles_since_tick()
        if since > self.longest or self.time.ms & ANEW_MASK == 0:
            self.longest = since
            if since > self.longest_ever:
                self.longest_ever = since

    def seconds(self) -> cython.double:
        """EXECUTION_TIME, s."""
        return float32(self.longest * self.seconds_per_cycle)

    def longest_seconds(self) -> cython.double:
        """MAX_EXECUTION_TIME, s."""
        return float32(self.longest_ever * self.seconds_per_cycle)
