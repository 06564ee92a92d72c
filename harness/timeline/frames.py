"""Frames as slices: those sent on each bus, and the wait in each transmit buffer."""

from typing import Any

import numpy as np

from ranger_sim.can_bus.fd_frame import LENGTHS, PHASE_MASK, phases
from ranger_sim.can_bus.frame import LENGTH_CODE, TAIL_BITS
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
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD
from ranger_sim.harness.names import Names
from ranger_sim.harness.timeline.model import Slices

FLAGS_MASK = (1 << TIMES_BUFFER_SHIFT) - 1
BUFFER_MASK = 3
NUMPY_TYPES = {"f32": np.float32, "i32": np.int32, "u32": np.uint32}


class BusFrames:
    """The frames of one bus, in the order of their starts: `slices`, and columns for finding flows.

    names: of its identifiers. `sender`: the node's number, -1 for none. `heard_ns`: when receivers had it, a bit before
    its end. On a CAN FD bus each frame has its bytes, FDF, BRS and ESI as notes, and inside one with BRS the part at
    the data bit rate is a slice.
    """

    def __init__(self, bus: Any, names: Names, rows: np.ndarray, zero_ns: int) -> None:
        self.names = names
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
        if bus.is_fd:
            self._add_fd(bus)

    def _slices(self) -> Slices:
        key = self.identifier << 20 | (self.sender + 1) << 8 | self.flags & (FLAG_ERROR | FLAG_EXTENDED)
        kinds, first, name = np.unique(key, return_index=True, return_inverse=True)
        names, senders = [], []
        for row in first.tolist():
            names.append(frame_name(self.names, int(self.identifier[row]), int(self.flags[row])))
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
            numbers = np.array([number for number, each in self.names.types.items() if each == kind])
            chosen = np.isin(self.identifier, numbers) & ~self.is_error
            values[chosen] = word[chosen].view(numpy_type)
        return values

    def _add_fd(self, bus: Any) -> None:
        """The notes of CAN FD, and the data phases inside the frames."""
        is_fd = (self.flags & FLAG_FD != 0) & ~self.is_error
        code = self.flags & LENGTH_CODE
        length = np.where(is_fd, np.array(LENGTHS)[code], np.minimum(code, 8))
        self.slices.notes["bytes"] = np.where(self.is_error, 0, length)
        for name, flag in (("FDF", FLAG_FD), ("BRS", FLAG_BRS), ("ESI", FLAG_ESI)):
            self.slices.notes[name] = np.where(is_fd & (self.flags & flag != 0), 1, 0)
        rows = np.flatnonzero(is_fd & (self.flags & FLAG_BRS != 0))
        if not len(rows):
            return
        timing = bus.timing
        tick_ns = 1e9 / timing.rate
        headers, header = np.unique(np.stack([self.identifier[rows], self.flags[rows]], 1), axis=0, return_inverse=True)
        # nominal bits up to BRS, which depend on nothing behind it; from its sample point on: the data phase
        before = np.array(
            [
                (phases(int(number), int(flags), b"", bool(bus.iso)) & PHASE_MASK) - (TAIL_BITS - 1)
                for number, flags in headers
            ]
        )[header.reshape(-1)]
        first_ns = ((before - 1) * timing.nominal + timing.sample) * tick_ns
        # the end: the sample point of the CRC delimiter, the first bit of the tail
        last_ns = (TAIL_BITS * timing.nominal - timing.sample) * tick_ns
        self.slices.inside = Slices(
            path=self.slices.path,
            names=[f"data phase, {bus.data_bitrate / 1e6:g} Mbit/s"],
            start_ns=self.start_ns[rows] + np.round(first_ns).astype(np.int64),
            end_ns=self.end_ns[rows] - round(last_ns),
            name=np.zeros(len(rows), dtype=np.int64),
        )

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


def frame_name(names: Names, identifier: int, flags: int) -> str:
    """The label of a frame: the variable's name, or the identifier of a frame that is not a variable."""
    name = names.variables.get(identifier) if not flags & FLAG_EXTENDED else None
    text = name if name is not None else f"{identifier:X}"
    return f"error frame: {text}" if flags & FLAG_ERROR else text
