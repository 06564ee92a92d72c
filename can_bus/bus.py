# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below is made from a node and a buffer, which `request` has checked, or is a waiting row)
"""Bit-accurate CAN bus: arbitration, timing, acknowledgement, and the result of every frame.

Related modules: `node.py`, a controller with its error confinement; `transmit_buffers.py`, the frames that wait;
`disturbance.py`, wrong bits; `tampering.py`, faults of frames; `rewiring.py`, cut wires; `bit_level.py` and
`medium_access.py`, their consequences bit by bit; `load_meter.py`, `bus_counters.py`, `frame_log.py`.

Time. Internally, the bus counts absolute bits since power-up; a count is converted to a time in ns only for results.
Bit k begins at the first whole nanosecond at or after k / bitrate (ceil(k 10^9 / bitrate)), so 3 Mbit/s, where a bit is
333 1/3 ns, drifts by nothing in any time. All controllers share this bit grid: real ones synchronise to the edges of
the sender (ISO 11898-1). A request takes part in every start of frame strictly after its stamp, never in one at its
stamp: a request written at the time at which the bus becomes free is too late. On an idle bus a frame therefore starts
at the next bit edge. So `advance(t)` can decide everything up to and including t as soon as all requests stamped before
t are known, and results do not depend on how time is divided into advances.

Order. The lowest arbitration field among the controllers ready wins; a controller offers the lowest of its
three buffers, ties by buffer number (LPC2194 with TPM = 0). Nothing is pre-empted.

A frame is decided at its start: its results are pushed, stamped in the future, into the nodes' inboxes; its end is
written where the sender reads it (`Node.connect`). That holds while nothing disturbs the frame; otherwise the bus is
simulated bit by bit (`bit_level.py`), with the same stamps. Receivers have the frame at the end of the sixth bit of
EOF, its sender is done at the end of the seventh.
"""

from typing import TYPE_CHECKING, Annotated, Final

import cython

from ranger_sim.can_bus.acceptance import Acceptance
from ranger_sim.can_bus.bit_level import BitLevel
from ranger_sim.can_bus.bit_timing import SAMPLE_POINT, BitTiming
from ranger_sim.can_bus.bus_counters import BusCounters
from ranger_sim.can_bus.disturbance import HIGHEST_RATE, Disturbance
from ranger_sim.can_bus.fd_frame import (
    PHASE_MASK,
    PHASE_SHIFT,
    fault_of_fd_flags,
    fd_data_length,
    phases,
)
from ranger_sim.can_bus.frame import (
    ACK_DELIMITER_FROM_END,
    EIGHT_BYTES,
    HIGHEST_EXTENDED,
    HIGHEST_STANDARD,
    INTERMISSION_BITS,
    LENGTH_CODE,
    MEASURED_BITS,
    RECEIVERS_SEE,
    SENDABLE,
    arbitration_key,
    first_difference,
    frame_bits,
    measure,
)
from ranger_sim.can_bus.frame_bytes import data_of_words
from ranger_sim.can_bus.frame_log import SENDER_SHIFT, TIMES_BUFFER_SHIFT, FrameLog
from ranger_sim.can_bus.load_meter import LoadMeter
from ranger_sim.can_bus.medium_access import (
    MAC_JOINING,
    MAC_SUSPENDED,
    MET_COUNTER,
    MET_FAILURE,
    MET_JOIN,
    MET_LOSS,
    MET_RECEIVED,
    MET_SENT,
    MET_SETTLED,
    MET_START,
    MediumAccess,
)
from ranger_sim.can_bus.node import (
    BUS_OFF,
    FDF_KNOWN,
    FDF_REFUSED,
    ICR_ERROR_WARNING,
    JOINING,
    OPERATING,
    RESET,
    SEQUENCE_BITS,
    SUSPEND_BITS,
    UNPLUGGED,
    Node,
)
from ranger_sim.can_bus.transmit_buffers import (
    ASKED,
    BUFFER_MASK,
    BUFFER_SHIFT,
    BUFFERS,
    ESI_REQUESTED,
    FLAGS,
    FREE_AT,
    HIGH,
    IDENTIFIER,
    LOW,
    NEXT,
    NODE_SHIFT,
    READY,
    ROW,
    TransmitBuffers,
)
from ranger_sim.foundation.events import (
    CAN_RX,
    CAN_TX_DONE,
    FLAG_BRS,
    FLAG_ESI,
    FLAG_EXTENDED,
    FLAG_FD,
    FLAG_REMOTE,
    FLAG_SINGLE_SHOT,
    NEVER,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import BusError

if TYPE_CHECKING:
    pass

# kinds of the messages in `Bus.commands`
COMMAND_ABORT: Final = 1
COMMAND_MODE: Final = 2
COMMAND_FILTER: Final = 3

SECOND_NS: Final = 1_000_000_000
FD_FLAGS: Final = 1792  # FLAG_FD, FLAG_BRS and FLAG_ESI


def _bytes_of(flags, lo, hi) -> bytes:
    """The data bytes of two words, as many as a CAN FD frame with these flags has; zeros from the ninth on."""
    length = fd_data_length(flags)
    return (lo & 0xFFFFFFFF | (hi & 0xFFFFFFFF) << 32).to_bytes(8, "little")[:length].ljust(length, b"\0")


@cython.final
@cython.cclass
class Bus:
    """A CAN bus. `bitrate` in bit/s; `seed` feeds the noise source of `set_bit_error_rate` only.

    A `data_bitrate` makes it a CAN FD bus: its nodes send and receive frames of both kinds (`request_fd`), classic
    nodes (`set_classic`) answer FD frames with form errors. `iso` False: as before ISO 11898-1:2015 (`fd_frame`).
    Sample points are shares of a bit, of the nominal and the data rate. "Bits" of such a bus are its ticks
    (`bit_timing`), wherever this class counts bits; frames start whole nominal bits after the end of the last one.

    `counters`, `load` and `log` record the past; `buffers` holds the waiting frames.
    """

    # fields used by every request and frame come first: few cache lines
    next_time: cython.longlong
    next_bit: cython.longlong
    advanced: cython.longlong
    free_time: cython.longlong
    free_bit: cython.longlong
    hindered_until: cython.longlong
    next_change: cython.longlong
    buffers: TransmitBuffers
    bitrate: cython.longlong
    node_count: cython.longlong
    acknowledging: cython.longlong
    wake_place: cython.longlong
    due: cython.p_longlong
    next_strike: cython.longlong
    strike_bit: cython.longlong
    second_bit: cython.longlong
    second_ns: cython.longlong
    disturbed: cython.bint
    bit_ns: cython.longlong
    bit_rest: cython.longlong
    intermission_ns: cython.longlong
    intermission_rest: cython.longlong
    nodes: list
    counters: BusCounters
    load: LoadMeter
    log: FrameLog
    # the array that `due` points into: replaced only by `wake`, which sets both
    wakes: Annotated[cython.longlong[::1], "readonly"]
    name: str
    disturbance: Disturbance
    commands: EventQueue
    bit_level: BitLevel
    joining: cython.longlong
    suspended_until: cython.longlong
    rivals: cython.longlong
    tampering: object
    tick_rate: cython.longlong
    bit_ticks: cython.longlong
    intermission: cython.longlong
    timing: BitTiming
    fd_data: bytes

    def __init__(
        self,
        name,
        bitrate,
        seed=0,
        log_capacity=4096,
        data_bitrate=0,
        iso=True,
        sample_point=SAMPLE_POINT,
        data_sample_point=SAMPLE_POINT,
    ) -> None:
        if bitrate < 1000 or bitrate > 100_000_000:
            raise ValueError(f"bus {name}: bit rate {bitrate} bit/s is outside 1000 ... 100000000")
        second: cython.longlong = SECOND_NS
        self.name = name
        self.bitrate = bitrate
        self.timing = BitTiming(f"bus {name}", bitrate, data_bitrate, sample_point, data_sample_point)
        self.tick_rate = self.timing.rate
        self.bit_ticks = self.timing.nominal
        self.intermission = INTERMISSION_BITS * self.bit_ticks
        self.fd_data = None  # of the request that is being made
        self.nodes = []
        self.node_count = 0
        self.acknowledging = 0
        self.joining = 0
        self.suspended_until = 0  # the last bit up to which a node has been suspended
        self.hindered_until = 0  # the same; NEVER while not every node takes part
        self.commands = EventQueue(16)
        self.next_change = NEVER  # time of the first command; -1 while a node is joining
        self.advanced = -1
        self.disturbed = False  # the bus is simulated bit by bit
        self.next_bit = NEVER  # where the next frame starts, as far as known
        self.next_time = NEVER
        self.wake(integers(1), 0)
        self.strike_bit = NEVER  # the next bit that is inverted, as far as known
        self.next_strike = -1  # the same; -1 when the next frame is not plain, wherever it starts
        self.free_bit = 0  # after the intermission of the last frame: the first bit not yet decided; its time:
        self.free_time = 0
        # the second in which the last frame began: its first bit and its time
        self.second_bit = 0
        self.second_ns = 0
        self.bit_ns, self.bit_rest = divmod(self.bit_ticks * second, self.tick_rate)  # a bit in ns, and
        # the remainder times the rate
        self.intermission_ns, self.intermission_rest = divmod(self.intermission * second, self.tick_rate)
        self.buffers = TransmitBuffers()
        self.buffers.iso = iso
        self.disturbance = Disturbance(RandomStream(seed, f"can_bus/{name}/bit errors"))
        self.disturbance.set_timing(self.bit_ticks, self.timing.data)
        self.bit_level = BitLevel(self.buffers, self.disturbance, bitrate, self.timing)
        self.tampering = None
        self.rivals = 0  # frames that were ready together with the winner of the last arbitration
        self.counters = BusCounters()
        self.load = LoadMeter(self.tick_rate)
        self.log = FrameLog(log_capacity)

    def reset_statistics(self, time) -> None:
        """Set every statistic to zero; loads count from `time` (ns) on. Waiting frames count as accepted."""
        self.counters.reset()
        self.load.start(self.bit_of(time))

    @property
    def is_fd(self) -> bool:
        """Whether this is a CAN FD bus."""
        return bool(self.timing.is_fd)

    @property
    def data_bitrate(self) -> int:
        """The data bit rate of a CAN FD bus, bit/s; 0 of a classic one."""
        return self.tick_rate // self.timing.data if self.timing.is_fd else 0

    @property
    def iso(self) -> bool:
        """How CAN FD frames are coded; see the class."""
        return bool(self.buffers.iso)

    def _refuses_fd(self) -> bool:
        """Whether a classic node on a CAN FD bus will disturb FD frames."""
        return any(node.fdf == FDF_REFUSED for node in self.nodes)

    def set_classic(self, node, classic=True) -> None:
        """Let a node of a CAN FD bus know classic frames only (or FD frames again).

        It answers a recessive FDF bit with a form error. UserError on a classic bus.
        """
        if not self.timing.is_fd:
            raise BusError(f"bus {self.name}: all nodes of a classic bus are classic")
        controller: Node = self.nodes[node]
        controller.fdf = FDF_REFUSED if classic else FDF_KNOWN

    def knows_fd(self, node) -> bool:
        """Whether a node of this bus knows CAN FD frames."""
        return self.nodes[node].fdf == FDF_KNOWN

    @property
    def operating(self) -> int:
        """Nodes that take part and acknowledge."""
        return self.acknowledging

    def set_silent(self, node, silent) -> None:
        """From now on, let a node receive only, driving no acknowledgement and no error flag; or take part again."""
        controller: Node = self.nodes[node]
        if controller.mode == OPERATING and controller.silent != bool(silent):
            self.acknowledging += -1 if silent else 1
        controller.silent = bool(silent)
        self._note_changes()

    @property
    def accepted(self) -> int:
        """Requests accepted, including those that waited when the statistics were set to zero."""
        return self.counters.over + self.buffers.waiting_count

    def load_mean(self, time) -> float:
        """Share of the time for which the bus was busy from the start of the statistics to `time` (ns), 0 ... 1."""
        return self.load.mean(self.bit_of(time))

    def note_outside(self, time, identifier, flags, lo, hi) -> None:
        """Record a frame that passed on the real bus which replaces this one."""
        self.counters.frames += 1
        if flags & FLAG_FD:
            data = data_of_words(flags, lo, hi)
            self.log.add_fd(time, identifier, flags, data, -1)
            if self.log.times is not None and self.timing.is_fd:  # else the data bit rate is unknown
                packed = phases(identifier, flags, data, self.iso)
                ticks = (packed & PHASE_MASK) * self.bit_ticks + (packed >> PHASE_SHIFT) * self.timing.data
                begun, hi = time - ticks * SECOND_NS // self.tick_rate, hi & 0xFFFFFFFF
                self.log.times.add(begun, begun, time, identifier, flags & RECEIVERS_SEE, lo, hi)
            return
        self.log.add(time, identifier, flags, lo, hi, -1)
        if self.log.times is not None:  # its requester and the time of the request are unknown here
            bits = frame_bits(identifier, flags & RECEIVERS_SEE, lo, hi)
            begun = time - bits * SECOND_NS // self.bitrate
            self.log.times.add(begun, begun, time, identifier, flags & RECEIVERS_SEE, lo, hi)

    def wake(self, wakes, place) -> None:
        """From now on an earlier `next_time` lowers `wakes[place]` (whole numbers, ns) to it."""
        self.wakes = wakes
        self.wake_place = place
        # compiled, an address: close to the other fields of every request, where a memoryview takes 208 bytes
        self.due = cython.address(self.wakes[0]) if cython.compiled else self.wakes

    # ---- time

    @cython.ccall
    @cython.exceptval(check=False)
    @cython.cdivision(True)  # bits are not negative
    def aligned(self, bit: cython.longlong) -> cython.longlong:
        """The first tick not before `bit` that is whole nominal bits after the tick at which the bus is free."""
        rest: cython.longlong = bit - self.free_bit
        if rest <= 0:
            return bit
        return self.free_bit + (rest + self.bit_ticks - 1) // self.bit_ticks * self.bit_ticks

    @cython.ccall
    @cython.exceptval(check=False)
    def bit_of(self, time: cython.longlong) -> cython.longlong:
        """Number of the bit in progress at `time` (ns): floor(time * rate / 10^9)."""
        seconds: cython.longlong = time // SECOND_NS
        return seconds * self.tick_rate + (time - seconds * SECOND_NS) * self.tick_rate // SECOND_NS

    @cython.ccall
    @cython.exceptval(check=False)
    @cython.cdivision(True)  # bits are not negative
    def edge_ns(self, bit: cython.longlong) -> cython.longlong:
        """First whole ns at which bit number `bit` has begun: ceil(bit * 10^9 / rate)."""
        seconds: cython.longlong = bit // self.tick_rate
        rest: cython.longlong = bit - seconds * self.tick_rate
        return seconds * SECOND_NS + (rest * SECOND_NS + self.tick_rate - 1) // self.tick_rate

    # ---- requests

    def add_node(self, name, inbox, controller, order) -> int:
        """Put a controller on the bus; returns its node number.

        `inbox`: EventQueue that gets CAN_RX, CAN_TX_DONE and CAN_STATUS, with `controller` as field a and
        `order` (stage * 256 + source) as the queue's order. `Node.connect` avoids most CAN_TX_DONE messages.
        """
        node: Node
        index = len(self.nodes)
        node = Node(name, index, inbox, controller, order)
        if index > 0:
            node.following = self.nodes[0]
            self.nodes[index - 1].following = node
        node.sequence = SEQUENCE_BITS * self.bit_ticks
        if self.timing.is_fd:
            node.fdf = FDF_KNOWN
            node.iso = self.iso
        self.nodes.append(node)
        self.node_count += 1
        self.buffers.add_node()
        self.bit_level.add_node(node)
        if self.disturbed:  # as after reset: the bus is not at rest
            node.leave()
            node.start_joining(self.free_bit)
            self.bit_level.join(node, self.free_bit)
            self.joining += 1
        else:
            self.acknowledging += 1
        self._note_changes()
        return index

    @cython.ccall
    @cython.cdivision(True)  # times are not negative
    def request(
        self,
        node: cython.longlong,
        buffer: cython.longlong,
        time: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
    ) -> cython.bint:
        """Ask at `time` (ns) to send a frame from transmit buffer 1..3 of `node`; True when accepted.

        The bus refuses and counts the request and returns False when the buffer still holds a frame (it is free again
        from the stamp of that frame's CAN_TX_DONE on), and, with a CAN_TX_DONE of status TX_ABORTED, when the node is
        off the bus. FLAG_SINGLE_SHOT: one attempt; a lost arbitration or an error ends it with TX_LOST. ValueError for
        a node, buffer, identifier or flag that does not exist.
        """
        first: cython.longlong
        start: cython.longlong
        second: cython.longlong
        mask: cython.longlong = 0xFFFFFFFF
        row: cython.longlong = (node << NODE_SHIFT) + (buffer << BUFFER_SHIFT)
        if node < 0 or node >= self.node_count or buffer < 1 or buffer > BUFFERS:
            self._no_such_buffer(node, buffer)
        slots: cython.p_longlong = self.buffers.slots
        lo &= mask
        hi &= mask
        if identifier >> 11 or flags & ~FLAG_SINGLE_SHOT != EIGHT_BYTES:  # no standard frame of eight bytes
            if flags & FD_FLAGS and self.fd_data is None:
                return self.request_fd(node, buffer, time, identifier, flags, _bytes_of(flags, lo, hi))
            self._check_frame(identifier, flags)
            if flags & FLAG_REMOTE:  # a remote frame carries no data
                lo = 0
                hi = 0
            elif flags & LENGTH_CODE < 4:
                lo &= (1 << 8 * (flags & LENGTH_CODE)) - 1
                hi = 0
            elif flags & LENGTH_CODE < 8:
                hi &= (1 << 8 * ((flags & LENGTH_CODE) - 4)) - 1
        if time < slots[row + FREE_AT]:
            self._refuse(node, flags)
            return False
        if time < self.advanced:
            # stamped before bits that are already decided: it takes part from here on
            self.counters.late_requests += 1
            first = max(self.bit_of(self.advanced) + 1, self.free_bit)
            start = self.edge_ns(first)
        elif time < self.free_time:
            first = self.free_bit
            start = self.free_time
        else:  # the bit after bit_of(time), and its edge_ns
            second = time // SECOND_NS
            first = (time - second * SECOND_NS) * self.tick_rate // SECOND_NS + 1
            start = second * SECOND_NS + (first * SECOND_NS + self.tick_rate - 1) // self.tick_rate
            first += second * self.tick_rate
        if first < self.hindered_until:
            first = self._hindered(node, buffer, time, flags, first)
            if first < 0:
                return False
            start = self.edge_ns(first) if first < NEVER else NEVER
        if cython.compiled:
            slots[row + FREE_AT] = NEVER
            slots[row + READY] = first
            slots[row + ASKED] = time
            slots[row + NEXT] = self.buffers.first
            slots[row + IDENTIFIER] = identifier
            slots[row + FLAGS] = flags
            slots[row + LOW] = lo
            slots[row + HIGH] = hi
        else:
            slots[row : row + ROW] = (NEVER, first, time, self.buffers.first, identifier, flags, lo, hi)
        self.buffers.first = row
        self.buffers.waiting_count += 1
        if self.bit_ticks > 1 and first < NEVER:
            first = self.aligned(first)
            start = self.edge_ns(first)
        if first < self.next_bit:
            self.next_bit = first
        if start < self.next_time:
            self.next_time = start
            if start < self.due[self.wake_place]:
                self.due[self.wake_place] = start
        return True

    def request_fd(self, node, buffer, time, identifier, flags, data) -> bool:
        """`request` of a CAN FD frame with `data` (bytes); flags with FLAG_FD and the length code of so many bytes.

        FLAG_ESI shows the error state of another node, as a gateway does; otherwise the sender's own state decides.
        ValueError also for a classic bus or node, a remote frame, and a number of bytes that the code does not mean.
        """
        if flags & FLAG_ESI:
            flags |= ESI_REQUESTED
        data = bytes(data)
        if flags & FLAG_FD and not flags & FLAG_REMOTE:
            expected = fd_data_length(flags)
            if len(data) != expected:
                raise ValueError(
                    f"bus {self.name}: identifier {identifier:#x} has {len(data)} data bytes, its length code means "
                    f"{expected}"
                )
        if 0 <= node < self.node_count and self.timing.is_fd and self.nodes[node].fdf != FDF_KNOWN:
            raise ValueError(f"bus {self.name}: node {node} is a classic node and cannot send CAN FD frames")
        lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:8], "little")
        self.fd_data = data
        try:
            accepted = self.request(node, buffer, time, identifier, flags, lo, hi)
        finally:
            self.fd_data = None
        if accepted:
            self.buffers.payloads[node << NODE_SHIFT | buffer << BUFFER_SHIFT] = data
        return bool(accepted)

    @cython.cfunc
    def _no_such_buffer(self, node: cython.longlong, buffer: cython.longlong) -> None:
        if node < 0 or node >= self.node_count:
            raise ValueError(f"bus {self.name}: node {node} does not exist")
        raise ValueError(f"bus {self.name}: transmit buffer {buffer} is not one of 1, 2, 3")

    @cython.cfunc
    def _check_frame(self, identifier: cython.longlong, flags: cython.longlong) -> None:
        """ValueError for a frame that cannot be sent."""
        if flags & FLAG_EXTENDED:
            if identifier < 0 or identifier > HIGHEST_EXTENDED:
                raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 29 bits")
        elif identifier < 0 or identifier > HIGHEST_STANDARD:
            raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 11 bits")
        if flags & FD_FLAGS:
            fault = fault_of_fd_flags(flags & ~ESI_REQUESTED)
            if not fault and not self.timing.is_fd:
                fault = "this bus is classic CAN, without a data bit rate"
            if fault:
                raise ValueError(f"bus {self.name}: identifier {identifier:#x}: {fault}")
        elif flags & ~SENDABLE:
            raise ValueError(f"bus {self.name}: flags {flags:#x} of identifier {identifier:#x} cannot be sent")

    @cython.cfunc
    def _refuse(self, node: cython.longlong, flags: cython.longlong) -> None:
        owner: Node = self.nodes[node]
        self.counters.refused += 1
        owner.refused += 1
        if flags & FLAG_SINGLE_SHOT:
            self.counters.single_shot_skipped += 1
            owner.single_shot_skipped += 1

    @cython.cfunc
    def _hindered(
        self,
        node: cython.longlong,
        buffer: cython.longlong,
        time: cython.longlong,
        flags: cython.longlong,
        first: cython.longlong,
    ) -> cython.longlong:
        """READY of a request that could start at bit `first`: later if its node is suspended, NEVER + that bit while it
        is joining; -1, refused and answered, when it is off the bus."""
        owner: Node = self.nodes[node]
        if owner.mode == RESET or owner.mode == BUS_OFF or owner.mode == UNPLUGGED:
            self._refuse(node, flags)
            owner.end_unsent(buffer, time, TX_ABORTED)
            return -1
        if first < owner.suspend_bit:
            first = owner.suspend_bit
        return NEVER + first if owner.mode == JOINING else first

    @cython.ccall
    @cython.exceptval(check=True)
    def abort(self, node: cython.longlong, buffer: cython.longlong, time: cython.longlong) -> cython.void:
        """Abort, at `time` (ns), the frame waiting in a transmit buffer.

        If it has not started it is answered with TX_ABORTED. A frame under way is not stopped; if an error ends it, it
        is not repeated (SJA1000 data sheet, command register).
        """
        self._command(node, buffer, time, COMMAND_ABORT)

    @cython.ccall
    @cython.exceptval(check=True)
    def set_mode(self, node: cython.longlong, mode: cython.longlong, time: cython.longlong) -> cython.void:
        """Mode register of a node at `time` (ns): OPERATING (0) or RESET (1), as CAN_MODE messages carry.

        RESET drops waiting frames (TX_ABORTED). OPERATING joins after one sequence of 11 recessive bits, or,
        out of bus-off, after 128 of them with both error counters at zero. A plain frame under way is completed.
        """
        if mode != OPERATING and mode != RESET:
            raise ValueError(f"bus {self.name}: mode {mode} is neither 0 (operating) nor 1 (reset)")
        self._command(node, mode, time, COMMAND_MODE)

    def set_filter(self, node, filter_bytes, time) -> None:
        """Acceptance filter of a node for frames that start after `time` (ns), as CAN_FILTER messages carry.

        filter_bytes: of `acceptance.packed`; None: every frame is accepted.
        """
        self._command(node, 0, time, COMMAND_FILTER, None if filter_bytes is None else Acceptance(filter_bytes))

    def _command(self, node, value, time, kind, ref=None) -> None:
        if node < 0 or node >= len(self.nodes):
            raise ValueError(f"bus {self.name}: node {node} does not exist")
        self.commands.push(max(time, self.advanced), 0, kind, node, value, 0, 0, 0, 0, ref)
        self._note_changes()
        self.next_time = min(self.next_time, self.commands.head_time)
        self.wakes[self.wake_place] = min(self.wakes[self.wake_place], self.next_time)

    # ---- disturbances

    def inject_errors(self, count, position=-1) -> None:
        """Invert one bit of each of the next `count` frames for all nodes, at `position` from the start of frame.

        Stuff bits count. The effect depends on the position: in the arbitration field a false dominant bit reads as a
        lost arbitration; in the last bit of EOF it makes the sender repeat a frame that receivers have; after the frame
        it inverts the bit there. Negative: the middle of the frame, or the first bit that is behind every arbitration
        field (17, extended 41) where that is later.
        """
        self.disturbance.hit_frames(count, position)
        self._aim()

    def inject_error_at(self, time) -> None:
        """Invert the bus level during the bit at `time` (ns); on an idle bus that is a false start of frame.

        ValueError for a time that is decided already: a frame and its intermission are decided at its start.
        """
        bit = self.bit_of(time)
        if bit <= self.bit_of(self.advanced) or bit < self.free_bit:
            decided = max(self.advanced, self.edge_ns(self.free_bit) - 1)
            raise ValueError(f"bus {self.name}: {time} ns is decided already (up to {decided} ns)")
        self.disturbance.hit_bit(bit)
        self._aim()

    def set_bit_error_rate(self, rate) -> None:
        """Invert each bit not yet decided with probability `rate` (0 ... 0.1), from a separate random stream."""
        if not 0.0 <= rate <= HIGHEST_RATE:
            raise ValueError(f"bus {self.name}: bit error rate {rate} is outside 0 ... {HIGHEST_RATE}")
        self.disturbance.set_rate(rate, max(self.bit_of(self.advanced), self.free_bit - 1))
        self._aim()

    def tamper(self, tampering) -> None:
        """Let faults affect frames from now on (`tampering.Tampering`); None: no longer."""
        self.tampering = tampering
        self.bit_level.tampering = tampering
        self._aim()

    def _aim(self) -> None:
        """Update the criteria for plain frames after a change to any of them; a lone node gets no acknowledgement."""
        strike: cython.longlong = self.disturbance.next_bit
        self.next_strike = strike
        if self.acknowledging < 2 or self.disturbance.frames_left > 0 or self.tampering is not None:
            self.next_strike = -1
        if strike != self.strike_bit:
            self.strike_bit = strike
            self._find_next()
            self.wakes[self.wake_place] = min(self.wakes[self.wake_place], self.next_time)

    # ---- passing of time

    @cython.ccall
    def advance(self, until: cython.longlong) -> cython.longlong:
        """Decide every bit that begins up to and including `until` (ns); returns the next time of interest.

        Every request, abort and mode change stamped before `until` must have been made. The result (also in the field
        `next_time`) is the start of the next frame as far as known, or NEVER; a call before that time returns at once.
        """
        if until > self.advanced:
            self.advanced = until  # decided, even if nothing starts
        while self.next_time <= until:
            if self.disturbed:
                self._pass_bits(until)
            elif self.next_change > until or not self._change(until):
                if self.strike_bit < self.next_bit:
                    self._begin_bits(self._strike_start())
                elif self.bit_ticks > 1:
                    self._attempt_timed(self.next_bit)
                else:
                    self._attempt(self.next_bit)
            if self.buffers.first < 0 and self.next_change == NEVER and self.strike_bit == NEVER and not self.disturbed:
                self.next_bit = NEVER
                self.next_time = NEVER
            else:
                self._find_next()
        return self.next_time

    @cython.cfunc
    @cython.exceptval(check=False)
    def _strike_start(self) -> cython.longlong:
        """The bit of the next inverted one; on a CAN FD bus the start of the nominal bit in which it is."""
        strike: cython.longlong = self.strike_bit
        if self.bit_ticks > 1 and strike < NEVER:
            return self.free_bit + max(strike - self.free_bit, 0) // self.bit_ticks * self.bit_ticks
        return strike

    @cython.cfunc
    def _find_next(self) -> cython.void:
        """Set `next_bit` and `next_time` from the waiting frames; bit by bit, the next bit that waits for programs."""
        first: cython.longlong = self.buffers.first_ready()
        if first <= self.free_bit or self.disturbed:
            self.next_bit = self.free_bit
            self.next_time = self.free_time
        else:
            if self.bit_ticks > 1 and first < NEVER:
                first = self.aligned(first)
            self.next_bit = first
            self.next_time = self.edge_ns(first) if first < NEVER else NEVER
        if self.disturbed:
            return
        if self.strike_bit < self.next_bit:
            self.next_time = self.edge_ns(self._strike_start())
        if self.next_change < NEVER:
            first = self._next_join()
            if first < self.next_bit and first < self._strike_start():
                self.next_time = self.edge_ns(first)
            if self.commands.head_time < self.next_time:
                self.next_time = self.commands.head_time

    # ---- nodes that leave and join

    def _note_changes(self) -> None:
        """Update the fields that depend on waiting commands and on nodes that join or take part, after a change."""
        self.next_change = -1 if self.joining > 0 else self.commands.head_time
        self.hindered_until = self.suspended_until if self.acknowledging == self.node_count else NEVER
        self._aim()

    @cython.cfunc
    def _change(self, until: cython.longlong) -> cython.bint:
        """Carry out an abort or mode change, or let nodes join, if that is due before the next frame."""
        node: Node
        last: cython.longlong = self.bit_of(until)
        join: cython.longlong = self._next_join()
        start: cython.longlong = min(self.next_bit, self._strike_start())
        first: cython.longlong = self.edge_ns(min(start, join, last + 1))
        if self.commands.head_time <= until and self.commands.head_time < first:
            self._execute()
            return True
        if join <= last and join <= start:
            for node in self.nodes:
                if node.mode == JOINING and node.joins_at(self.free_bit) <= join:
                    self._join(node, join)
            return True
        for node in self.nodes:
            if node.mode == JOINING:
                node.count_sequences(self.free_bit, start)
        return False

    @cython.cfunc
    def _next_join(self) -> cython.longlong:
        """Bit at which the next joining node has seen its recessive sequences, if no frame starts earlier."""
        first: cython.longlong = NEVER
        node: Node
        if self.joining > 0:
            for node in self.nodes:
                if node.mode == JOINING:
                    first = min(first, node.joins_at(self.free_bit))
        return first

    def _execute(self) -> None:
        """Carry out the first abort, mode change or change of a filter."""
        node: Node
        commands: EventQueue = self.commands
        commands.take()
        node = self.nodes[commands.a]
        if commands.kind == COMMAND_ABORT:
            self._abort(node, commands.b, commands.time)
        elif commands.kind == COMMAND_FILTER:
            node.acceptance = commands.ref
        elif commands.b == RESET:
            self._reset(node, commands.time)
        elif (node.mode == RESET or node.mode == BUS_OFF) and commands.time >= node.off_ns:
            self._set_going(node, commands.time)
        self._note_changes()

    def _abort(self, node, buffer, time) -> None:
        """Abort the frame in a buffer, if it holds one; after a failed attempt: at its end."""
        row = node.index << NODE_SHIFT | buffer << BUFFER_SHIFT
        if not 1 <= buffer <= BUFFERS or not self.buffers.is_full(row):
            return
        if self.disturbed and self.bit_level.is_sending(row):
            self.bit_level.aborting.append(row)
            return
        if node.mode == OPERATING:
            time = max(time, self.edge_ns(self.buffers.rows[row + READY]))
        self._drop_aborted(node, row, time)

    def _reset(self, node, time) -> None:
        """Take a node off the bus, with its waiting frames."""
        if node.mode == OPERATING:
            self.acknowledging -= not node.silent
            node.leave()
        elif node.mode == JOINING:
            self.joining -= 1
            node.leave()
        if self.disturbed:
            self.bit_level.leave(node)
        for row in self.buffers.waiting_of(node.index):
            self._drop_aborted(node, row, time)

    def _drop_aborted(self, node, row, time) -> None:
        """End a request that its program aborted."""
        self.counters.aborted += 1
        node.aborted += 1
        self._drop(node, row, time, TX_ABORTED)

    @cython.cfunc
    def _join(self, node: Node, bit: cython.longlong) -> None:
        """Let a node whose sequences are complete at `bit` take part."""
        self.joining -= 1
        self.acknowledging += not node.silent
        if node.join():
            node.report_status(self.edge_ns(bit), ICR_ERROR_WARNING)
            self._note_result(self.edge_ns(bit))
        for row in self.buffers.waiting_of(node.index):
            self.buffers.rows[row + READY] = max(self.buffers.rows[row + READY] - NEVER, bit)
        self._note_changes()

    # ---- nodes that begin to join

    def _set_going(self, node: Node, time) -> None:
        """A node off the bus waits for its recessive sequences from `time` (ns) on."""
        first: cython.longlong = self.bit_of(time) + 1
        node.start_joining(first + (self.free_bit - first) % self.bit_ticks)  # as the nominal bits around it
        self.joining += 1
        if self.disturbed and self.bit_level.join(node, node.join_from) & MET_JOIN:
            self._join(node, self.bit_level.bit)
        self._note_changes()

    def take_out(self, node, time) -> list:
        """Take the requests that wait at a node, neither lost nor answered: (buffer, identifier, flags, lo, hi).

        `hi` of a CAN FD frame holds all bytes from the fifth on.
        """
        waited = []
        for row in self.buffers.waiting_of(node):
            rows = self.buffers.rows
            identifier, flags, hi = rows[row + IDENTIFIER], rows[row + FLAGS], rows[row + HIGH]
            if flags & FLAG_FD:
                hi = int.from_bytes(self.buffers.payloads[row][4:], "little")
                requested = FLAG_ESI if flags & ESI_REQUESTED else 0  # without the one that its own state shows
                flags = flags & ~(FLAG_ESI | ESI_REQUESTED) | requested
            waited.append((row >> BUFFER_SHIFT & BUFFER_MASK, identifier, flags, rows[row + LOW], hi))
            self.bit_level.forget(row)
            self.buffers.remove(row)
            self.buffers.rows[row + FREE_AT] = time
        return waited

    def recompute_next(self) -> None:
        """Recompute the next event and its time after nodes or requests were exchanged directly."""
        self._note_changes()
        self._find_next()
        self.wakes[self.wake_place] = min(self.wakes[self.wake_place], self.next_time)

    # ---- one frame

    @cython.cfunc
    @cython.cdivision(True)  # bits are not negative
    def _attempt(self, k: cython.longlong) -> cython.longlong:
        """Decide the frame that starts at bit k: arbitration; then its results to all nodes, when nothing disturbs it.

        Returns the first undecided bit: for a plain frame the bit at which the bus is free again, else k.
        """
        row: cython.longlong = self.buffers.first
        merged: cython.bint = False
        any_received: cython.bint = False
        identifier: cython.longlong
        flags: cython.longlong
        lo: cython.longlong
        hi: cython.longlong
        end: cython.longlong
        done: cython.longlong
        received: cython.longlong
        rest: cython.longlong
        asked: cython.longlong
        bits: cython.longlong
        rate: cython.longlong = self.tick_rate
        sender: Node
        node: Node
        slots: cython.p_longlong = self.buffers.slots
        if self.buffers.waiting_count > 1:
            row = self._arbitrate(k)
            if row < 0:  # another node sends the same arbitration field
                row = -row
                merged = True
        if cython.compiled:
            asked = slots[row + ASKED]
            identifier = slots[row + IDENTIFIER]
            flags = slots[row + FLAGS]
            lo = slots[row + LOW]
            hi = slots[row + HIGH]
        else:
            _, _, asked, _, identifier, flags, lo, hi = slots[row : row + ROW]
        bits = measure(identifier, flags, lo, hi) & MEASURED_BITS
        end = k + bits
        if (merged or self.next_strike < end + INTERMISSION_BITS) and self._is_disturbed(k, row, end, merged):
            self._begin_bits(k)
            return k
        if self.rivals > 0:
            self._contend(k, row)
            self.rivals = 0
        # edge_ns of `end`; from it those of end - 1 (the end of the sixth bit of EOF) and of the intermission's end
        if k - self.second_bit >= rate:
            self.second_ns = k // rate * SECOND_NS
            self.second_bit = k // rate * rate
        rest = (end - self.second_bit) * SECOND_NS + rate - 1
        done = rest // rate
        rest -= done * rate
        done += self.second_ns
        received = done - self.bit_ns - (rest < self.bit_rest)
        self.free_bit = end + INTERMISSION_BITS
        self.free_time = done + self.intermission_ns + (rest + self.intermission_rest >= rate)
        self.load.take(k, self.free_bit)
        self.counters.frames += 1
        if received <= self.advanced:
            self.counters.late_results += 1
        # the sender's buffer is free from `done` on
        self.buffers.remove(row)
        slots[row + FREE_AT] = done
        sender = cython.cast(Node, self.nodes[row >> NODE_SHIFT])
        if not sender.ends.write(row >> BUFFER_SHIFT & BUFFER_MASK, done, TX_SENT):
            sender.inbox.put(
                done, sender.order, CAN_TX_DONE, sender.controller, row >> BUFFER_SHIFT & BUFFER_MASK, TX_SENT, 0, 0, 0
            )
        sender.sent += 1
        if sender.transmit_errors > 0 or sender.passive:
            self._after_success(sender, end, done)
        flags &= RECEIVERS_SEE
        node = sender.following
        while node is not sender:
            if node.mode == OPERATING and not (merged and node.sending_end == end):
                if node.receive_errors > 0:
                    node.count_reception()
                    self._confine(node, self.edge_ns(end - ACK_DELIMITER_FROM_END), 0)  # behind the ACK slot
                if node.listening:
                    if node.acceptance is None or node.takes(identifier, flags):
                        node.inbox.put(received, node.order, CAN_RX, node.controller, identifier, flags, lo, hi, 0)
                        node.received += 1
                    any_received = True
            node = node.following
        if not any_received:
            self.counters.lost += 1
        if not flags & FLAG_EXTENDED:
            self.counters.note_answer(identifier, done - asked)
        self.log.add(received, identifier, flags, lo, hi, row >> NODE_SHIFT)
        if self.log.times is not None:
            self._note_times(k, asked, done, row, flags)
        return self.free_bit

    # ---- one frame on a CAN FD bus

    @cython.cfunc
    def _attempt_timed(self, k: cython.longlong) -> cython.longlong:
        """`_attempt` on a CAN FD bus, for frames of both kinds."""
        row: cython.longlong
        end: cython.longlong
        flags: cython.longlong
        identifier: cython.longlong
        lo: cython.longlong
        hi: cython.longlong
        merged: cython.bint = False
        any_received: cython.bint = False
        sender: Node
        node: Node
        slots: cython.p_longlong = self.buffers.slots
        self._show_error_states()
        row = self._arbitrate(k)
        if row < 0:
            row = -row
            merged = True
        end = k + self._ticks_of(row)
        identifier = slots[row + IDENTIFIER]
        flags = slots[row + FLAGS] & RECEIVERS_SEE
        lo = slots[row + LOW]
        hi = slots[row + HIGH]
        data = self.buffers.payloads[row] if flags & FLAG_FD else None
        special: cython.bint = data is not None and self._refuses_fd()
        plain: cython.bint = not merged and not special and self.next_strike >= end + self.intermission
        if not plain and self._is_disturbed(k, row, end, merged):
            self._begin_bits(k)
            return k
        if self.rivals > 0:
            self._contend(k, row)
            self.rivals = 0
        done = self.edge_ns(end)
        received = self.edge_ns(end - self.bit_ticks)
        self.free_bit = end + self.intermission
        self.free_time = self.edge_ns(self.free_bit)
        self.load.take(k, self.free_bit)
        self.counters.frames += 1
        self._note_result(received)
        asked = slots[row + ASKED]
        self.buffers.remove(row)
        slots[row + FREE_AT] = done
        sender = self.nodes[row >> NODE_SHIFT]
        buffer = row >> BUFFER_SHIFT & BUFFER_MASK
        if not sender.ends.write(buffer, done, TX_SENT):
            sender.inbox.put(done, sender.order, CAN_TX_DONE, sender.controller, buffer, TX_SENT, 0, 0, 0)
        sender.sent += 1
        if sender.transmit_errors > 0 or sender.passive:
            self._after_success(sender, end, done)
        node = sender.following
        while node is not sender:
            if node.mode == OPERATING and not (merged and node.sending_end == end):
                if node.receive_errors > 0:
                    node.count_reception()
                    # behind the ACK slot
                    self._confine(node, self.edge_ns(end - ACK_DELIMITER_FROM_END * self.bit_ticks), 0)
                if node.listening:
                    if node.takes(identifier, flags):
                        node.inbox.push(
                            received, node.order, CAN_RX, node.controller, identifier, flags, lo, hi, 0, data
                        )
                        node.received += 1
                    any_received = True
            node = node.following
        if not any_received:
            self.counters.lost += 1
        if not flags & FLAG_EXTENDED:
            self.counters.note_answer(identifier, done - asked)
        if data is None:
            self.log.add(received, identifier, flags, lo, hi, row >> NODE_SHIFT)
        else:
            self._note_fd(row, received, flags, data)
        if self.log.times is not None:
            self._note_times(k, asked, done, row, flags)
        return self.free_bit

    def _show_error_states(self) -> None:
        """Set ESI of waiting CAN FD frames by the error states of their senders (ISO 11898-1:2015)."""
        rows = self.buffers.rows
        for row in self.buffers.waiting():
            if rows[row + FLAGS] & FLAG_FD:
                shown = self.nodes[row >> NODE_SHIFT].passive or rows[row + FLAGS] & ESI_REQUESTED
                rows[row + FLAGS] = rows[row + FLAGS] & ~FLAG_ESI | (FLAG_ESI if shown else 0)

    def _ticks_of(self, row) -> int:
        """Ticks of the frame in a row of a CAN FD bus, from start of frame to the end of EOF."""
        rows = self.buffers.rows
        identifier, flags = rows[row + IDENTIFIER], rows[row + FLAGS]
        if flags & FLAG_FD:
            packed = phases(identifier, flags, self.buffers.payloads[row], self.iso)
            return int((packed & PHASE_MASK) * self.bit_ticks + (packed >> PHASE_SHIFT) * self.timing.data)
        return int((measure(identifier, flags, rows[row + LOW], rows[row + HIGH]) & MEASURED_BITS) * self.bit_ticks)

    def _note_fd(self, row, received, flags, data) -> None:
        """Record a CAN FD frame that its receivers have at `received` (ns)."""
        identifier = self.buffers.rows[row + IDENTIFIER]
        if flags & FLAG_BRS:
            self.load.data_bits += (phases(identifier, flags, data, self.iso) >> PHASE_SHIFT) * self.timing.data
        self.log.add_fd(received, identifier, flags, data, row >> NODE_SHIFT)

    @cython.cfunc
    def _note_times(
        self,
        k: cython.longlong,
        asked: cython.longlong,
        done: cython.longlong,
        row: cython.longlong,
        flags: cython.longlong,
    ) -> None:
        """Record that the frame in `row`, requested at `asked`, began at bit `k` and ends at `done` (ns)."""
        slots: cython.p_longlong = self.buffers.slots
        sender: cython.longlong = (row >> NODE_SHIFT) + 1 << SENDER_SHIFT
        sender |= (row >> BUFFER_SHIFT & BUFFER_MASK) << TIMES_BUFFER_SHIFT | flags
        self.log.times.add(
            self.edge_ns(k), asked, done, slots[row + IDENTIFIER], sender, slots[row + LOW], slots[row + HIGH]
        )

    @cython.cfunc
    def _after_success(self, node: Node, end: cython.longlong, done: cython.longlong) -> None:
        """Update a sender with earlier errors that has sent a whole frame: to bit `end`, at `done` (ns).

        Whether it suspends transmission is decided at the end of the intermission, so by the counter that has moved
        (see `MediumAccess._sample_intermission`); a good frame moves no counter in between.
        """
        if node.transmit_errors > 0:
            node.count_success()
            self._confine(node, done, 0)
        if node.passive:
            self._suspend(node, end + self.intermission + SUSPEND_BITS * self.bit_ticks)

    # ---- arbitration

    @cython.cfunc
    @cython.exceptval(check=False)
    def _key(self, row: cython.longlong) -> cython.longlong:
        """The arbitration field of the frame in a row: the lower one wins."""
        return arbitration_key(self.buffers.slots[row + IDENTIFIER], self.buffers.slots[row + FLAGS])

    @cython.cfunc
    def _arbitrate(self, k: cython.longlong) -> cython.longlong:
        """The row that wins the frame that starts at bit k; negative when another node offers the same field."""
        best: cython.longlong = -1
        best_key: cython.longlong = 0
        ready: cython.longlong = 0
        merged: cython.bint = False
        slots: cython.p_longlong = self.buffers.slots
        row: cython.longlong = self.buffers.first
        key: cython.longlong
        while row >= 0:
            if slots[row + READY] <= k:
                ready += 1
                key = self._key(row)
                if best < 0 or key < best_key:
                    merged = False
                    best = row
                    best_key = key
                elif key == best_key:
                    if row >> NODE_SHIFT != best >> NODE_SHIFT:
                        merged = True
                    if row < best:
                        best = row
            row = slots[row + NEXT]
        self.rivals = ready - 1
        return -best if merged else best

    @cython.cfunc
    def _contend(self, k: cython.longlong, best: cython.longlong) -> None:
        """Record the nodes that lose the arbitration against the row `best`."""
        slots: cython.p_longlong = self.buffers.slots
        row: cython.longlong = self.buffers.first
        key: cython.longlong
        best_key: cython.longlong = self._key(best)
        loser: Node
        skipped = None
        while row >= 0:
            if row >> NODE_SHIFT != best >> NODE_SHIFT and slots[row + READY] <= k:  # another node's
                key = self._key(row)
                if key != best_key and self._is_offered(row, key, k):
                    loser = self.nodes[row >> NODE_SHIFT]
                    loser.arbitrations_lost += 1
                    self.counters.arbitrations_lost += 1
                    if slots[row + FLAGS] & FLAG_SINGLE_SHOT:
                        if skipped is None:
                            skipped = []
                        skipped.append(row)
            row = slots[row + NEXT]
        if skipped is not None:
            for lost in sorted(skipped):
                self._skip(lost, self.edge_ns(k + self._bits_until_loss(lost, best) * self.bit_ticks))

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_offered(self, row: cython.longlong, key: cython.longlong, k: cython.longlong) -> cython.bint:
        """True when its node offers this row at bit k: the lowest of its ready frames."""
        slots: cython.p_longlong = self.buffers.slots
        other: cython.longlong = self.buffers.first
        other_key: cython.longlong
        while other >= 0:
            if other >> NODE_SHIFT == row >> NODE_SHIFT and other != row and slots[other + READY] <= k:
                other_key = self._key(other)
                if other_key < key or (other_key == key and other < row):
                    return False
            other = slots[other + NEXT]
        return True

    def _bits_until_loss(self, row, best) -> int:
        """Bits from the start of frame to the end of the bit at which the sender of `row` saw that `best` wins."""
        return first_difference(self.buffers.wire(row)[0], self.buffers.wire(best)[0]) + 1

    def _skip(self, row, time) -> None:
        """End a single shot that failed."""
        node: Node = self.nodes[row >> NODE_SHIFT]
        node.single_shot_skipped += 1
        self.counters.single_shot_skipped += 1
        self.counters.single_shot_dropped += 1
        self._drop(node, row, time, TX_LOST)

    def _drop(self, node, row, time, status) -> None:
        """End a waiting request without success, answered at `time`."""
        if self.disturbed:
            self.bit_level.forget(row)
        self.buffers.remove(row)
        self.buffers.rows[row + FREE_AT] = time
        self._note_result(time)
        node.end_unsent(row >> BUFFER_SHIFT & BUFFER_MASK, time, status)

    # ---- several senders of one frame

    @cython.cfunc
    def _is_disturbed(
        self, k: cython.longlong, best: cython.longlong, end: cython.longlong, merged: cython.bint
    ) -> cython.bint:
        """True when the frame on bits k ... end - 1, or its intermission, is not plain.

        When it is, the other senders of a `merged` frame are completed here.
        """
        if self.strike_bit < end + self.intermission or self.disturbance.frames_left > 0:
            return True
        if self.buffers.rows[best + FLAGS] & FLAG_FD and self._refuses_fd():
            return True
        if self.tampering is not None and self.tampering.reaches(self, best, k):
            return True
        senders = self._senders(k, best) if merged else [best]
        if sum(not self.nodes[row >> NODE_SHIFT].silent for row in senders) >= self.acknowledging:
            return True  # no node is left to acknowledge
        wire = self.buffers.wire(best)[0]
        if any(self.buffers.wire(row)[0] != wire for row in senders):
            return True
        for row in senders:
            if row != best:
                self.counters.merged += 1
                self._finish_merged(self.nodes[row >> NODE_SHIFT], row, end)
        return False

    def _senders(self, k, best) -> list:
        """Rows whose frames are sent together: the first one with the winning field of each node."""
        found: dict = {}
        for row in self.buffers.waiting():
            if self.buffers.rows[row + READY] <= k and self._key(row) == self._key(best):
                node = row >> NODE_SHIFT
                found[node] = min(row, found.get(node, row))
        return sorted(found.values())

    def _finish_merged(self, node, row, end) -> None:
        """Complete a node that sent the same frame as the winner, up to bit `end`: it is a sender too, not a
        receiver."""
        done = self.edge_ns(end)
        buffer = row >> BUFFER_SHIFT & BUFFER_MASK
        self.buffers.remove(row)
        self.buffers.rows[row + FREE_AT] = done
        node.sending_end = end
        node.sent += 1
        if not node.ends.write(buffer, done, TX_SENT):
            node.inbox.put(done, node.order, CAN_TX_DONE, node.controller, buffer, TX_SENT, 0, 0, 0)
        self._after_success(node, end, done)

    # ---- bit by bit

    def _begin_bits(self, bit) -> None:
        """Switch to bit-by-bit simulation from `bit` on, up to which the bus is idle."""
        self.disturbed = True
        self.rivals = 0
        self.bit_level.begin(bit, self.free_bit)
        self.free_bit = bit
        self.free_time = self.edge_ns(bit)

    def _pass_bits(self, until: cython.longlong) -> None:
        """Pass bits until the bus is at rest, or up to one that begins after `until` and waits for programs."""
        level: BitLevel = self.bit_level
        machine: MediumAccess
        last: cython.longlong = self.bit_of(until)
        while True:
            level.prepare_bit()
            if level.at_rest and level.bit > level.first_bit and not level.away:
                break
            if level.open or level.at_rest:
                while self.commands.head_time <= until and self.commands.head_time < self.edge_ns(level.bit):
                    self._execute()
                if level.bit > last:
                    self._decided(level.bit)
                    return
                level.levels.clear()
                level.prepare_bit()
                if level.at_rest and level.bit > level.first_bit:
                    break
                level.start_frames()
            if level.is_timed:
                level.pass_ticks()
            else:
                level.pass_bit()
            for machine in level.machines:
                if machine.met and (machine.next_start == level.bit or not level.is_timed):
                    self._follow(machine, level.bit)
            if level.in_error:
                self._follow_error_frame()
        self._decided(level.bit)
        self.disturbed = False
        for machine in level.machines:
            if machine.state == MAC_SUSPENDED:
                self._suspend(machine.node, level.bit + (SUSPEND_BITS - machine.count) * self.bit_ticks)
            elif machine.state == MAC_JOINING:
                machine.node.join_from = level.bit - machine.count * self.bit_ticks
        self._note_changes()

    @cython.cfunc
    def _decided(self, bit: cython.longlong) -> None:
        """Mark all bits before `bit` as decided."""
        self.load.take(self.free_bit, bit)
        self.free_bit = bit
        self.free_time = self.edge_ns(bit)

    def _follow(self, machine: MediumAccess, bit: cython.longlong) -> None:
        """Handle the result of the bit before `bit` for a node."""
        node: Node = machine.node
        met: cython.longlong = machine.met
        row: cython.longlong = machine.row
        time: cython.longlong = self.edge_ns(bit)
        if met & MET_RECEIVED and node.listening and (self.tampering is None or self.tampering.receives(machine, time)):
            flags = machine.flags
            if not node.takes(machine.identifier, flags):
                pass
            elif flags & FLAG_FD:
                data = bytes(machine.payload)
                lo, hi = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:8], "little")
                node.inbox.push(time, node.order, CAN_RX, node.controller, machine.identifier, flags, lo, hi, 0, data)
                node.received += 1
            else:
                node.inbox.put(
                    time, node.order, CAN_RX, node.controller, machine.identifier, flags, machine.lo, machine.hi, 0
                )
                node.received += 1
            self.bit_level.received_bit = bit
            self._note_result(time)
        if met & MET_SENT:
            self._sent(node, row, bit)
        if met & MET_LOSS:
            node.arbitrations_lost += 1
            self.counters.arbitrations_lost += 1
            if row in self.bit_level.aborting:
                self._drop_aborted(node, row, time)
            elif self.buffers.rows[row + FLAGS] & FLAG_SINGLE_SHOT:
                self._skip(row, time)
        if met & MET_COUNTER:
            if self.tampering is not None:
                self.tampering.notices(machine, time)
            self._confine(node, time, machine.capture)
            if node.mode == BUS_OFF:
                self._flush(node, time)
                return
        if met & MET_FAILURE and row not in self.bit_level.aborting:
            if not self.buffers.rows[row + FLAGS] & FLAG_SINGLE_SHOT:
                self.counters.retries += 1
                node.retries += 1
        if met & MET_SETTLED and row >= 0:
            if row in self.bit_level.aborting:
                self._drop_aborted(node, row, time)
            elif self.buffers.rows[row + FLAGS] & FLAG_SINGLE_SHOT:
                self._skip(row, time)
            else:
                self.buffers.hold(row, bit + (INTERMISSION_BITS - 1) * self.bit_ticks)  # its last bit may be a start
        if met & MET_JOIN:
            self._join(node, bit)
        if met & MET_START:
            self.bit_level.start_late(machine)
            self._aim()

    @cython.cfunc
    def _sent(self, node: Node, row: cython.longlong, bit: cython.longlong) -> None:
        """Complete a node's frame, whose last bit was the one before `bit`."""
        slots: cython.p_longlong = self.buffers.slots
        time: cython.longlong = self.edge_ns(bit)
        identifier: cython.longlong = slots[row + IDENTIFIER]
        flags: cython.longlong = slots[row + FLAGS] & RECEIVERS_SEE
        if self.bit_level.sent_bit == bit:  # another node sent the same
            self.counters.merged += 1
        else:
            self.bit_level.sent_bit = bit
            self.counters.frames += 1
            if self.bit_level.received_bit != bit - self.bit_ticks:
                self.counters.lost += 1
            if not flags & FLAG_EXTENDED:
                self.counters.note_answer(identifier, time - slots[row + ASKED])
            received: cython.longlong = self.edge_ns(bit - self.bit_ticks)
            if flags & FLAG_FD:
                self._note_fd(row, received, flags, self.buffers.payloads[row])
            else:
                self.log.add(received, identifier, flags, slots[row + LOW], slots[row + HIGH], node.index)
            if self.log.times is not None:
                machine: MediumAccess = self.bit_level.machines[node.index]
                self._note_times(machine.begun, slots[row + ASKED], time, row, flags)
        self.bit_level.forget(row)
        self.buffers.remove(row)
        slots[row + FREE_AT] = time
        node.sent += 1
        self._note_result(time)
        buffer = row >> BUFFER_SHIFT & BUFFER_MASK
        if not node.ends.write(buffer, time, TX_SENT):
            node.inbox.put(time, node.order, CAN_TX_DONE, node.controller, buffer, TX_SENT, 0, 0, 0)

    def _follow_error_frame(self) -> None:
        """Count an error frame when it begins, log it when it is over."""
        level: BitLevel = self.bit_level
        if not level.counted:
            level.counted = True
            self.counters.errors += 1
        if level.error_is_over():
            level.in_error = level.counted = False
            end = self.edge_ns(level.bit)
            flags = level.flags if self.log.stream is None else level.flags & 0xFF  # of a stream's row, without FD's
            self.log.add(end, level.identifier, flags, level.error_field, level.error_position, level.sender)
            if self.log.times is not None:
                begun = self.edge_ns(level.error_begun)
                sender = level.sender + 1 << SENDER_SHIFT | level.flags
                self.log.times.add(begun, begun, end, level.identifier, sender, level.error_field, level.error_position)

    def _flush(self, node, time) -> None:
        """Handle a node that is bus-off: its waiting frames are lost."""
        self.bit_level.leave(node)
        for waiting in self.buffers.waiting_of(node.index):
            self.counters.flushed += 1
            node.flushed += 1
            self.counters.lost += 1
            self._drop(node, waiting, time, TX_ABORTED)

    # ---- error confinement

    def _suspend(self, node, bit) -> None:
        """Suspend transmission: an error-passive sender sends nothing before `bit` (ISO 11898-1)."""
        node.suspend_bit = bit
        self.suspended_until = max(self.suspended_until, bit)
        self.hindered_until = max(self.hindered_until, bit)
        for row in self.buffers.waiting_of(node.index):
            self.buffers.hold(row, bit)

    @cython.cfunc
    def _confine(self, node: Node, time: cython.longlong, interrupts: cython.longlong) -> None:
        """Update the error confinement of a node whose counter has changed."""
        if node.confine(time, interrupts):
            self.acknowledging -= not node.silent
            node.off_ns = time
            self._note_changes()
        self._note_result(time)

    @cython.cfunc
    def _note_result(self, time: cython.longlong) -> None:
        """Count a result that was pushed with the stamp `time`."""
        if time <= self.advanced:
            self.counters.late_results += 1
