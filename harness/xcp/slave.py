"""The XCP slave without a transport: a command packet in, an answer packet out; measurement lists when time passes.

Packets are those of ASAM MCD-1 XCP, part 2 (protocol layer 1.1), in Intel byte order. No clock, no socket, no robot:
the same commands at the same times give the same packets. The answer to an unserved command is ERR_CMD_UNKNOWN. A
master may write more than one packet holds: DOWNLOAD and the DOWNLOAD_NEXT after it are one write, with one answer.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Callable, Sequence
from typing import Protocol

# First byte of what the slave sends.
ANSWER, ERROR = 0xFF, 0xFE
LAST_PID = 0xFB  # of a measurement; above are answers, errors, events and service requests

# Error codes that we use.
ERR_CMD_SYNCH = 0x00
ERR_DAQ_ACTIVE = 0x11
ERR_CMD_UNKNOWN = 0x20
ERR_CMD_SYNTAX = 0x21
ERR_OUT_OF_RANGE = 0x22
ERR_ACCESS_DENIED = 0x24
ERR_MODE_NOT_VALID = 0x27
ERR_SEQUENCE = 0x29
ERR_DAQ_CONFIG = 0x2A
ERR_MEMORY_OVERFLOW = 0x30

CAL, DAQ = 0x01, 0x04  # resources
DAQ_RUNNING = 0x40  # of the session status
DAQ_PROPERTIES = 0x01 | 0x02 | 0x10  # lists are made by the master; prescalers; time stamps
TIMESTAMP_WANTED = 0x10  # of a list's mode
UNSERVED_MODES = 0x02 | 0x01 | 0x20 | 0x40  # stimulation, alternating display, no identifiers: refused
ADD_14 = 0x03  # checksum: bytes added up in 32 bits
ID_TEXT, ID_A2L_NAME = 0, 1
A2L_NAME = "ranger"  # of the file, without its ending
MASTER_BLOCKS = 0x01  # of the optional communication modes
MOST_BLOCK_BYTES = 255  # the limit of DOWNLOAD's count
A_DAQ_LIST, CONSISTENT = 0x04, 0x80  # an event's: for lists that measure, whose values are all of one time
MOST_LISTS = 32  # chosen by us: limits what one master can make the slave keep and sample
MOST_ENTRY_BYTES = 4
MOST_CHECKSUM_BYTES = 65536  # chosen by us, above the whole table


class XcpError(Exception):
    """A refused command: the master receives `code`, followed by `more`."""

    def __init__(self, code: int, more: bytes = b"") -> None:
        super().__init__(f"XCP error {code:#04x}")
        self.code, self.more = code, more


class Memory(Protocol):
    """The memory that is measured and changed. Both methods raise XcpError, and then nothing has changed."""

    def read(self, address: int, count: int) -> bytes:
        """Read `count` bytes from `address` on."""

    def write(self, address: int, data: bytes) -> None:
        """Write all of `data` from `address` on, or none of it."""


@dataclasses.dataclass(frozen=True)
class Clock:
    """Time stamps of a transport: `size` bytes, counting units of `unit_ns`; `unit_code` as in the standard."""

    size: int
    unit_code: int
    unit_ns: int

    def stamp(self, time_ns: int) -> int:
        """The count at `time_ns`, truncated to `size`."""
        return time_ns // self.unit_ns % (1 << 8 * self.size)


FINE = Clock(4, 3, 1_000)  # 1 us: wraps after 71 minutes
# A frame of 8 bytes holds identifier, stamp and one value only if the stamp has 2 bytes: wraps after 0.65 s,
# hundreds of times the slowest event's period.
SHORT = Clock(2, 4, 10_000)


@dataclasses.dataclass(frozen=True)
class Event:
    """When lists are sampled; unit codes as in the standard (5: 100 us)."""

    name: str
    period_ns: int
    cycle: int
    unit_code: int


EVENTS = (  # the slots of the boards (boards.toml)
    Event("slot_0_5ms", 500_000, 5, 5),
    Event("slot_1ms", 1_000_000, 10, 5),
    Event("slot_2ms", 2_000_000, 20, 5),
)


class _List:
    """A measurement list: ODTs of entries (address, bytes), its event, and whether it runs."""

    def __init__(self) -> None:
        self.tables: list[list[tuple[int, int]]] = []
        self.mode = 0
        self.event = 0
        self.prescaler = 1
        self.selected = self.running = False
        self.passed = 0  # events since it was started
        self.first_pid = 0


class Slave:
    """One slave for one master. `name`: the answer to GET_ID; `max_cto`, `max_dto`: packet bytes, 8 ... 255 and more.

    `command` answers; `sample` returns the packets of the lists that are due. `bears`: whether the transport can carry
    packets (bytes, shortest time between two in ns), all that would be measured at once; None: always.
    """

    def __init__(
        self,
        memory: Memory,
        max_cto: int = 8,
        max_dto: int = 8,
        clock: Clock = SHORT,
        name: str = "ranger_sim",
        bears: Callable[[Sequence[tuple[int, int]]], bool] | None = None,
    ) -> None:
        self.memory, self.max_cto, self.max_dto, self.clock, self.name = memory, max_cto, max_dto, clock, name
        self.bears = bears
        self.connected = False
        self.time_ns = 0
        self._forget()

    def _forget(self) -> None:
        """Reset to the state after power-up."""
        self.lists: list[_List] = []
        self.stage = ""  # of allocation: the last command
        self.pointer: tuple[int, int, int] | None = None
        self.address = 0
        self.text: bytes | None = None  # what UPLOAD reads instead of memory: a name that was asked for
        self.block: bytes | None = None  # the part received of a write in several packets
        self.block_bytes = 0  # and its total length

    @property
    def running(self) -> bool:
        """True while a list is measured."""
        return any(each.running for each in self.lists)

    # ---- commands

    def command(self, packet: bytes, time_ns: int) -> bytes:
        """The answer to a command at this virtual time, ns.

        No bytes while no master is connected, and for all but the last packet of a block.
        """
        self.time_ns = time_ns
        if not packet or (not self.connected and packet[0] != 0xFF):
            return b""
        if packet[0] != DOWNLOAD_NEXT:
            self.block = None
        entry = COMMANDS.get(packet[0])
        if entry is None or self.max_cto < SHORTEST_CTO.get(packet[0], 0):
            return bytes((ERROR, ERR_CMD_UNKNOWN))
        obey, length = entry
        if len(packet) < length or len(packet) > self.max_cto:
            return bytes((ERROR, ERR_CMD_SYNTAX))
        try:
            answer = bytes((ANSWER,)) + obey(self, packet)
        except XcpError as refused:
            return bytes((ERROR, refused.code)) + refused.more
        return b"" if self.block is not None else answer

    def _connect(self, packet: bytes) -> bytes:
        if packet[1] != 0:  # user-defined modes: not served
            raise XcpError(ERR_OUT_OF_RANGE)
        self._forget()
        self.connected = True
        return struct.pack("<BBBHBB", CAL | DAQ, 0x80, self.max_cto, self.max_dto, 1, 1)

    def _disconnect(self, packet: bytes) -> bytes:
        self._forget()
        self.connected = False
        return b""

    def _status(self, packet: bytes) -> bytes:
        return struct.pack("<BBBH", DAQ_RUNNING if self.running else 0, 0, 0, 0)

    def _synch(self, packet: bytes) -> bytes:
        raise XcpError(ERR_CMD_SYNCH)

    def _comm_mode(self, packet: bytes) -> bytes:
        # blocks from the master, without a pause between their packets; no interleaving; driver 1.0
        return bytes((0, MASTER_BLOCKS, 0, most_packets(self.max_cto), 0, 0, 0x10))

    def _identify(self, packet: bytes) -> bytes:
        self.text = {ID_TEXT: self.name, ID_A2L_NAME: A2L_NAME}.get(packet[1], "").encode()
        return struct.pack("<BHI", 0, 0, len(self.text))

    def _set_address(self, packet: bytes) -> bytes:
        self.address, self.text = _address(packet[3], packet, 4), None
        return b""

    def _read(self, count: int) -> bytes:
        """Read from the pointer on, and move it."""
        if self.text is not None:
            if count > len(self.text):
                raise XcpError(ERR_OUT_OF_RANGE)
            data, self.text = self.text[:count], self.text[count:]
            return data
        data = self.memory.read(self.address, count)
        self.address += count
        return data

    def _upload(self, packet: bytes) -> bytes:
        if not 0 < packet[1] < self.max_cto:
            raise XcpError(ERR_OUT_OF_RANGE)
        return self._read(packet[1])

    def _short_upload(self, packet: bytes) -> bytes:
        address = _address(packet[3], packet, 4)
        if not 0 < packet[1] < self.max_cto:
            raise XcpError(ERR_OUT_OF_RANGE)
        self.address, self.text = address, None
        return self._read(packet[1])

    def _write(self, data: bytes, count: int) -> bytes:
        if count == 0 or count > len(data):
            raise XcpError(ERR_CMD_SYNTAX)
        self.memory.write(self.address, data[:count])
        self.address += count
        return b""

    def _download(self, packet: bytes) -> bytes:
        if self.text is not None:
            raise XcpError(ERR_ACCESS_DENIED)
        if packet[1] > self.max_cto - 2 == len(packet) - 2:
            self.block, self.block_bytes = packet[2:], packet[1]
            return b""
        return self._write(packet[2:], packet[1])

    def _download_next(self, packet: bytes) -> bytes:
        block, self.block = self.block, None
        missing = self.block_bytes - len(block) if block is not None else 0
        if block is None or packet[1] != missing:
            raise XcpError(ERR_SEQUENCE, bytes((missing,)))
        if missing > self.max_cto - 2 == len(packet) - 2:
            self.block = block + packet[2:]
            return b""
        return self._write(block + packet[2 : 2 + missing], self.block_bytes)

    def _short_download(self, packet: bytes) -> bytes:
        self.address, self.text = _address(packet[3], packet, 4), None
        return self._write(packet[8:], packet[1])

    def _checksum(self, packet: bytes) -> bytes:
        count = int.from_bytes(packet[4:8], "little")
        if not 0 < count <= MOST_CHECKSUM_BYTES or self.text is not None:
            raise XcpError(ERR_OUT_OF_RANGE)
        return struct.pack("<BHI", ADD_14, 0, sum(self._read(count)) & 0xFFFFFFFF)

    # ---- lists

    def _list(self, number: int) -> _List:
        if number >= len(self.lists):
            raise XcpError(ERR_OUT_OF_RANGE)
        return self.lists[number]

    def _still(self) -> None:
        """Refuse a change of lists while one runs."""
        if self.running:
            raise XcpError(ERR_DAQ_ACTIVE)

    def _after(self, *stages: str) -> None:
        self._still()
        if self.stage not in stages:
            raise XcpError(ERR_SEQUENCE)

    def _free(self, packet: bytes) -> bytes:
        self.lists, self.pointer, self.stage = [], None, "free"
        return b""

    def _allocate_lists(self, packet: bytes) -> bytes:
        self._after("free")
        count = _word(packet, 2)
        if count > MOST_LISTS:
            raise XcpError(ERR_MEMORY_OVERFLOW)
        self.lists = [_List() for _ in range(count)]
        self.stage = "lists"
        return b""

    def _allocate_tables(self, packet: bytes) -> bytes:
        self._after("lists", "tables")
        wanted = self._list(_word(packet, 2))
        others = sum(len(each.tables) for each in self.lists if each is not wanted)
        if others + packet[4] > LAST_PID + 1:
            raise XcpError(ERR_MEMORY_OVERFLOW)
        wanted.tables = [[] for _ in range(packet[4])]
        first = 0
        for each in self.lists:
            each.first_pid = first
            first += len(each.tables)
        self.stage = "tables"
        return b""

    def _allocate_entries(self, packet: bytes) -> bytes:
        self._after("tables", "entries")
        tables = self._list(_word(packet, 2)).tables
        if packet[4] >= len(tables):
            raise XcpError(ERR_OUT_OF_RANGE)
        if packet[5] > self.max_dto - 1:
            raise XcpError(ERR_MEMORY_OVERFLOW)
        tables[packet[4]] = [(0, 0)] * packet[5]
        self.stage = "entries"
        return b""

    def _point(self, packet: bytes) -> bytes:
        self._still()
        number, table, entry = _word(packet, 2), packet[4], packet[5]
        tables = self._list(number).tables
        if table >= len(tables) or entry >= len(tables[table]):
            raise XcpError(ERR_OUT_OF_RANGE)
        self.pointer = number, table, entry
        return b""

    def _enter(self, packet: bytes) -> bytes:
        return self._put(packet[1], packet[2], packet[3], packet, 4)

    def _enter_several(self, packet: bytes) -> bytes:
        """Entries of eight bytes: bit, size, address, extension, one of padding."""
        if len(packet) < 2 + 8 * packet[1]:
            raise XcpError(ERR_CMD_SYNTAX)
        for at in range(2, 2 + 8 * packet[1], 8):
            self._put(packet[at], packet[at + 1], packet[at + 6], packet, at + 2)
        return b""

    def _put(self, bit: int, size: int, extension: int, packet: bytes, at: int) -> bytes:
        """Write one entry at the pointer, and move it."""
        self._still()
        if self.pointer is None:
            raise XcpError(ERR_SEQUENCE)
        address = _address(extension, packet, at)
        number, table, entry = self.pointer
        entries = self.lists[number].tables[table]
        if bit != 0xFF or not 0 < size <= MOST_ENTRY_BYTES:
            raise XcpError(ERR_OUT_OF_RANGE)
        self.memory.read(address, size)  # refused where there is nothing
        entries[entry] = (address, size)
        self.pointer = (number, table, entry + 1) if entry + 1 < len(entries) else None
        return b""

    def _set_mode(self, packet: bytes) -> bytes:
        self._still()
        wanted, event, prescaler = self._list(_word(packet, 2)), _word(packet, 4), packet[6]
        if packet[1] & UNSERVED_MODES:
            raise XcpError(ERR_MODE_NOT_VALID)
        if event >= len(EVENTS) or prescaler == 0:
            raise XcpError(ERR_OUT_OF_RANGE)
        wanted.mode, wanted.event, wanted.prescaler = packet[1] & TIMESTAMP_WANTED, event, prescaler
        return b""

    def _mode(self, packet: bytes) -> bytes:
        wanted = self._list(_word(packet, 2))
        state = wanted.mode | (0x01 if wanted.selected else 0) | (0x40 if wanted.running else 0)
        return struct.pack("<BHHBB", state, 0, wanted.event, wanted.prescaler, 0)

    def _may_run(self, wanted: _List) -> None:
        """Refuse a list whose packets are too long or, with all others, too many for the transport, or that has an
        entry left out."""
        left_out = any(size == 0 for entries in wanted.tables for _, size in entries)
        if not wanted.tables or left_out or any(size > self.max_dto for size, _ in self._packets(wanted)):
            raise XcpError(ERR_DAQ_CONFIG)
        if self.bears is not None:
            at_once = [each for each in self.lists if each.running or each.selected or each is wanted]
            if not self.bears([packet for each in at_once for packet in self._packets(each)]):
                raise XcpError(ERR_DAQ_CONFIG)

    def _packets(self, measured: _List) -> list[tuple[int, int]]:
        """(bytes, shortest time between two in ns) of each packet of a list."""
        period_ns = EVENTS[measured.event].period_ns * measured.prescaler
        stamps = [self.clock.size if measured.mode else 0] + [0] * (len(measured.tables) - 1)
        return [
            (1 + stamp + sum(size for _, size in entries), period_ns)
            for stamp, entries in zip(stamps, measured.tables, strict=True)
        ]

    def _start_list(self, packet: bytes) -> bytes:
        wanted = self._list(_word(packet, 2))
        if packet[1] == 0:
            wanted.running = wanted.selected = False
        elif packet[1] == 1:
            self._may_run(wanted)
            wanted.running, wanted.passed = True, 0
        elif packet[1] == 2:
            self._may_run(wanted)
            wanted.selected = True
        else:
            raise XcpError(ERR_MODE_NOT_VALID)
        return bytes((wanted.first_pid,))

    def _start_all(self, packet: bytes) -> bytes:
        if packet[1] > 2:
            raise XcpError(ERR_MODE_NOT_VALID)
        chosen = self.lists if packet[1] == 0 else [each for each in self.lists if each.selected]
        if packet[1] == 1:  # it may have been changed since it was selected
            for each in chosen:
                self._may_run(each)
        for each in chosen:
            if packet[1] == 1 and not each.running:
                each.passed = 0
            each.running, each.selected = packet[1] == 1, False
        return b""

    def _clock(self, packet: bytes) -> bytes:
        return struct.pack("<BHI", 0, 0, self.clock.stamp(self.time_ns))

    def _processor(self, packet: bytes) -> bytes:
        return struct.pack("<BHHBB", DAQ_PROPERTIES, MOST_LISTS, len(EVENTS), 0, 0)

    def _resolution(self, packet: bytes) -> bytes:
        mode = self.clock.size | self.clock.unit_code << 4
        return struct.pack("<BBBBBH", 1, MOST_ENTRY_BYTES, 1, 0, mode, 1)

    def _event(self, packet: bytes) -> bytes:
        number = _word(packet, 2)
        if number >= len(EVENTS):
            raise XcpError(ERR_OUT_OF_RANGE)
        event = EVENTS[number]
        self.text = event.name.encode()
        return bytes((A_DAQ_LIST | CONSISTENT, MOST_LISTS, len(self.text), event.cycle, event.unit_code, 0))

    def _list_info(self, packet: bytes) -> bytes:
        tables = self._list(_word(packet, 2)).tables
        most = max((len(entries) for entries in tables), default=0)
        return struct.pack("<BBBH", A_DAQ_LIST, len(tables), most, 0)

    # ---- time

    def sample(self, time_ns: int, since_start_ns: int) -> list[bytes]:
        """The packets of lists due at `time_ns`; events are multiples of their periods in `since_start_ns`."""
        packets: list[bytes] = []
        for each in self.lists:
            if not each.running or since_start_ns % EVENTS[each.event].period_ns:
                continue
            due = each.passed % each.prescaler == 0
            each.passed += 1
            if not due:
                continue
            for place, entries in enumerate(each.tables):
                packet = bytes((each.first_pid + place,))
                if place == 0 and each.mode:
                    packet += self.clock.stamp(time_ns).to_bytes(self.clock.size, "little")
                packets.append(packet + b"".join(self.memory.read(address, size) for address, size in entries))
        return packets


def _word(packet: bytes, at: int) -> int:
    return packet[at] | packet[at + 1] << 8


def _address(extension: int, packet: bytes, at: int) -> int:
    """The address in a packet; there is one memory, extension 0."""
    if extension != 0:
        raise XcpError(ERR_OUT_OF_RANGE)
    return int.from_bytes(packet[at : at + 4], "little")


def most_packets(max_cto: int) -> int:
    """The most packets of one write: as many as its longest block needs."""
    return -(-MOST_BLOCK_BYTES // (max_cto - 2))


DOWNLOAD_NEXT = 0xEF
# What a packet of CAN is too short for: SHORT_DOWNLOAD and WRITE_DAQ_MULTIPLE with one byte and one entry
SHORTEST_CTO = {0xED: 9, 0xC7: 10}
# Code of a command: its handler, and its least number of bytes.
COMMANDS: dict[int, tuple[Callable[[Slave, bytes], bytes], int]] = {
    0xFF: (Slave._connect, 2),
    0xFE: (Slave._disconnect, 1),
    0xFD: (Slave._status, 1),
    0xFC: (Slave._synch, 1),
    0xFB: (Slave._comm_mode, 1),
    0xFA: (Slave._identify, 2),
    0xF6: (Slave._set_address, 8),
    0xF5: (Slave._upload, 2),
    0xF4: (Slave._short_upload, 8),
    0xF3: (Slave._checksum, 8),
    0xF0: (Slave._download, 3),
    DOWNLOAD_NEXT: (Slave._download_next, 3),
    0xED: (Slave._short_download, 9),
    0xE2: (Slave._point, 6),
    0xE1: (Slave._enter, 8),
    0xE0: (Slave._set_mode, 8),
    0xDF: (Slave._mode, 4),
    0xDE: (Slave._start_list, 4),
    0xDD: (Slave._start_all, 2),
    0xDC: (Slave._clock, 1),
    0xDA: (Slave._processor, 1),
    0xD9: (Slave._resolution, 1),
    0xD8: (Slave._list_info, 4),
    0xD7: (Slave._event, 4),
    0xD6: (Slave._free, 1),
    0xD5: (Slave._allocate_lists, 4),
    0xD4: (Slave._allocate_tables, 5),
    0xD3: (Slave._allocate_entries, 6),
    0xC7: (Slave._enter_several, 2),
}
