"""Measured duration of the slots: the variables EXECUTION_TIME and MAX_EXECUTION_TIME
(robot.md N3.1)."""

from typing import Final

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.foundation.numbers import float32

ANEW_MASK: Final = 255  # ms of the network time: the search for the longest slot begins anew

SECONDS_PER_CYCLE = 0.0000000166667  # of 60 MHz, as the firmware has it


@cython.final
@cython.cclass
class ExecutionTimer:
    """`longest` and `longest_ever`: from the slot's start to the last entry of its row, as the slot timer counts it, in
    cycles of the core.

    `longest` starts anew while the low 8 bits of the network time are 0, about every 256 ms.
    """

    chip: Microcontroller
    time: NetworkTime
    seconds_per_cycle: cython.double
    longest: cython.longlong
    longest_ever: cython.longlong

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

    @cython.ccall
    @cython.exceptval(check=False)
    def seconds(self) -> cython.double:
        """EXECUTION_TIME, s."""
        return float32(self.longest * self.seconds_per_cycle)

    @cython.ccall
    @cython.exceptval(check=False)
    def longest_seconds(self) -> cython.double:
        """MAX_EXECUTION_TIME, s."""
        return float32(self.longest_ever * self.seconds_per_cycle)
