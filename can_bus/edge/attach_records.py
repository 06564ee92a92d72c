"""The attach protocol on the wire: records over a stream. ATTACH.md describes it for other languages.

A record is `length` (unsigned 32 bits, of the rest), `type` (one byte), body. All numbers are little-endian.
"""

import struct
import sys
from collections.abc import Iterator
from typing import Any

from ranger_sim.can_bus.fd_frame import fd_data_length
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.foundation import systems
from ranger_sim.foundation.events import FLAG_FD
from ranger_sim.foundation.user_error import BusError

VERSION = 1
MAGIC = b"RNGR"
SOCKET_PREFIX = "\0ranger-sim/"
DEFAULT_NAME = "ranger"
NAME_LIMIT = 64  # characters; an abstract address holds 107 bytes (unix(7))
RECORD_LIMIT = 1024  # bytes of type and body; chosen by us: the longest is a list of channels or a reason

HELLO = 1  # client: magic, version (u16), options (u16), name of the channel in UTF-8; none: only list the channels
WELCOME = 2  # server: version (u16), window (u16), bit rate (u32), epoch (i64 ns), channels in UTF-8, one per line
REFUSED = 3  # server: reason in UTF-8; the connection ends
SEND = 4  # client: identifier (u32), flags (u16), data bytes 0-3 and 4-7 (u32 each); of CAN FD, the data bytes
FRAME = 5  # server: time (i64 ns), then as SEND
SENT = 6  # server: your oldest frame is on the bus whole; body as FRAME
DROPPED = 7  # server: your oldest frame will never be sent; body as FRAME
STATE = 8  # server: time (i64 ns), state (u16), transmit errors (u16), receive errors (u16)
CONTROL = 9  # client: one byte, ACTIVATE, LISTEN or FLUSH
OVERFLOW = 10  # server: time (i64 ns), number of frames that you have missed so far (u64)
FD = 11  # server, after WELCOME to a client with OPTION_FD: data bit rate (u32), 1 for ISO 11898-1:2015 (u16)

OPTION_LISTEN = 1  # HELLO: start in listen-only mode
OPTION_FD = 2  # HELLO: a CAN FD node; without it a client is a classic one
ACTIVATE, LISTEN, FLUSH = 1, 2, 3

HEAD = struct.Struct("<IB")
HELLO_BODY = struct.Struct("<4sHH")
WELCOME_BODY = struct.Struct("<HHIq")
SEND_BODY = struct.Struct("<IHII")
FRAME_BODY = struct.Struct("<qIHII")
STATE_BODY = struct.Struct("<qHHH")
OVERFLOW_BODY = struct.Struct("<qQ")
SEND_RECORD = struct.Struct("<IBIHII")
FRAME_RECORD = struct.Struct("<IBqIHII")
FD_BODY = struct.Struct("<IH")
SEND_HEAD = struct.Struct("<IH")  # of a body with data bytes
FRAME_HEAD = struct.Struct("<qIH")
LENGTH = struct.Struct("<I")
WORDS = 8  # bytes of a classic frame's data in a body


class MalformedError(Exception):
    """Input is not a record of this protocol; the text gives the reason."""


def record(kind: int, body: bytes = b"") -> bytes:
    """One record."""
    return HEAD.pack(1 + len(body), kind) + body


def send_record(identifier: int, flags: int, lo: int, hi: int) -> bytes:
    """A SEND record. `hi` of a CAN FD frame: all bytes from the fifth on."""
    if flags & FLAG_FD:
        return record(SEND, SEND_HEAD.pack(identifier, flags) + data_of_words(flags, lo, hi))
    return SEND_RECORD.pack(1 + SEND_BODY.size, SEND, identifier, flags, lo, hi)


def frame_record(kind: int, time_ns: int, identifier: int, flags: int, lo: int, hi: int) -> bytes:
    """A FRAME, SENT or DROPPED record. `hi` of a CAN FD frame: all bytes from the fifth on."""
    if flags & FLAG_FD:
        return record(kind, FRAME_HEAD.pack(time_ns, identifier, flags) + data_of_words(flags, lo, hi))
    return FRAME_RECORD.pack(1 + FRAME_BODY.size, kind, time_ns, identifier, flags, lo, hi)


def frame_of(head: struct.Struct, body: bytes) -> tuple[int, ...]:
    """The numbers of `head`, which ends with the flags, then lo and hi as in `frame_record`; MalformedError."""
    if len(body) < head.size:
        raise MalformedError(f"a body of {len(body)} bytes is too short for a frame")
    numbers = head.unpack_from(body)
    data = body[head.size :]
    wanted = fd_data_length(numbers[-1]) if numbers[-1] & FLAG_FD else WORDS
    if len(data) != wanted:
        raise MalformedError(f"{len(data)} data bytes in a body where {wanted} belong")
    return *numbers, int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")


def records_of(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    """(type, body) of every whole record in the buffer, removing them. MalformedError for an invalid length."""
    at = 0  # the buffer is cut once, at the end: a client receives many at a time
    try:
        while len(buffer) - at >= HEAD.size:
            length, kind = HEAD.unpack_from(buffer, at)
            if not 1 <= length <= RECORD_LIMIT:
                raise MalformedError(f"a record of {length} bytes is outside 1 ... {RECORD_LIMIT}")
            end = at + LENGTH.size + length
            if end > len(buffer):
                return
            body = bytes(buffer[at + HEAD.size : end])
            at = end
            yield kind, body
    finally:
        del buffer[:at]


def next_record(buffer: bytearray) -> tuple[int, bytes] | None:
    """(type, body) of the first record, removing it from the buffer; None while it is not whole. As `records_of`."""
    if len(buffer) < HEAD.size:
        return None
    length, kind = HEAD.unpack_from(buffer)
    if not 1 <= length <= RECORD_LIMIT:
        raise MalformedError(f"a record of {length} bytes is outside 1 ... {RECORD_LIMIT}")
    end = LENGTH.size + length
    if end > len(buffer):
        return None
    body = bytes(buffer[HEAD.size : end])
    del buffer[:end]
    return kind, body


def unpacked(layout: struct.Struct, body: bytes) -> tuple[Any, ...]:
    """The numbers of a body of exactly this layout; MalformedError otherwise."""
    if len(body) != layout.size:
        raise MalformedError(f"a body of {len(body)} bytes where {layout.size} belong")
    return layout.unpack(body)


def address_of(name: str) -> str:
    """The abstract socket address of a robot or a host of private buses. UserError for an impossible name."""
    if not systems.is_linux():
        raise BusError(f"attaching to {name!r}: abstract unix sockets exist on Linux only, this is {sys.platform}")
    if not 1 <= len(name) <= NAME_LIMIT or not all(c.isascii() and (c.isalnum() or c in "._-") for c in name):
        raise BusError(f"name {name!r} is not 1 ... {NAME_LIMIT} letters, digits, dots, hyphens or underscores")
    return SOCKET_PREFIX + name


def names_running() -> list[str]:
    """Names of the robots and hosts on this machine that listen now, from the kernel's list of sockets."""
    try:
        with open("/proc/net/unix", encoding="ascii", errors="replace") as table:
            rows = [line.split() for line in table]
    except OSError:
        return []
    shown = SOCKET_PREFIX.replace("\0", "@")  # so the kernel writes it
    listening = 0x10000  # __SO_ACCEPTCON, linux/net.h: the sockets that accept, not those accepted
    found = {
        row[7].removeprefix(shown)
        for row in rows
        if len(row) == 8 and row[7].startswith(shown) and int(row[3], 16) & listening
    }
    return sorted(found)
