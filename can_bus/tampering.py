"""Faults in the frames of a bus: one node misreads, loses, or receives frames late or changed.

A bus with `Tampering` simulates every affected frame bit by bit. The consequences of a bit that one node samples
wrongly (error flags, counters, repetitions, bus-off) then come from the controllers (`medium_access.py`).

Errors have the names of FMI-LS-BUS: BIT, BIT_STUFFING, FORM, CRC, ACK, BROKEN_ERROR_FRAME. The node that a fault makes
misread a bit sees the error first and signals it: its error is primary. Errors that others see because of its error
flag are secondary.

CAN FD buses have the same faults, and one more: a node that misreads BRS receives at the wrong rate.
"""

from collections import Counter
from typing import Any

from ranger_sim.can_bus.fd_frame import FIELD_BRS, FIELD_ESI
from ranger_sim.can_bus.frame import (
    DOMINANT,
    EIGHT_BYTES,
    FIELD_ACK_SLOT,
    FIELD_ACTIVE_FLAG,
    FIELD_CRC,
    FIELD_CRC_DELIMITER,
    FIELD_DATA,
    FIELD_DELIMITER,
    FIELD_DLC,
    FIELD_OVERLOAD_FLAG,
    FIELD_PASSIVE_FLAG,
    FIELD_R0,
    FIELD_R1,
    FIELD_RTR,
    FIELD_SRTR,
    FIELD_TOLERATED,
    RECEIVERS_SEE,
    RECESSIVE,
    STUFF_AFTER,
)
from ranger_sim.can_bus.medium_access import MET_ERROR, MediumAccess
from ranger_sim.can_bus.node import (
    BUS_OFF,
    BUS_OFF_LIMIT,
    FDF_IGNORED,
    ICR_FIELD_MASK,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    JOINING,
    KIND_BIT,
    KIND_FORM,
    KIND_STUFF,
    OPERATING,
    RESET,
    Node,
)
from ranger_sim.can_bus.transmit_buffers import BUFFER_SHIFT, FLAGS, HIGH, IDENTIFIER, LOW, NODE_SHIFT
from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.foundation.events import CAN_RX, FLAG_FD, NEVER, STAGE_BUS, EventQueue
from ranger_sim.foundation.user_error import BusError

ERRORS = ("BIT", "BIT_STUFFING", "FORM", "CRC", "ACK", "BROKEN_ERROR_FRAME")
# Errors that a node cannot see, and why: (error, whether it is the sender)
IMPOSSIBLE = {
    ("FORM", True): "a sender that samples a dominant bit where it sent a recessive one sees a BIT error",
    ("CRC", True): "a sender does not check the CRC of its own frame",
    ("ACK", False): "only a sender looks for the acknowledgement",
}
INTRUDERS_ORDER = STAGE_BUS * 256 + 255  # no node of the robot has it
FLAG_BIT_BROKEN = 3  # bits from an error to the one of its error flag that is misread: the third of six
BIT_BEHIND_ARBITRATION = (FIELD_R1, FIELD_R0, FIELD_DLC, FIELD_DATA, FIELD_CRC)
BEHIND_BRS = (FIELD_ESI, FIELD_DLC, FIELD_DATA, FIELD_CRC)  # the same of a CAN FD frame: in its data phase


def error_name(capture: int) -> str:
    """Name of the error in an ICR_* word with a bus error; "" for dominant bits after a flag, which are not a new
    error."""
    field = capture >> ICR_FIELD_SHIFT & ICR_FIELD_MASK
    kind = capture >> ICR_KIND_SHIFT & 3
    if field in (FIELD_ACTIVE_FLAG, FIELD_DELIMITER, FIELD_OVERLOAD_FLAG):
        return "BROKEN_ERROR_FRAME"
    if field in (FIELD_TOLERATED, FIELD_PASSIVE_FLAG):
        return ""
    named = {KIND_BIT: "BIT", KIND_FORM: "FORM", KIND_STUFF: "BIT_STUFFING"}
    return named.get(kind, "ACK" if field == FIELD_ACK_SLOT else "CRC")


def places_of_error(
    error: str, of_sender: bool, bits: list, fields: list, fdf: int = FDF_IGNORED, iso: bool = True
) -> list:
    """Positions from the start of a frame at which a node must misread the bus in order to see `error`.

    `bits` and `fields` of the frame on the wire, as `frame.wire` gives them. `fdf`, `iso`: as of `Node`. Empty: this
    frame has no such position.
    """
    if error == "ACK" or (error == "BIT" and not of_sender):  # of a receiver: the acknowledgement that it sends itself
        return [fields.index(FIELD_ACK_SLOT)]
    if error == "FORM":
        return [fields.index(FIELD_CRC_DELIMITER)]
    candidates = BEHIND_BRS if FIELD_ESI in fields else BIT_BEHIND_ARBITRATION
    behind = next(n for n, field in enumerate(fields) if field in candidates)
    if error == "BIT":
        return [behind]
    if error == "BROKEN_ERROR_FRAME":
        first = behind if of_sender else fields.index(FIELD_CRC_DELIMITER)
        return [first, first + FLAG_BIT_BROKEN]
    if of_sender:
        return _recessive_stuff_bit(bits, fields)[:1]
    wanted = "BIT_STUFFING" if error == "BIT_STUFFING" else "CRC"
    for place in range(behind, fields.index(FIELD_CRC_DELIMITER)):
        if _what_a_receiver_sees(bits, fields, place, fdf, iso) == wanted:
            return [place]
    return []


def _recessive_stuff_bit(bits: list, fields: list) -> list:
    """Recessive stuff bits of the arbitration field: one that is sampled dominant is not a lost arbitration."""
    last = fields.index(FIELD_RTR if FIELD_RTR in fields else FIELD_SRTR)
    found, run, level = [], 0, RECESSIVE
    for place, bit in enumerate(bits[: last + 1]):
        if run == STUFF_AFTER and bit == RECESSIVE:
            found.append(place)
        run = run + 1 if bit == level and run < STUFF_AFTER else 1
        level = bit
    return found


def _what_a_receiver_sees(bits: list, fields: list, misread: int, fdf: int = FDF_IGNORED, iso: bool = True) -> str:
    """Name of the first error of a receiver that misreads one bit of the frame, "" for none."""
    node = Node("probe", 0, EventQueue(1), 1, 0)
    node.fdf, node.iso = fdf, iso
    machine = MediumAccess(node)
    machine.place(0, 0)
    acknowledged = fields.index(FIELD_ACK_SLOT)
    for place, bit in enumerate(bits):
        level = DOMINANT if place == acknowledged else bit
        if machine.sample(1 - level if place == misread else level, place) & MET_ERROR:
            return error_name(machine.capture)
    return ""


class Tamper:
    """Effect of one fault on a bus. Subclasses implement the four calls that a bus makes (`Tampering`).

    Picks frames of `identifier` (-1: any) sent by node `sender` (-1: any; `but`: any but this one): every `every`-th
    of them, and of those a `share` by `random`. `count`: the most frames to pick, 0: no limit. `tampered`: frames so
    far. `noted(time_ns, difference)` is called when it acted.
    """

    def __init__(self, identifier: int = -1, sender: int = -1, but: int = -1) -> None:
        self.identifier = identifier
        self.sender = sender
        self.but = but
        self.every = 1
        self.share = 1.0
        self.count = 0
        self.random: Any = None
        self.noted: Any = None
        self.begun = 0
        self.tampered = 0
        self.hit = False  # the frame that is on the bus

    def picks(self, identifier: int, sender: int) -> bool:
        """Whether it may affect a frame."""
        return (
            self.identifier in (-1, identifier)
            and self.sender in (-1, sender)
            and sender != self.but
            and not (0 < self.count <= self.tampered)
        )

    def takes(self, identifier: int, sender: int) -> bool:
        """Whether it affects the frame that begins now."""
        if not self.picks(identifier, sender):
            return False
        self.begun += 1
        if self.begun % self.every:
            return False
        return self.share >= 1.0 or bool(self.random.uniform() < self.share)

    def note(self, time: int, difference: float = 1.0) -> None:
        """Record that it acted."""
        if self.noted is not None:
            self.noted(time, difference)

    def before_frame(self, bus: Any, row: int, bit: int) -> bool:
        """A frame is about to begin on an idle bus. True: it shall be simulated bit by bit."""
        return self.picks(bus.buffers.rows[row + IDENTIFIER], row >> NODE_SHIFT)

    def frame_begins(self, level: Any, row: int, bit: int) -> None:
        """A frame that it affects begins."""

    def receives(self, machine: Any, time: int) -> bool:
        """A node has an affected frame. False: its program does not receive it this way."""
        return True

    def notices(self, machine: Any, time: int) -> None:
        """Error confinement of a node has something to report."""


class Tampering:
    """All faults that affect the frames of one bus."""

    def __init__(self, bus: Any) -> None:
        self.bus = bus
        self.tampers: list[Tamper] = []

    def add(self, tamper: Tamper) -> None:
        """Add a fault."""
        self.tampers.append(tamper)
        self.bus.tamper(self)

    def remove(self, tamper: Tamper) -> None:
        """Remove a fault. Without any, the bus passes plain frames unchanged."""
        self.tampers.remove(tamper)
        if not self.tampers:
            self.bus.tamper(None)

    # ---- called by the bus

    def reaches(self, bus: Any, row: int, bit: int) -> bool:
        """Whether the frame in `row`, which would begin at `bit` on an idle bus, must be simulated bit by bit."""
        return any([tamper.before_frame(bus, row, bit) for tamper in self.tampers])

    def frame_begins(self, level: Any, row: int, bit: int) -> None:
        """The frame in `row` begins at `bit`, perhaps together with others; misread bits of the previous one are
        over."""
        level.disturbance.misread.clear()
        for tamper in self.tampers:
            tamper.hit = tamper.takes(level.buffers.rows[row + IDENTIFIER], row >> NODE_SHIFT)
            if tamper.hit:
                tamper.frame_begins(level, row, bit)

    def receives(self, machine: Any, time: int) -> bool:
        """Whether the node of `machine` receives a frame at `time` (ns), changed or not."""
        return all([tamper.receives(machine, time) for tamper in self.tampers if tamper.hit])

    def notices(self, machine: Any, time: int) -> None:
        """A node has an error, or a changed counter, at `time` (ns)."""
        for tamper in self.tampers:
            tamper.notices(machine, time)


def tampering_of(bus: Any) -> Tampering:
    """The `Tampering` of `bus`, created if it has none."""
    return bus.tampering if bus.tampering is not None else Tampering(bus)


class Misreading(Tamper):
    """`node` sees `error` in the frames that are picked, as their sender or as a receiver.

    UserError for an error that such a node cannot see. `notes_errors`: it acted when the node saw the error. `seen`:
    counts of errors by node, error and order, since the first frame hit: {(node, error, "primary" | "secondary"):
    count}. `unfit`: frames without a position for it.
    """

    notes_errors = True

    def __init__(self, error: str, node: int, of_sender: bool, identifier: int = -1) -> None:
        Tamper.__init__(self, identifier, sender=node if of_sender else -1, but=-1 if of_sender else node)
        if (error, of_sender) in IMPOSSIBLE:
            raise BusError(f"{error}: {IMPOSSIBLE[error, of_sender]}")
        self.error = error
        self.node = node
        self.of_sender = of_sender
        self.seen: Counter[tuple[str, str, str]] = Counter()
        self.unfit = 0

    def frame_begins(self, level: Any, row: int, bit: int) -> None:
        node = level.machines[self.node].node
        bits, fields = level.buffers.wire(row)
        places = places_of_error(self.error, self.of_sender, bits, fields, node.fdf, node.iso)
        if not places or node.mode != OPERATING:
            self.unfit += 1
            self.hit = False
            return
        self.tampered += 1
        for later in level.ticks_of(row, places):
            level.disturbance.hit_node(bit + later, self.node)

    def notices(self, machine: Any, time: int) -> None:
        error = error_name(machine.capture) if machine.met & MET_ERROR else ""
        if self.hit and error:
            rank = "primary" if machine.node.index == self.node else "secondary"
            self.seen[machine.node.name, error, rank] += 1
            # On a bus of two a wrong CRC is a missing acknowledgement as well: the sender's flag comes first, on the
            # ACK delimiter, which is a FORM error to the receiver.
            meant = error == self.error or (self.error, error) == ("CRC", "FORM")
            if rank == "primary" and meant and self.notes_errors:
                self.note(time)


class Loss(Tamper):
    """`node` acknowledges the picked frames, but its program never receives them: lost after the receive path."""

    def __init__(self, node: int, identifier: int = -1) -> None:
        Tamper.__init__(self, identifier, but=node)
        self.node = node

    def receives(self, machine: Any, time: int) -> bool:
        if machine.node.index != self.node:
            return True
        self.tampered += 1
        self.note(time)
        return False


class Corruption(Tamper):
    """`node` receives other data than were sent: word 0 with the bits of `mask` inverted, after the CRC check."""

    def __init__(self, node: int, mask: int, identifier: int = -1) -> None:
        Tamper.__init__(self, identifier, but=node)
        self.node = node
        self.mask = mask

    def receives(self, machine: Any, time: int) -> bool:
        if machine.node.index == self.node:
            self.tampered += 1
            if machine.flags & FLAG_FD:
                for place, byte in enumerate(self.mask.to_bytes(4, "little")[: len(machine.payload)]):
                    machine.payload[place] ^= byte
            else:
                machine.lo ^= self.mask
            self.note(time)
        return True


class Delay(Tamper):
    """`node` receives the picked frames `delay_ns` later; later frames may overtake them."""

    def __init__(self, node: int, delay_ns: int, identifier: int = -1) -> None:
        Tamper.__init__(self, identifier, but=node)
        self.node = node
        self.delay_ns = delay_ns

    def receives(self, machine: Any, time: int) -> bool:
        node = machine.node
        if node.index != self.node:
            return True
        self.tampered += 1
        node.received += 1
        late = time + self.delay_ns
        lo, hi, data = machine.lo, machine.hi, None
        if machine.flags & FLAG_FD:
            data = bytes(machine.payload)
            lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:8], "little")
        node.inbox.push(late, node.order, CAN_RX, node.controller, machine.identifier, machine.flags, lo, hi, 0, data)
        self.note(time, self.delay_ns * 1e-3)
        return False


class Silence(Misreading):
    """BIT errors in every frame that `node` sends until its controller is bus-off; then its recovery proceeds
    undisturbed."""

    notes_errors = False

    def __init__(self, node: int) -> None:
        Misreading.__init__(self, "BIT", node, True)

    def takes(self, identifier: int, sender: int) -> bool:
        return self.count == 0 and Misreading.takes(self, identifier, sender)

    def notices(self, machine: Any, time: int) -> None:
        Misreading.notices(self, machine, time)
        if machine.node.index == self.node and self.count == 0 and machine.node.transmit_errors >= BUS_OFF_LIMIT:
            self.count = self.tampered  # no more
            self.note(time)


class MisreadSwitch(Tamper):
    """`node` misreads BRS in the CAN FD frames of others that are picked, so that it samples at the other rate."""

    def __init__(self, node: int, identifier: int = -1) -> None:
        Tamper.__init__(self, identifier, but=node)
        self.node = node

    def frame_begins(self, level: Any, row: int, bit: int) -> None:
        _, fields = level.buffers.wire(row)
        if FIELD_BRS not in fields or level.machines[self.node].node.mode != OPERATING:
            self.hit = False
            return
        self.tampered += 1
        level.disturbance.hit_node(bit + level.ticks_of(row, [fields.index(FIELD_BRS)])[0], self.node)

    def notices(self, machine: Any, time: int) -> None:
        if self.hit and machine.node.index == self.node and machine.met & MET_ERROR:
            self.note(time)


class WrongRate(Tamper):
    """A node runs at a wrong bit rate: every frame is simulated bit by bit while it takes part."""

    def __init__(self, node: Node) -> None:
        Tamper.__init__(self)
        self.node = node

    def picks(self, identifier: int, sender: int) -> bool:
        return self.node.mode not in (BUS_OFF, RESET)

    def notices(self, machine: Any, time: int) -> None:
        if machine.node.index == self.node.index and machine.met & MET_ERROR and error_name(machine.capture):
            self.tampered += 1
            self.note(time)


class Intruder:
    """An extra controller on a bus of the robot: it acknowledges, and its program receives nothing."""

    def __init__(self, bus: Any, name: str) -> None:
        self.bus = bus
        self.inbox = EventQueue(8)
        self.number = bus.add_node(name, self.inbox, 1, INTRUDERS_ORDER)
        self.node = bus.nodes[self.number]
        self.node.listening = False
        self.ends = TransmitEnds()
        self.node.connect(self.ends)

    def offer(
        self, buffer: int, ready: int, identifier: int, flags: int, low: int, high: int, data: bytes | None = None
    ) -> bool:
        """Put a frame that may start at bit `ready` in a transmit buffer, even if the bus has advanced further.

        `data`: all bytes of a CAN FD frame.
        False while the buffer holds one, or while it is off the bus.
        """
        buffers = self.bus.buffers
        row = self.number << NODE_SHIFT | buffer << BUFFER_SHIFT
        if buffers.is_full(row) or self.node.mode not in (OPERATING, JOINING):
            return False
        self.inbox.clear()
        self.ends.times[buffer] = NEVER
        ready = max(ready, self.node.suspend_bit)
        if self.node.mode == JOINING:
            ready += NEVER
        words = (NEVER, ready, self.bus.edge_ns(ready % NEVER), buffers.first, identifier, flags, low, high)
        for place, word in enumerate(words):
            buffers.rows[row + place] = word
        buffers.first = row
        buffers.waiting_count += 1
        if data is not None:
            buffers.payloads[row] = data
        return True


class Duplicate(Tamper):
    """Whenever a frame of `identifier` begins, `intruder` begins one with the same identifier at the same time, with
    other data."""

    def __init__(self, intruder: Intruder, identifier: int, mask: int) -> None:
        Tamper.__init__(self, identifier, but=intruder.number)
        self.intruder = intruder
        self.mask = mask

    def before_frame(self, bus: Any, row: int, bit: int) -> bool:
        if not Tamper.before_frame(self, bus, row, bit):
            return False
        rows = bus.buffers.rows
        flags, low, high = rows[row + FLAGS] & RECEIVERS_SEE, rows[row + LOW] ^ self.mask, rows[row + HIGH]
        data = None
        if flags & FLAG_FD:
            data = bus.buffers.payloads[row]
            words = int.from_bytes(data, "little") ^ self.mask & ((1 << 8 * len(data)) - 1)
            data = words.to_bytes(len(data), "little")
        if not self.intruder.offer(1, bit, self.identifier, flags, low & 0xFFFFFFFF, high, data):
            return False
        self.tampered += 1
        self.note(bus.edge_ns(bit))
        return True


class Babbling(Tamper):
    """`intruder` sends frames of `identifier` whenever it can, or one every `period_ns`; alternating between two
    buffers."""

    def __init__(self, intruder: Intruder, identifier: int, period_ns: int) -> None:
        Tamper.__init__(self, identifier, sender=intruder.number)
        self.intruder = intruder
        self.period_ns = period_ns
        self.due_ns = 0
        self.buffer = 1

    def start_from(self, time: int) -> None:
        """Allow the first frame to start after `time` (ns)."""
        self.due_ns = time
        self._offer(self.intruder.bus.bit_of(time) + 1)
        self.intruder.bus.recompute_next()

    def _offer(self, bit: int) -> None:
        """Offer the next frame, from `bit` on."""
        bus = self.intruder.bus
        ready = max(bit, bus.bit_of(self.due_ns))
        if self.intruder.offer(3 - self.buffer, ready, self.identifier, EIGHT_BYTES, 0, 0):
            self.buffer = 3 - self.buffer

    def _begins(self, row: int, bit: int) -> None:
        if row >> NODE_SHIFT == self.sender:
            time = self.intruder.bus.edge_ns(bit)
            self.tampered += 1
            self.note(time)
            self.due_ns = max(self.due_ns + self.period_ns, time)
            self._offer(bit + 1)

    def before_frame(self, bus: Any, row: int, bit: int) -> bool:
        self._begins(row, bit)
        return False

    def frame_begins(self, level: Any, row: int, bit: int) -> None:
        self._begins(row, bit)
