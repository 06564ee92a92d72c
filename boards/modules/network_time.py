"""The robot's time as this board last received it: the router's millisecond count, from identifier 0.

A board has no other clock and neither corrects its crystal nor shifts its slots: without sync frames it stops
(robot.md N1.4).
"""

import cython

from ranger_sim.boards.modules.receiver import Receiver


@cython.cclass
class NetworkTime(Receiver):
    """`ms`: the last count received, 0 ... 2^32-1."""

    ms: cython.longlong

    def __init__(self) -> None:
        Receiver.__init__(self)
        self.ms = 0

    def deliver(self, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """Both words of the sync frame hold the count; the time word is used, as on the robot."""
        self.frames += 1
        self.ms = time_word
