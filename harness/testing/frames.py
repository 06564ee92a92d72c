"""Frames for tests, and a keeper of the last of them while a robot or a board runs."""

import collections
import functools
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

from ranger_sim.can_bus.fd_frame import LONGEST, fd_data_length
from ranger_sim.can_bus.frame import data_length
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_FD
from ranger_sim.foundation.row_stream import FD_FLAGS_SHIFT, FURTHER
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.names import Names

WINDOW_S = 20.0  # how much is kept: some 30 steps of a walk, 16 MB for all four buses (chosen by us)
ROW = 3  # numbers per row of a stream, a frame but for CAN FD: see foundation/row_stream.py
WORD = 0xFFFFFFFF


class Words(NamedTuple):
    """The parts of a frame; `time_ns` is when receivers had it, in the machine's time.

    `lo`: bytes 0-3; `hi`: bytes 4-7, of a CAN FD frame all bytes from the fifth on.
    """

    time_ns: int
    bus: str
    identifier: int
    flags: int
    lo: int
    hi: int


class Frame(Words):
    """A frame that was on a bus. `frame_type` gives the class for the names of a machine."""

    names: ClassVar[Names] = Names()

    @property
    def name(self) -> str:
        """The variable's name, or the identifier where the table has none."""
        return self.names.name(self.identifier)

    @property
    def time_s(self) -> float:
        """Its time, s."""
        return self.time_ns * 1e-9

    @property
    def value(self) -> float:
        """The value word as the table's type reads it; unchanged for an identifier without one."""
        return self.names.value(self.identifier, self.lo)

    @property
    def values(self) -> tuple[float, ...]:
        """Every value that it carries: several of a variable such as f32[12]."""
        count = self.names.counts.get(self.identifier, 1)
        words = [self.lo, *(self.hi >> 32 * place & WORD for place in range(count - 1))]
        return tuple(self.names.value(self.identifier, word) for word in words)

    @property
    def data(self) -> bytes:
        """Its data bytes."""
        if self.flags & FLAG_FD:
            return (self.lo | self.hi << 32).to_bytes(LONGEST, "little")[: fd_data_length(self.flags)]
        return (self.lo | self.hi << 32).to_bytes(8, "little")[: data_length(self.flags)]

    @property
    def stamp_ms(self) -> int:
        """The time word, behind its values: network time of the value, ms."""
        return self.hi >> 32 * (self.names.counts.get(self.identifier, 1) - 1) & WORD

    @property
    def is_error(self) -> bool:
        """Whether it is an error frame of the bus, which has no sender."""
        return bool(self.flags & FLAG_ERROR)

    def text(self) -> str:
        """One line for a report."""
        if self.is_error:
            return f"{self.time_s:12.6f} s  {self.bus}  error frame"
        line = f"{self.time_s:12.6f} s  {self.bus}  {self.identifier:03X} {self.name}"
        if self.name.startswith("ERROR_"):
            return f"{line} {self.names.error_text(self.lo)}"
        shown = ", ".join(f"{value:.6g}" for value in self.values)
        return f"{line} {shown} (stamp {self.stamp_ms})"


@functools.cache
def frame_type(names: Names) -> type[Frame]:
    """The class of frames with these names."""
    return type("Frame", (Frame,), {"names": names, "__doc__": Frame.__doc__})


class FrameKeeper:
    """Keeps the frames of the last `window_s` that pass through `streams`: {bus: its FrameStream}.

    `from_ns`: since when they are kept, by bus; above 0 for a keeper made after time had passed.
    """

    def __init__(self, streams: dict[str, Any], names: Names, window_s: float = WINDOW_S, from_ns: int = 0) -> None:
        self.streams = streams
        self.names = names
        self.frame = frame_type(names)
        self.window_ns = round(window_s * 1e9)
        self.blocks: dict[str, collections.deque[tuple[int, bytes]]] = {}
        self.late_ns = from_ns
        self.from_ns = dict.fromkeys(streams, from_ns)
        for name, stream in streams.items():
            stream.flush()
            self.blocks[name] = collections.deque()
            stream.sink = self._keeper(name, stream.sink)

    def _keeper(self, name: str, other: Callable[[int, bytes], None] | None) -> Callable[[int, bytes], None]:
        blocks = self.blocks[name]

        def keep(last_time_ns: int, block: bytes) -> None:
            blocks.append((last_time_ns, block))
            while blocks[0][0] < last_time_ns - self.window_ns:
                self.from_ns[name] = blocks.popleft()[0] + 1
            if other is not None:
                other(last_time_ns, block)

        return keep

    def add_earlier(self, bus: str, block: bytes) -> None:
        """Add frames of a bus from before the keeper was made, in their order."""
        if block:
            self.blocks[bus].append((memoryview(block).cast("q")[-ROW], block))

    def check(self, bus: str, since_ns: int | None = None) -> None:
        """UserError for requested frames that are not kept: those since `since_ns`, or, None, any of a late keeper."""
        if bus not in self.streams:
            return  # `frames` reports it
        self.streams[bus].flush()
        begin_ns = self.from_ns[bus]
        if since_ns is None and self.late_ns and not self.blocks[bus] or since_ns is not None and since_ns < begin_ns:
            raise UserError(
                f"bus {bus}: frames before {begin_ns * 1e-9:.6g} s (the time that frames show) are not kept; kept are "
                f"the last {self.window_ns * 1e-9:g} s, from the first call of wire() or with log='full'"
            )

    def frames(self, bus: str, identifiers: set[int] | None = None, since_ns: int = 0) -> list[Frame]:
        """Frames of a bus in their order; only those identifiers (None: all), from `since_ns` on."""
        if bus not in self.streams:
            raise UserError(unknown("bus", bus, self.streams))
        self.streams[bus].flush()
        found: list[Frame] = []
        for last_ns, block in self.blocks[bus]:
            if last_ns >= since_ns:
                found += frames_of(self.frame, block, bus, identifiers, since_ns)
        return found

    def latest(self, most: int) -> list[Frame]:
        """The last `most` frames of all buses together, in order of time."""
        every: list[Frame] = []
        for bus, stream in self.streams.items():
            stream.flush()
            of_bus: list[Frame] = []
            for _, block in reversed(self.blocks[bus]):
                of_bus = frames_of(self.frame, block, bus) + of_bus
                if len(of_bus) >= most:
                    break
            every += of_bus[-most:]
        return sorted(every)[-most:]


def frames_of(
    frame: type[Frame], block: bytes, bus: str, identifiers: set[int] | None = None, since_ns: int = 0
) -> list[Frame]:
    """The frames of a block of a stream."""
    rows = memoryview(block).cast("q")
    found = []
    for at in range(0, len(rows), ROW):
        third = rows[at + 2]
        identifier = third & 0x1FFFFFFF
        if rows[at + 1] & FURTHER:
            continue
        if rows[at] < since_ns or (identifiers is not None and identifier not in identifiers):
            continue
        second = rows[at + 1]
        flags = second >> 4 & 0xFF | (second >> FD_FLAGS_SHIFT & 7) << 8
        hi = third >> 29
        if flags & FLAG_FD:
            hi |= _further(rows, at + ROW)
        found.append(frame(rows[at], bus, identifier, flags, second >> 12 & WORD, hi))
    return found


def _further(rows: Any, at: int) -> int:
    """The bytes of a CAN FD frame behind the eighth, in the rows from place `at` on, at their place in `hi`."""
    found, shift = 0, 32
    while at < len(rows) and rows[at + 1] & FURTHER:
        found |= (rows[at + 1] >> 12 & WORD | rows[at + 2] >> 29 << 32) << shift
        at, shift = at + ROW, shift + 64
    return found
