"""Faults on the wire of a bus: nodes that do not belong there, and noise."""

from typing import Any

from ranger_sim.can_bus import rewiring, tampering
from ranger_sim.can_bus.disturbance import HIGHEST_RATE
from ranger_sim.can_bus.node import OPERATING
from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.catalogue import mode
from ranger_sim.harness.faults.fault import Fault, Parameter, WholeNumber
from ranger_sim.harness.faults.kinds import BUS
from ranger_sim.harness.faults.names import ANY, identifier_of, name_parameter
from ranger_sim.harness.faults.outside import OutsideBabbling, OutsideDuplicate, OutsideIntruder, external_bus
from ranger_sim.harness.faults.reach import bus_of, wake_buses


class BusFault(Fault):
    """A fault on the wire of one bus. Clear when all of the machine's controllers take part, counters as they were."""

    kinds = (BUS,)
    needs = "a CAN bus"

    def connect(self) -> None:
        self.bus = bus_of(self.robot, self.place.details["bus"], f"fault {self.text()}")

    def begin(self, now_ns: int) -> None:
        self.own = [node for node in self.bus.nodes if node.order != tampering.INTRUDERS_ORDER]
        self.counters_before = self._counters()

    def _counters(self) -> list[int]:
        return [count for node in self.own for count in (node.transmit_errors, node.receive_errors)]

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        """Whether the error counters are back; they fall by one with each good frame."""
        calm = all(now <= before for now, before in zip(self._counters(), self.counters_before, strict=True))
        return calm and all(node.mode == OPERATING for node in self.own)


class IntruderFault(BusFault):
    """A controller is connected to the bus while the fault works, and removed at its end.

    On a bus outside it is another peer on the same interface (`outside.py`); the counters of nodes there are not
    visible here, so the place is clear when the peer is gone.
    """

    tamper: Any
    peer: Any = None

    def connect(self) -> None:
        self.external = external_bus(self.robot, self.place.details["bus"])
        if self.external is None:
            BusFault.connect(self)

    def made_outside(self) -> OutsideIntruder:
        """The intruder's actions on a bus outside."""
        raise NotImplementedError

    def before(self, now_ns: int) -> None:
        if self.peer is not None:
            self.peer.step(now_ns)

    def is_clear(self, start_ns: int, end_ns: int) -> bool:
        return self.external is not None or BusFault.is_clear(self, start_ns, end_ns)

    def begin(self, now_ns: int) -> None:
        if self.external is not None:
            self.peer = self.made_outside()
            self.peer.step(now_ns)
            return
        BusFault.begin(self, now_ns)
        self.intruder = tampering.Intruder(self.bus, f"intruder {len(self.bus.nodes)}")
        self.clip_on(now_ns)
        self.tamper.noted = self.note
        tampering.tampering_of(self.bus).add(self.tamper)
        wake_buses(self.robot, now_ns)

    def clip_on(self, now_ns: int) -> None:
        """Make `tamper`: the intruder's actions."""
        raise NotImplementedError

    def finish(self, now_ns: int) -> None:
        if self.peer is not None:
            self.peer.leave()
            self.peer = None
            return
        rewiring.unplug(self.bus, self.intruder.number, now_ns)
        self.bus.tampering.remove(self.tamper)
        wake_buses(self.robot, now_ns)


@mode
class BabblingNode(IntruderFault):
    """A node that sends unasked. With a low identifier it wins every arbitration: others starve."""

    mode = "babbling"
    meaning = "has a node that sends frames of one identifier all the time"
    unit = "frames"
    parameters = (
        name_parameter("frame", "0", "variable or identifier that it sends", "chosen by us: what beats everybody"),
        Parameter("period_us", "us", 0.0, 0.0, 1e6, "from frame to frame; 0: one after another", "chosen by us: worst"),
    )

    def connect(self) -> None:
        IntruderFault.connect(self)
        self.identifier = identifier_of(self.robot, self.values["frame"], f"fault {self.text()}")
        if self.identifier < 0:
            raise FaultError(f"fault {self.text()}: a babbling node needs an identifier, not {ANY!r}")

    def clip_on(self, now_ns: int) -> None:
        self.tamper = tampering.Babbling(self.intruder, self.identifier, round(1000 * self.values["period_us"]))

    def made_outside(self) -> OutsideIntruder:
        return OutsideBabbling(self.external, self.identifier, round(1000 * self.values["period_us"]), self.note)

    def begin(self, now_ns: int) -> None:
        IntruderFault.begin(self, now_ns)
        if self.external is None:
            self.tamper.speak(now_ns)


@mode
class DuplicateIdentifier(IntruderFault):
    """A second node sends an identifier that already has a sender: at the same bit, with another value.

    On a bus outside the bit cannot be matched: there it sends its frame after each of the other's.
    Arbitration does not separate the two, so the first data bit that differs is a bit error of one of them. Both
    repeat at once, until both are error passive and the node whose error flag is silent yields.
    """

    mode = "duplicate"
    meaning = "has a second node that sends the same identifier at the same time"
    unit = "frames"
    parameters = (
        name_parameter("frame", "", "variable or identifier that both send", "has to be given"),
        WholeNumber("bit", "1", 22, 0, 31, "of the value's word, in which they differ", "chosen by us"),
    )

    def connect(self) -> None:
        IntruderFault.connect(self)
        if not self.values["frame"] or self.values["frame"] == ANY:
            raise FaultError(f"fault {self.text()}: say by frame= which identifier is there twice")
        self.identifier = identifier_of(self.robot, self.values["frame"], f"fault {self.text()}")

    def made_outside(self) -> OutsideIntruder:
        return OutsideDuplicate(self.external, self.identifier, 1 << int(self.values["bit"]), self.note)

    def clip_on(self, now_ns: int) -> None:
        self.tamper = tampering.Duplicate(self.intruder, self.identifier, 1 << int(self.values["bit"]))


@mode
class Noise(BusFault):
    """Bits inverted for all nodes, at random: a bad termination, a motor's leads next to the cable."""

    mode = "noise"
    meaning = "has bits inverted at random, for everybody"
    unit = "error frames"
    parameters = (
        Parameter("rate", "1", 1e-4, 0.0, HIGHEST_RATE, "chance of each bit", "chosen by us: about a frame in eighty"),
    )

    def begin(self, now_ns: int) -> None:
        BusFault.begin(self, now_ns)
        self.errors = self.bus.counters.errors
        self.bus.set_bit_error_rate(self.values["rate"])
        wake_buses(self.robot, now_ns)

    def before(self, now_ns: int) -> None:
        new = self.bus.counters.errors - self.errors
        if new:
            self.errors += new
            self.note(now_ns, new)

    def finish(self, now_ns: int) -> None:
        self.before(now_ns)
        self.bus.set_bit_error_rate(0.0)
        wake_buses(self.robot, now_ns)
