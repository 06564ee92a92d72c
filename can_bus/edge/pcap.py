"""Packet captures of SocketCAN: pcap and pcapng, as tcpdump and Wireshark write them.

Sources: the Internet drafts draft-ietf-opsawg-pcap and -pcapng for the files, and tcpdump's list of link types for the
packets. No library on the package index reads both files with SocketCAN's link types and is maintained.
"""

import dataclasses
import struct
from collections.abc import Iterator
from typing import BinaryIO

from ranger_sim.can_bus.edge.candump import FD_BRS, FD_ESI
from ranger_sim.can_bus.edge.log_kinds import CAPTURE_NG, CAPTURE_NS, CAPTURES
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI
from ranger_sim.foundation.user_error import DataError

BYTE_ORDER = 0x1A2B3C4D  # in the first block of a pcapng file
INTERFACE, SIMPLE, ENHANCED = 1, 3, 6  # types of blocks
OPTION_NAME, OPTION_RESOLUTION, OPTION_OFFSET = 2, 9, 14  # of an interface
SOCKETCAN, COOKED, COOKED_2 = 227, 113, 276  # link types: a CAN interface, and "any" interface of Linux
PROTOCOL_CAN, PROTOCOL_CAN_FD = 0x000C, 0x000D  # of packets of any interface
LARGEST_PACKET = 1 << 20  # bytes; a CAN frame has 16 to 72
CAN_FD_FLAG, CAN_XL_FLAG = 0x04, 0x80  # in the byte behind the length; of CAN XL in the length's place
SECOND_NS = 1_000_000_000


@dataclasses.dataclass(frozen=True)
class Packet:
    """A captured CAN frame. word: identifier with SocketCAN's flags; is_whole: nothing of it was cut off. switches:
    FLAG_BRS and FLAG_ESI of a CAN FD frame."""

    bus: str
    time_ns: int
    word: int
    data: bytes
    is_fd: bool = False
    is_whole: bool = True
    switches: int = 0


class CutOffError(Exception):
    """The file ends within a packet."""


@dataclasses.dataclass
class _Interface:
    link: int
    name: str = ""
    per_second: int = 1_000_000
    offset_s: int = 0


def packets(file: BinaryIO, name: str) -> Iterator[Packet]:
    """The CAN frames of a capture. name: of the file, for messages.

    DataError for a capture of another kind; CutOffError where the file ends within a packet.
    """
    first = file.read(4)
    yield from (_next_generation(file, name) if first == CAPTURES[-1] else _classic(file, name, first))


def _exactly(file: BinaryIO, count: int) -> bytes:
    content = file.read(count)
    if len(content) < count:
        raise CutOffError
    return content


def _classic(file: BinaryIO, name: str, magic: bytes) -> Iterator[Packet]:
    order = "<" if magic in CAPTURES[0::2] else ">"
    nanoseconds = struct.unpack(order + "I", magic)[0] == CAPTURE_NS
    link = struct.unpack(order + "HHiIII", _exactly(file, 20))[5] & 0xFFFF
    interface = _Interface(link, "", per_second=SECOND_NS if nanoseconds else 1_000_000)
    _check_link(name, link)
    while head := file.read(16):
        if len(head) < 16:
            raise CutOffError
        seconds, part, size, original = struct.unpack(order + "IIII", head)
        time_ns = seconds * SECOND_NS + part * (SECOND_NS // interface.per_second)
        packet = _packet(interface, order, time_ns, _content(file, name, size), size == original)
        if packet is not None:
            yield packet


def _content(file: BinaryIO, name: str, size: int) -> bytes:
    if size > LARGEST_PACKET:
        raise DataError(f"{name}: a packet of {size} bytes, allowed are {LARGEST_PACKET}: the capture is broken")
    return _exactly(file, size)


def _next_generation(file: BinaryIO, name: str) -> Iterator[Packet]:
    kind, order = CAPTURE_NG, "<"
    interfaces: list[_Interface] = []
    while True:
        length_bytes = _exactly(file, 4)
        if kind == CAPTURE_NG:  # a section; its byte order is in its body
            mark = _exactly(file, 4)
            order = "<" if int.from_bytes(mark, "little") == BYTE_ORDER else ">"
            interfaces = []
            size = struct.unpack(order + "I", length_bytes)[0]
            _content(file, name, max(0, size - 12))
        else:
            size = struct.unpack(order + "I", length_bytes)[0]
            body = _content(file, name, max(0, size - 8))
            if kind == INTERFACE:
                interfaces.append(_interface(body, order))
            elif kind in (ENHANCED, SIMPLE):
                packet = _of_block(kind, body, order, interfaces, name)
                if packet is not None:
                    yield packet
        head = file.read(4)
        if not head:
            return
        if len(head) < 4:
            raise CutOffError
        kind = struct.unpack(order + "I", head)[0]


def _interface(body: bytes, order: str) -> _Interface:
    found = _Interface(struct.unpack(order + "H", body[:2])[0])
    place = 8
    while place + 4 <= len(body):
        code, size = struct.unpack(order + "HH", body[place : place + 4])
        value = body[place + 4 : place + 4 + size]
        if code == 0:
            break
        if code == OPTION_NAME:
            found.name = value.decode("utf-8", errors="replace")
        elif code == OPTION_RESOLUTION and value:
            found.per_second = 2 ** (value[0] & 0x7F) if value[0] & 0x80 else 10 ** value[0]
        elif code == OPTION_OFFSET and len(value) == 8:
            found.offset_s = struct.unpack(order + "q", value)[0]
        place += 4 + size + -size % 4
    return found


def _of_block(kind: int, body: bytes, order: str, interfaces: list[_Interface], name: str) -> Packet | None:
    if kind == SIMPLE:
        raise DataError(f"{name}: its packets have no stamps (simple packet blocks of pcapng)")
    number, high, low, size, original = struct.unpack(order + "IIIII", body[:20])
    if number >= len(interfaces):
        raise DataError(f"{name}: a packet of interface {number}, and {len(interfaces)} are described")
    interface = interfaces[number]
    _check_link(name, interface.link)
    ticks = high << 32 | low
    time_ns = ticks * SECOND_NS // interface.per_second + interface.offset_s * SECOND_NS
    return _packet(interface, order, time_ns, body[20 : 20 + size], size == original)


def _check_link(name: str, link: int) -> None:
    if link not in (SOCKETCAN, COOKED, COOKED_2):
        raise DataError(
            f"{name}: a capture of link type {link}, not of CAN ({SOCKETCAN}: SocketCAN; {COOKED}, {COOKED_2}: any "
            "interface of Linux)"
        )


def _packet(interface: _Interface, order: str, time_ns: int, content: bytes, is_whole: bool) -> Packet | None:
    """A CAN frame; None for a packet of another protocol. order: of the capturing computer, for any interface."""
    bus, word_order = interface.name, ">"
    protocol = 0
    if interface.link == COOKED:
        protocol = int.from_bytes(content[14:16], "big")
        content, word_order = content[16:], order
    elif interface.link == COOKED_2:
        protocol = int.from_bytes(content[:2], "big")
        bus = bus or f"interface{int.from_bytes(content[4:8], 'big')}"
        content, word_order = content[20:], order
    if interface.link != SOCKETCAN and protocol not in (PROTOCOL_CAN, PROTOCOL_CAN_FD):
        return None
    if len(content) < 8:
        return Packet(bus, time_ns, 0, b"", is_whole=False)
    word = struct.unpack(word_order + "I", content[:4])[0]
    length, flags = content[4], content[5]
    if length & CAN_XL_FLAG:
        return Packet(bus, time_ns, word, b"", is_whole=False)
    is_fd = protocol == PROTOCOL_CAN_FD or bool(flags & CAN_FD_FLAG) or length > 8
    data = content[8 : 8 + length]
    switches = (FLAG_BRS if flags & FD_BRS else 0) | (FLAG_ESI if flags & FD_ESI else 0) if is_fd else 0
    return Packet(bus, time_ns, word, data, is_fd, is_whole and len(data) == length, switches)
