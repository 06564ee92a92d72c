"""The other end of the serial link, for a single router or main brain: exchanges every 200 us, as on the robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from ranger_sim.boards.modules.ssp_link import EXCHANGE_NS, MainBrainSspLink, RouterSspLink, empty_segment
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.foundation.events import ORDER_INTERRUPTS, SSP_SEGMENT, SSP_START
from ranger_sim.harness.ranger_names import RANGER
from ranger_sim.harness.testing.frames import Frame, frame_type

PERIOD_NS = 200_000  # between two exchanges (robot.md N1.6)
LAST_ID = 2031  # the highest identifier of the link
DATA_8 = 8


class Bench(Protocol):
    """A board that runs alone, as its link needs it; `now` in ns."""

    name: str
    chip: Any
    now: int

    def call_at(self, time_ns: int, function: Callable[[float], Any], period_ns: int = 0) -> None:
        """Call `function(time_s)` at a time, and again every `period_ns` if that is above 0."""


class Link:
    """The test's end of the link. `heard`: frames of the board, stamped when they were complete here."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.heard: list[Frame] = []
        self.errors: list[int] = []  # codes that this end would report

    def send(self, what: str | int, value: float, stamp_ms: int | None = None) -> None:
        """Send a variable with the next exchange that has space."""
        identifier = RANGER.identifier(what)
        stamp = self.bench.now // 1_000_000 if stamp_ms is None else stamp_ms
        self.send_words(identifier, word_of_value(all_variables.TYPES[identifier], value), stamp & 0xFFFFFFFF)

    def received(self, what: str | int | None = None) -> list[Frame]:
        """What the board sent: every frame, or those of one variable."""
        wanted = None if what is None else RANGER.identifier(what)
        return [frame for frame in self.heard if wanted is None or frame.identifier == wanted]

    def note(self, time_ns: int, identifier: int, lo: int, hi: int) -> None:
        """Take a frame of the board."""
        self.heard.append(frame_type(RANGER)(time_ns, "link", identifier, DATA_8, lo, hi))

    def send_words(self, identifier: int, lo: int, hi: int) -> None:
        """Send a frame unchanged."""
        raise NotImplementedError

    def from_board(self, kind: int, time_ns: int, segment: Any) -> None:
        """Handle the board's start of an exchange, or its next segment."""
        raise NotImplementedError

    def deliver(self, time_ns: int, segment: Any) -> None:
        """Deliver a segment, complete at the board at `time_ns`."""
        self.bench.chip.inbox.push(time_ns, ORDER_INTERRUPTS, SSP_SEGMENT, 0, 0, 0, 0, 0, 0, segment)


class BrainsEnd(Link):
    """The test replaces the main brain; the router is the master and starts the exchanges."""

    def __init__(self, bench: Bench) -> None:
        Link.__init__(self, bench)
        self.end = MainBrainSspLink(self.errors.append, LAST_ID, False)

    def send_words(self, identifier: int, lo: int, hi: int) -> None:
        self.end.send(identifier, lo, hi)
        self.end.flush()

    def from_board(self, kind: int, time_ns: int, segment: Any) -> None:
        if kind != SSP_START:
            return
        self.deliver(time_ns + EXCHANGE_NS, self.end.exchanged(segment))
        self.end.parse()
        for identifier, lo, hi in self.end.parsed():
            self.note(time_ns + EXCHANGE_NS, identifier, lo, hi)


class RoutersEnd(Link):
    """The test replaces the router: an exchange every 200 us."""

    def __init__(self, bench: Bench) -> None:
        Link.__init__(self, bench)
        self.end = RouterSspLink(self.errors.append)
        self.loaded = empty_segment()
        bench.call_at(PERIOD_NS, self._exchange, PERIOD_NS)

    def send_words(self, identifier: int, lo: int, hi: int) -> None:
        self.end.push(identifier, DATA_8, lo, hi, self.bench.now)

    def from_board(self, kind: int, time_ns: int, segment: Any) -> None:
        if kind != SSP_START:
            self.loaded = segment

    def _exchange(self, time_s: float) -> None:
        now = self.bench.now
        segment = self.end.tick(now)
        if segment is not None:
            self.deliver(now + EXCHANGE_NS, segment)
        self.end.receive(self.loaded)
        while self.end.take():
            self.note(now + EXCHANGE_NS, self.end.rx_id, self.end.rx_word0, self.end.rx_word1)


def link_of(bench: Bench) -> Link | None:
    """The other end for the board on the bench; None when it has no link."""
    if bench.name == "CSR":
        return BrainsEnd(bench)
    return RoutersEnd(bench) if bench.name == "MB" else None
