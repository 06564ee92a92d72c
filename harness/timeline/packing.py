# cython: boundscheck=False, wraparound=False
# (every index below lies in a template, in the space reserved for a record, or counts the rows that are given)
"""Packets of a trace, many of one kind: the `perfetto` package makes one of each kind, this module fills in numbers.

A packet is a template, bytes as `perfetto`'s own classes serialise them, in which some numbers of eight bytes
(doubles and flow identifiers have fixed length in protobuf) are replaced, and after which its time stamp follows.
The order of fields in a message is free, so the result is a regular packet.
"""

import struct
from typing import Final

import cython

from ranger_sim.foundation.numbers import integers

HOLE_BYTES: Final = 8
VARINT_BYTES: Final = 10  # the longest
PACKET_TAG: Final = 0x0A  # field 1 of a Trace, length-delimited: a packet
TIMESTAMP_TAG: Final = 0x40  # field 8 of a TracePacket, a varint
# what `nested` gives: 4 x the row + one of these
OUTER_BEGINS: Final = 0
OUTER_ENDS: Final = 1
INNER_BEGINS: Final = 2
INNER_ENDS: Final = 3


def varint(value: int) -> bytes:
    """A whole number of 0 or more in protobuf's variable length."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


@cython.final
@cython.cclass
class PacketPacker:
    """Packets one after another, in `buffer` up to `used`.

    `write`: takes the bytes when more than `flush_bytes` have accumulated.
    """

    write: object
    flush_bytes: cython.longlong
    used: cython.longlong
    longest: cython.longlong
    buffer: object
    text: object
    laid: cython.longlong
    text_begins: cython.longlong[::1]
    hole_begins: cython.longlong[::1]
    hole_places: cython.longlong[::1]
    templates: list
    holes: list

    def __init__(self, write, flush_bytes=1 << 20) -> None:
        self.write = write
        self.flush_bytes = flush_bytes
        self.templates = []
        self.holes = []  # of each template: the places of its numbers
        self.longest = 0
        self.buffer = bytearray(1)
        self.used = 0
        self._lay()

    def template(self, packet: bytes, holes: list) -> int:
        """Number of a new template: a TracePacket without time stamp, and the places of its numbers."""
        self.templates.append(packet)
        self.holes.append(list(holes))
        self.longest = max(self.longest, len(packet))
        return len(self.templates) - 1

    def _lay(self) -> None:
        """Concatenate all templates, and their holes: from text_begins[n] and hole_begins[n] on."""
        self.laid = len(self.templates)
        self.text = bytearray(b"".join(self.templates) + b"\0")
        self.text_begins = integers(self.laid + 1)
        self.hole_begins = integers(self.laid + 1)
        self.hole_places = integers(sum(map(len, self.holes)) + 1)
        place = 0
        for number, holes in enumerate(self.holes):
            self.text_begins[number + 1] = self.text_begins[number] + len(self.templates[number])
            self.hole_begins[number + 1] = self.hole_begins[number] + len(holes)
            for hole in holes:
                self.hole_places[place] = hole
                place += 1
        self.flush()
        self.buffer = bytearray(self.flush_bytes + self.longest + 2 * VARINT_BYTES + 2)

    @cython.ccall
    def put(
        self,
        times: cython.longlong[::1],
        kinds: cython.longlong[::1],
        values: cython.longlong[::1],
        firsts: cython.longlong[::1],
    ) -> None:
        """Write packets of `kinds` (templates) at `times` (ns); packet i has its numbers in `values` from firsts[i] on.

        `values` are the eight bytes of each number, taken as an integer.
        """
        i: cython.longlong
        j: cython.longlong
        at: cython.longlong
        begin: cython.longlong
        length: cython.longlong
        number: cython.longlong
        place: cython.longlong
        byte: cython.longlong
        if self.laid != len(self.templates):
            self._lay()
        if not cython.compiled:
            self._put_interpreted(times, kinds, values, firsts)
            return
        out: cython.uchar[::1] = self.buffer
        text: cython.uchar[::1] = self.text
        text_begins: cython.longlong[::1] = self.text_begins
        hole_begins: cython.longlong[::1] = self.hole_begins
        hole_places: cython.longlong[::1] = self.hole_places
        for i in range(len(times)):
            begin = text_begins[kinds[i]]
            length = text_begins[kinds[i] + 1] - begin
            number = times[i]
            place = length + 2  # of the whole packet: its time stamp is a byte, and one more for every 7 bits
            while number > 127:
                number >>= 7
                place += 1
            at = self.used
            out[at] = PACKET_TAG
            at += 1
            while place > 127:
                out[at] = place & 127 | 128
                place >>= 7
                at += 1
            out[at] = place
            at += 1
            for j in range(length):
                out[at + j] = text[begin + j]
            place = firsts[i]
            for j in range(hole_begins[kinds[i]], hole_begins[kinds[i] + 1]):
                number = values[place]
                for byte in range(HOLE_BYTES):
                    out[at + hole_places[j] + byte] = number >> 8 * byte & 255
                place += 1
            at += length
            out[at] = TIMESTAMP_TAG
            at += 1
            number = times[i]
            while number > 127:
                out[at] = number & 127 | 128
                number >>= 7
                at += 1
            out[at] = number
            self.used = at + 1
            if self.used > self.flush_bytes:
                self.flush()

    def _put_interpreted(self, times, kinds, values, firsts) -> None:
        """The same, by means that are fast in Python."""
        parts = []
        for time, kind, first in zip(times, kinds, firsts, strict=True):
            packet = self.templates[kind]
            for hole in self.holes[kind]:
                packet = packet[:hole] + struct.pack("<q", values[first]) + packet[hole + HOLE_BYTES :]
                first += 1
            packet += bytes((TIMESTAMP_TAG,)) + varint(time)
            parts.append(bytes((PACKET_TAG,)) + varint(len(packet)) + packet)
        self.flush()
        self.write(b"".join(parts))

    def flush(self) -> None:
        """Write what has accumulated."""
        if self.used:
            used = self.used
            self.used = 0
            self.write(bytes(self.buffer[:used]))


@cython.ccall
def nested(
    outer_start: cython.longlong[::1],
    outer_end: cython.longlong[::1],
    inner_start: cython.longlong[::1],
    inner_end: cython.longlong[::1],
    order: cython.longlong[::1],
) -> cython.longlong:
    """Fill `order` with begins and ends of two rows of slices, so that the inner ones lie within the outer ones.

    An entry is 4 x the row + OUTER_BEGINS ... INNER_ENDS; returns how many there are. An inner slice belongs to the
    outer one in which it starts, or at whose end, if that is not the start of the next.
    """
    place: cython.longlong = 0
    outer: cython.longlong
    inner: cython.longlong = 0
    outers: cython.longlong = len(outer_start)
    inners: cython.longlong = len(inner_start)
    for outer in range(outers):
        while inner < inners and inner_start[inner] < outer_start[outer]:
            order[place] = 4 * inner + INNER_BEGINS
            order[place + 1] = 4 * inner + INNER_ENDS
            place += 2
            inner += 1
        order[place] = 4 * outer + OUTER_BEGINS
        place += 1
        while inner < inners and inner_end[inner] <= outer_end[outer]:
            order[place] = 4 * inner + INNER_BEGINS
            order[place + 1] = 4 * inner + INNER_ENDS
            place += 2
            inner += 1
        order[place] = 4 * outer + OUTER_ENDS
        place += 1
    while inner < inners:
        order[place] = 4 * inner + INNER_BEGINS
        order[place + 1] = 4 * inner + INNER_ENDS
        place += 2
        inner += 1
    return place


@cython.ccall
@cython.exceptval(-2, check=True)
def index_packets(data: cython.const[cython.uchar][::1], rows: cython.longlong[::1]) -> cython.longlong:
    """Find the packets of a trace; `rows` takes of each its begin, its end and its time stamp (ns; -1: none).

    Returns how many there are, those beyond the length of `rows` too; -1 when `data` is not a sequence of packets.
    """
    at: cython.longlong = 0
    end: cython.longlong
    place: cython.longlong
    tag: cython.longlong
    time: cython.longlong
    count: cython.longlong = 0
    size: cython.longlong = len(data)
    cursor: cython.longlong[2]
    if not cython.compiled:
        cursor = [0, 0]
    while at < size:
        cursor[0] = at
        tag = take_varint(data, cursor, size)
        end = take_varint(data, cursor, size)
        at = cursor[0]
        if tag != PACKET_TAG or end < 0 or end > size - at:
            return -1
        end += at
        time = -1
        place = at
        while place < end:
            cursor[0] = place
            tag = take_varint(data, cursor, end)
            if tag < 0:
                return -1
            if tag & 7 == 0:  # a varint
                time = take_varint(data, cursor, end) if tag == TIMESTAMP_TAG else time
                if tag != TIMESTAMP_TAG:
                    take_varint(data, cursor, end)
            elif tag & 7 == 2:  # a length and that many bytes
                place = take_varint(data, cursor, end)
                if place < 0:
                    return -1
                cursor[0] += place
            elif tag & 7 == 1:
                cursor[0] += 8
            elif tag & 7 == 5:
                cursor[0] += 4
            else:
                return -1
            place = cursor[0]
        if place != end:
            return -1
        if 3 * count + 3 <= len(rows):
            rows[3 * count] = at
            rows[3 * count + 1] = end
            rows[3 * count + 2] = time
        count += 1
        at = end
    return count


@cython.cfunc
@cython.exceptval(check=False)
def take_varint(
    data: cython.const[cython.uchar][::1], cursor: cython.p_longlong, end: cython.longlong
) -> cython.longlong:
    """The number of variable length at cursor[0], which moves past it; -1 when it does not end before `end`."""
    at: cython.longlong = cursor[0]
    value: cython.longlong = 0
    shift: cython.longlong = 0
    byte: cython.longlong  # as wide as the number, so that a shift loses nothing
    while at < end and shift < 63:
        byte = data[at]
        value |= (byte & 127) << shift
        if byte < 128:
            cursor[0] = at + 1
            return value
        shift += 7
        at += 1
    return -1
