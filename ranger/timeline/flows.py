"""Flows: from the function that publishes to its frame, to the interrupt and the function that handles it.

An arrow joins two slices. How each pair is found:

- function -> frame: `harness/timeline/arrows.py`.
- frame -> interrupt: the one requested when the frame was received. Where a frame met an interrupt that was pending
  already, its own is requested later: it is the last such frame before. A lost frame has no arrow.
- interrupt -> function: the next start of the task that empties the ring, where that board accepts the identifier.
- through the router and over the serial link: the same identifier and both words, at the first time after arrival.
- the main brain's function of a segment: the latest one that began before that segment was queued for sending.

A pair that these rules do not find has no arrow.
"""

import itertools
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ranger_sim.boards.modules.ssp_link import EXCHANGE_NS
from ranger_sim.harness.timeline.arrows import FlowBook, containing, publish
from ranger_sim.harness.timeline.frames import BusFrames
from ranger_sim.harness.timeline.model import Slices
from ranger_sim.harness.timeline.processors import Processor
from ranger_sim.ranger import wiring

ROUTER, MAIN_BRAIN = "CSR", "MB"
RECEIVE_TASK = "can_rx_dispatch_all"
LINK_INTERRUPT = "ssp"
LINK_RECEIVE_TASK, LINK_SEND_TASK = "parse_ssp", "send_ssp"
IDENTIFIER_MASK = 0x7FF  # of a half-word's header on the link
# Longest way through the router: two full transmit rings at 36 us a frame take less (chosen by us).
LONGEST_WAY_NS = 20_000_000
LONGEST_SERVICE_NS = 1_000_000  # from a frame to its interrupt (chosen by us: the firmware's are below 100 us)
LONGEST_WAIT_NS = 100_000_000  # for a slot or an exchange (chosen by us: they come every 14 ms at most)
ROUNDING_NS = 2  # both times are rounded to whole ns, one of them twice


def connect_all(
    robot: Any, processors: Mapping[str, Processor], buses: Iterable[BusFrames], exchanges: "Exchanges"
) -> None:
    """Write every arrow that can be found into the slices."""
    book = FlowBook()
    buses = list(buses)
    came_in: list[Passing] = []  # frames as the router received them: from its buses, and from the link
    for bus, hears in zip(buses, hearers(), strict=True):
        publish(book, bus, processors)
        for board, controller in hears:
            if board not in processors:
                continue
            rows, interrupt = receive(book, bus, board, controller, processors[board])
            if board == ROUTER:
                came_in.append(Passing(processors[board].fast, rows, interrupt, bus))
            else:
                link = getattr(robot.boards[board], "can", None)
                if link is not None:  # else the identifiers that its program accepts are unknown
                    deliver(book, bus, link.receivers, rows, interrupt, processors[board])
    if ROUTER in processors and MAIN_BRAIN in processors:
        exchanges.connect(book, processors[ROUTER], processors[MAIN_BRAIN], came_in, buses)


def hearers() -> list[list[tuple[str, int]]]:
    """[(board, controller)] of each bus."""
    return [[(wire.board, wire.controller) for wire in wiring.CAN if wire.bus == number] for number in range(1, 5)]


def receive(
    book: FlowBook, bus: BusFrames, board: str, controller: int, processor: Processor
) -> tuple[np.ndarray, np.ndarray]:
    """(frames of other nodes, the receive interrupt of each or -1); for the router those are fast interrupts."""
    rows = np.flatnonzero((bus.sender != bus.nodes.index(board)) & ~bus.is_error)
    fast = board == ROUTER
    slices = processor.fast if fast else processor.services
    asked_ns = processor.fast_asked_ns if fast else processor.services_asked_ns
    at, _ = slices.starts_of(f"can{controller} receive" if fast else "can_receive")
    order = np.argsort(bus.heard_ns[rows], kind="stable")
    rows = rows[order]
    found = paired(bus.heard_ns[rows], asked_ns[at], LONGEST_SERVICE_NS)
    interrupt = np.where(found >= 0, np.append(at, -1)[found], -1)
    book.connect(bus.slices, rows, slices, interrupt)
    return rows, interrupt


def paired(came_ns: np.ndarray, asked_ns: np.ndarray, longest_ns: int) -> np.ndarray:
    """For each frame, received at `came_ns`, the index of its interrupt of those requested at `asked_ns`; -1 for none.

    Both in order of time. An interrupt belongs to the frame received at its request, within the tolerance of
    a rounded bit; those left over, from the last one on, to the latest frame left over before them, in `longest_ns`.
    """
    found = np.full(len(came_ns), -1, dtype=np.int64)
    if len(came_ns) == 0:
        return found
    frame = np.searchsorted(came_ns, asked_ns - ROUNDING_NS)
    exact = frame < len(came_ns)
    exact[exact] = came_ns[frame[exact]] <= asked_ns[exact] + ROUNDING_NS
    found[frame[exact]] = np.flatnonzero(exact)
    left = np.flatnonzero(found < 0).tolist()
    for interrupt in np.flatnonzero(~exact)[::-1].tolist():
        while left and came_ns[left[-1]] > asked_ns[interrupt]:
            left.pop()
        if left and asked_ns[interrupt] - came_ns[left[-1]] <= longest_ns:
            found[left.pop()] = interrupt
    return found


def next_start(at: np.ndarray, starts_ns: np.ndarray, after_ns: np.ndarray) -> np.ndarray:
    """The first slice of `at` that begins after each time, within LONGEST_WAIT_NS; -1 for none."""
    place = np.searchsorted(starts_ns, after_ns, side="right")
    found = np.full(len(after_ns), -1, dtype=np.int64)
    there = place < len(at)
    there[there] = starts_ns[place[there]] - after_ns[there] <= LONGEST_WAIT_NS
    found[there] = at[place[there]]
    return found


def deliver(
    book: FlowBook, bus: BusFrames, listened: list, rows: np.ndarray, interrupt: np.ndarray, processor: Processor
) -> None:
    """From the interrupt to the task that hands the frame to its receiver, where the board has one."""
    wanted = np.array([each is not None for each in listened])
    known = (interrupt >= 0) & (bus.identifier[rows] < len(wanted))
    known[known] = wanted[bus.identifier[rows[known]]]
    interrupt = interrupt[known]
    at, starts = processor.tasks.starts_of(RECEIVE_TASK)
    task = next_start(at, starts, processor.services.start_ns[interrupt])
    book.connect(processor.services, interrupt, processor.tasks, task)


class Passing:
    """Frames on their way: slice rows[i] of `slices` brought frames[i] of `source` (a BusFrames or a Direction)."""

    def __init__(self, slices: Slices, frames: np.ndarray, rows: np.ndarray, source: Any) -> None:
        known = rows >= 0
        self.slices = slices
        self.rows = rows[known]
        self.content = contents(source)[frames[known]]
        self.time_ns = slices.start_ns[self.rows]


def contents(source: Any) -> np.ndarray:
    """(frames, 3): identifier and both words."""
    return np.stack([source.identifier, source.low & 0xFFFFFFFF, source.high & 0xFFFFFFFF], axis=1)


class Direction:
    """One direction of the link: an exchange is a slice; `exchange` is the one of each frame."""

    def __init__(self, track: str, rows: np.ndarray, zero_ns: int) -> None:
        start, first, exchange, count = np.unique(
            rows[:, 0] - zero_ns, return_index=True, return_inverse=True, return_counts=True
        )
        del first
        self.exchange = exchange.reshape(-1)
        self.identifier = rows[:, 2] & IDENTIFIER_MASK
        self.low, self.high = rows[:, 3], rows[:, 4]
        names = [f"{frames} frame{'s' if frames > 1 else ''}" for frames in range(7)]
        self.slices = Slices(("Link", track), names, start, start + EXCHANGE_NS, count.astype(np.int64))


class Exchanges:
    """The serial link between router and main brain; `rows`: as SspWire records them. Empty exchanges are not shown."""

    def __init__(self, rows: np.ndarray, zero_ns: int) -> None:
        from_slave = rows[:, 1] == 1
        self.to_main_brain = Direction("to the main brain", rows[~from_slave], zero_ns)
        self.to_router = Direction("to the router", rows[from_slave], zero_ns)

    def connect(
        self, book: FlowBook, router: Processor, main_brain: Processor, came_in: list[Passing], buses: list[BusFrames]
    ) -> None:
        """Write the arrows into the link, through it, and on from the router."""
        down, up = self.to_main_brain, self.to_router
        self._end(book, down, main_brain, LINK_RECEIVE_TASK)
        self._send(book, up, main_brain)
        at, starts = router.fast.starts_of(LINK_INTERRUPT)
        interrupt = next_start(at, starts, up.slices.end_ns - 1)
        book.connect(up.slices, np.arange(len(up.slices)), router.fast, interrupt)
        for passing in came_in:
            target = first_after(passing, contents(down), down.slices.start_ns[down.exchange])
            book.connect(
                passing.slices,
                *once(passing.rows, np.where(target >= 0, down.exchange[target], -1), down.slices),
            )
        from_link = Passing(router.fast, np.arange(len(up.exchange)), interrupt[up.exchange], up)
        for passing, bus in itertools.product([*came_in, from_link], buses):
            own = np.flatnonzero((bus.sender == bus.nodes.index(ROUTER)) & ~bus.is_error)
            target = first_after(passing, contents(bus)[own], bus.asked_ns[own])
            frame = np.where(target >= 0, own[target], -1) if len(own) else np.full(len(target), -1)
            turn = np.where(frame >= 0, containing(router.turns, bus.asked_ns[frame]), -1)
            book.connect(passing.slices, *once(passing.rows, turn, router.turns))

    def _end(self, book: FlowBook, direction: Direction, processor: Processor, task: str) -> None:
        """Connect each exchange to the interrupt at its end, and to the task that reads it."""
        at, starts = processor.fast.starts_of(LINK_INTERRUPT)
        interrupt = next_start(at, starts, direction.slices.end_ns - 1)
        book.connect(direction.slices, np.arange(len(direction.slices)), processor.fast, interrupt)
        at, starts = processor.tasks.starts_of(task)
        interrupt = interrupt[interrupt >= 0]
        reading = next_start(at, starts, processor.fast.start_ns[interrupt])
        book.connect(processor.fast, interrupt, processor.tasks, reading)

    def _send(self, book: FlowBook, direction: Direction, processor: Processor) -> None:
        """Connect the task that packed a segment to its exchange: an earlier interrupt had queued the segment."""
        _, put_up = processor.fast.starts_of(LINK_INTERRUPT)
        before = np.searchsorted(put_up, direction.slices.start_ns, side="left") - 1
        at, starts = processor.tasks.starts_of(LINK_SEND_TASK)
        if len(at) == 0 or len(put_up) == 0:
            return
        place = np.searchsorted(starts, put_up[before], side="left") - 1
        soon = direction.slices.start_ns - starts[place] <= LONGEST_WAIT_NS
        task = np.where((before >= 0) & (place >= 0) & soon, at[place], -1)
        book.connect(processor.tasks, task, direction.slices, np.arange(len(direction.slices)))


def first_after(passing: Passing, content: np.ndarray, time_ns: np.ndarray) -> np.ndarray:
    """For each passing frame the row of the first of the same content that is not earlier; -1 for none in time."""
    found = np.full(len(passing.rows), -1, dtype=np.int64)
    if len(passing.rows) == 0 or len(content) == 0:
        return found
    number = numbered(np.concatenate([passing.content, content]))
    _, moment = np.unique(np.concatenate([passing.time_ns, time_ns]), return_inverse=True)
    # one integer of both, lower for an earlier moment
    keys = number << 32 | moment.reshape(-1)
    wanted, offered = number[: len(found)], number[len(found) :]
    order = np.argsort(keys[len(found) :], kind="stable")
    place = np.searchsorted(keys[len(found) :][order], keys[: len(found)])
    there = place < len(order)
    row = order[place[there]]
    same = (offered[row] == wanted[there]) & (time_ns[row] - passing.time_ns[there] <= LONGEST_WAY_NS)
    found[np.flatnonzero(there)[same]] = row[same]
    return found


def numbered(content: np.ndarray) -> np.ndarray:
    """A number for each row of (identifier, two words of 32 bits): the same for the same row."""
    _, words = np.unique(
        content[:, 1].astype(np.uint64) << np.uint64(32) | content[:, 2].astype(np.uint64), return_inverse=True
    )
    _, number = np.unique(words.reshape(-1) << 29 | content[:, 0], return_inverse=True)  # identifiers have 29 bits
    return number.reshape(-1)


def once(rows: np.ndarray, targets: np.ndarray, slices: Slices) -> tuple[np.ndarray, Slices, np.ndarray]:
    """Pairs without repetition, as `connect` takes them: several frames may have the same pair."""
    both = (rows >= 0) & (targets >= 0)
    pairs = np.unique(rows[both] << 32 | targets[both])
    return pairs >> 32, slices, pairs & 0xFFFFFFFF
