# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is a place of a block: a block is a whole number of rows and flushed when it is full)
"""Rows of 64-bit numbers that a run records: collected into blocks, hashed, passed on as bytes."""

import array
import hashlib
from typing import Annotated

import cython

# BLAKE2b (RFC 7693): as strong as SHA-256, in half the time on processors without instructions for that
DIGEST_BYTES = 32
FD_FLAGS_SHIFT = 44  # in the second number of a frame's row: its flags from bit 8 on
FURTHER = 1 << 47  # there, too: a row of further data of the frame before


@cython.cclass
class RowStream:
    """Rows of 64-bit values collected into blocks. `hashed`: feed the blocks to BLAKE2b as well.

    code: "q" for whole numbers, "d" for doubles. A row is written into `integers` or `reals` from `used` on, then
    closed by `finish_row`. `number` distinguishes streams of one kind.
    """

    used: cython.longlong
    capacity: cython.longlong
    last_time_ns: cython.longlong
    number: cython.longlong
    numbers: cython.p_longlong
    columns: cython.longlong
    integers: Annotated[cython.longlong[::1], "readonly"]
    reals: cython.double[::1]
    is_real: cython.bint
    digest: object
    sink: object

    def __init__(self, code, columns, hashed, block_rows=512, number=0) -> None:
        self.number = number
        self.columns = columns
        self.capacity = columns * block_rows
        self.integers = array.array("q", [0]) * (self.capacity if code == "q" else 0)
        self.reals = array.array("d", [0.0]) * (self.capacity if code == "d" else 0)
        # compiled, the address of `integers`: close to the other fields of every row; a memoryview is 208 bytes away
        self.numbers = cython.address(self.integers[0]) if cython.compiled else self.integers
        self.used = 0
        self.last_time_ns = 0
        self.is_real = code == "d"
        self.digest = hashlib.blake2b(digest_size=DIGEST_BYTES) if hashed else None
        self.sink = None

    @cython.ccall
    def finish_row(self, time_ns: cython.longlong) -> None:
        """Close the row that was just written from `used` on."""
        self.used += self.columns
        self.last_time_ns = time_ns
        if self.used == self.capacity:
            self.flush()

    @cython.ccall
    def flush(self) -> object:
        """Hash the content of the block and pass it on."""
        if self.used == 0:
            return
        block: object = memoryview(self.reals) if self.is_real else memoryview(self.integers)
        block = block[: self.used]
        if self.digest is not None:
            self.digest.update(block)
        self.used = 0  # first: a sink that fails must not let the next row be written behind the block's end
        if self.sink is not None:
            self.sink(self.last_time_ns, block.tobytes())


@cython.final
@cython.cclass
class FrameStream(RowStream):
    """The frames of bus `bus` (0 ... 15), hashed: three numbers a row, in order of their start.

    They are: the time (ns) at which receivers have the frame; word 0 << 12 | flags << 4 | bus; word 1 << 29 |
    identifier. Flags above 255, of CAN FD, are bits 44 ... 46 of the second number. Each eight bytes more of such a
    frame are a further row of the same time and identifier, with FURTHER in its second number; all are in one block.
    """

    def __init__(self, bus) -> None:
        RowStream.__init__(self, "q", 3, True, number=bus)

    @cython.ccall
    def add(
        self,
        time_ns: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> None:
        """Add a frame that was on the bus."""
        at: cython.longlong = self.used
        self.numbers[at] = time_ns
        self.numbers[at + 1] = (lo << 12) | (flags << 4) | self.number
        self.numbers[at + 2] = (hi << 29) | identifier
        self.used = at + 3
        self.last_time_ns = time_ns
        if self.used == self.capacity:
            self.flush()

    def add_fd(self, time_ns, identifier, flags, data) -> None:
        """Add a CAN FD frame with these data (bytes)."""
        words = [int.from_bytes(data[at : at + 4], "little") for at in range(0, max(len(data), 8), 4)]
        if len(words) % 2:
            words.append(0)
        if self.used + self.columns * (len(words) // 2) > self.capacity:
            self.flush()
        marks = (flags & 0xFF) << 4 | flags >> 8 << FD_FLAGS_SHIFT | self.number
        for at in range(0, len(words), 2):
            self.integers[self.used] = time_ns
            self.integers[self.used + 1] = words[at] << 12 | (marks if at == 0 else FURTHER | self.number)
            self.integers[self.used + 2] = words[at + 1] << 29 | identifier
            self.finish_row(time_ns)
