"""Wrong bytes on the data link, both ways: the main brain keeps its slots, and the logging program keeps working.

One case is a pass of the main brain's table (22 ms) with a few bytes from the computer: noise, packets for any
identifier with any value, packets with a byte changed. What the board sends goes to a session of `ranger-sim daq`
with bytes changed, lost and added. Every byte must be accounted for on both sides.
"""

from __future__ import annotations

from typing import Any

from dev.fuzz import Finding
from ranger_sim.boards.main_brain.board import MainBrainBoard
from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.generated import mb as table
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.foundation.events import UART_BYTE, UART_OUTPUT
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.tools.robodaq.codec import SEGMENT_BYTES, write_packet
from ranger_sim.tools.robodaq.session import Session

PASS_NS = 22_000_000
SLOTS_PER_PASS = 11
FIRST_PARAMETER = table.LV_START


class Fuzz:
    """`case()` is one case; `counters()` the counts; Finding as soon as a check fails."""

    def __init__(self, seed: int = 1) -> None:
        self.stream: Any = RandomStream(seed, "serial fuzz")
        self.board: Any = MainBrainBoard(Crystal(), Quirks(), 0, "robust")
        self.board.computer.rate_sum = 40_960
        self.session = Session()
        self.session.select([], [])
        self.now_ns = 0
        self.cases = 0
        self.bytes_to_robot = 0
        self.bytes_from_robot = 0
        self.bytes_to_session = 0
        # let it walk: the machines then work with the values from the packets
        self.board.store.set_int(table.UI_BUTTONS, 2)
        self._advance()
        self.board.store.set_int(table.UI_BUTTONS, 0)

    def number(self, n: int) -> int:
        """Uniform in 0 ... n-1."""
        return int(self.stream.integer(n))

    def noise(self, count: int) -> bytes:
        return bytes(self.number(256) for _ in range(count))

    def packet(self) -> bytes:
        """To a parameter or anything else, with any value."""
        kind = self.number(3)
        last = all_variables.ID_OF_LAST
        identifier = (self.number(65536), self.number(last + 1), FIRST_PARAMETER + self.number(last - FIRST_PARAMETER))
        return write_packet(identifier[kind], self.number(1 << 32))

    def changed(self, data: bytes) -> bytes:
        """The bytes with one changed, lost, or added."""
        if not data:
            return data
        place, kind = self.number(len(data)), self.number(3)
        return data[:place] + (b"", self.noise(1), self.noise(2))[kind] + data[place + 1 :]

    def to_robot(self) -> bytes:
        """Bytes from the computer's side of the line in one case."""
        pieces = []
        for _ in range(self.number(4)):
            kind = self.number(4)
            piece = self.noise(self.number(20)) if kind == 0 else self.packet()
            pieces.append(self.changed(piece) if kind == 1 else piece)
        return b"".join(pieces)

    def case(self) -> None:
        """Some bytes in, a pass of the table, its bytes out."""
        data = self.to_robot() + self.session.outgoing(self.now_ns * 1e-9)
        uart, at = self.board.computer_uart, self.now_ns
        for i in range(0, len(data), 8):
            part = data[i : i + 8]
            at += len(part) * uart.byte_ns
            low, high = int.from_bytes(part[:4], "little"), int.from_bytes(part[4:], "little")
            self.board.inbox.push(at, 256, UART_BYTE, uart.number, part[0], len(part), low, high)
        self.bytes_to_robot += len(data)
        slots = self.board.scheduler.slot_count
        sent = self._advance()
        self.bytes_from_robot += len(sent)
        if self.number(2):
            sent = self.changed(sent)
        if self.number(50) == 0:
            sent = self.noise(self.number(3 * SEGMENT_BYTES)) + sent
        self.bytes_to_session += len(sent)
        self.session.receive(sent, self.now_ns * 1e-9)
        self.session.new_errors.clear()
        self.cases += 1
        self._check(slots)

    def _advance(self) -> bytes:
        self.now_ns += PASS_NS
        self.board.store.set_word(table.TIMESTAMP, self.now_ns // 1_000_000, self.now_ns // 1_000_000)
        self.board.advance(self.now_ns)
        out = self.board.outbox
        sent = []
        while out.take():
            if out.kind == UART_OUTPUT:
                sent.append(out.ref)
        return b"".join(sent)

    def _check(self, slots: int) -> None:
        link, uart, decoder = self.board.computer, self.board.computer_uart, self.session.decoder
        held = uart.filled + link.waiting()
        seen = 8 * link.packets + link.bad_packets + link.ring_full + uart.lost
        counted = decoder.segments * SEGMENT_BYTES + decoder.skipped_bytes + len(decoder.buffer)
        for what, is_so in (
            ("a slot of the main brain is missing", self.board.scheduler.slot_count == slots + SLOTS_PER_PASS),
            ("a slot took too long", self.board.scheduler.overruns == 0),
            ("bytes to the robot are not accounted for", seen + held == self.bytes_to_robot),
            ("bytes from the robot are not accounted for", counted == self.bytes_to_session),
        ):
            if not is_so:
                raise Finding(f"{what} (case {self.cases})")

    def counters(self) -> dict[str, int]:
        """Counts by name."""
        link = self.board.computer
        return {
            "cases": self.cases,
            "bytes_to_robot": self.bytes_to_robot,
            "bytes_from_robot": self.bytes_from_robot,
            "packets": link.packets,
            "refused": link.refused,
            "bad_packets": link.bad_packets,
            **{f"daq_{name}": count for name, count in self.session.counters().items()},
        }


def run(cases: int, seed: int = 1) -> dict[str, int]:
    """Run `cases` cases; returns the counters."""
    fuzz = Fuzz(seed)
    for _ in range(cases):
        fuzz.case()
    return fuzz.counters()
