"""Fetches what boards in other processes recorded, during the run."""

import itertools

import cython

from ranger_sim.harness.step_watch import StepWatch

GATHER_NS = 50_000_000  # of seven boards each every 0.35 s: some 2 MB of a motor board (chosen by us)


@cython.final
@cython.cclass
class Gathering(StepWatch):
    """Fetches the records of boards in other processes, one after another, before they keep too much.

    Only for a timeline that keeps everything: each board keeps the last seconds itself until the end.
    """

    timeline: object
    names: object
    next_ns: cython.longlong

    def __init__(self, timeline) -> None:
        StepWatch.__init__(self)
        self.timeline = timeline
        self.names = itertools.cycle(tuple(timeline.activity))
        self.next_ns = 0

    def before_step(self, now_ns: cython.longlong) -> object:
        if now_ns >= self.next_ns:
            self.next_ns = now_ns + GATHER_NS
            if self.timeline.robot.loop.side_by_side:
                self.timeline.gather(next(self.names))
        return None
