"""Faults on the serial lines: the link of router and main brain, the inertial unit's, the computer's."""

from typing import Any

from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, Place, WholeNumber
from ranger_sim.ranger.faults.catalogue import CATALOGUE

LINK = "serial link"
SERIAL = "serial line"
SEGMENT_BITS = 31 * 16  # half-words of a segment, the last one its checksum (robot.md N1.6)
EVERY = WholeNumber("every", "exchanges", 1, 1, 1e6, "every n-th exchange", "chosen by us: each of them")
SHARE = Parameter("share", "1", 1.0, 0.0, 1.0, "chance of each, by the fault's own seeded stream", "chosen by us: all")

CATALOGUE.add_places(
    (
        Place("CSR.ssp", LINK, "what the router receives from the main brain", {"slave": False}),
        Place("MB.ssp", LINK, "what the main brain receives from the router", {"slave": True}),
        Place("UI.serial", SERIAL, "the inertial unit's line to the user interface board", {"board": "UI"}),
        Place("MB.serial", SERIAL, "the main brain's line to the computer, what it sends", {"board": "MB"}),
    )
)


class LinkFault(Fault):
    """A fault in exchanges of the link. Clear after the first exchange that arrives as it was sent."""

    kinds = (LINK,)
    needs = "the serial link of router and main brain"
    unit = "segments"

    def connect(self) -> None:
        loop = self.robot.loop
        self.link: Any = loop.wires[loop.place("CSR")].link
        self.to_slave = self.place.details["slave"]  # the main brain is the slave of the exchanges
        self.count = 0

    def claims(self) -> tuple[str, ...]:
        """The link: both ends' places share it."""
        return ("the link of router and main brain",)

    def begin(self, now_ns: int) -> None:
        self.link.tampering = self

    def finish(self, now_ns: int) -> None:
        self.link.tampering = None
        self.exchanges = self.link.exchanges

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        return bool(self.link.exchanges > self.exchanges)

    def exchange(self, end_ns: int, to_slave: Any, to_master: Any) -> tuple[Any, Any]:
        """What arrives on both sides of an exchange that ends at `end_ns`."""
        self.count += 1
        if self.count % int(self.values["every"]) or self.random.uniform() >= self.values["share"]:
            return to_slave, to_master
        self.note(end_ns, 1.0)
        return self.changed(to_slave, to_master)

    def changed(self, to_slave: Any, to_master: Any) -> tuple[Any, Any]:
        """Change an exchange that was picked."""
        raise NotImplementedError


@mode
class FlippedBit(LinkFault):
    """A bit of a segment arrives inverted, so that its checksum is wrong: the receiver drops the whole segment.

    The router skips a segment that begins with a zero half-word, an empty one, without checking its checksum.
    """

    mode = "checksum"
    meaning = "receives segments with a bit inverted, so that their checksum is wrong"
    parameters = (
        WholeNumber(
            "bit",
            "1",
            20,
            0,
            SEGMENT_BITS - 1,
            "from the segment's begin, highest first",
            "chosen by us: data",
        ),
        EVERY,
        SHARE,
    )

    def changed(self, to_slave: Any, to_master: Any) -> tuple[Any, Any]:
        if self.to_slave:
            return self._flipped(to_slave), to_master
        return to_slave, self._flipped(to_master)

    def _flipped(self, segment: Any) -> Any:
        word, bit = divmod(int(self.values["bit"]), 16)
        half_words = segment.words
        half_words[word] ^= 0x8000 >> bit
        copy: Any = SspSegment()
        copy.words = half_words
        copy.used = segment.used
        return copy


@mode
class MissingExchange(LinkFault):
    """An exchange that never completes at this end: no segment, no interrupt. The other end gets its own."""

    mode = "missing"
    meaning = "does not have the segment of an exchange"
    parameters = (EVERY, SHARE)

    def changed(self, to_slave: Any, to_master: Any) -> tuple[Any, Any]:
        return (None, to_master) if self.to_slave else (to_slave, None)


class DeafLine:
    """Replaces the receiver of a board's UART while its line is broken. `line`: the receiver before and after."""

    def __init__(self, line: Any, fault: Fault) -> None:
        self.line = line
        self.fault = fault

    def from_board(self, time: int, byte: int, count: int, data: Any) -> None:
        """Discard the bytes."""
        self.fault.note(time, max(count, 1))


@mode
class DropOut(Fault):
    """A broken line: no byte arrives. Lost at the inertial unit: both directions; at the computer: the robot's."""

    mode = "drop_out"
    kinds = (SERIAL,)
    needs = "a serial line"
    meaning = "carries no bytes"
    unit = "bytes"

    def connect(self) -> None:
        loop = self.robot.loop
        board = self.place.details["board"]
        self.lines: dict[int, Any] = loop.wires[loop.place(board)].serial_lines
        self.imu_wire: Any = loop.serial_device if board == "UI" else None
        if not self.lines:
            raise FaultError(f"fault {self.text()}: nothing is connected to this line, so its bytes cannot be missed")
        if self.imu_wire is not None and not self.imu_wire.plugged:
            raise FaultError(f"fault {self.text()}: another unit outside replaces the emulated one")

    def begin(self, now_ns: int) -> None:
        for uart, line in list(self.lines.items()):
            self.lines[uart] = DeafLine(line, self)
        if self.imu_wire is not None:
            self.imu_wire.plugged = False

    def after(self, start_ns: int, end_ns: int) -> None:
        if self.imu_wire is not None and self.imu_wire.imu.bytes.count:
            self.note(end_ns, self.imu_wire.imu.bytes.count)

    def finish(self, now_ns: int) -> None:
        for uart, line in list(self.lines.items()):
            if isinstance(line, DeafLine):
                self.lines[uart] = line.line
        if self.imu_wire is not None:
            self.imu_wire.plugged = True
