"""The feed on the wire: records over a stream, from the robot to viewers. FEED.md describes it for other languages.

A record is `length` (unsigned 32 bits, of what follows), `type` (one byte), body. All numbers are little-endian.
"""

import json
import struct
from collections.abc import Iterator
from typing import Any

from ranger_sim.foundation import systems

VERSION = 1
PREFIX = "\0ranger-sim-feed/"
RECORD_LIMIT = 1 << 24  # bytes of type and body; chosen by us: a second of every stream of the robot is below 4 MB

HELLO = 1  # JSON: the robot's name, and what the streams hold
ROWS = 2  # number of the stream (one byte), then its rows
GAP = 3  # JSON: {stream: rows that were left out here}, because too much was waiting
STATE = 4  # JSON: what no stream holds
SLOTS = 5  # number of the board (one byte), then its slots: three 64-bit whole numbers each

HEAD = struct.Struct("<IB")


def address(name: str) -> str:
    """The abstract address of robot `name`; it has no file, so nothing of it remains."""
    systems.require_linux(f"robot {name}: robots under a name", "abstract sockets", "`walk` runs everywhere")
    return PREFIX + name


def record(kind: int, body: bytes) -> bytes:
    """One record."""
    return HEAD.pack(1 + len(body), kind) + body


def text_record(kind: int, content: Any) -> bytes:
    """One record of JSON."""
    return record(kind, json.dumps(content, separators=(",", ":")).encode())


def taken(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    """Take (type, body) of every whole record from the head of `buffer`. ValueError for an invalid record."""
    at = 0
    try:
        while len(buffer) - at >= HEAD.size:
            length, kind = HEAD.unpack_from(buffer, at)
            if not 1 <= length <= RECORD_LIMIT:
                raise ValueError(f"a record of {length} bytes: 1 to {RECORD_LIMIT} are possible")
            end = at + 4 + length
            if len(buffer) < end:
                break
            yield kind, bytes(buffer[at + HEAD.size : end])
            at = end
    finally:
        del buffer[:at]
