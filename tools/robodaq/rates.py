"""Rates of the link's three lists: their variables, the promised rate of each, the received rate, and gaps.

The robot sends in cycles: every variable of the fast list that is new, one of the medium list, the next one of all
(robot.md N4.15). Each check of a variable is a step, and so is the return; a slot of the main brain has at most ten of
them. So the lists' lengths determine how many cycles a second there are at full speed, and that is a list's promise: a
fast variable is sent once in a cycle, a medium one once in as many cycles as there are medium ones, any other once in
as many as there are variables. No variable is sent more often than its board publishes it.
"""

from __future__ import annotations

import collections
from typing import Any

import numpy as np

from ranger_sim.boards.main_brain.data_link import CHANNELS, FAST, IDENTIFIER, MEDIUM
from ranger_sim.datatable import load
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.tools.robodaq.codec import Point
from ranger_sim.tools.robodaq.session import FIRST_CHANNEL, GAP_MS, Session

STEPS_PER_S = 10 / 0.002  # of the main brain's slots of 2 ms
RETURN_STEPS = 1
VARIABLES = all_variables.ID_OF_LAST + 1
BIN_MS = 500
BINS = 10  # rates cover the last 5 s of the robot's time (chosen by us: the slow list comes round several times)
GAP_PERIODS = 2.5  # as in the plots: this many periods without a point are a gap
FAST_LIST, MEDIUM_LIST, SLOW_LIST = "fast", "medium", "slow"
LISTS = (FAST_LIST, MEDIUM_LIST, SLOW_LIST)


def lists_of(words: list[float]) -> tuple[list[int], list[int]]:
    """(fast, medium) identifiers that these values of LV_CH_0 ... choose, as the main brain reads them."""
    chosen = [int(word) for word in words if MEDIUM <= word < 2 * FAST]
    known = [word for word in chosen if word & IDENTIFIER < VARIABLES]
    return [word & IDENTIFIER for word in known if word & FAST], [word & IDENTIFIER for word in known if word & MEDIUM]


def promised_hz(fast: int, medium: int, least: bool = False) -> dict[str, float]:
    """{list: points per second of one of its variables}, for lists of these lengths at full speed.

    least: each check of the medium list goes through all of it, because nothing in it is new.
    """
    looks = medium if least else min(medium, 1)
    cycles_hz = STEPS_PER_S / (fast + looks + 1 + RETURN_STEPS)
    return {FAST_LIST: cycles_hz, MEDIUM_LIST: cycles_hz / max(medium, 1), SLOW_LIST: cycles_hz / VARIABLES}


def published_hz() -> dict[int, float]:
    """{identifier: rate at which its board publishes it}, for regularly published variables."""
    own_ms = {row.id: row.period_ms for row in load().variables}
    return {number: 1000.0 / float(period) for number, period in own_ms.items() if period}


class Rates:
    """Counts a session's points by variable and robot time; pass every point to `take` after the session."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.bins: collections.deque[Any] = collections.deque(maxlen=BINS + 1)  # the last one is being filled
        self.bin = 0
        self.words: list[float] | None = None  # of the channels, as far as the robot has sent them
        self.list_of: dict[int, str] = {}
        self.promised_hz = np.zeros(VARIABLES)
        self.patience_ms = np.full(VARIABLES, np.inf)
        self.received_ms: dict[int, int] = {}
        self.gaps = np.zeros(VARIABLES, np.int64)
        self.longest_ms = np.zeros(VARIABLES, np.int64)
        self.last_gap_ms: dict[int, int] = {}  # when its latest gap ended, by the robot's clock
        self.published_hz = published_hz()

    @property
    def know(self) -> bool:
        """True when the robot has sent its lists."""
        return self.words is not None

    def take(self, point: Point) -> bool:
        """Count one point; True if the time since its variable's last point exceeds the limit of its list."""
        now_ms, number = self.session.clock_ms, point.number
        if now_ms is None or number >= VARIABLES:
            return False
        self._step_to(now_ms // BIN_MS)
        self.bins[-1][number] += 1
        if FIRST_CHANNEL <= number < FIRST_CHANNEL + CHANNELS:
            self._learn()
        before_ms = self.received_ms.get(number)
        self.received_ms[number] = now_ms
        if before_ms is None or now_ms - before_ms <= self.patience_ms[number]:
            return False
        self.gaps[number] += 1
        self.longest_ms[number] = max(self.longest_ms[number], now_ms - before_ms)
        self.last_gap_ms[number] = now_ms
        return True

    def _step_to(self, number: int) -> None:
        """Advance to a bin; bins without a point count too. A clock that jumped back or far ahead restarts the bins."""
        if not self.bins or not 0 <= number - self.bin <= BINS:
            if not self.bins or number < self.bin:
                self.received_ms.clear()
            self.bins.clear()
            self.bins.append(np.zeros(VARIABLES, np.int64))
        else:
            for _ in range(number - self.bin):
                self.bins.append(np.zeros(VARIABLES, np.int64))
        self.bin = number

    def _learn(self) -> None:
        """Update the lists from the channel values that the robot sends; changed lists are measured anew."""
        known = self.session.values
        numbers = range(FIRST_CHANNEL, FIRST_CHANNEL + CHANNELS)
        words = [float(value_of_word("f32", known[number][0])) if number in known else 0.0 for number in numbers]
        if words == self.words:
            return
        self.words = words
        fast, medium = lists_of(words)
        before, self.list_of = self.list_of, dict.fromkeys(medium, MEDIUM_LIST) | dict.fromkeys(fast, FAST_LIST)
        full = promised_hz(len(fast), len(medium))
        least = promised_hz(len(fast), len(medium), least=True)
        for number in range(VARIABLES):
            which = self.list_of.get(number, SLOW_LIST)
            own_hz = self.published_hz.get(number)
            if own_hz is None or which == SLOW_LIST:
                # a variable not published regularly may be new or not: only the slow list is certain to send it
                self.promised_hz[number], sure_hz = full[SLOW_LIST], least[SLOW_LIST]
            else:
                self.promised_hz[number], sure_hz = min(full[which], own_hz), min(least[which], own_hz)
            self.patience_ms[number] = max(GAP_PERIODS * 1000.0 / sure_hz, GAP_MS)
            if which != before.get(number, SLOW_LIST):
                self.received_ms.pop(number, None)

    # --- for displays -----------------------------------------------------------------------------------

    def rates_hz(self) -> Any:
        """Points per second of every variable, (VARIABLES,), over the last whole bins; zeros before the first."""
        whole = list(self.bins)[:-1]
        return np.sum(whole, axis=0) / (len(whole) * BIN_MS * 1e-3) if whole else np.zeros(VARIABLES)

    def rows(self, numbers: list[int]) -> list[dict[str, Any]]:
        """For each variable: list, rate and promise (Hz), gaps, the longest (ms), when the latest ended (ms).

        regular: its board publishes it at a fixed rate; any other is sent more often when it is written.
        """
        rates = self.rates_hz()
        return [
            {
                "name": all_variables.NAMES[number],
                "list": self.list_of.get(number, SLOW_LIST),
                "rate_hz": float(rates[number]),
                "promised_hz": float(self.promised_hz[number]),
                "regular": number in self.published_hz,
                "gaps": int(self.gaps[number]),
                "longest_ms": int(self.longest_ms[number]),
                "last_ms": self.last_gap_ms.get(number),
            }
            for number in numbers
        ]

    def lists(self) -> list[dict[str, Any]]:
        """For each list: variables, received and promised points per second, gaps of all its variables."""
        found = []
        rows = self.rows(list(range(VARIABLES)))
        for which in LISTS:
            own = [row for row in rows if row["list"] == which]
            ended = [row["last_ms"] for row in own if row["last_ms"] is not None]
            found.append(
                {
                    "list": which,
                    "variables": len(own),
                    "rate_hz": sum(row["rate_hz"] for row in own),
                    "promised_hz": sum(row["promised_hz"] for row in own) if self.know else None,
                    "gaps": max((row["gaps"] for row in own), default=0),
                    "longest_ms": max((row["longest_ms"] for row in own), default=0),
                    "last_ms": max(ended, default=None),
                }
            )
        return found

    def chosen(self) -> list[int]:
        """The variables on the fast and the medium list, as sent by the robot."""
        return sorted(self.list_of, key=lambda number: (LISTS.index(self.list_of[number]), number))
