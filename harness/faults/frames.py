"""Faults at a CAN controller of a board: errors that it sees in frames, and what its program receives of them.

The errors have the names of FMI-LS-BUS. The node that misreads a bit sees its error first (primary); the others see one
because of its error flag (secondary). The controllers produce counters, flags, repetitions and bus-off themselves.
"""

from typing import Any, ClassVar

from ranger_sim.can_bus import rewiring, tampering
from ranger_sim.can_bus.frame import wire
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.foundation.user_error import FaultError, UserError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, WholeNumber
from ranger_sim.harness.faults.kinds import CONTROLLER
from ranger_sim.harness.faults.names import ANY, identifier_of, name_parameter
from ranger_sim.harness.faults.reach import controller_of, reaching_into, wake_buses

FRAME = name_parameter("frame", ANY, "variable or identifier of the frames; any: all of them", "the master table")
EVERY = WholeNumber("every", "frames", 1, 1, 1e6, "every n-th of these frames", "chosen by us: each of them")
COUNT = WholeNumber(
    "count",
    "frames",
    0,
    0,
    1e9,
    "so many at most; 0: until the fault ends",
    "chosen by us: no end",
)
SHARE = Parameter("share", "1", 1.0, 0.0, 1.0, "chance of each, by the fault's own seeded stream", "chosen by us: all")


class ControllerFault(Fault):
    """A fault at one controller. Clear when all on its bus take part and their counters are back at their values."""

    kinds = (CONTROLLER,)
    needs = "a CAN controller"

    def connect(self) -> None:
        details = self.place.details
        self.bus, self.node, self.wires, self.controller = controller_of(
            self.robot, details["board"], details["bus"], f"fault {self.text()}"
        )

    @property
    def controller_node(self) -> Any:
        """The controller's node on its bus."""
        return self.bus.nodes[self.node]

    def counters(self) -> list[int]:
        """Error counters of all nodes of the bus."""
        return [count for node in self.bus.nodes for count in (node.transmit_errors, node.receive_errors)]

    def begin(self, now_ns: int) -> None:
        self.counters_before = self.counters()

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the error counters are back; they fall by one with each good frame."""
        calm = all(now <= before for now, before in zip(self.counters(), self.counters_before, strict=False))
        return calm and all(node.mode == OPERATING or node.index >= len(self.nodes()) for node in self.bus.nodes)

    def nodes(self) -> list[Any]:
        """The machine's own controllers on this bus, which are first there."""
        return [wire for wire in self.robot.wiring.can if wire.bus == self.place.details["bus"]]


class FrameFault(ControllerFault):
    """A fault that picks frames: by name, every n-th, by chance, a number of them."""

    parameters: ClassVar[tuple[Parameter, ...]] = (FRAME, EVERY, COUNT, SHARE)

    def connect(self) -> None:
        ControllerFault.connect(self)
        self.identifier = identifier_of(self.robot, self.values["frame"], f"fault {self.text()}")
        self.tamper = self.made()
        self.tamper.every = int(self.values["every"])
        self.tamper.count = int(self.values["count"])
        self.tamper.share = self.values["share"]
        self.tamper.random = self.random
        self.tamper.noted = self.note

    def made(self) -> tampering.Tamper:
        """Its effect on the bus."""
        raise NotImplementedError

    def claims(self) -> tuple[str, ...]:
        """Its frames: faults of other frames may act at the same time."""
        return (f"{self.place.name}:{self.mode} of frame {self.values['frame']}",)

    def begin(self, now_ns: int) -> None:
        ControllerFault.begin(self, now_ns)
        tampering.tampering_of(self.bus).add(self.tamper)

    def finish(self, now_ns: int) -> None:
        self.bus.tampering.remove(self.tamper)


class ErrorFault(FrameFault):
    """One of the errors of FMI-LS-BUS, seen by this controller first. `seen`: by each node (`tampering.Misreading`)."""

    unit = "errors"
    tamper: Any

    def made(self) -> tampering.Tamper:
        of_sender = self.values["sender"] != 0.0
        try:
            made = tampering.Misreading(self.mode, self.node, of_sender, self.identifier)
        except UserError as reason:
            raise FaultError(f"fault {self.text()}: {reason}") from None
        if self.mode == "BIT_STUFFING" and of_sender and self.identifier >= 0:
            if not tampering.places_of_error(self.mode, True, *wire(self.identifier, 8, 0, 0)):
                raise FaultError(
                    f"fault {self.text()}: identifier {self.identifier:#x} has no recessive stuff bit in its"
                    " arbitration field, the only place where its sender can see this error"
                )
        return made

    @property
    def seen(self) -> dict[tuple[str, str, str], int]:
        """How often which board saw which error, primary or secondary: {(board, error, rank): count}."""
        assert isinstance(self.tamper, tampering.Misreading)
        return dict(self.tamper.seen)


def _error_mode(error: str, sends: int, meaning: str) -> type[Fault]:
    """The mode of one error; `sends`: whether its node is by default the sender of the frame."""
    sender = WholeNumber(
        "sender",
        "1",
        sends,
        0,
        1,
        "1: in frames that it sends, 0: in those that it receives",
        "FMI-LS-BUS: IsSender",
    )
    fields = {
        "mode": error,
        "meaning": meaning,
        "parameters": (FRAME, sender, EVERY, COUNT, SHARE),
        "__doc__": f"{error}: it {meaning}.",
    }
    return mode(type(f"{error.title().replace('_', '')}Error", (ErrorFault,), fields))


ERROR_MODES = {
    error: _error_mode(error, sends, meaning)
    for error, sends, meaning in (
        ("BIT", 1, "samples the opposite of the bit that it sends"),
        ("BIT_STUFFING", 0, "samples six equal bits where five are the most"),
        ("FORM", 0, "samples a dominant CRC delimiter"),
        ("CRC", 0, "reads a frame whose CRC is wrong"),
        ("ACK", 1, "sends a frame that nobody seems to acknowledge"),
        ("BROKEN_ERROR_FRAME", 1, "sees an error, and its error flag broken in the third bit"),
    )
}


class Reception(FrameFault):
    """Its program receives good frames differently: after the transceiver and the check of the CRC."""

    def finish(self, now_ns: int) -> None:
        FrameFault.finish(self, now_ns)
        self.received = self.controller_node.received

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the next frame has arrived as it was sent."""
        return bool(self.controller_node.received > self.received)


@mode
class Loss(Reception):
    """Frames are acknowledged and lost after the receive path: an acceptance filter or a buffer that failed."""

    mode = "loss"
    meaning = "acknowledges frames that its program never has"
    unit = "frames"

    def made(self) -> tampering.Tamper:
        return tampering.Loss(self.node, self.identifier)


@mode
class Corruption(Reception):
    """Other data than was sent, unnoticed.

    On the wire the CRC finds all errors of up to five bits (CAN Specification 2.0, 3.1.1: Hamming distance 6), so such
    data comes from a controller's memory or from a router that copies frames; it acts after the check here.
    """

    mode = "corruption"
    meaning = "has other data than was sent, which no CRC can find"
    unit = "frames"
    parameters = (
        *FrameFault.parameters,
        WholeNumber(
            "bit",
            "1",
            22,
            0,
            31,
            "of the value's word, that is inverted",
            "chosen by us: a float's top digit",
        ),
    )

    def made(self) -> tampering.Tamper:
        return tampering.Corruption(self.node, 1 << int(self.values["bit"]), self.identifier)


@mode
class Delay(Reception):
    """Frames reach the program late, as through a slow gateway; later ones may overtake them."""

    mode = "delay"
    meaning = "has frames later than they came"
    unit = "us"
    parameters = (
        *FrameFault.parameters,
        Parameter("late_us", "us", 2000.0, 1.0, 1e6, "by how much", "chosen by us: four slots of a motor board"),
    )

    def made(self) -> tampering.Tamper:
        return tampering.Delay(self.node, round(1000 * self.values["late_us"]), self.identifier)


@mode
class BusOff(ControllerFault):
    """Bit errors in all that it sends until it is bus-off; its program and the bus make its recovery."""

    mode = "bus_off"
    meaning = "is driven bus-off by bit errors in the frames that it sends"
    unit = "times"
    parameters = (
        WholeNumber("times", "1", 1, 1, 1000, "so often, each time after its recovery", "chosen by us: once"),
    )

    def begin(self, now_ns: int) -> None:
        ControllerFault.begin(self, now_ns)
        self.silence()

    def silence(self) -> None:
        """Disturb it once more."""
        self.tamper = tampering.Silence(self.node)
        self.tamper.noted = self.note
        tampering.tampering_of(self.bus).add(self.tamper)

    def before(self, now_ns: int) -> None:
        if self.tamper.count and self.acted_count < self.values["times"] and self.controller_node.mode == OPERATING:
            self.bus.tampering.remove(self.tamper)
            self.silence()

    def finish(self, now_ns: int) -> None:
        self.bus.tampering.remove(self.tamper)


@mode
class WrongBitRate(ControllerFault):
    """A wrong prescaler in CxBTR: its bits are longer or shorter than the other nodes'."""

    mode = "bit_rate"
    meaning = "runs at another bit rate than its bus"
    unit = "errors"
    parameters = (
        Parameter(
            "rate", "bit/s", 2e6, 1e3, 1e8, "of this controller",
            "60 MHz over ten quanta with BRP one too high: 2 Mbit/s; limits: can_bus/rewiring.py",
        ),
    )  # fmt: skip

    def connect(self) -> None:
        ControllerFault.connect(self)
        rewiring.check_rate(self.bus, int(self.values["rate"]), f"fault {self.text()}")

    def begin(self, now_ns: int) -> None:
        ControllerFault.begin(self, now_ns)
        self.tamper = tampering.WrongRate(self.controller_node)
        self.tamper.noted = self.note
        tampering.tampering_of(self.bus).add(self.tamper)
        self._set(int(self.values["rate"]), now_ns)

    def finish(self, now_ns: int) -> None:
        self._set(0, now_ns)
        self.bus.tampering.remove(self.tamper)

    def _set(self, rate: int, now_ns: int) -> None:
        with reaching_into(self.robot, self.place.details["board"], now_ns):
            rewiring.set_rate_of(self.bus, self.node, rate, now_ns)
        wake_buses(self.robot, now_ns)


@mode
class CutCable(ControllerFault):
    """The cable between this controller and the other nodes is cut: each side receives and acknowledges only itself.

    On a bus of three boards that is a cut of this board's stub. The record of the bus, its loads and counters are those
    of the remaining side; `far` has the other side's.
    """

    mode = "cut"
    meaning = "is cut off from the other nodes of its bus"
    unit = "attempts to send across"

    def begin(self, now_ns: int) -> None:
        ControllerFault.begin(self, now_ns)
        self.cut = rewiring.Cut(self.bus, self.node)
        self.far = self.cut.part(now_ns)
        self._lead_to(self.far, 0, now_ns)
        loop = self.robot.loop
        self.far.wake(loop.due, len(loop.boards))
        loop.buses = [*loop.buses, self.far]
        self.attempts = self._attempts()

    def _lead_to(self, bus: Any, node: int, now_ns: int) -> None:
        """Connect the board's wires to a node of another piece of the cable."""
        with reaching_into(self.robot, self.place.details["board"], now_ns):
            self.wires.connect_bus(self.controller, bus, node)
        wake_buses(self.robot, now_ns)

    def _attempts(self) -> int:
        return int(sum(bus.counters.frames + bus.counters.errors for bus in (self.bus, self.far)))

    def before(self, now_ns: int) -> None:
        new = self._attempts() - self.attempts
        if new:
            self.attempts += new
            self.note(now_ns, new)

    def finish(self, now_ns: int) -> None:
        self.before(now_ns)
        self._lead_to(self.bus, self.node, now_ns)
        self.cut.mend(now_ns)
        loop = self.robot.loop
        loop.buses = [bus for bus in loop.buses if bus is not self.far]
