"""ASAM MDF 4.10 written continuously: the file can be read after every write, however the program ends.

The blocks that describe the file (header, groups, channels) are written first, for groups that are all known. Rows are
collected for each group, compressed and written at the end of the file; the links and counts that lead to them are
changed only after that. So memory is flat, and a program that is killed leaves whole rows of every group.
Names of blocks and fields are those of the ASAM standard, part 1, version 4.1.
"""

import os
import pathlib
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from ranger_sim.foundation import systems

HEADER = struct.Struct("<4sIQQ")  # id, reserved, length, number of links: in front of every block
ID_BYTES = 64
TOOL = b"rngrsim\0"
COLLECTED_ROWS = 2048  # of a group before they are written; chosen by us: 24 kB of a variable's, 12 MB of all of them
# CN block
CHANNEL_FIXED, CHANNEL_MASTER = 0, 2
SYNC_NONE, SYNC_TIME = 0, 1
DATA_TYPES = {"u": 0, "i": 2, "f": 4}  # little-endian unsigned, signed, real; by numpy's kind
# DZ block: what was compressed, and how: transposed, so that bytes of one weight lie together, then deflated
ZIPPED = b"DT"
TRANSPOSED = 1


@dataclass(frozen=True)
class Channel:
    """A channel: its values are of `dtype`, a little-endian number."""

    name: str
    unit: str
    comment: str
    dtype: Any


@dataclass(frozen=True)
class Group:
    """Channels with one time base, in s. A row is `dtype`: time first, then a value for each channel."""

    name: str
    channels: tuple[Channel, ...]

    @property
    def dtype(self) -> np.dtype:
        """The dtype of its rows."""
        values = [(f"value_{place}", channel.dtype) for place, channel in enumerate(self.channels)]
        return np.dtype([("time_s", "<f8"), *values])


class Rows:
    """The places of one group's rows in the file, and the rows that wait."""

    def __init__(self, row_bytes: int, cycle_count_at: int, data_link_at: int) -> None:
        self.row_bytes = row_bytes
        self.cycle_count_at = cycle_count_at
        self.next_link_at = data_link_at  # the link to the next block of rows
        self.count = 0  # of those in the file
        self.waiting: list[bytes] = []
        self.waiting_rows = 0


class MdfWriter:
    """A file with `groups`; `properties` go into its header. OSError when it cannot be written."""

    def __init__(self, path: pathlib.Path, groups: Sequence[Group], properties: Mapping[str, str]) -> None:
        self.file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC | systems.O_BINARY, 0o644)
        self.path = path
        self.texts: dict[tuple[bytes, str], int] = {}
        self.rows: list[Rows] = []
        self.end = 0
        self._identification()
        header = self._block(b"HD", [0] * 6, struct.pack("<QhhBBBBdd", 0, 0, 0, 0, 0, 0, 0, 0.0, 0.0))
        elements = "".join(f"<e name={quoteattr(name)}>{escape(text)}</e>" for name, text in properties.items())
        described = f"<HDcomment><TX/><common_properties>{elements}</common_properties></HDcomment>"
        self._link(header, 5, self._text(described, b"MD"))
        tool = (
            "<FHcomment><TX/><tool_id>ranger-sim</tool_id><tool_vendor>ranger-sim</tool_vendor>"
            "<tool_version>1</tool_version></FHcomment>"
        )
        self._link(header, 1, self._block(b"FH", [0, self._text(tool, b"MD")], struct.pack("<QhhB3x", 0, 0, 0, 0)))
        before, place = header, 0  # the link to the first data group is the header's first
        for group in groups:
            before, place = self._group(group, before, place), 0

    def append(self, group: int, rows: np.ndarray) -> None:
        """Add rows (an array of the group's dtype) to the group of this number."""
        kept = self.rows[group]
        kept.waiting.append(rows.tobytes())
        kept.waiting_rows += len(rows)
        if kept.waiting_rows >= COLLECTED_ROWS:
            self._write_rows(kept)

    def flush(self) -> None:
        """Write the waiting rows."""
        for each in self.rows:
            self._write_rows(each)

    def close(self) -> None:
        """Finish the file."""
        if self.file >= 0:
            try:
                self.flush()
            finally:
                self.abandon()

    def abandon(self) -> None:
        """Close the file without finishing it."""
        if self.file >= 0:
            os.close(self.file)
            self.file = -1

    # --- rows -----------------------------------------------------------------------------------------------

    def _write_rows(self, kept: Rows) -> None:
        if not kept.waiting_rows:
            return
        data = b"".join(kept.waiting)
        columns = np.frombuffer(data, np.uint8).reshape(-1, kept.row_bytes).T
        packed = zlib.compress(columns.tobytes())
        zipped = struct.pack("<2sBBIQQ", ZIPPED, TRANSPOSED, 0, kept.row_bytes, len(data), len(packed))
        block = self._block(b"DZ", [], zipped + packed)
        listed = self._block(b"DL", [0, block], struct.pack("<B3xIQ", 0, 1, kept.count * kept.row_bytes))
        first = listed
        if not kept.count:
            first = self._block(b"HL", [listed], struct.pack("<HB5x", 0, TRANSPOSED))
        self._write(kept.next_link_at, struct.pack("<Q", first))
        kept.next_link_at = listed + HEADER.size
        kept.count += kept.waiting_rows
        self._write(kept.cycle_count_at, struct.pack("<Q", kept.count))
        kept.waiting.clear()
        kept.waiting_rows = 0

    # --- the blocks that describe ---------------------------------------------------------------------------

    def _identification(self) -> None:
        fields = (b"MDF     ", b"4.10    ", TOOL, b"", 410, b"", 0, 0)
        self._write(0, struct.pack("<8s8s8s4sH30sHH", *fields))
        self.end = ID_BYTES

    def _group(self, group: Group, before: int, place: int) -> int:
        """Write a group and link it from `place` of the block `before`; returns its data group."""
        dtype = group.dtype
        next_channel = 0
        for number, channel in reversed(list(enumerate(group.channels))):
            offset = sum(dtype[place].itemsize for place in range(1 + number))  # rows are packed
            next_channel = self._channel(channel, CHANNEL_FIXED, offset, next_channel)
        time = Channel("time", "s", "", np.dtype("<f8"))
        first = self._channel(time, CHANNEL_MASTER, 0, next_channel)
        links = [0, first, self._text(group.name), 0, 0, 0]
        channels = self._block(b"CG", links, struct.pack("<QQHH4xII", 0, 0, 0, 0, dtype.itemsize, 0))
        data = self._block(b"DG", [0, channels, 0, 0], struct.pack("<B7x", 0))
        self._link(before, place, data)
        count_at = channels + HEADER.size + 8 * len(links) + 8
        self.rows.append(Rows(dtype.itemsize, count_at, data + HEADER.size + 8 * 2))
        return data

    def _channel(self, channel: Channel, kind: int, offset: int, following: int) -> int:
        number = np.dtype(channel.dtype)
        sync = SYNC_TIME if kind == CHANNEL_MASTER else SYNC_NONE
        links = [following, 0, self._text(channel.name), 0, 0, 0, self._text(channel.unit), self._text(channel.comment)]
        fields = (kind, sync, DATA_TYPES[number.kind], 0, offset, 8 * number.itemsize, 0, 0, 0, 0, 0)
        return self._block(b"CN", links, struct.pack("<BBBBIIIIBBH6d", *fields, *(0.0,) * 6))

    def _text(self, text: str, kind: bytes = b"TX") -> int:
        """The block of a text; equal texts share one, and an empty one has none."""
        if not text:
            return 0
        if (kind, text) not in self.texts:
            encoded = text.encode() + b"\0"
            self.texts[kind, text] = self._block(kind, [], encoded.ljust(-len(encoded) % 8 + len(encoded), b"\0"))
        return self.texts[kind, text]

    def _block(self, kind: bytes, links: Sequence[int], data: bytes) -> int:
        """Write a block at the end of the file; returns its position."""
        length = HEADER.size + 8 * len(links) + len(data)
        block = HEADER.pack(b"##" + kind, 0, length, len(links)) + struct.pack(f"<{len(links)}Q", *links) + data
        at = self.end
        self._write(at, block.ljust(-length % 8 + length, b"\0"))
        self.end = at + -length % 8 + length
        return at

    def _link(self, block: int, place: int, target: int) -> None:
        """Let link `place` of a block lead to another one."""
        self._write(block + HEADER.size + 8 * place, struct.pack("<Q", target))

    def _write(self, at: int, data: bytes) -> None:
        """Write all of `data`; a nearly full disk takes a part of it first."""
        while data:
            taken = systems.write_at(self.file, data, at)
            at, data = at + taken, data[taken:]
