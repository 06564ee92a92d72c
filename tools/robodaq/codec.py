"""Bytes of the data link from the computer's side (robot.md N4.15).

From the robot: segments of 92 bytes, nine points of identifier, value word and stamp in ms, and the sum of these 90
bytes plus 1. To the robot: packets of 8 bytes, identifier, value word, and the sum of the six plus 1. Big-endian.
"""

import struct
from typing import NamedTuple

POINTS = 9
SEGMENT_BYTES = 92
CHECKSUM_AT = 90
_SEGMENT = struct.Struct(">" + "HII" * POINTS)
_PACKET = struct.Struct(">HI")


class Point(NamedTuple):
    """One value: identifier, 32-bit word, robot time in ms at which it was written (0: never)."""

    number: int
    word: int
    stamp: int


def checksum(data: bytes | bytearray) -> int:
    """Sum of the bytes plus 1, 16 bits."""
    return (1 + sum(data)) & 0xFFFF


def write_packet(number: int, word: int) -> bytes:
    """The 8 bytes that set variable `number` to the 32-bit `word`."""
    body = _PACKET.pack(number, word)
    return body + checksum(body).to_bytes(2, "big")


def segment(points: list[Point]) -> bytes:
    """The 92 bytes of nine points."""
    body = _SEGMENT.pack(*(part for point in points for part in point))
    return body + checksum(body).to_bytes(2, "big")


class SegmentDecoder:
    """Finds segments in a stream that has neither start bytes nor escapes.

    In step, a segment is accepted by its checksum; out of step, it must also contain only known identifiers, because
    one of some thousand positions in a stream has a right sum by chance. `bad_checksums`: how often the step was lost;
    `skipped_bytes`: bytes outside segments; `unknown_points`: points with identifiers beyond the table, left out.
    """

    def __init__(self, last_id: int) -> None:
        self.last_id = last_id
        self.buffer = bytearray()
        self.in_step = False
        self.segments = 0
        self.bad_checksums = 0
        self.skipped_bytes = 0
        self.unknown_points = 0

    def feed(self, data: bytes) -> list[Point]:
        """The points of every segment completed by these bytes."""
        buffer = self.buffer
        buffer += data
        points: list[Point] = []
        at = 0
        while len(buffer) - at >= SEGMENT_BYTES:
            found = self._points(buffer, at)
            if found is None:
                if self.in_step:
                    self.in_step = False
                    self.bad_checksums += 1
                self.skipped_bytes += 1
                at += 1
                continue
            self.in_step = True
            self.segments += 1
            at += SEGMENT_BYTES
            for point in found:
                if point.number <= self.last_id:
                    points.append(point)
                else:
                    self.unknown_points += 1
        del buffer[:at]
        return points

    def _points(self, buffer: bytearray, at: int) -> list[Point] | None:
        total = checksum(buffer[at : at + CHECKSUM_AT])
        if total != buffer[at + CHECKSUM_AT] << 8 | buffer[at + CHECKSUM_AT + 1]:
            return None
        parts = _SEGMENT.unpack_from(buffer, at)
        points = [Point(*parts[i : i + 3]) for i in range(0, len(parts), 3)]
        if not self.in_step and any(point.number > self.last_id for point in points):
            return None
        return points
