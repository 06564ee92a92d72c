# cython: boundscheck=False, wraparound=False
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

A frame is decided at its start: its results are pushed, stamped in the future, into the nodes' inboxes.
Receivers have the frame at the end of the sixth bit of EOF, its sender is done at the end of the seventh.
"""

import array

import cython

from can_bus.frame import INTERMISSION_BITS, arbitration_key, measure, wire
from foundation.events import (
    CAN_STATUS,
    CAN_TX_DONE,
    FLAG_ERROR,
    NEVER,
    TX_ABORTED,
    TX_LOST,
    EventQueue,
)
from foundation.numbers import integers
from foundation.random_stream import RandomStream
from foundation.row_stream import FrameStream

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

# C variables when compiled (.pxd): Cython makes a Python object of every literal above 31 bits.
_MASK = 0xFFFFFFFF
_NEVER = NEVER


class Node:
    """A controller on a bus, with its error counters (ISO 11898-1) and what it did so far.

    `listening`: it wants what it receives (a node that does not still acknowledges). `flushed`: frames
    that waited when it went bus-off. `refused`: requests into an occupied buffer or while off the bus.
    """

    def __init__(self, name, index, inbox, controller, order) -> None:
        self.name = name
        self.index = index
        self.inbox = inbox
        self.controller = controller
        self.order = order
        self.listening = True
        self.mode = 0  # OPERATING
        self.transmit_errors = 0
        self.receive_errors = 0
        self.passive = False
        self.warning = False
        self.sequences_left = 0
        self.join_from = 0
        self.suspend_bit = 0
        self.sending_end = -1
        self.accepted = 0
        self.refused = 0
        self.sent = 0
        self.received = 0
        self.aborted = 0
        self.single_shot_skipped = 0
        self.flushed = 0
        self.arbitrations_lost = 0
        self.retries = 0


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
        self.commands = EventQueue(16)
        self.free_bit = 0  # after the intermission of the last frame; its instant:
        self.free_time = 0
        self.quiet_bit = 0
        self.advanced = -1
        self.next_bit = NEVER  # where the next frame starts, as far as known
        self.next_time = NEVER
        self.wakes = integers(1)
        self.wake_place = 0
        self.operating = 0
        self.joining = 0
        empty = integers(0)
        self.keys = empty
        self.ready = empty
        self.asked = empty
        self.asked_time = empty
        self.identifiers = empty
        self.flags = empty
        self.lows = empty
        self.highs = empty
        self.busy_until = empty
        self.pending = empty
        self.pending_count = 0
        self.noise = None
        self.bit_error_rate = 0.0
        self.next_noise_bit = NEVER
        self.next_planned_bit = NEVER
        self.next_strike = NEVER
        self.strikes_left = 0
        self.strike_position = -1
        self.planned_bits = []
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
        self.accepted = self.pending_count
        self.frames = 0
        self.merged = 0
        self.bits = 0
        self.lost = 0
        self.single_shot_skipped = 0
        self.retries = 0
        self.errors = 0
        self.refused = 0
        self.arbitrations_lost = 0
        self.aborted = 0
        self.flushed = 0
        self.late_results = 0
        self.late_requests = 0
        self.frames_by_identifier = integers(2048)
        self.response_max_ns = integers(2048)
        self.frames_by_extended_identifier = {}
        self.origin_bit = self.bit_of(time)
        self.window_end = self.origin_bit + self.window_bits
        self.window_busy = 0
        self.window_busy_max = 0
        self.window_count = 0
        self.windows = integers(WINDOW_RING)

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

    # ---- nodes

    def add_node(self, name, inbox, controller, order) -> int:
        """Put a controller on the bus; returns its node number.

        `inbox`: EventQueue that gets CAN_RX, CAN_TX_DONE and CAN_STATUS, with `controller` as field a and
        `order` (stage * 256 + source) as the queue's order.
        """
        index = len(self.nodes)
        self.nodes.append(Node(name, index, inbox, controller, order))
        self.operating += 1
        for field, filler in (
            ("keys", 0),
            ("ready", NEVER),
            ("asked", 0),
            ("asked_time", 0),
            ("identifiers", 0),
            ("flags", 0),
            ("lows", 0),
            ("highs", 0),
            ("busy_until", 0),
            ("pending", 0),
        ):
            before = getattr(self, field)
            grown = integers(len(before) + BUFFERS, filler)
            for slot in range(len(before)):
                grown[slot] = before[slot]
            setattr(self, field, grown)
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
        owner: Node
        slot: cython.longlong
        key: cython.longlong = identifier << 21
        first: cython.longlong
        start: cython.longlong
        second: cython.longlong
        billion: cython.longlong = 1000000000
        if node < 0 or node >= len(self.nodes):
            raise ValueError(f"bus {self.name}: node {node} does not exist")
        if buffer < 1 or buffer > 3:
            raise ValueError(f"bus {self.name}: transmit buffer {buffer} is not one of 1, 2, 3")
        if flags & ~32 != 8 or identifier < 0 or identifier > 0x7FF:  # no standard frame of eight bytes
            key = self._key_of(identifier, flags)
        owner = self.nodes[node]
        slot = node * 3 + buffer - 1
        if time < self.busy_until[slot]:
            self._refuse(owner, flags)
            return False
        if owner.mode == 1 or owner.mode == 2:  # RESET, BUS_OFF
            self._refuse(owner, flags)
            owner.inbox.push(time, owner.order, CAN_TX_DONE, owner.controller, buffer, TX_ABORTED)
            return False
        lo &= _MASK
        hi &= _MASK
        if flags & ~32 != 8:
            if flags & 16:  # a remote frame carries no data
                lo = 0
                hi = 0
            elif flags & 15 < 4:
                lo &= (1 << 8 * (flags & 15)) - 1
                hi = 0
            elif flags & 15 < 8:
                hi &= (1 << 8 * ((flags & 15) - 4)) - 1
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
        self.asked[slot] = first
        self.asked_time[slot] = time
        if first < owner.suspend_bit:
            first = owner.suspend_bit
            start = self.edge_ns(first)
        self.keys[slot] = key
        self.identifiers[slot] = identifier
        self.flags[slot] = flags
        self.lows[slot] = lo
        self.highs[slot] = hi
        self.busy_until[slot] = _NEVER
        self.pending[self.pending_count] = slot
        self.pending_count += 1
        self.accepted += 1
        owner.accepted += 1
        if owner.mode == 3:  # JOINING: held until the node takes part
            self.ready[slot] = _NEVER
            return True
        self.ready[slot] = first
        if first < self.next_bit:
            self.next_bit = first
        if start < self.next_time:
            self.next_time = start
            if start < self.wakes[self.wake_place]:
                self.wakes[self.wake_place] = start
        return True

    def _key_of(self, identifier: cython.longlong, flags: cython.longlong) -> cython.longlong:
        """The arbitration key of a frame that can be sent; else ValueError."""
        if flags & 64:  # FLAG_EXTENDED
            if identifier < 0 or identifier > 0x1FFFFFFF:
                raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 29 bits")
        elif identifier < 0 or identifier > 0x7FF:
            raise ValueError(f"bus {self.name}: identifier {identifier} does not fit in 11 bits")
        if flags & ~0x7F:  # length code, remote, single shot, extended
            raise ValueError(f"bus {self.name}: flags {flags:#x} of identifier {identifier:#x} cannot be sent")
        return arbitration_key(identifier, flags)

    def _refuse(self, owner, flags) -> None:
        self.refused += 1
        owner.refused += 1
        if flags & 32:  # FLAG_SINGLE_SHOT
            self.single_shot_skipped += 1
            owner.single_shot_skipped += 1

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
        self.next_strike = min(self.next_planned_bit, self.next_noise_bit)

    def set_bit_error_rate(self, rate) -> None:
        """Invert each bit with probability `rate` (0 ... 0.1) from now on, from a stream of its own."""
        if not 0.0 <= rate <= 0.1:
            raise ValueError(f"bus {self.name}: bit error rate {rate} is outside 0 ... 0.1")
        if self.noise is None:
            self.noise = RandomStream(self.seed, f"can_bus/{self.name}/bit errors")
        self.bit_error_rate = rate
        self.next_noise_bit = max(self.bit_of(self.advanced), 0)
        self._draw_noise()
        self.next_strike = min(self.next_planned_bit, self.next_noise_bit)

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
            self.next_strike = min(self.next_planned_bit, self.next_noise_bit)
        if self.next_strike < last and position < 0:
            position = self.next_strike - first
        if position < 0:
            return -1
        return min(max(position, vulnerable), last - first - 1)

    def _forget_strike(self) -> None:
        """The first planned disturbance is over."""
        self.planned_bits.pop(0)
        self.next_planned_bit = self.planned_bits[0] if self.planned_bits else NEVER
        self.next_strike = min(self.next_planned_bit, self.next_noise_bit)

    # ---- passing of time

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Decide every start of frame up to and including `until` (ns); returns the next instant of interest.

        Every request, abort and mode change stamped before `until` must have been made. The answer
        (also in the field `next_time`) is the start of the next frame as far as known, or NEVER; a
        call before that instant returns at once.
        """
        if until > self.advanced:
            self.advanced = until  # decided, also where nothing starts
        while self.next_time <= until:
            if self.commands.head_time == _NEVER and self.joining == 0:
                self._attempt(self.next_bit)
            elif not self._change(until):
                self._attempt(self.next_bit)
            if self.pending_count == 0 and self.commands.head_time == _NEVER and self.joining == 0:
                self.next_bit = _NEVER
                self.next_time = _NEVER
            else:
                self._look_ahead()
        return self.next_time

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
                join = max(self.quiet_bit, node.join_from) + 11 * node.sequences_left
                if join < first:
                    first = join
        return first

    def _look_ahead(self) -> cython.void:
        """Set `next_bit` and `next_time` from what waits."""
        first: cython.longlong = _NEVER
        ready: cython.longlong
        i: cython.longlong
        for i in range(self.pending_count):
            ready = self.ready[self.pending[i]]
            if ready < first:
                first = ready
        if first <= self.free_bit:
            self.next_bit = self.free_bit
            self.next_time = self.free_time
        else:
            self.next_bit = first
            self.next_time = self.edge_ns(first) if first < _NEVER else _NEVER
        if self.joining > 0:
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
            slot = commands.a * BUFFERS + commands.b - 1
            if 1 <= commands.b <= BUFFERS and self.busy_until[slot] == NEVER:
                self.aborted += 1
                node.aborted += 1
                if node.mode == OPERATING:
                    time = max(time, self.edge_ns(self.ready[slot]))  # after a failed attempt: at its end
                self._drop(node, slot, time, TX_ABORTED)
        elif commands.b == RESET:
            if node.mode == OPERATING:
                self.operating -= 1
                node.mode = RESET
            elif node.mode == JOINING:
                self.joining -= 1
                # reset does not spare a bus-off node its recovery
                node.mode = BUS_OFF if node.transmit_errors >= BUS_OFF_LIMIT else RESET
            for slot in self._waiting(node):
                self.aborted += 1
                node.aborted += 1
                self._drop(node, slot, time, TX_ABORTED)
        elif node.mode == RESET or node.mode == BUS_OFF:
            node.sequences_left = RECOVERY_SEQUENCES if node.mode == BUS_OFF else 1
            node.join_from = self.bit_of(time) + 1
            node.mode = JOINING
            self.joining += 1

    def _join(self, bit) -> None:
        """Let every node whose sequences are complete at `bit` take part."""
        node: Node
        for node in self.nodes:
            if node.mode != JOINING:
                continue
            if max(self.quiet_bit, node.join_from) + SEQUENCE_BITS * node.sequences_left > bit:
                continue
            node.mode = OPERATING
            node.sequences_left = 0
            self.joining -= 1
            self.operating += 1
            if node.transmit_errors >= BUS_OFF_LIMIT:
                node.transmit_errors = 0
                node.receive_errors = 0
                node.passive = False
                node.warning = False
                self._tell(node, self.edge_ns(bit), ICR_ERROR_WARNING)
            for slot in self._waiting(node):
                self.ready[slot] = max(self.asked[slot], bit)

    def _waiting(self, node) -> list:
        """Slots of a node that wait, lowest buffer first."""
        first = node.index * BUFFERS
        return [slot for slot in range(first, first + BUFFERS) if self.busy_until[slot] == NEVER]

    def pending_of(self, node: cython.longlong) -> cython.longlong:
        """Frames that wait in the transmit buffers of `node`."""
        count: cython.longlong = 0
        i: cython.longlong
        for i in range(self.pending_count):
            if self.pending[i] // 3 == node:
                count += 1
        return count

    def _remove(self, slot: cython.longlong) -> cython.void:
        """Take a slot off the list of those that wait."""
        i: cython.longlong
        last: cython.longlong = self.pending_count - 1
        for i in range(last + 1):
            if self.pending[i] == slot:
                self.pending[i] = self.pending[last]
                break
        self.pending_count = last

    def _drop(self, node, slot, time, status) -> None:
        """End a waiting request without success, answered at `time`."""
        self._remove(slot)
        self.busy_until[slot] = time
        if time <= self.advanced:
            self.late_results += 1
        node.inbox.push(time, node.order, CAN_TX_DONE, node.controller, slot % BUFFERS + 1, status)

    # ---- one frame

    @cython.cdivision(True)  # bits and slots are not negative
    def _attempt(self, k: cython.longlong) -> cython.longlong:
        """The frame that starts at bit k: arbitration, then an error frame, or a whole frame and results to everybody.

        Returns the bit at which the bus is free again.
        """
        slot: cython.longlong = self.pending[0]
        merged: cython.bint = False
        heard: cython.bint = False
        bits: cython.longlong
        end: cython.longlong
        node: Node
        if self.pending_count > 1:
            slot = self._arbitrate(k)
            merged = self._contend(k, slot)
        if self.joining > 0:
            self._count_sequences(k)
        identifier: cython.longlong = self.identifiers[slot]
        flags: cython.longlong = self.flags[slot]
        lo: cython.longlong = self.lows[slot]
        hi: cython.longlong = self.highs[slot]
        bits = measure(identifier, flags, lo, hi) & 0xFFFF
        if merged or self.operating < 2 or self.strikes_left > 0 or self.next_strike < k + bits - 1:
            if self._disturbed(k, slot, bits, merged):
                return self.free_bit
        end = k + bits
        # edge_ns of `end`; from it those of end - 1 (the end of the sixth bit of EOF) and of the intermission's end
        rate: cython.longlong = self.bitrate
        billion: cython.longlong = 1000000000
        if k - self.second_bit >= rate:
            self.second_ns = k // rate * billion
            self.second_bit = k // rate * rate
        rest: cython.longlong = (end - self.second_bit) * billion + rate - 1
        done: cython.longlong = rest // rate
        rest -= done * rate
        done += self.second_ns
        received: cython.longlong = done - self.bit_ns
        if rest < self.bit_rest:
            received -= 1
        sender: cython.longlong = slot // 3
        self.free_bit = end + 3  # INTERMISSION_BITS
        self.free_time = done + self.intermission_ns
        if rest + self.intermission_rest >= rate:
            self.free_time += 1
        self.quiet_bit = end - 8  # ACK delimiter and EOF are recessive
        flags &= 0x5F  # single shot is not on the wire
        for node in self.nodes:
            if node.index == sender:
                self._finish_sender(node, slot, end, done)
            elif node.mode == 0 and not (merged and node.sending_end == end):  # OPERATING
                if node.receive_errors > 0:
                    self._calm_receiver(node, received)
                if node.listening:
                    node.inbox.put(received, node.order, 2, node.controller, identifier, flags, lo, hi, 0)  # CAN_RX
                    node.received += 1
                    heard = True
        if received <= self.advanced:
            self.late_results += 1
        if not heard:
            self.lost += 1
        self.frames += 1
        if flags & 64:  # FLAG_EXTENDED
            self._count_extended(identifier)
        else:
            self.frames_by_identifier[identifier] += 1
            if done - self.asked_time[slot] > self.response_max_ns[identifier]:
                self.response_max_ns[identifier] = done - self.asked_time[slot]
        self.bits += bits + 3  # INTERMISSION_BITS
        self.window_busy += bits + 3
        if self.free_bit > self.window_end:
            self._split_windows(k)
        self._record(received, identifier, flags, lo, hi, sender)
        return self.free_bit

    def _arbitrate(self, k: cython.longlong) -> cython.longlong:
        """The slot that wins the frame that starts at bit k."""
        best: cython.longlong = -1
        best_key: cython.longlong = 0
        i: cython.longlong
        slot: cython.longlong
        key: cython.longlong
        for i in range(self.pending_count):
            slot = self.pending[i]
            if self.ready[slot] <= k:
                key = self.keys[slot]
                if best < 0 or key < best_key or (key == best_key and slot < best):
                    best = slot
                    best_key = key
        return best

    def _disturbed(self, k, best, bits, merged) -> bool:
        """Settle the frame on bits k ... k + bits - 1 where something may be wrong; True when it failed."""
        senders = self._senders(k, best) if merged else [best]
        position = -1
        if merged:
            position = self._collision(senders)
        acknowledged = self.operating > len(senders)
        if position < 0:
            vulnerable = 41 if self.flags[best] & 64 else 17  # see inject_errors
            position = self._strike_of(k, k + bits - 1, vulnerable)
        if not acknowledged and (position < 0 or position > bits - 9):
            position = bits - 9  # the ACK slot stays recessive
        if position >= 0:
            self._fail(k, senders, position, acknowledged)
            return True
        for slot in senders:
            if slot != best:
                self.merged += 1
                self._finish_sender(self.nodes[slot // BUFFERS], slot, k + bits, self.edge_ns(k + bits))
        return False

    @cython.cdivision(True)  # slots are not negative
    def _contend(self, k: cython.longlong, best: cython.longlong) -> cython.bint:
        """Settle with the losers of an arbitration; True when another node offers the very same field."""
        i: cython.longlong
        j: cython.longlong
        slot: cython.longlong
        other: cython.longlong
        node: cython.longlong
        offered: cython.bint
        merged: cython.bint = False
        loser: Node
        skipped = None
        for i in range(self.pending_count):
            slot = self.pending[i]
            node = slot // 3
            if node == best // 3 or self.ready[slot] > k:
                continue
            offered = True  # a node puts only its lowest frame on the bus
            for j in range(self.pending_count):
                other = self.pending[j]
                if other // 3 == node and other != slot and self.ready[other] <= k:
                    if self.keys[other] < self.keys[slot] or (self.keys[other] == self.keys[slot] and other < slot):
                        offered = False
            if not offered:
                continue
            if self.keys[slot] == self.keys[best]:
                merged = True
                continue
            loser = self.nodes[node]
            loser.arbitrations_lost += 1
            self.arbitrations_lost += 1
            if self.flags[slot] & 32:  # FLAG_SINGLE_SHOT
                if skipped is None:
                    skipped = []
                skipped.append(slot)
        if skipped is not None:
            for lost in sorted(skipped):
                self._skip(lost, self.edge_ns(k + self._bits_until_loss(lost, best)))
        return merged

    def _bits_until_loss(self, slot, best) -> int:
        """Bits from the start of frame to the end of the bit at which `slot` saw that `best` wins."""
        own = wire(self.identifiers[slot], self.flags[slot], self.lows[slot], self.highs[slot])[0]
        winner = wire(self.identifiers[best], self.flags[best], self.lows[best], self.highs[best])[0]
        return next(i for i, (a, b) in enumerate(zip(own, winner, strict=False)) if a != b) + 1

    def _skip(self, slot, time) -> None:
        """End a single shot that did not get through."""
        node: Node = self.nodes[slot // BUFFERS]
        node.single_shot_skipped += 1
        self.single_shot_skipped += 1
        self._drop(node, slot, time, TX_LOST)

    def _senders(self, k, best) -> list:
        """Slots that send together: of each node its first slot with the winning field."""
        found: dict = {}
        for i in range(self.pending_count):
            slot = self.pending[i]
            if self.ready[slot] <= k and self.keys[slot] == self.keys[best]:
                node = slot // BUFFERS
                found[node] = min(slot, found.get(node, slot))
        return sorted(found.values())

    def _collision(self, senders) -> int:
        """First bit at which frames with one arbitration field differ, or -1 when they are equal."""
        frames = [wire(self.identifiers[s], self.flags[s], self.lows[s], self.highs[s])[0] for s in senders]
        for position, levels in enumerate(zip(*frames, strict=False)):
            if len(set(levels)) > 1:
                return position
        return -1

    @cython.cdivision(True)  # slots are not negative
    def _finish_sender(
        self, node: Node, slot: cython.longlong, end: cython.longlong, done: cython.longlong
    ) -> cython.longlong:
        """The sender of a whole frame that ended at bit `end`, `done` in ns: its buffer is free from `done` on."""
        if self.pending_count == 1:
            self.pending_count = 0
        else:
            self._remove(slot)
        self.busy_until[slot] = done
        node.inbox.put(done, node.order, 3, node.controller, slot % 3 + 1, 0, 0, 0, 0)  # CAN_TX_DONE, TX_SENT
        node.sent += 1
        node.sending_end = end
        if node.passive:
            self._suspend(node, end + INTERMISSION_BITS)
        if node.transmit_errors > 0:
            node.transmit_errors -= 1
            self._confine(node, done, 0)
        return done

    def _suspend(self, node, free) -> None:
        """An error-passive sender waits eight bits more after the intermission (ISO 11898-1)."""
        node.suspend_bit = free + 8
        for slot in self._waiting(node):
            self.ready[slot] = max(self.ready[slot], node.suspend_bit)

    def _calm_receiver(self, node, time) -> None:
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
        frames = [wire(self.identifiers[s], self.flags[s], self.lows[s], self.highs[s]) for s in senders]
        bits, fields = frames[0]
        levels = {frame[0][position] for frame in frames}
        seen = 0 if len(levels) > 1 else 1 - bits[position]
        owners = [slot // BUFFERS for slot in senders]
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
        self.quiet_bit = over - 8
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
        for slot in senders:
            node = self.nodes[slot // BUFFERS]
            if self.flags[slot] & 32:  # FLAG_SINGLE_SHOT
                self._skip(slot, end)
            elif node.mode == OPERATING:
                # offered again as soon as the bus is free (a passive sender: 8 bits later)
                self.ready[slot] = max(self.ready[slot], self.free_bit)
                self.retries += 1
                node.retries += 1
            if node.mode == BUS_OFF:
                for waiting in self._waiting(node):
                    self.flushed += 1
                    node.flushed += 1
                    self.lost += 1
                    self._drop(node, waiting, end, TX_ABORTED)
        slot = senders[0]
        self._record(
            end, self.identifiers[slot], self.flags[slot] & 0x5F | FLAG_ERROR, fields[position], position, owners[0]
        )

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
            self.operating -= 1
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
                run = k - max(self.quiet_bit, node.join_from)
                node.sequences_left -= max(run, 0) // SEQUENCE_BITS

    # ---- load and log

    def _count_extended(self, identifier) -> None:
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
        trace: FrameStream = self.trace
        if trace is not None:
            trace.add(time, identifier, flags, lo, hi)
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
