"""Hostile masters at the XCP slave's UDP port: valid and nearly valid commands and noise, with a robot that stands.

After every case: no poll exceeded the table of limits, waiting answers and measurements are bounded and no longer than
the transport's packets, only parameters within their limits were written, and now and then a well-behaved master
connects and is answered.
"""

from __future__ import annotations

import contextlib
import socket
import struct
from typing import Any

from dev.fuzz import Finding
from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.datatable import parameters
from ranger_sim.datatable.addresses import BASE, address_of
from ranger_sim.datatable.packing import value_of_word
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.xcp.udp import MAX_CTO, MAX_DTO, POLL_NS, WAITING, XcpUdpServer
from ranger_sim.ranger.robot import Ranger

HEADER = struct.Struct("<HH")
FIRST_COMMAND = 0xC0  # of ASAM MCD-1 XCP part 2; lower codes are not commands
CASES_TO_CHECK = 50
LOOKS_TO_ANSWER = 20  # a second of the robot has 250 queries to the kernel, a poll takes 0.5 ms
POSITIVE, ERROR, EVENT, SERVICE = 0xFF, 0xFE, 0xFD, 0xFC


class Fuzz:
    """`case()` is one case; Finding as soon as a check fails."""

    def __init__(self, robot: Ranger, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "xcp fuzz")
        self.robot = robot
        self.server = XcpUdpServer(robot, 0)
        self.server.clock = lambda: self.now_ns * 1e-9
        self.server.asked_s = 0.0
        self.master = self._socket()
        self.now_ns = 0
        self.cases = self.answers = self.measurements = self.checked = 0
        self.table = robot.board("MB").memory
        self.others = [number for number, row in self.server.memory.by_id.items() if not parameters.is_parameter(row)]
        self.before = [self.table[number] for number in self.others]
        self.bytes_of_table = address_of(max(self.server.memory.by_id) + 1) - BASE

    def _socket(self) -> socket.socket:
        master = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        master.connect(("127.0.0.1", self.server.port))
        master.setblocking(False)
        return master

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def noise(self, most: int) -> bytes:
        return bytes(self.number(256) for _ in range(self.number(most)))

    def packet(self) -> bytes:
        """A command: its numbers small, or addresses of the table, or anything."""
        code = FIRST_COMMAND + self.number(0x40)
        kind = self.number(6)
        if kind == 0:
            return bytes([self.number(256)]) + self.noise(MAX_CTO + 8)
        body = bytearray(bytes([code]) + bytes(7))
        for place in range(1, 8):
            body[place] = self.number(4) if kind < 4 else self.number(256)
        if kind in (2, 3):
            body[4:8] = (BASE + self.number(self.bytes_of_table + 8)).to_bytes(4, "little")
        return bytes(body[: 1 + self.number(8)]) if self.number(4) == 0 else bytes(body)

    def measuring(self) -> bytes:
        """All commands that start a measurement, perhaps with one byte changed; lengths and numbers of lists vary."""
        lists, words = 1 + self.number(3), 1 + self.number(12)
        packets = [b"\xff\x00", b"\xd6", struct.pack("<BBH", 0xD5, 0, lists)]  # CONNECT, FREE_DAQ, ALLOC_DAQ
        packets += [struct.pack("<BBHB", 0xD4, 0, each, 1) for each in range(lists)]  # ALLOC_ODT
        packets += [struct.pack("<BBHBB", 0xD3, 0, each, 0, words) for each in range(lists)]  # ALLOC_ODT_ENTRY
        for each in range(lists):
            packets.append(struct.pack("<BBHBB", 0xE2, 0, each, 0, 0))  # SET_DAQ_PTR
            for _ in range(words):  # WRITE_DAQ
                packets.append(
                    struct.pack("<BBBBI", 0xE1, 0xFF, 4, 0, BASE + 4 * self.number(self.bytes_of_table // 4))
                )
            packets.append(struct.pack("<BBHHBB", 0xE0, 0x10, each, self.number(3), 1, 0))  # SET_DAQ_LIST_MODE
            packets.append(struct.pack("<BBH", 0xDE, 1, each))  # START_STOP_DAQ_LIST
        data = bytearray(b"".join(HEADER.pack(len(packet), 0) + packet for packet in packets))
        if self.number(2):
            data[self.number(len(data))] = self.number(256)
        return bytes(data)

    def datagram(self) -> bytes:
        """Packets with their heads, some of them wrong."""
        data = b""
        for _ in range(1 + (self.number(40) if self.number(20) == 0 else self.number(3))):
            packet = self.packet()
            length = self.number(400) if self.number(30) == 0 else len(packet)
            data += HEADER.pack(length, self.number(65536)) + packet
        if self.number(30) == 0:
            data = data[: self.number(len(data) + 1)]
        return data[:60_000]

    def case(self) -> None:
        """One datagram of a hostile master, and a poll."""
        self.cases += 1
        what = self.number(60)
        if what == 0:
            self.master.close()
            self.master = self._socket()
        with contextlib.suppress(OSError):
            self.master.send(self.noise(300) if what == 1 else self.measuring() if what < 6 else self.datagram())
        self.look()
        if self.cases % CASES_TO_CHECK == 0:
            self.well_behaved()

    def look(self) -> list[bytes]:
        """Advance a little time and poll; returns every packet sent back."""
        self.now_ns += POLL_NS
        before = self.server.totals["commands"]
        self.server.sample(self.now_ns)
        self.server.poll(self.now_ns)
        if self.server.totals["commands"] - before > LIMITS["xcp-udp"].burst:
            raise Finding(f"more commands in a poll than the table allows (case {self.cases})")
        if len(self.server.waiting) > WAITING:
            raise Finding(f"measurements pile up (case {self.cases})")
        found = []
        while True:
            try:
                data = self.master.recv(4096)
            except OSError:
                break
            length = HEADER.unpack_from(data)[0]
            packet = data[HEADER.size :]
            if length != len(packet) or not packet:
                raise Finding(f"an answer of {len(packet)} bytes says {length} (case {self.cases})")
            of_command = packet[0] >= SERVICE
            if len(packet) > (MAX_CTO if of_command else MAX_DTO):
                raise Finding(f"an answer of {len(packet)} bytes is longer than was agreed (case {self.cases})")
            self.answers += of_command
            self.measurements += not of_command
            found.append(packet)
        self.written()
        return found

    def written(self) -> None:
        """Check that only parameters have changed, each within its limits."""
        if any(self.table[number] != word for number, word in zip(self.others, self.before, strict=True)):
            raise Finding(f"a variable that is not a parameter was written (case {self.cases})")
        if self.cases % CASES_TO_CHECK:
            return
        for row in parameters.parameters():
            try:
                parameters.checked_word(row, value_of_word(row.type, self.table[row.id]))
            except UserError as fault:
                raise Finding(f"{fault} (case {self.cases})") from fault

    def well_behaved(self) -> None:
        """The same program ends its session, connects and requests the status: it must be answered."""
        for _ in range(100):  # remaining answers to hostile datagrams come first
            if not self.server.left_over and not self.server.rest:
                break
            self.look()
        for command, answer in ((b"\xfe", None), (b"\xff\x00", POSITIVE), (b"\xfd", POSITIVE)):
            heard: list[int] = []
            for _ in range(LOOKS_TO_ANSWER if answer is not None else 1):  # queries to the kernel are limited
                self.master.send(HEADER.pack(len(command), 0) + command)
                heard += [packet[0] for packet in self.look()]
                if answer in heard:
                    break
            if answer is not None and answer not in heard:
                raise Finding(f"a well-behaved master is not answered (case {self.cases}): {heard[:8]}")
        self.checked += 1

    def counted(self) -> dict[str, int]:
        """Counts by name."""
        server = self.server
        return {
            "cases": self.cases,
            "commands": server.totals["commands"],
            "answers": self.answers,
            "measurements": self.measurements,
            "well_behaved_answered": self.checked,
            "writes_refused": server.memory.refused,
            **{f"sent_away_{reason}": count for reason, count in server.sent_away.items()},
        }

    def close(self) -> None:
        """Close the sockets."""
        self.master.close()
        self.server.close()


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counts."""
    with contextlib.closing(Ranger()) as robot:
        robot.run_for(0.05)  # its program has written its parameters
        fuzz = Fuzz(robot, seed)
        with contextlib.closing(fuzz):
            for _ in range(cases):
                fuzz.case()
            return fuzz.counted()
