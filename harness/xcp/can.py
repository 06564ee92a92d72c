"""XCP on CAN: a probe on the main brain's memory, with its own controller on one of the robot's buses.

The robot's firmware has no XCP, and the main brain is behind the router and the serial link, where a slave in its
program could answer and measure once per slot of 2 ms. So the slave is not a board of the robot. It is a probe such as
one plugs onto a control unit to measure faster than its program allows: it reads the memory directly and costs the
program nothing. Its frames are like all others of the bus: they arbitrate, add to the load, and are lost with it.

ROBOT PARITY: the robot had no such probe. The router and the boards of that bus receive its frames and spend their
receive interrupt on them; the router's table, which has the identifiers of XCP, forwards them nowhere.

Time is virtual. The probe acts at every step of the plant (250 us), when all boards are at one time: it executes the
commands that have arrived, measures, and queues its packets. Its controller sends that queue frame by frame,
each as soon as the one before has ended. So the same frames from a master give the same bytes.

Transport layer of the standard (ASAM MCD-1 XCP, part 3, CAN): a packet is a frame, without length or counter; frames
are as long as their packets.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from ranger_sim.can_bus.bounds import message, utilisation
from ranger_sim.datatable.addresses import XCP_BUS, XCP_MASTER_ID, XCP_SLAVE_ID
from ranger_sim.firmware_sim.board import Board
from ranger_sim.foundation.events import (
    CAN_MODE,
    CAN_REQUEST,
    CAN_RX,
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_EXTENDED,
    FLAG_REMOTE,
    NEVER,
    ORDER_INTERRUPTS,
    STAGE_BUS,
    TX_SENT,
)
from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.outside import bus_schedule, profile
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.xcp.slave import ANSWER, ERR_CMD_UNKNOWN, ERR_OUT_OF_RANGE, ERROR, SHORT, Slave
from ranger_sim.harness.xcp.table_memory import TableMemory

MAX_DLC = 8  # bytes of a packet: those of a frame
CONTROLLER = 1
BUFFER = 1  # of the three; one keeps the order, and is filled again before the bus is free
LENGTH_CODE = 15
NAME = "XCP"
# Share of the bus that may be taken at most, with the longest stuffing, before another list is refused. Chosen by us:
# the rest is for commands and answers, for other masters of the bus, and for repeated frames.
MOST_LOAD = Fraction(4, 5)
WAITING = 1024  # packets; chosen by us: 46 ms of a bus at 3 Mbit/s, far more than a disturbance within the bound
LOOK_NS = 1_000_000_000  # no external program waits for it; it is polled for its counters only

# Commands of the transport layer.
TRANSPORT_LAYER_CMD = 0xF2
GET_SLAVE_ID, GET_DAQ_ID = 0xFF, 0xFE
XCP_TEXT = b"XCP"
IDENTIFY, CONFIRM = 0, 1
FIXED = 1  # the identifier of a list cannot be changed


class _Station(Board):
    """The controller: frames of the master in, a queue of packets out."""

    def __init__(self) -> None:
        Board.__init__(self, NAME)
        self.next_time = NEVER
        self.heard: deque[bytes] = deque()
        self.waiting: deque[bytes] = deque()
        self.sending = False
        self.counts: Counter[str] = Counter()

    def advance(self, until: int) -> int:
        """Every frame and every end of a transmission before `until`, ns."""
        self.horizon = until
        inbox = self.inbox
        while inbox.head_time < self.horizon:
            inbox.take()
            if inbox.kind == CAN_RX:
                self._hear(inbox.b, inbox.c, inbox.d, inbox.e)
            elif inbox.kind == CAN_TX_DONE:
                self.sending = False
                self.counts["packets_out" if inbox.c == TX_SENT else "packets_lost"] += 1
                self.go_on(inbox.time)
            elif inbox.kind == CAN_STATUS and inbox.e:  # bus-off: waiting packets are old when it may send again
                self.counts["bus_off"] += 1
                self.counts["packets_lost"] += len(self.waiting)
                self.waiting.clear()
                self.outbox.push(inbox.time, ORDER_INTERRUPTS, CAN_MODE, CONTROLLER, 0)
        return NEVER

    def _hear(self, identifier: int, flags: int, low: int, high: int) -> None:
        if identifier == XCP_MASTER_ID and not flags & (FLAG_EXTENDED | FLAG_REMOTE) and flags & LENGTH_CODE:
            data = (high << 32 | low).to_bytes(MAX_DLC, "little")
            self.heard.append(data[: min(flags & LENGTH_CODE, MAX_DLC)])

    def put(self, packet: bytes) -> None:
        """Queue a packet; it is dropped when the queue is full."""
        if len(self.waiting) >= WAITING:
            self.counts["packets_dropped"] += 1
        else:
            self.waiting.append(packet)

    def go_on(self, now_ns: int) -> None:
        """Move the next packet into the controller, if that is free."""
        if self.sending or not self.waiting:
            return
        packet = self.waiting.popleft()
        self.sending = True
        word = int.from_bytes(packet, "little")
        low, high = word & 0xFFFFFFFF, word >> 32
        self.outbox.push(
            now_ns, ORDER_INTERRUPTS, CAN_REQUEST, CONTROLLER, BUFFER, XCP_SLAVE_ID, len(packet), low, high
        )


class XcpCanProbe(StepWatch):
    """A slave over `robot`'s data table on its bus can1 ... can4. Give it to `robot.attach`.

    outside: the bus of this name, where `can_bus.edge.external_bus` replaces it. UserError for an unknown bus.
    """

    kind = "xcp-can"

    def __init__(self, robot: Any, bus: str = XCP_BUS.lower(), outside: Any = None) -> None:
        StepWatch.__init__(self)
        names = [each.name for each in robot.buses]
        if bus not in names:
            raise UserError(f"XCP: {unknown('bus', bus, names)}")
        self.robot, self.bus = robot, bus
        emulated = robot.buses[names.index(bus)]
        bit_rate = emulated.bitrate if outside is None else outside.bit_rate
        self.bit_rate = bit_rate
        known = robot.profile if robot.profile is not None else profile.default()
        streams = bus_schedule.streams(bus_schedule.robots_table(), bus, known.schedules())
        self.robots_share = utilisation([each.message for each in streams], bit_rate)
        self.memory = TableMemory(robot)
        self.slave = Slave(self.memory, MAX_DLC, MAX_DLC, SHORT, bears=self.bears)
        self.station = _Station()
        self.commands = 0
        wires = robot.loop.add(self.station)
        order = STAGE_BUS * 256 + 16 * robot.loop.place(NAME) + CONTROLLER
        if outside is None:
            node = emulated.add_node(NAME, self.station.inbox, CONTROLLER, order)
            wires.connect_bus(CONTROLLER, emulated, node)
        else:
            wires.can_lines[CONTROLLER] = outside.add_peer(f"{bus}, {NAME}", self.station.inbox, CONTROLLER, order)
        robot.loop.watchers.append(self)

    def bears(self, packets: Sequence[tuple[int, int]]) -> bool:
        """Whether the bus can carry packets (bytes, ns from one to the next) with the robot's own frames."""
        return self.robots_share + self.share_of(packets) <= MOST_LOAD

    def share_of(self, packets: Sequence[tuple[int, int]]) -> Fraction:
        """Their share of the bus, with the most stuff bits that they can have."""
        sent = [message(NAME, XCP_SLAVE_ID, period_ns, size) for size, period_ns in packets]
        return utilisation(sent, self.bit_rate)

    def before_step(self, now_ns: int) -> object:
        """Execute received commands, measure, and send."""
        station = self.station
        while station.heard:
            self.commands += 1
            answer = self.answer(station.heard.popleft(), now_ns)
            if answer:
                station.put(answer)
        if self.slave.running:
            for packet in self.slave.sample(now_ns, now_ns - self.robot.start_ns):
                station.put(packet)
        station.go_on(now_ns)
        return None

    def answer(self, packet: bytes, now_ns: int) -> bytes:
        """The answer of the slave, or of the transport for it."""
        if packet[0] != TRANSPORT_LAYER_CMD or len(packet) < 2:
            return self.slave.command(packet, now_ns)
        if packet[1] == GET_SLAVE_ID:  # a query for slaves, answered to masters that are not connected, too
            if packet[2:5] != XCP_TEXT or packet[5:6] not in (bytes((IDENTIFY,)), bytes((CONFIRM,))):
                return b""
            echo = XCP_TEXT if packet[5] == IDENTIFY else bytes(each ^ 0xFF for each in XCP_TEXT)
            return bytes((ANSWER,)) + echo + XCP_MASTER_ID.to_bytes(4, "little")
        if not self.slave.connected:
            return b""
        if packet[1] == GET_DAQ_ID and len(packet) >= 4:
            if int.from_bytes(packet[2:4], "little") >= len(self.slave.lists):
                return bytes((ERROR, ERR_OUT_OF_RANGE))
            return bytes((ANSWER, FIXED, 0, 0)) + XCP_SLAVE_ID.to_bytes(4, "little")
        return bytes((ERROR, ERR_CMD_UNKNOWN))

    # --- the interface for `robot.attach`

    def poll(self, now_ns: int) -> int:
        """Do nothing: everything happens in virtual time, and nothing outside is polled."""
        return now_ns + LOOK_NS

    def filenos(self) -> list[int]:
        """None: its master is on the bus."""
        return []

    def counters(self) -> dict[str, int]:
        """Whole numbers by name."""
        found = dict.fromkeys(("packets_out", "packets_lost", "packets_dropped", "bus_off"), 0)
        return {"commands": self.commands, **found, **self.station.counts, "writes_refused": self.memory.refused}

    def close(self) -> None:
        """Stop measuring."""
        if self in self.robot.loop.watchers:
            self.robot.loop.watchers.remove(self)
