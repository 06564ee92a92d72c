"""Frames as slices: those sent on each bus, and the wait in each transmit buffer."""

from typing import Any

import numpy as np

from ranger_sim.can_bus.frame_log import (
    SENDER_SHIFT,
    TIMES_ASKED,
    TIMES_BUFFER_SHIFT,
    TIMES_END,
    TIMES_HIGH,
    TIMES_IDENTIFIER,
    TIMES_LOW,
    TIMES_SENDER,
    TIMES_START,
)
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED
from ranger_sim.harness.timeline.model import Slices

FLAGS_MASK = (1 << TIMES_BUFFER_SHIFT) - 1
BUFFER_MASK = 3
NUMPY_TYPES = {"f32": np.float32, "i32": np.int32, "u32": np.uint32}


class BusFrames:
    """The frames of one bus, in the order of their starts: `slices`, and columns for finding flows.

    `sender`: the node's number, -1 for none. `heard_ns`: when receivers had it, a bit before its end.
    """

    def __init__(self, bus: Any, rows: np.ndarray, zero_ns: int) -> None:
        rows = rows[np.argsort(rows[:, TIMES_START], kind="stable")]
        self.name = bus.name
        self.nodes = [node.name for node in bus.nodes]
        self.start_ns = rows[:, TIMES_START] - zero_ns
        self.asked_ns = rows[:, TIMES_ASKED] - zero_ns
        self.end_ns = rows[:, TIMES_END] - zero_ns
        self.heard_ns = self.end_ns - (1_000_000_000 + bus.bitrate - 1) // bus.bitrate
        self.identifier = rows[:, TIMES_IDENTIFIER]
        self.flags = rows[:, TIMES_SENDER] & FLAGS_MASK
        self.buffer = rows[:, TIMES_SENDER] >> TIMES_BUFFER_SHIFT & BUFFER_MASK
        self.sender = (rows[:, TIMES_SENDER] >> SENDER_SHIFT) - 1
        self.low, self.high = rows[:, TIMES_LOW], rows[:, TIMES_HIGH]
        self.is_error = self.flags & FLAG_ERROR != 0
        self.slices = self._slices()

    def _slices(self) -> Slices:
        key = self.identifier << 20 | (self.sender + 1) << 8 | self.flags & (FLAG_ERROR | FLAG_EXTENDED)
        kinds, first, name = np.unique(key, return_index=True, return_inverse=True)
        names, senders = [], []
        for row in first.tolist():
            names.append(frame_name(int(self.identifier[row]), int(self.flags[row])))
            senders.append(self.node_name(int(self.sender[row])))
        return Slices(
            path=("Buses", self.name, "frames"),
            names=names,
            start_ns=self.start_ns,
            end_ns=self.end_ns,
            name=name.reshape(-1).astype(np.int64),
            notes={"value": self._values(), "waited_us": (self.start_ns - self.asked_ns) * 1e-3},
            labels={"sender": senders},
        )

    def node_name(self, node: int) -> str:
        """The name of node number `node`."""
        return self.nodes[node] if 0 <= node < len(self.nodes) else ""

    def _values(self) -> np.ndarray:
        """The value of each frame, by its variable's type in the master table; of an error frame its field."""
        word = (self.low & 0xFFFFFFFF).astype(np.uint32)
        values = word.astype(np.float64)
        for kind, numpy_type in NUMPY_TYPES.items():
            numbers = np.array([number for number, each in all_variables.TYPES.items() if each == kind])
            chosen = np.isin(self.identifier, numbers) & ~self.is_error
            values[chosen] = word[chosen].view(numpy_type)
        return values

    def waits(self) -> list[Slices]:
        """For each transmit buffer: from the request of a frame to its start. Below a bit's time is not a wait."""
        found = []
        for node, name in enumerate(self.nodes):
            for buffer in range(1, 4):
                rows = np.flatnonzero((self.sender == node) & (self.buffer == buffer))
                if len(rows) == 0:
                    continue
                found.append(
                    Slices(
                        path=("Buses", self.name, f"{name} waits, buffer {buffer}"),
                        names=self.slices.names,
                        start_ns=self.asked_ns[rows],
                        end_ns=self.start_ns[rows],
                        name=self.slices.name[rows],
                    )
                )
        return found


def frame_name(identifier: int, flags: int) -> str:
    """The label of a frame: the variable's name, or the identifier of a frame that is not a variable."""
    name = all_variables.NAMES.get(identifier) if not flags & FLAG_EXTENDED else None
    text = name if name is not None else f"{identifier:X}"
    return f"error frame: {text}" if flags & FLAG_ERROR else text
