"""Buses of a source: their frames and load at a given time, and the load as a channel next to other signals."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ranger_sim.tools.panel.channels import Channel, Memory, Times, Values
from ranger_sim.tools.panel.inside.frames import ERROR, Reading, listed
from ranger_sim.tools.panel.inside.load import WINDOW_NS, Load
from ranger_sim.tools.panel.inside.slots import STATISTICS_S, statistics

GROUP = "buses"
FRAMES_SHOWN = 40
KEPT_S = 3600.0  # of the load of a running robot; chosen by us: 9 MB for a bus, once it is full
SECOND_NS = 10**9
WINDOW_S = WINDOW_NS * 1e-9


class Frames(Protocol):
    """Frames of a bus, in memory or in a file."""

    def until(self, until_ns: int | None, most: int) -> Any:
        """The last rows not later than `until_ns`."""

    def within(self, first_ns: int, until_ns: int) -> int | None:
        """The number of frames between two times."""

    def counts(self, until_ns: int | None, keys: list[int]) -> list[int | None]:
        """The count of each kind up to `until_ns`; None: not known yet."""


class Bus:
    """One bus. start_ns: the stamp of its frames at the source's time 0; bit_per_s: None if unknown. data_bit_per_s:
    of the data phase of CAN FD frames; 0 on a classic bus.

    more_errors: number of error frames known from elsewhere, beyond those in the rows; None if unknown.
    """

    def __init__(
        self,
        name: str,
        start_ns: int,
        bit_per_s: int | None,
        frames: Frames,
        read: Reading,
        kept_s: float = KEPT_S,
        data_bit_per_s: int = 0,
    ) -> None:
        self.name = name
        self.start_ns = start_ns
        self.frames = frames
        self.read = read
        self.load = None if bit_per_s is None else Load(bit_per_s, start_ns, data_bit_per_s)
        self.rates = [each for each in (bit_per_s, data_bit_per_s) if each]
        self.memory = Memory(1, WINDOW_S, kept_s)
        self.more_errors: int | None = 0

    def channels(self) -> list[Channel]:
        """The channels that a plot may show of it."""
        if self.load is None:
            return []
        return [Channel(f"load_{self.name}", "%", f"{self.name}: share of the 10 ms before that was taken", GROUP)]

    def take(self, rows: Any) -> None:
        """Add frames that have passed."""
        if self.load is not None:
            self._note(*self.load.take(rows))

    def passed(self, until_ns: int) -> None:
        """No other frame has passed before this time."""
        if self.load is not None:
            self._note(*self.load.passed(until_ns))

    def gap(self) -> None:
        """Frames were missed at this time."""
        if self.load is not None:
            self.load.gap()

    def _note(self, times: Times, shares: Values) -> None:
        self.memory.append(times, 100.0 * shares[:, np.newaxis])

    def value(self, at: float | None) -> float | None:
        """Load of the last window that had ended, %; None if unknown."""
        row = self.memory.row(np.inf if at is None else at)
        return None if row is None or (at is not None and at - row[0] > 2 * WINDOW_S) else float(row[1][0])

    def content(self, at: float | None, now_s: float) -> dict[str, Any]:
        """Bit rates; the 10 ms and the second before a time (None: now): load in %, frames, and error frames up to it.

        "load" and "of_second" are None if unknown.
        """
        end_s = now_s if at is None else at
        end_ns = self.start_ns + round(end_s * 1e9)
        times, values = self.memory.fine.rows()
        first, last = np.searchsorted(times, (end_s - STATISTICS_S, end_s), side="right")
        errors = self.frames.counts(None if at is None else end_ns, [ERROR])[0]
        return {
            "rates": self.rates,
            "load": self.value(at),
            "of_second": statistics(values[first:last, 0]) if self.value(at) is not None else None,
            "frames_per_s": self.frames.within(end_ns - SECOND_NS, end_ns),
            "errors": None if errors is None or self.more_errors is None else errors + self.more_errors,
        }

    def listed(self, at: float | None) -> list[dict[str, Any]]:
        """The last frames up to a time, the newest first, decoded."""
        until_ns = None if at is None else self.start_ns + round(at * 1e9)
        rows = self.frames.until(until_ns, FRAMES_SHOWN)
        return listed(rows, lambda keys: self.frames.counts(until_ns, keys), self.start_ns, self.read)
