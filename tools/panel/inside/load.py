"""How much of a bus is taken, from the frames that passed on it: in windows of 10 ms, as its own meter has them.

To the bit where stamps are whole nanoseconds; a recording in microseconds puts up to 3 bits of 30,000 into the window
beside. Of an error frame only the shortest form is known, so that a disturbed bus is shown a little emptier than it is.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ranger_sim.can_bus.frame import INTERMISSION_BITS, fill_frame_bits
from ranger_sim.can_bus.load_meter import WINDOWS_PER_SECOND
from ranger_sim.foundation.events import FLAG_ERROR
from ranger_sim.tools.panel.channels import Times, Values

WINDOW_NS = 10**9 // WINDOWS_PER_SECOND
BEHIND_BITS = 1  # a frame is stamped when receivers have it, a bit before its end (can_bus/bus.py)
ERROR_BITS = 6 + 8  # ISO 11898-1: an active error flag and its delimiter
NOTHING: tuple[Times, Values] = (np.empty(0), np.empty(0, np.float32))


class Load:
    """The share of each window, as frames are told. Instants count from `start_ns`, a window is stamped by its end.

    edge: number of the window that is open; None before the first frame, and after a gap.
    """

    def __init__(self, bit_per_s: int, start_ns: int) -> None:
        self.bit_ns = 1e9 / bit_per_s
        self.window_bits = max(bit_per_s // WINDOWS_PER_SECOND, 1)
        self.start_ns = start_ns
        self.edge: int | None = None
        self.open_bits = 0.0

    def take(self, frames: dict[str, Any]) -> tuple[Times, Values]:
        """(end of the window in s, its share 0 ... 1) of the windows that are over since the frames before these.

        frames: as `logbook.decoded` has them, in order of time.
        """
        if not len(frames["time_ns"]):
            return NOTHING
        bits, behind = bits_of(frames)
        free = (frames["time_ns"] - self.start_ns + behind * self.bit_ns) / WINDOW_NS  # in windows
        first = free - bits * self.bit_ns / WINDOW_NS
        sums = np.cumsum(bits)
        at = np.maximum.accumulate(np.stack((first, free), axis=1).ravel())
        taken = np.stack((sums - bits, sums), axis=1).ravel()
        if self.edge is not None and first[0] < self.edge - 1:  # time began anew
            self.gap()
        if self.edge is None:
            self.edge = int(np.ceil(first[0]))
        before = float(np.interp(self.edge, at, taken)) - self.open_bits  # what lies before the edge is no more wanted
        last = max(self.edge, int(np.floor(at[-1])))
        ends = np.arange(self.edge + 1, last + 1)
        reached = np.interp(ends, at, taken)
        shares = np.rint(np.diff(reached, prepend=before)) / self.window_bits
        self.open_bits = float(taken[-1] - (reached[-1] if len(ends) else before))
        self.edge = last
        return ends_s(ends), shares.astype(np.float32)

    def passed(self, until_ns: int) -> tuple[Times, Values]:
        """The same after a silence: nothing but what was told has begun before this instant."""
        last = (until_ns - self.start_ns) // WINDOW_NS
        if self.edge is None or last <= self.edge:
            return NOTHING
        ends = np.arange(self.edge + 1, last + 1)
        shares: Values = np.zeros(len(ends), np.float32)
        shares[0] = round(self.open_bits) / self.window_bits
        self.edge, self.open_bits = last, 0.0
        return ends_s(ends), shares

    def gap(self) -> None:
        """Frames were missed: windows begin anew with the first whole one."""
        self.edge, self.open_bits = None, 0.0


def ends_s(numbers: Any) -> Times:
    """Where windows end, s."""
    return np.asarray(numbers * (WINDOW_NS * 1e-9), np.float64)


def bits_of(frames: dict[str, Any]) -> tuple[Any, Any]:
    """(bits for which each frame takes the bus, with its intermission; those behind its stamp)."""
    bits = np.empty(len(frames["time_ns"]), np.int64)
    names = ("identifier", "flags", "word0", "word1")
    identifiers, flags, lows, highs = (np.ascontiguousarray(frames[name]) for name in names)
    fill_frame_bits(identifiers, flags, lows, highs, bits)
    is_error = frames["flags"] & FLAG_ERROR != 0
    reached = np.where(frames["word1"] > 0, frames["word1"] + 1, 0)  # of the frame, where the error was detected
    bits = np.where(is_error, ERROR_BITS + reached, bits) + INTERMISSION_BITS
    return bits, np.where(is_error, 0, BEHIND_BITS) + INTERMISSION_BITS
