"""The delay of the main brain in noticing the body's heel strikes: from the strike to the slot that does."""

import math

import cython

from ranger_sim.firmware_sim.board import Board
from ranger_sim.harness.step_watch import StepEnd
from ranger_sim.plant.ranger import RangerPlant


@cython.final
@cython.cclass
class StrikeWatch(StepEnd):
    """`board`: the main brain, of which the swing leg can be watched (`Board.watched`).

    `count` strikes were noticed; `missed`: steps without a flip of the swing leg; `unmatched`: flips without a
    new strike. `sum_ms`, `squares_ms2`: of the delays.
    """

    plant: RangerPlant
    board: Board
    swing_leg: cython.longlong
    seen_ns: cython.longlong
    steps_noticed: cython.longlong
    count: cython.longlong
    unmatched: cython.longlong
    missed: cython.longlong
    sum_ms: cython.double
    squares_ms2: cython.double

    def __init__(self, plant, board) -> None:
        self.plant = plant
        self.board = board
        self.swing_leg = board.watched()
        self.seen_ns = -1
        self.steps_noticed = 0
        self.count = 0
        self.unmatched = 0
        self.missed = 0
        self.sum_ms = 0.0
        self.squares_ms2 = 0.0

    def observe(self) -> object:
        """Check, once per step of the plant, whether the main brain has flipped the swing leg."""
        board: Board = self.board
        leg: cython.longlong = board.watched()
        if leg != self.swing_leg:
            self.swing_leg = leg
            self._notice()
        return None

    @cython.cfunc
    def _notice(self) -> cython.void:
        """Record how long after the body's strike the slot of that flip began."""
        plant: RangerPlant = self.plant
        delay_ms: cython.double
        if plant.steps == 0:
            return  # the reset on entering the walk
        if plant.strike_time_ns == self.seen_ns:
            self.unmatched += 1
            return
        if plant.steps > self.steps_noticed + 1:
            self.missed += plant.steps - self.steps_noticed - 1
        self.steps_noticed = plant.steps
        self.seen_ns = plant.strike_time_ns
        delay_ms = (self.board.latest_slot() - self.seen_ns) * 1e-6
        self.count += 1
        self.sum_ms += delay_ms
        self.squares_ms2 += delay_ms * delay_ms

    def statistics(self) -> dict:
        """Mean and standard deviation of the delay in ms (None without a strike), and what was counted."""
        mean = deviation = None
        if self.count:
            mean = self.sum_ms / self.count
            deviation = math.sqrt(max(0.0, self.squares_ms2 / self.count - mean * mean))
        return {
            "mean": mean,
            "std": deviation,
            "count": self.count,
            "unmatched": self.unmatched,
            "missed": self.missed,
        }
