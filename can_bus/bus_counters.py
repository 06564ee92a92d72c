# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is made of a standard identifier, which `Bus.request` has checked)
"""Frame counters of a bus."""

from typing import Annotated

import cython

from ranger_sim.can_bus.frame import STANDARD_IDENTIFIERS
from ranger_sim.foundation.numbers import integers


@cython.final
@cython.cclass
class BusCounters:
    """Counted since the last `reset`.

    `frames` sent whole; `merged` frames that two nodes sent at once with equal content; `lost` accepted but received
    by no listening node (no node listened, or the sender went off the bus with the frame still waiting); `errors`
    error frames; `retries` after an error; `refused` requests; `aborted`; `flushed` waited when their sender went
    bus-off; `arbitrations_lost`; `single_shot_skipped` single shots that were not sent, of which
    `single_shot_dropped` had been accepted.
    `late_requests` arrived with stamps before bits that were already decided. `late_results` were stamped at or before
    the `until` that found them: with steps of `Bus.advance` shorter than the shortest frame and no errors there are
    none.
    """

    frames: cython.longlong
    counts: cython.p_longlong
    merged: cython.longlong
    lost: cython.longlong
    single_shot_skipped: cython.longlong
    single_shot_dropped: cython.longlong
    retries: cython.longlong
    errors: cython.longlong
    refused: cython.longlong
    arbitrations_lost: cython.longlong
    aborted: cython.longlong
    flushed: cython.longlong
    late_results: cython.longlong
    late_requests: cython.longlong
    # the array that `counts` points into: replaced only by `reset`, which sets both
    identifiers: Annotated[cython.longlong[::1], "readonly"]

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Set every counter to zero."""
        self.frames = 0
        self.merged = 0
        self.lost = 0
        self.single_shot_skipped = 0
        self.single_shot_dropped = 0
        self.retries = 0
        self.errors = 0
        self.refused = 0
        self.arbitrations_lost = 0
        self.aborted = 0
        self.flushed = 0
        self.late_results = 0
        self.late_requests = 0
        self.identifiers = integers(2 * STANDARD_IDENTIFIERS)  # of each: frames, longest response in ns
        self.counts = cython.address(self.identifiers[0]) if cython.compiled else self.identifiers

    @cython.cfunc
    def note_answer(self, identifier: cython.longlong, response_ns: cython.longlong) -> cython.void:
        """Count a frame with a standard identifier that was sent whole, and its response time."""
        place: cython.longlong = 2 * identifier
        self.counts[place] += 1
        if response_ns > self.counts[place + 1]:
            self.counts[place + 1] = response_ns

    @property
    def over(self) -> int:
        """Requests that have been answered, with any result."""
        return self.frames + self.merged + self.aborted + self.flushed + self.single_shot_dropped

    @property
    def frames_by_identifier(self) -> list:
        """Frames sent whole, by standard identifier."""
        return list(self.identifiers[0::2])

    @property
    def response_max_ns(self) -> list:
        """Longest time from a request to the end of its frame, by standard identifier, ns."""
        return list(self.identifiers[1::2])
