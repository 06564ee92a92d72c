"""Frames of the remote serial protocol: `$payload#checksum`, acknowledged by `+`, and the interrupt byte.

Source: Debugging with GDB (gdb 13), appendix E, sections Overview and Packet Acknowledgment.
"""

from __future__ import annotations

INTERRUPT = 0x03
ESCAPE, ESCAPED_BY = 0x7D, 0x20
SPECIAL = b"$#}*"


class MalformedError(Exception):
    """The bytes are not a frame of this protocol."""


def framed(payload: bytes) -> bytes:
    """A frame with this payload, which holds no `#` or `$` that is not escaped."""
    return b"$%b#%02x" % (payload, sum(payload) & 0xFF)


def escaped(data: bytes) -> bytes:
    """Binary data as escaped in a payload."""
    out = bytearray()
    for byte in data:
        if byte in SPECIAL:
            out += bytes((ESCAPE, byte ^ ESCAPED_BY))
        else:
            out.append(byte)
    return bytes(out)


def unescaped(data: bytes) -> bytes:
    """The data before escaping."""
    out = bytearray()
    parts = iter(data)
    for byte in parts:
        out.append(next(parts, ESCAPED_BY) ^ ESCAPED_BY if byte == ESCAPE else byte)
    return bytes(out)


def take_frame(incoming: bytearray) -> tuple[bytes, bool] | None:
    """The first frame of `incoming`, taken out of it: its payload, and whether the checksum is right.

    None for an incomplete one. The first byte is a `$`; MalformedError for a checksum that is not a number.
    """
    end = incoming.find(b"#")
    if end < 0 or len(incoming) < end + 3:
        return None
    payload = bytes(incoming[1:end])
    try:
        wanted = int(incoming[end + 1 : end + 3], 16)
    except ValueError:
        raise MalformedError from None
    del incoming[: end + 3]
    return payload, wanted == sum(payload) & 0xFF
