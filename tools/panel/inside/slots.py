"""Slots of a running robot's boards: how much time each took and how late it was, in the last minutes.

They are channels as well, so that a plot shows them with the other signals.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ranger_sim import datatable
from ranger_sim.tools.panel.channels import Channel, Memory

GROUP = "slots"
KEPT_S = 120.0  # every slot; chosen by us: 40 MB for the boards of Ranger. Before that the longest of each 0.1 s
STATISTICS_S = 1.0  # median, 99 % and longest cover this long before the cursor's time
ROW_WORDS = 3  # of the feed: time (ns), cycles, lateness (ns)
NS, US = 1e-9, 1e6


class BoardSlots:
    """One board: `memory` has its slots' duration and lateness, us, by the time of their tick."""

    def __init__(self, name: str, hz: float) -> None:
        self.name = name
        self.us_per_cycle = US / hz
        self.slot_us = next(board.slot_us for board in datatable.load().boards if board.name == name)
        self.memory = Memory(2, self.slot_us / US, KEPT_S)

    def channels(self) -> list[Channel]:
        """The channels that a plot may show of them, in the order of the memory's columns."""
        return [
            Channel(f"slot_{self.name}_us", "µs", f"{self.name}: time that a slot took, of {self.slot_us} µs", GROUP),
            Channel(f"late_{self.name}_us", "µs", f"{self.name}: how late a slot was by the wall clock", GROUP),
        ]

    def take(self, data: bytes, start_ns: int) -> None:
        """Add rows of the feed (harness/feed/FEED.md)."""
        rows = np.frombuffer(data, np.int64).reshape(-1, ROW_WORDS)
        values = np.empty((len(rows), 2), np.float32)
        values[:, 0] = np.where(rows[:, 1] > 0, rows[:, 1] * self.us_per_cycle, np.nan)  # 0: it never ended
        values[:, 1] = np.where(rows[:, 2] >= 0, rows[:, 2] * 1e-3, np.nan)
        self.memory.append(((rows[:, 0] - start_ns) * NS).astype(np.float64), values)

    def content(self, at: float | None) -> dict[str, Any] | None:
        """The last slot that had ended at a time (None: now), and the second before; None without data.

        {"begun_s", "used_us", "late_us", "used": {"median", "most", "worst"}, "late": the same}; most: 99 of 100.
        """
        times, values = self.memory.fine.rows()
        end = len(times) if at is None else int(np.searchsorted(times, at, side="right"))
        if end == 0:
            return None
        first = int(np.searchsorted(times, times[end - 1] - STATISTICS_S, side="right"))
        used, late = statistics(values[first:end, 0]), statistics(values[first:end, 1])
        begun_s, (used_us, late_us) = float(times[end - 1]), (number(each) for each in values[end - 1])
        return {"begun_s": begun_s, "used_us": used_us, "late_us": late_us, "used": used, "late": late}


def statistics(values: Any) -> dict[str, float] | None:
    """Median, the value that 99 of 100 do not exceed, and the largest; None without a value."""
    there = values[~np.isnan(values)]
    if len(there) == 0:
        return None
    median, most = np.quantile(there, (0.5, 0.99), method="inverted_cdf")
    return {"median": float(median), "most": float(most), "worst": float(there.max())}


def number(value: Any) -> float | None:
    """A number for the page; None for NaN."""
    return float(value) if np.isfinite(value) else None
