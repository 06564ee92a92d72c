"""Arrows that any machine has: from the function that sends to its frame.

An arrow joins two slices. The function that sent a frame is the one that had the processor when the frame was
requested. A task takes effect at its start, so its start is that time; otherwise it is the interrupt, or the turn of
the main loop, that ran then. A frame for which these rules find nothing has no arrow.
"""

from collections.abc import Mapping

import numpy as np

from ranger_sim.harness.timeline.frames import BusFrames
from ranger_sim.harness.timeline.model import Slices
from ranger_sim.harness.timeline.processors import Processor


class FlowBook:
    """Gives every arrow its number and writes both ends into the slices."""

    def __init__(self) -> None:
        self.last = 0

    def connect(self, source: Slices, source_rows: np.ndarray, target: Slices, target_rows: np.ndarray) -> None:
        """An arrow from source_rows[i] to target_rows[i]; pairs with a negative row get none."""
        both = (source_rows >= 0) & (target_rows >= 0)
        source_rows, target_rows = source_rows[both], target_rows[both]
        numbers = np.arange(self.last + 1, self.last + 1 + len(source_rows), dtype=np.int64)
        self.last += len(numbers)
        add_ends(source, source_rows, numbers, 0)
        add_ends(target, target_rows, numbers, 1)


def add_ends(slices: Slices, rows: np.ndarray, numbers: np.ndarray, ends: int) -> None:
    """Let flows `numbers` pass the slices `rows`, or end there."""
    slices.flow_at = np.concatenate([slices.flow_at, rows])
    slices.flow_id = np.concatenate([slices.flow_id, numbers])
    slices.flow_ends = np.concatenate([slices.flow_ends, np.full(len(rows), ends, dtype=np.int64)])


def publish(book: FlowBook, bus: BusFrames, processors: Mapping[str, Processor]) -> None:
    """Connect each frame with what requested it."""
    for node, name in enumerate(bus.nodes):
        if name not in processors:
            continue
        rows = np.flatnonzero((bus.sender == node) & ~bus.is_error)
        for slices, found in asking(processors[name], bus.asked_ns[rows]):
            book.connect(slices, found, bus.slices, rows)


def asking(processor: Processor, asked_ns: np.ndarray) -> list[tuple[Slices, np.ndarray]]:
    """[(slices, row of each request in them or -1)]; every request has at most one."""
    left = np.ones(len(asked_ns), dtype=bool)
    found = []
    for slices, at_start in (
        (processor.tasks, True),
        (processor.fast, False),
        (processor.services, False),
        (processor.turns, False),
    ):
        rows = containing(slices, asked_ns)
        if at_start and len(slices):
            rows[slices.start_ns[rows] != asked_ns] = -1
        rows[~left] = -1
        left &= rows < 0
        found.append((slices, rows))
    return found


def containing(slices: Slices, time_ns: np.ndarray) -> np.ndarray:
    """The slice that contains each time, both ends included; -1 for none."""
    if len(slices) == 0:
        return np.full(len(time_ns), -1, dtype=np.int64)
    rows = np.searchsorted(slices.start_ns, time_ns, side="right") - 1
    rows[(rows >= 0) & (slices.end_ns[rows] < time_ns)] = -1
    return rows
