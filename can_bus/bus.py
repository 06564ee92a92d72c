# cython: boundscheck=False, wraparound=False, initializedcheck=False
# (every index below counts nodes, transmit buffers or logged frames, or is an identifier that `request` has checked)
"""One CAN bus to the bit: arbitration, timing, acknowledgement, errors and load.

Time. Inside, the bus counts absolute bits since power-up; an instant in ns is made from such a count only
when a result leaves. Bit k begins at the first whole nanosecond at or after k / bitrate
(ceil(k 10^9 / bitrate)), so 3 Mbit/s, where a bit is 333 1/3 ns, drifts by nothing in any time.
All controllers share this bit grid: real ones synchronise to the edges of whoever sends (ISO 11898-1).
A request takes part in every start of frame strictly after its stamp, never in one at its stamp: what a
program writes at the instant at which the bus falls free comes too late. On an idle bus a frame therefore
starts at the next bit edge. So `advance(t)` can decide everything up to and including t as soon as all
requests stamped before t are known, and results do not depend on how time is cut into advances.

Order. The lowest arbitration field among the controllers ready wins; a controller offers the lowest of its
three buffers, ties by buffer number (LPC2194 with TPM = 0). Nothing is pre-empted.

A frame is decided at its start: its results are pushed, stamped in the future, into the nodes' inboxes; its end is
written down for the sender where that looks for it (`Node.connect`).
Receivers have the frame at the end of the sixth bit of EOF, its sender is done at the end of the seventh.
"""

import array

import cython

from ranger_sim.can_bus.frame import INTERMISSION_BITS, arbitration_key, measure, wire
from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.foundation.events import (
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_ERROR,
    NEVER,
    TX_ABORTED,
    TX_LOST,
    TX_SENT,
    EventQueue,
)
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.random_stream import RandomStream

if not cython.compiled:
    from math import log

# Modes of a node, as `set_mode` takes them (the first two) and as `Node.mode` shows them.
OPERATING = 0
RESET = 1  # off the bus: neither sends, receives nor acknowledges
BUS_OFF = 2  # thrown off by its transmit error counter
JOINING = 3  # waits for recessive sequences before it takes part

# Interrupt bits of a CAN_STATUS message: CxICR of the LPC2194 (user manual UM10114, table of CANICR).
ICR_ERROR_WARNING = 1 << 2  # EI: the warning limit was crossed either way, or bus-off entered or left
ICR_ERROR_PASSIVE = 1 << 5  # EPI: error passive entered or left
ICR_BUS_ERROR = 1 << 7  # BEI: an error frame; the capture fields below are valid
ICR_FIELD_SHIFT = 16  # bits 16-20: FIELD_* of can_bus.frame
ICR_RECEIVING = 1 << 21  # ERRDIR: the error was met while receiving
ICR_KIND_SHIFT = 22  # bits 22-23: KIND_*
KIND_BIT = 0
KIND_FORM = 1
KIND_STUFF = 2
KIND_OTHER = 3

WARNING_LIMIT = 96  # CxEWL after reset; ISO 11898-1 recommends the same
PASSIVE_LIMIT = 128  # ISO 11898-1: error passive from here
BUS_OFF_LIMIT = 256  # ISO 11898-1: bus-off from here (transmit errors)
RECOVERY_SEQUENCES = 128  # ISO 11898-1: occurrences of 11 recessive bits before a bus-off node returns
SEQUENCE_BITS = 11

BUFFERS = 3  # transmit buffers of an LPC2194 CAN controller
LOG_FIELDS = 6  # time_ns, identifier, flags, lo, hi, node
WINDOW_RING = 1024  # closed load windows kept, 10.24 s

COMMAND_ABORT = 1
COMMAND_MODE = 2

# A transmit buffer is a row of eight numbers in `Bus.rows`; buffer 1 ... 3 of a node begins at node * 32 + buffer * 8.
ROW = 8
FREE_AT = 0  # instant from which it takes a frame, ns; NEVER while it holds one
READY = 1  # bit at which its frame may start; NEVER + that bit while its node is joining
ASKED = 2  # instant of the request, ns
NEXT = 3  # the row that waits behind this one, -1 for none
IDENTIFIER = 4
FLAGS = 5
LOW = 6  # word 0
HIGH = 7  # word 1


class Node:
    """A controller on a bus, with its error counters (ISO 11898-1) and what it did so far.

    `following`: the next one of the bus; behind the last comes the first. `listening`: it wants what it receives (a
    node that does not still acknowledges). `flushed`: frames that waited when it went bus-off. `refused`: requests
    into an occupied buffer or while off the bus. `ends`: where the ends of its transmissions are written, unless they
    shall be messages.
    """

    def __init__(self, name, index, inbox, controller, order) -> None:
        self.inbox = inbox
        self.ends = TransmitEnds(by_message=True)
        self.following = self
        self.order = order
        self.controller = controller
        self.mode = 0  # OPERATING
        self.listening = True
        self.transmit_errors = 0
        self.receive_errors = 0
        self.passive = False
        self.warning = False
        self.sent = 0
        self.received = 0
        self.name = name
        self.index = index
        self.sequences_left = 0
        self.join_from = 0
        self.suspend_bit = 0
        self.sending_end = -1
        self.refused = 0
        self.aborted = 0
        self.single_shot_skipped = 0
        self.flushed = 0
        self.arbitrations_lost = 0
        self.retries = 0

    def connect(self, ends) -> None:
        """The ends of transmissions are written into `ends` from now on, None: all are messages."""
        self.ends = TransmitEnds(by_message=True) if ends is None else ends
        self.ends.order = self.order


class Bus:
    """A CAN bus. `bitrate` in bit/s; `seed` feeds the noise source of `set_bit_error_rate` only.

    Statistics are fields: `accepted` requests; `frames` sent whole; `bits` the bus was taken (stuff bits,
    intermission and error frames included); `lost` accepted but received by no listening node (nobody
    listened, or the sender fell off the bus with the frame still waiting); `single_shot_skipped` single
    shots that did not go out; `arbitrations_lost`, `retries` after an error; `errors` error frames;
    `refused` requests; `aborted`; `merged` frames that two nodes sent at once with equal content.
    At any time accepted = frames + merged + aborted + flushed + single shots dropped + pending_count.
    `late_results` counts results stamped at or before the `until` that found them: with steps of
    `advance` shorter than the shortest frame and no errors it stays 0.
    """

    def __init__(self, name, bitrate, seed=0, log_capacity=4096) -> None:
        if bitrate < 1000 or bitrate > 100_000_000:
            raise ValueError(f"bus {name}: bit rate {bitrate} bit/s is outside 1000 ... 100000000")
        self.name = name
        self.bitrate = bitrate
        self.seed = seed
        self.nodes = []
        self.node_count = 0
        self.acknowledging = 0
        self.joining = 0
        self.suspended_until = 0  # the last bit up to which a node has been suspended
        self.hindered_until = 0  # the same; NEVER while not every node takes part
        self.commands = EventQueue(16)
        self.next_change = NEVER  # the instant of the first command; -1 while a node is joining
        self.advanced = -1
        self.next_bit = NEVER  # where the next frame starts, as far as known
        self.next_time = NEVER
        self.wakes = integers(1)
        self.wake_place = 0
        self.rows = integers(ROW)
        self.first = -1  # of the rows that wait, in no order
        self.pending_count = 0
        self.noise = None
        self.bit_error_rate = 0.0
        self.next_noise_bit = NEVER
        self.next_planned_bit = NEVER
        self.next_strike = -1  # the next bit that is hit; -1 when the next frame fails wherever that lies
        self.strikes_left = 0
        self.strike_position = -1
        self.planned_bits = []
        self.free_bit = 0  # after the intermission of the last frame; its instant:
        self.free_time = 0
        # the second in which the last frame began: its first bit and its instant
        self.second_bit = 0
        self.second_ns = 0
        self.bit_ns, self.bit_rest = divmod(1_000_000_000, bitrate)  # a bit in ns, and what is left of it times bitrate
        self.intermission_ns, self.intermission_rest = divmod(INTERMISSION_BITS * 1_000_000_000, bitrate)
        self.window_bits = max(bitrate // 100, 1)  # 10 ms
        self.log_capacity = log_capacity
        self.log = array.array("q", [0]) * (LOG_FIELDS * log_capacity)
        self.log_count = 0
        self.log_dropped = 0
        self.log_sink = None
        self.trace = None  # a FrameStream takes the frames instead of the log
        self.reset_statistics(0)

    def reset_statistics(self, time) -> None:
        """Set every statistic to zero; loads count from `time` (ns) on. Waiting frames count as accepted."""
        self.frames = 0
        self.merged = 0
        self.bits = 0
        self.lost = 0
        self.single_shot_skipped = 0
        self.single_shot_dropped = 0
        self.retries = 0
        self.errors = 0
        self.refused = 0
        self.arbitrations_lost = 0
        self.aborted = 0
        self.flushed = 0
        self.late_results = 0
        self.late_requests = 0
        self.identifiers = integers(2 * 2048)  # by standard identifier: frames, longest response in ns
        self._find_numbers()
        self.frames_by_extended_identifier = {}
        self.origin_bit = self.bit_of(time)
        self.window_end = self.origin_bit + self.window_bits
        self.window_busy = 0
        self.window_busy_max = 0
        self.window_count = 0
        self.windows = integers(WINDOW_RING)

    def _find_numbers(self) -> None:
        """Set `slots`, `counts` and `due`, by which `rows`, `identifiers` and `wakes` are read and written.

        Compiled they are addresses: three in a line of the processor's cache, where a memoryview takes 208 bytes.
        """
        if cython.compiled:
            self.slots = cython.address(self.rows[0])
            self.counts = cython.address(self.identifiers[0])
            self.due = cython.address(self.wakes[0])
        else:
            self.slots = self.rows
            self.counts = self.identifiers
            self.due = self.wakes

    @property
    def operating(self) -> int:
        """Nodes that take part and acknowledge; an observer that only listens takes itself off."""
        return self.acknowledging

    @operating.setter
    def operating(self, count: int) -> None:
        self.acknowledging = count
        self._note_changes()

    @property
    def accepted(self) -> int:
        """Requests taken; what waited when the statistics were set to zero counts."""
        over = self.frames + self.merged + self.aborted + self.flushed + self.single_shot_dropped
        return over + self.pending_count

    @property
    def frames_by_identifier(self) -> list:
        """Frames sent whole, by standard identifier."""
        return list(self.identifiers[0::2])

    @property
    def response_max_ns(self) -> list:
        """Longest time from a request to the end of its frame, by standard identifier, ns."""
        return list(self.identifiers[1::2])

    # ---- time

    def bit_of(self, time: cython.longlong) -> cython.longlong:
        """Number of the bit that runs at `time` (ns): floor(time * bitrate / 10^9)."""
        billion: cython.longlong = 1000000000
        seconds: cython.longlong = time // billion
        return seconds * self.bitrate + (time - seconds * billion) * self.bitrate // billion

    @cython.cdivision(True)  # bits are not negative
    def edge_ns(self, bit: cython.longlong) -> cython.longlong:
        """First whole ns at which bit number `bit` has begun: ceil(bit * 10^9 / bitrate)."""
        billion: cython.longlong = 1000000000
        seconds: cython.longlong = bit // self.bitrate
        rest: cython.longlong = bit - seconds * self.bitrate
        return seconds * billion + (rest * billion + self.bitrate - 1) // self.bitrate

    def wake(self, wakes, place) -> None:
        """From now on an earlier `next_time` lowers `wakes[place]` (whole numbers, ns) to it."""
        self.wakes = wakes
        self.wake_place = place
        self._find_numbers()

    # ---- nodes

    def add_node(self, name, inbox, controller, order) -> int:
        """Put a controller on the bus; returns its node number.

        `inbox`: EventQueue that gets CAN_RX, CAN_TX_DONE and CAN_STATUS, with `controller` as field a and
        `order` (stage * 256 + source) as the queue's order. `Node.connect` spares it most of CAN_TX_DONE.
        """
        node: Node
        index = len(self.nodes)
        node = Node(name, index, inbox, controller, order)
        if index > 0:
            node.following = self.nodes[0]
            self.nodes[index - 1].following = node
        self.nodes.append(node)
        self.node_count += 1
        self.acknowledging += 1
        before = self.rows
        self.rows = integers(4 * ROW * self.node_count)
        for place in range(len(before)):
            self.rows[place] = before[place]
        self._find_numbers()
        self._aim()
        return index

    @cython.cdivision(True)  # instants are not negative
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

        Refused, counted and answered False when the buffer still holds a frame (it is free again from
        the stamp of that frame's CAN_TX_DONE on), and, with a CAN_TX_DONE of status TX_ABORTED, when the
        node is off the bus. FLAG_SINGLE_SHOT: one attempt; a lost arbitration or an error ends it with
        TX_LOST. ValueError for a node, buffer, identifier or flag that does not exist.
        """
        first: cython.longlong
        start: cython.longlong
        second: cython.longlong
        billion: cython.longlong = 1000000000
        mask: cython.longlong = 0xFFFFFFFF
        never: cython.longlong = 1 << 62
        row: cython.longlong = (node << 5) + (buffer << 3)
        if node < 0 or node >= self.node_count or buffer < 1 or buffer > 3:
            self._no_such_buffer(node, buffer)
        lo &= mask
        hi &= mask
        if identifier >> 11 or flags & ~32 != 8:  # no standard frame of eight bytes
            self._check_frame(identifier, flags)
            if flags & 16:  # a remote frame carries no data
                lo = 0
                hi = 0
            elif flags & 15 < 4:
                lo &= (1 << 8 * (flags & 15)) - 1
                hi = 0
            elif flags & 15 < 8:
                hi &= (1 << 8 * ((flags & 15) - 4)) - 1
        if time < self.slots[row]:  # FREE_AT
            self._refuse(node, flags)
            return False
        if time < self.advanced:
            # stamped before what has been decided: it takes part from here on
            self.late_requests += 1
            first = max(self.bit_of(self.advanced) + 1, self.free_bit)
            start = self.edge_ns(first)
        elif time < self.free_time:
            first = self.free_bit
            start = self.free_time
        else:  # the bit after bit_of(time), and its edge_ns
            second = time // billion
            first = (time - second * billion) * self.bitrate // billion + 1
            start = second * billion + (first * billion + self.bitrate - 1) // self.bitrate
            first += second * self.bitrate
        if first < self.hindered_until:
            first = self._hindered(node, buffer, time, flags, first)
            if first < 0:
                return False
            start = self.edge_ns(first) if first < never else never
        if cython.compiled:
            self.slots[row] = never
            self.slots[row + 1] = first
            self.slots[row + 2] = time
            self.slots[row + 3] = self.first
            self.slots[row + 4] = identifier
            self.slots[row + 5] = flags
            self.slots[row + 6] = lo
            self.slots[row + 7] = hi
        else:
            self.slots[row : row + 8] = (never, first, time, self.first, identifier, flags, lo, hi)
        self.first = row
        self.pending_count += 1
        if first < self.next_bit:
            self.next_bit = first
        if start < self.next_time:
            self.next_time = start
            if start < self.due[self.wake_place]:
                self.due[self.wake_place] = start
        return True

    def _no_such_buffer(self, node: cython.longlong, buffer: cython.longlong) -> None:
        if node < 0 or node >= self.node_count:
            raise ValueError(f"bus {self.name}: node {node} does not exist")
        raise ValueError(f"bus {self.name}: transmit buffer {buffer} is not one of 1, 2, 3")

    def _check_frame(self, identifier: cython.longlong, flags: cython.longlong) -> None:
        """ValueError for a frame that cannot be sent."""
        if flags & 64:  # FLAG_EXTENDED
            if identifier < 0 or identifier > 0x1FFFFFFF:
                raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 29 bits")
        elif identifier < 0 or identifier > 0x7FF:
            raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 11 bits")
        if flags & ~0x7F:  # length code, remote, single shot, extended
            raise ValueError(f"bus {self.name}: flags {flags:#x} of identifier {identifier:#x} cannot be sent")

    def _refuse(self, node: cython.longlong, flags: cython.longlong) -> None:
        owner: Node = self.nodes[node]
        self.refused += 1
        owner.refused += 1
        if flags & 32:  # FLAG_SINGLE_SHOT
            self.single_shot_skipped += 1
            owner.single_shot_skipped += 1

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
        if owner.mode == RESET or owner.mode == BUS_OFF:
            self._refuse(node, flags)
            if not owner.ends.write(buffer, time, TX_ABORTED):
                owner.inbox.push(time, owner.order, CAN_TX_DONE, owner.controller, buffer, TX_ABORTED)
            return -1
        if first < owner.suspend_bit:
            first = owner.suspend_bit
        return NEVER + first if owner.mode == JOINING else first

    def abort(self, node: cython.longlong, buffer: cython.longlong, time: cython.longlong) -> cython.void:
        """Take back, at `time` (ns), the frame waiting in a transmit buffer.

        If it has not started it is answered with TX_ABORTED. A frame under way is not stopped; should
        it fail by an error, it is not repeated (SJA1000 data sheet, command register).
        """
        self._command(node, buffer, time, COMMAND_ABORT)

    def set_mode(self, node: cython.longlong, mode: cython.longlong, time: cython.longlong) -> cython.void:
        """Mode register of a node at `time` (ns): OPERATING (0) or RESET (1), as CAN_MODE messages carry.

        RESET drops what waits (TX_ABORTED). OPERATING joins after one sequence of 11 recessive bits, or,
        out of bus-off, after 128 of them with both error counters at zero. A frame under way is completed.
        """
        if mode != OPERATING and mode != RESET:
            raise ValueError(f"bus {self.name}: mode {mode} is neither 0 (operating) nor 1 (reset)")
        self._command(node, mode, time, COMMAND_MODE)

    def _command(self, node, value, time, kind) -> None:
        if node < 0 or node >= len(self.nodes):
            raise ValueError(f"bus {self.name}: node {node} does not exist")
        self.commands.push(max(time, self.advanced), 0, kind, node, value)
        self._note_changes()
        self.next_time = min(self.next_time, self.commands.head_time)
        self.wakes[self.wake_place] = min(self.wakes[self.wake_place], self.next_time)

    # ---- disturbances

    def inject_errors(self, count, position=-1) -> None:
        """Corrupt the next `count` frames at bit `position` (from the start of frame, stuff bits counted).

        The bus level of that bit is inverted for everybody. Negative: the middle of the frame. Positions
        are held between the first bit after the arbitration field (17, extended 41: inside it a false
        bit reads as a lost arbitration) and the sixth of EOF (after which receivers keep the frame).
        """
        self.strikes_left = count
        self.strike_position = position
        self._aim()

    def inject_error_at(self, time) -> None:
        """Invert the bus level during the bit at `time` (ns); an idle bit feels nothing.

        ValueError for an instant that is decided already.
        """
        bit = self.bit_of(time)
        if bit <= self.bit_of(self.advanced):
            raise ValueError(f"bus {self.name}: {time} ns is decided already (up to {self.advanced} ns)")
        self.planned_bits.append(bit)
        self.planned_bits.sort()
        self.next_planned_bit = self.planned_bits[0]
        self._aim()

    def set_bit_error_rate(self, rate) -> None:
        """Invert each bit with probability `rate` (0 ... 0.1) from now on, from a stream of its own."""
        if not 0.0 <= rate <= 0.1:
            raise ValueError(f"bus {self.name}: bit error rate {rate} is outside 0 ... 0.1")
        if self.noise is None:
            self.noise = RandomStream(self.seed, f"can_bus/{self.name}/bit errors")
        self.bit_error_rate = rate
        self.next_noise_bit = max(self.bit_of(self.advanced), 0)
        self._draw_noise()
        self._aim()

    def _aim(self) -> None:
        """Set `next_strike` after anything that decides on it; a lone node fails because nobody acknowledges."""
        fails = self.strikes_left > 0 or self.acknowledging < 2
        self.next_strike = -1 if fails else min(self.next_planned_bit, self.next_noise_bit)

    def _draw_noise(self) -> None:
        """The next disturbed bit: distances between them are exponential with mean 1 / rate."""
        u: cython.double
        distance: cython.double
        if self.bit_error_rate <= 0.0:
            self.next_noise_bit = NEVER
            return
        u = self.noise.uniform()
        distance = -log(1.0 - u) / self.bit_error_rate
        self.next_noise_bit += 1 + int(distance)

    def _strike_of(self, first, last, vulnerable) -> int:
        """Bit position at which the frame on bits first ... last is hit, or -1.

        `vulnerable` is the first position after the arbitration field. Disturbances before the frame
        are forgotten; one inside its arbitration field is moved behind it.
        """
        position = -1
        if self.strikes_left > 0:
            self.strikes_left -= 1
            position = self.strike_position if self.strike_position >= 0 else (last - first) // 2
        while self.next_planned_bit < first:
            self._forget_strike()
        if self.next_noise_bit < first:
            # what fell on idle bits is forgotten; the distance to the next one has no memory
            self.next_noise_bit = first - 1
            self._draw_noise()
        if min(self.next_planned_bit, self.next_noise_bit) < last and position < 0:
            position = min(self.next_planned_bit, self.next_noise_bit) - first
        self._aim()
        if position < 0:
            return -1
        return min(max(position, vulnerable), last - first - 1)

    def _forget_strike(self) -> None:
        """The first planned disturbance is over."""
        self.planned_bits.pop(0)
        self.next_planned_bit = self.planned_bits[0] if self.planned_bits else NEVER

    # ---- passing of time

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Decide every start of frame up to and including `until` (ns); returns the next instant of interest.

        Every request, abort and mode change stamped before `until` must have been made. The answer
        (also in the field `next_time`) is the start of the next frame as far as known, or NEVER; a
        call before that instant returns at once.
        """
        never: cython.longlong = 1 << 62
        if until > self.advanced:
            self.advanced = until  # decided, also where nothing starts
        while self.next_time <= until:
            if self.next_change > until or not self._change(until):
                self._attempt(self.next_bit)
            if self.first < 0 and self.next_change == never:
                self.next_bit = never
                self.next_time = never
            else:
                self._look_ahead()
        return self.next_time

    def _note_changes(self) -> None:
        """Set what depends on it after a command came or went, or a node began or ended to join or to take part."""
        self.next_change = -1 if self.joining > 0 else self.commands.head_time
        self.hindered_until = self.suspended_until if self.acknowledging == self.node_count else NEVER
        self._aim()

    def _change(self, until: cython.longlong) -> cython.bint:
        """Carry out the abort or mode change, or let the nodes join, that come before the next frame, if any do."""
        last: cython.longlong = self.bit_of(until)
        join: cython.longlong = self._next_join()
        first: cython.longlong = self.edge_ns(min(self.next_bit, join, last + 1))
        if self.commands.head_time <= until and self.commands.head_time < first:
            self._execute()
            return True
        if join <= last and join <= self.next_bit:
            self._join(join)
            return True
        if self.joining > 0:
            self._count_sequences(self.next_bit)
        return False

    def _next_join(self) -> cython.longlong:
        """Bit at which the next joining node has seen its recessive sequences, if no frame comes before."""
        first: cython.longlong = 1 << 62
        join: cython.longlong
        node: Node
        if self.joining == 0:
            return first
        for node in self.nodes:
            if node.mode == 3:  # JOINING
                join = max(self.free_bit - 11, node.join_from) + 11 * node.sequences_left
                if join < first:
                    first = join
        return first

    def _look_ahead(self) -> cython.void:
        """Set `next_bit` and `next_time` from what waits."""
        never: cython.longlong = 1 << 62
        first: cython.longlong = never
        row: cython.longlong = self.first
        while row >= 0:
            if self.slots[row + 1] < first:  # READY
                first = self.slots[row + 1]
            row = self.slots[row + 3]  # NEXT
        if first <= self.free_bit:
            self.next_bit = self.free_bit
            self.next_time = self.free_time
        else:
            self.next_bit = first
            self.next_time = self.edge_ns(first) if first < never else never
        if self.next_change < never:
            first = self._next_join()
            if first < self.next_bit:
                self.next_time = self.edge_ns(first)
            if self.commands.head_time < self.next_time:
                self.next_time = self.commands.head_time

    def _execute(self) -> None:
        """Carry out the first abort or mode change."""
        node: Node
        commands: EventQueue = self.commands
        commands.take()
        time = commands.time
        node = self.nodes[commands.a]
        if commands.kind == COMMAND_ABORT:
            row = (4 * commands.a + commands.b) * ROW
            if 1 <= commands.b <= BUFFERS and self.rows[row] == NEVER:  # FREE_AT
                self.aborted += 1
                node.aborted += 1
                if node.mode == OPERATING:
                    time = max(time, self.edge_ns(self.rows[row + READY]))  # after a failed attempt: at its end
                self._drop(node, row, time, TX_ABORTED)
        elif commands.b == RESET:
            if node.mode == OPERATING:
                self.acknowledging -= 1
                node.mode = RESET
            elif node.mode == JOINING:
                self.joining -= 1
                # reset does not spare a bus-off node its recovery
                node.mode = BUS_OFF if node.transmit_errors >= BUS_OFF_LIMIT else RESET
            for row in self._waiting(node):
                self.aborted += 1
                node.aborted += 1
                self._drop(node, row, time, TX_ABORTED)
        elif node.mode == RESET or node.mode == BUS_OFF:
            node.sequences_left = RECOVERY_SEQUENCES if node.mode == BUS_OFF else 1
            node.join_from = self.bit_of(time) + 1
            node.mode = JOINING
            self.joining += 1
        self._note_changes()

    def _join(self, bit) -> None:
        """Let every node whose sequences are complete at `bit` take part."""
        node: Node
        for node in self.nodes:
            if node.mode != JOINING:
                continue
            if max(self.free_bit - SEQUENCE_BITS, node.join_from) + SEQUENCE_BITS * node.sequences_left > bit:
                continue
            node.mode = OPERATING
            node.sequences_left = 0
            self.joining -= 1
            self.acknowledging += 1
            if node.transmit_errors >= BUS_OFF_LIMIT:
                node.transmit_errors = 0
                node.receive_errors = 0
                node.passive = False
                node.warning = False
                self._tell(node, self.edge_ns(bit), ICR_ERROR_WARNING)
            for row in self._waiting(node):
                self.rows[row + READY] = max(self.rows[row + READY] - NEVER, bit)
        self._note_changes()

    def _waiting(self, node) -> list:
        """Rows of a node that wait, lowest buffer first."""
        rows = [(4 * node.index + buffer) * ROW for buffer in range(1, BUFFERS + 1)]
        return [row for row in rows if self.rows[row] == NEVER]  # FREE_AT

    def rows_waiting(self) -> list:
        """Rows of all nodes that wait, in no order."""
        found = []
        row = self.first
        while row >= 0:
            found.append(row)
            row = self.rows[row + NEXT]
        return found

    def alone_and_passive(self) -> bool:
        """True while what waits cannot be acknowledged, by nobody, and only repeats."""
        if self.pending_count == 0 or self.acknowledging >= 2 or self.joining or self.commands.count:
            return False
        return all(self.nodes[row // (4 * ROW)].passive for row in self.rows_waiting())

    def hold_off(self, bit) -> None:
        """No attempt before `bit`: what waits is not ready before."""
        for row in self.rows_waiting():
            self.rows[row + READY] = max(self.rows[row + READY], bit)
        self.next_bit = max(self.next_bit, bit)
        self.next_time = max(self.next_time, self.edge_ns(bit))

    def pending_of(self, node: cython.longlong) -> cython.longlong:
        """Frames that wait in the transmit buffers of `node`."""
        count: cython.longlong = 0
        row: cython.longlong = self.first
        while row >= 0:
            if row >> 5 == node:
                count += 1
            row = self.rows[row + 3]  # NEXT
        return count

    def _remove(self, row: cython.longlong) -> cython.void:
        """Take a row off the list of those that wait."""
        before: cython.longlong = self.first
        following: cython.longlong = self.slots[row + 3]  # NEXT
        self.pending_count -= 1
        if before == row:
            self.first = following
            return
        while self.slots[before + 3] != row:
            before = self.slots[before + 3]
        self.slots[before + 3] = following

    def _drop(self, node, row, time, status) -> None:
        """End a waiting request without success, answered at `time`."""
        self._remove(row)
        self.rows[row] = time  # FREE_AT
        if time <= self.advanced:
            self.late_results += 1
        if not node.ends.write(row // ROW % 4, time, status):
            node.inbox.push(time, node.order, CAN_TX_DONE, node.controller, row // ROW % 4, status)

    # ---- one frame

    @cython.cdivision(True)  # bits are not negative
    def _attempt(self, k: cython.longlong) -> cython.longlong:
        """The frame that starts at bit k: arbitration; then an error frame, or a whole one and results to everybody.

        Returns the bit at which the bus is free again.
        """
        row: cython.longlong = self.first
        merged: cython.bint = False
        heard: cython.bint = False
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
        place: cython.longlong
        rate: cython.longlong = self.bitrate
        billion: cython.longlong = 1000000000
        sender: Node
        node: Node
        if self.pending_count > 1:
            row = self._arbitrate(k)
            if row < 0:  # another node sends the same arbitration field
                row = -row
                merged = True
        if cython.compiled:
            asked = self.slots[row + 2]
            identifier = self.slots[row + 4]
            flags = self.slots[row + 5]
            lo = self.slots[row + 6]
            hi = self.slots[row + 7]
        else:
            _, _, asked, _, identifier, flags, lo, hi = self.slots[row : row + 8]
        bits = measure(identifier, flags, lo, hi) & 0xFFFF
        end = k + bits
        if (merged or self.next_strike < end - 1) and self._disturbed(k, row, bits, merged):
            return self.free_bit
        # edge_ns of `end`; from it those of end - 1 (the end of the sixth bit of EOF) and of the intermission's end
        if k - self.second_bit >= rate:
            self.second_ns = k // rate * billion
            self.second_bit = k // rate * rate
        rest = (end - self.second_bit) * billion + rate - 1
        done = rest // rate
        rest -= done * rate
        done += self.second_ns
        received = done - self.bit_ns - (rest < self.bit_rest)
        bits += 3  # INTERMISSION_BITS
        self.free_bit = k + bits
        self.free_time = done + self.intermission_ns + (rest + self.intermission_rest >= rate)
        self.frames += 1
        self.bits += bits
        self.window_busy += bits
        if self.free_bit > self.window_end:
            self._split_windows(k)
        if received <= self.advanced:
            self.late_results += 1
        # the sender's buffer is free from `done` on
        if self.pending_count == 1:
            self.first = -1
            self.pending_count = 0
        else:
            self._remove(row)
        self.slots[row] = done  # FREE_AT
        sender = cython.cast(Node, self.nodes[row >> 5])
        if not sender.ends.write(row >> 3 & 3, done, 0):  # TX_SENT
            sender.inbox.put(done, sender.order, 3, sender.controller, row >> 3 & 3, 0, 0, 0, 0)  # CAN_TX_DONE
        sender.sent += 1
        if sender.transmit_errors > 0 or sender.passive:
            self._after_success(sender, end, done)
        flags &= 0x5F  # single shot is not on the wire
        node = sender.following
        while node is not sender:
            if node.mode == 0 and not (merged and node.sending_end == end):  # OPERATING
                if node.receive_errors > 0:
                    self._calm_receiver(node, received)
                if node.listening:
                    node.inbox.put(received, node.order, 2, node.controller, identifier, flags, lo, hi, 0)  # CAN_RX
                    node.received += 1
                    heard = True
            node = node.following
        if not heard:
            self.lost += 1
        if flags & 64:  # FLAG_EXTENDED
            self._count_extended(identifier)
        else:
            place = 2 * identifier
            self.counts[place] += 1
            if done - asked > self.counts[place + 1]:
                self.counts[place + 1] = done - asked
        if self.trace is not None:
            self.trace.add(received, identifier, flags, lo, hi)
        else:
            self._record(received, identifier, flags, lo, hi, row >> 5)
        return self.free_bit

    def _key(self, row: cython.longlong) -> cython.longlong:
        """The arbitration field of the frame in a row: the lower one wins."""
        return arbitration_key(self.slots[row + 4], self.slots[row + 5])  # IDENTIFIER, FLAGS

    def _arbitrate(self, k: cython.longlong) -> cython.longlong:
        """The row that wins the frame that starts at bit k; negative when another node offers the very same field."""
        best: cython.longlong = -1
        best_key: cython.longlong = 0
        ready: cython.longlong = 0
        row: cython.longlong = self.first
        key: cython.longlong
        while row >= 0:
            if self.slots[row + 1] <= k:  # READY
                ready += 1
                key = self._key(row)
                if best < 0 or key < best_key or (key == best_key and row < best):
                    best = row
                    best_key = key
            row = self.slots[row + 3]  # NEXT
        return -best if ready > 1 and self._contend(k, best, best_key) else best

    def _contend(self, k: cython.longlong, best: cython.longlong, best_key: cython.longlong) -> cython.bint:
        """Settle with the losers of an arbitration; True when another node offers the very same field."""
        row: cython.longlong = self.first
        other: cython.longlong
        key: cython.longlong
        other_key: cython.longlong
        offered: cython.bint
        merged: cython.bint = False
        loser: Node
        skipped = None
        while row >= 0:
            if row >> 5 != best >> 5 and self.slots[row + 1] <= k:  # another node's, READY
                key = self._key(row)
                offered = True  # a node puts only its lowest frame on the bus
                other = self.first
                while other >= 0:
                    if other >> 5 == row >> 5 and other != row and self.slots[other + 1] <= k:
                        other_key = self._key(other)
                        if other_key < key or (other_key == key and other < row):
                            offered = False
                    other = self.slots[other + 3]
                if offered and key == best_key:
                    merged = True
                elif offered:
                    loser = self.nodes[row >> 5]
                    loser.arbitrations_lost += 1
                    self.arbitrations_lost += 1
                    if self.slots[row + 5] & 32:  # FLAG_SINGLE_SHOT
                        if skipped is None:
                            skipped = []
                        skipped.append(row)
            row = self.slots[row + 3]  # NEXT
        if skipped is not None:
            for lost in sorted(skipped):
                self._skip(lost, self.edge_ns(k + self._bits_until_loss(lost, best)))
        return merged

    def _disturbed(
        self, k: cython.longlong, best: cython.longlong, bits: cython.longlong, merged: cython.bint
    ) -> cython.bint:
        """Settle the frame on bits k ... k + bits - 1 where something may be wrong; True when it failed."""
        senders = self._senders(k, best) if merged else [best]
        position = -1
        if merged:
            position = self._collision(senders)
        acknowledged = self.acknowledging > len(senders)
        if position < 0:
            vulnerable = 41 if self.rows[best + FLAGS] & 64 else 17  # see inject_errors
            position = self._strike_of(k, k + bits - 1, vulnerable)
        if not acknowledged and (position < 0 or position > bits - 9):
            position = bits - 9  # the ACK slot stays recessive
        if position >= 0:
            self._fail(k, senders, position, acknowledged)
            return True
        for row in senders:
            if row != best:
                self.merged += 1
                self._finish_merged(self.nodes[row // (4 * ROW)], row, k + bits)
        return False

    def _finish_merged(self, node, row, end) -> None:
        """A node sent the same frame as the winner, up to bit `end`: it is a sender too, no receiver."""
        done = self.edge_ns(end)
        self._remove(row)
        self.rows[row] = done  # FREE_AT
        node.sending_end = end
        node.sent += 1
        if not node.ends.write(row // ROW % 4, done, TX_SENT):
            node.inbox.put(done, node.order, CAN_TX_DONE, node.controller, row // ROW % 4, TX_SENT, 0, 0, 0)
        self._after_success(node, end, done)

    def _after_success(self, node: Node, end: cython.longlong, done: cython.longlong) -> None:
        """What a frame sent whole, to bit `end`, at `done` in ns, means for a sender that has had errors."""
        if node.passive:
            self._suspend(node, end + INTERMISSION_BITS)
        if node.transmit_errors > 0:
            node.transmit_errors -= 1
            self._confine(node, done, 0)

    def _bits_until_loss(self, row, best) -> int:
        """Bits from the start of frame to the end of the bit at which the sender of `row` saw that `best` wins."""
        own = self._wire(row)[0]
        winner = self._wire(best)[0]
        return next(i for i, (a, b) in enumerate(zip(own, winner, strict=False)) if a != b) + 1

    def _wire(self, row) -> tuple:
        """The bits of the frame in a row and their fields."""
        identifier, flags, lo, hi = (self.rows[row + place] for place in (IDENTIFIER, FLAGS, LOW, HIGH))
        return wire(identifier, flags, lo, hi)

    def _skip(self, row, time) -> None:
        """End a single shot that did not get through."""
        node: Node = self.nodes[row // (4 * ROW)]
        node.single_shot_skipped += 1
        self.single_shot_skipped += 1
        self.single_shot_dropped += 1
        self._drop(node, row, time, TX_LOST)

    def _senders(self, k, best) -> list:
        """Rows whose frames go out together: of each node its first one with the winning field."""
        found: dict = {}
        for row in self.rows_waiting():
            if self.rows[row + READY] <= k and self._key(row) == self._key(best):
                node = row // (4 * ROW)
                found[node] = min(row, found.get(node, row))
        return sorted(found.values())

    def _collision(self, senders) -> int:
        """First bit at which frames with one arbitration field differ, or -1 when they are equal."""
        frames = [self._wire(row)[0] for row in senders]
        for position, levels in enumerate(zip(*frames, strict=False)):
            if len(set(levels)) > 1:
                return position
        return -1

    def _suspend(self, node, free) -> None:
        """An error-passive sender waits eight bits more after the intermission (ISO 11898-1)."""
        node.suspend_bit = free + 8
        self.suspended_until = node.suspend_bit
        self.hindered_until = max(self.hindered_until, node.suspend_bit)
        for row in self._waiting(node):
            self.rows[row + READY] = max(self.rows[row + READY], node.suspend_bit)

    def _calm_receiver(self, node: Node, time: cython.longlong) -> None:
        """Receive counter after a good frame (ISO 11898-1: above 127 back to 119 ... 127, we take 119)."""
        node.receive_errors = node.receive_errors - 1 if node.receive_errors < PASSIVE_LIMIT else 119
        self._confine(node, time, 0)

    def _fail(self, k, senders, position, acknowledged) -> None:
        """An error frame because of the bit at `position` of the frame that started at bit k.

        The sender's error flag of six bits begins after that bit; receivers inside the stuffed region
        notice only when they have seen six equal bits, and add six of their own: the flags together take
        6 ... 12 bits; behind the CRC everybody notices at once. Then 8 bits delimiter and the intermission.
        A receiver in error-passive state is taken to need the same time (chosen by us).
        """
        node: Node
        frames = [self._wire(row) for row in senders]
        bits, fields = frames[0]
        levels = {frame[0][position] for frame in frames}
        seen = 0 if len(levels) > 1 else 1 - bits[position]
        owners = [row // (4 * ROW) for row in senders]
        level = 1 if all(self.nodes[owner].passive for owner in owners) else 0
        stuffed = position < len(bits) - 10
        delay = 0
        if acknowledged and stuffed:
            run = 0
            if seen == level:
                run = 1
                while run <= position and run < 6 and bits[position - run] == level:
                    run += 1
            delay = 6 - run
        over = k + position + 1 + 6 + delay + 8
        self.free_bit = over + INTERMISSION_BITS
        self.free_time = self.edge_ns(self.free_bit)
        self.errors += 1
        self.bits += self.free_bit - k
        self.window_busy += self.free_bit - k
        if self.free_bit > self.window_end:
            self._split_windows(k)
        capture = ICR_BUS_ERROR | fields[position] << ICR_FIELD_SHIFT
        for node in self.nodes:
            if node.mode != OPERATING:
                continue
            if node.index in owners:
                if node.passive:
                    self._suspend(node, self.free_bit)
                if acknowledged or not node.passive:  # a passive sender that nobody answers stays where it is
                    node.transmit_errors += 8
                kind = KIND_BIT if acknowledged else KIND_OTHER
                self._confine(node, self.edge_ns(k + position + 1), capture | kind << ICR_KIND_SHIFT)
            else:
                node.receive_errors += 1
                kind = KIND_STUFF if stuffed else KIND_FORM
                self._confine(
                    node,
                    self.edge_ns(k + position + 1 + delay),
                    capture | ICR_RECEIVING | kind << ICR_KIND_SHIFT,
                )
        end = self.edge_ns(over)
        for row in senders:
            node = self.nodes[row // (4 * ROW)]
            if self.rows[row + FLAGS] & 32:  # FLAG_SINGLE_SHOT
                self._skip(row, end)
            elif node.mode == OPERATING:
                # offered again as soon as the bus is free (a passive sender: 8 bits later)
                self.rows[row + READY] = max(self.rows[row + READY], self.free_bit)
                self.retries += 1
                node.retries += 1
            if node.mode == BUS_OFF:
                for waiting in self._waiting(node):
                    self.flushed += 1
                    node.flushed += 1
                    self.lost += 1
                    self._drop(node, waiting, end, TX_ABORTED)
        row = senders[0]
        flags = self.rows[row + FLAGS] & 0x5F | FLAG_ERROR
        self._record(end, self.rows[row + IDENTIFIER], flags, fields[position], position, owners[0])

    def _confine(self, node, time, interrupts) -> None:
        """Fault confinement after a counter moved (ISO 11898-1): state changes, told with the counters."""
        worst = max(node.transmit_errors, node.receive_errors)
        if (worst >= WARNING_LIMIT) != node.warning:
            node.warning = not node.warning
            interrupts |= ICR_ERROR_WARNING
        if (worst >= PASSIVE_LIMIT) != node.passive:
            node.passive = not node.passive
            interrupts |= ICR_ERROR_PASSIVE
        if node.transmit_errors >= BUS_OFF_LIMIT:
            node.mode = BUS_OFF
            self.acknowledging -= 1
            self._note_changes()
            interrupts |= ICR_ERROR_WARNING
        self._tell(node, time, interrupts)

    def _tell(self, node, time, interrupts) -> None:
        """CAN_STATUS to a node. Off the bus its transmit counter reads 127 as in the LPC2194."""
        off = 1 if node.mode == BUS_OFF else 0
        shown = 127 if off else node.transmit_errors
        if time <= self.advanced:
            self.late_results += 1
        node.inbox.push(time, node.order, CAN_STATUS, node.controller, interrupts, shown, node.receive_errors, off)

    def _count_sequences(self, k) -> None:
        """The recessive run before the start of frame at bit k counts for the nodes that are joining."""
        node: Node
        for node in self.nodes:
            if node.mode == JOINING:
                run = k - max(self.free_bit - SEQUENCE_BITS, node.join_from)
                node.sequences_left -= max(run, 0) // SEQUENCE_BITS

    # ---- load and log

    def _count_extended(self, identifier: cython.longlong) -> None:
        counts = self.frames_by_extended_identifier
        counts[identifier] = counts.get(identifier, 0) + 1

    def _split_windows(self, first: cython.longlong) -> cython.void:
        """The bits from `first` until the bus is free, counted in the open window, reach beyond it."""
        last: cython.longlong = self.free_bit
        self.window_busy -= last - first
        if first >= self.window_end:
            self._roll(first)
        while last > self.window_end:
            self.window_busy += self.window_end - first
            first = self.window_end
            self._roll(first)
        self.window_busy += last - first

    def _roll(self, bit: cython.longlong) -> cython.void:
        """Close load windows until `bit` lies in the open one."""
        idle: cython.longlong
        if self.window_busy > self.window_busy_max:
            self.window_busy_max = self.window_busy
        while bit >= self.window_end:
            self.windows[self.window_count % 1024] = self.window_busy  # WINDOW_RING
            self.window_count += 1
            self.window_busy = 0
            self.window_end += self.window_bits
            idle = (bit - self.window_end) // self.window_bits - 1024
            if idle > 0:  # a ring full of idle windows is enough
                self.window_count += idle
                self.window_end += idle * self.window_bits

    def load_mean(self, time) -> float:
        """Share of the bus that was taken from the start of the statistics to `time` (ns), 0 ... 1."""
        now = self.bit_of(time)
        if now <= self.origin_bit:
            return 0.0
        ahead = max(self.free_bit - now, 0) if self.bits else 0  # of a frame decided but not over
        return max(self.bits - ahead, 0) / (now - self.origin_bit)

    def load_max(self) -> float:
        """Largest load of a window of 10 ms (the open one counts with what it has), 0 ... 1."""
        return max(self.window_busy_max, self.window_busy) / self.window_bits

    def load_windows(self) -> list:
        """Loads of the closed 10 ms windows still kept (the last 1024), oldest first, 0 ... 1."""
        kept = min(self.window_count, WINDOW_RING)
        return [
            self.windows[i % WINDOW_RING] / self.window_bits for i in range(self.window_count - kept, self.window_count)
        ]

    def statistics(self, time) -> dict:
        """The figures of a report at `time` (ns); loads as fractions 0 ... 1."""
        return {
            "frames": self.frames,
            "load_mean": self.load_mean(time),
            "load_max": self.load_max(),
            "lost": self.lost,
            "single_shot_skipped": self.single_shot_skipped,
            "arbitrations_lost": self.arbitrations_lost,
            "retries": self.retries,
            "errors": self.errors,
            "refused": self.refused,
            "aborted": self.aborted,
        }

    def _record(
        self,
        time: cython.longlong,
        identifier: cython.longlong,
        flags: cython.longlong,
        lo: cython.longlong,
        hi: cython.longlong,
        node: cython.longlong,
    ) -> cython.longlong:
        """Append to the frame log; returns how many it holds. A full one is first offered to `log_sink(bus)`."""
        base: cython.longlong
        if self.trace is not None:
            self.trace.add(time, identifier, flags, lo, hi)
            return 0
        if self.log_count >= self.log_capacity:
            if self.log_sink is not None:
                self.log_sink(self)
            if self.log_count >= self.log_capacity:
                self.log_dropped += 1
                return self.log_count
        base = self.log_count * 6  # LOG_FIELDS
        self.log[base] = time
        self.log[base + 1] = identifier
        self.log[base + 2] = flags
        self.log[base + 3] = lo
        self.log[base + 4] = hi
        self.log[base + 5] = node
        self.log_count += 1
        return self.log_count

    def clear_log(self) -> None:
        """Forget the logged frames (their reader has them)."""
        self.log_count = 0

    def take_log(self) -> bytes:
        """The logged frames as native 64-bit integers, LOG_FIELDS each, in order of their start; then clears.

        Fields: time_ns (receivers' instant; of an error frame its end), identifier, flags, lo, hi, sending
        node. An error frame has FLAG_ERROR, lo = field (FIELD_*) and hi = bit position of the error.
        """
        taken = bytes(memoryview(self.log)[: LOG_FIELDS * self.log_count])
        self.log_count = 0
        return taken
