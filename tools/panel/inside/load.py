"""Bus load from the frames that passed: in windows of 10 ms, like the bus's own meter.

Exact to the bit if stamps are whole nanoseconds; a recording in microseconds puts up to 3 bits of 30,000 into the
adjacent window. Of an error frame only the shortest form is known, so the load of a disturbed bus is slightly too low.
A bit here is a nominal one; a bit of CAN FD's data phase is a part of it, by the ratio of the bit rates.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ranger_sim.can_bus.fd_frame import PHASE_MASK, PHASE_SHIFT, phases
from ranger_sim.can_bus.frame import INTERMISSION_BITS, fill_frame_bits
from ranger_sim.can_bus.load_meter import WINDOWS_PER_SECOND
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_FD
from ranger_sim.harness.records import logbook
from ranger_sim.tools.panel.channels import Times, Values
from ranger_sim.tools.panel.inside.frames import data_of_rows, first_rows

WINDOW_NS = 10**9 // WINDOWS_PER_SECOND
BEHIND_BITS = 1  # a frame is stamped when receivers have it, a bit before its end (can_bus/bus.py)
ERROR_BITS = 6 + 8  # ISO 11898-1: an active error flag and its delimiter
NOTHING: tuple[Times, Values] = (np.empty(0), np.empty(0, np.float32))


class Load:
    """The load of each window, computed as frames arrive. Times count from `start_ns`; a window's stamp is its end.

    edge: number of the open window; None before the first frame, and after a gap. data_bit_per_s: of CAN FD's data
    phase; without it (0) that is as slow as the rest.
    """

    def __init__(self, bit_per_s: int, start_ns: int, data_bit_per_s: int = 0) -> None:
        self.data_bit = bit_per_s / data_bit_per_s if data_bit_per_s else 1.0
        self.bit_ns = 1e9 / bit_per_s
        self.window_bits = max(bit_per_s // WINDOWS_PER_SECOND, 1)
        self.start_ns = start_ns
        self.edge: int | None = None
        self.open_bits = 0.0

    def take(self, rows: Any) -> tuple[Times, Values]:
        """(end of the window in s, its load 0 ... 1) of the windows that have ended since the previous call.

        rows: of frames (inside/frames.py), in order of time.
        """
        frames = logbook.decoded(rows)
        if not len(frames["time_ns"]):
            return NOTHING
        bits, behind = bits_of(frames)
        has_fd = bool((frames["flags"] & FLAG_FD).any())
        if has_fd:
            bits = self._with_fd(bits, rows, frames)
        free = (frames["time_ns"] - self.start_ns + behind * self.bit_ns) / WINDOW_NS  # in windows
        first = free - bits * self.bit_ns / WINDOW_NS
        sums = np.cumsum(bits)
        at = np.maximum.accumulate(np.stack((first, free), axis=1).ravel())
        taken = np.stack((sums - bits, sums), axis=1).ravel()
        if self.edge is not None and first[0] < self.edge - 1:  # time restarted
            self.gap()
        if self.edge is None:
            self.edge = int(np.ceil(first[0]))
        before = float(np.interp(self.edge, at, taken)) - self.open_bits  # data before the edge are no longer needed
        last = max(self.edge, int(np.floor(at[-1])))
        ends = np.arange(self.edge + 1, last + 1)
        reached = np.interp(ends, at, taken)
        passed = np.diff(reached, prepend=before)
        shares = (passed if has_fd else np.rint(passed)) / self.window_bits
        self.open_bits = float(taken[-1] - (reached[-1] if len(ends) else before))
        self.edge = last
        return ends_s(ends), shares.astype(np.float32)

    def _with_fd(self, bits: Any, rows: Any, frames: dict[str, Any]) -> Any:
        """The bits of all frames, with those of CAN FD by their own lengths."""
        bits = bits.astype(np.float64)
        begins = np.flatnonzero(first_rows(rows))
        ends = np.append(begins[1:], len(rows))
        for place in np.flatnonzero(frames["flags"] & (FLAG_FD | FLAG_ERROR) == FLAG_FD).tolist():
            flags = int(frames["flags"][place])
            data = data_of_rows(rows[begins[place] : ends[place]], flags)
            found = phases(int(frames["identifier"][place]), flags, data)
            bits[place] = (found & PHASE_MASK) + (found >> PHASE_SHIFT) * self.data_bit + INTERMISSION_BITS
        return bits

    def passed(self, until_ns: int) -> tuple[Times, Values]:
        """As `take`, after a silence: no frames but those already given began before this time."""
        last = (until_ns - self.start_ns) // WINDOW_NS
        if self.edge is None or last <= self.edge:
            return NOTHING
        ends = np.arange(self.edge + 1, last + 1)
        shares: Values = np.zeros(len(ends), np.float32)
        shares[0] = round(self.open_bits) / self.window_bits
        self.edge, self.open_bits = last, 0.0
        return ends_s(ends), shares

    def gap(self) -> None:
        """Frames were missed: restart with the first whole window."""
        self.edge, self.open_bits = None, 0.0


def ends_s(numbers: Any) -> Times:
    """The ends of windows, s."""
    return np.asarray(numbers * (WINDOW_NS * 1e-9), np.float64)


def bits_of(frames: dict[str, Any]) -> tuple[Any, Any]:
    """(bits for which each frame occupies the bus, including its intermission; bits after its stamp)."""
    bits = np.empty(len(frames["time_ns"]), np.int64)
    names = ("identifier", "flags", "word0", "word1")
    identifiers, flags, lows, highs = (np.ascontiguousarray(frames[name]) for name in names)
    fill_frame_bits(identifiers, flags, lows, highs, bits)
    is_error = frames["flags"] & FLAG_ERROR != 0
    reached = np.where(frames["word1"] > 0, frames["word1"] + 1, 0)  # bits of the frame before the error was detected
    bits = np.where(is_error, ERROR_BITS + reached, bits) + INTERMISSION_BITS
    return bits, np.where(is_error, 0, BEHIND_BITS) + INTERMISSION_BITS
