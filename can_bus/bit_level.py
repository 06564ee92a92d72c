"""Bit-by-bit simulation of a bus while something on it is not plain: every controller drives, all sample the result.

Undisturbed frames are decided at their start, as a whole (`bus.py`). This module handles the rest: nodes that send one
arbitration field with different data, inverted bits (of frames, of error frames, of an idle bus), frames that no node
acknowledges. The bus enters this mode at a bit at which every node saw it idle, and leaves it at the next such bit.

Lookahead. A bit is `open` when a program's action now could change it: a node may begin a frame, or one out
of reset may have seen its recessive sequence. Such a bit waits until everything stamped before it is known; bits
between open bits are decided at once. So results do not depend on how time is divided, and a frame with its error frame
is mostly decided at its start, like a plain one.
"""

from typing import TYPE_CHECKING

import cython

from ranger_sim.can_bus.fd_frame import FIELD_BRS
from ranger_sim.can_bus.frame import (
    DOMINANT,
    FIELD_CRC_DELIMITER,
    FIELD_RTR,
    FIELD_SRTR,
    INTERMISSION_BITS,
    MEASURED_BITS,
    RECEIVERS_SEE,
    RECESSIVE,
    arbitration_key,
    measure,
)
from ranger_sim.can_bus.medium_access import (
    MAC_AWAY,
    MAC_FRAME,
    MAC_IDLE,
    MAC_INTERMISSION,
    MAC_JOINING,
    MAC_SUSPENDED,
    MET_ERROR,
    MET_FAILURE,
    MET_JOIN,
    MediumAccess,
)
from ranger_sim.can_bus.node import BUS_OFF, ICR_FIELD_MASK, ICR_FIELD_SHIFT, RESET, SEQUENCE_BITS
from ranger_sim.can_bus.transmit_buffers import (
    ESI_REQUESTED,
    FLAGS,
    HIGH,
    IDENTIFIER,
    LOW,
    NEXT,
    NODE_SHIFT,
    READY,
    TransmitBuffers,
)
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, NEVER

if TYPE_CHECKING:
    from ranger_sim.can_bus.bit_timing import BitTiming
    from ranger_sim.can_bus.disturbance import Disturbance


@cython.final
@cython.cclass
class BitLevel:
    """The medium access of all nodes (`machines`, by node number) and the bus between them.

    `bit`: the next one to pass; `first_bit`: the start of this stretch. `quiet`: number of recessive bits passed last;
    `levels`: of the bits passed since the last open one. `at_rest`: no node is in a frame, and the bus has been
    recessive for long enough; `away`: some are in reset or bus-off. `aborting`: rows whose frame shall not be repeated.
    `received_bit`: the bit after which a listening node had a frame, `sent_bit`: after which a transmitter was done.
    `in_error`: an error frame is under way, which began in the frame of `error_begun`; `counted`: the bus has counted
    it. `tampering`: what faults do to frames (`tampering.py`), or None. `bitrate`: of the bus.

    A CAN FD bus (`is_timed`) has bits of two lengths, and after an error in a data phase its nodes are no longer in
    step: each has its own start of bit and sample point, in ticks (`timing`). `bit` is then the tick at which the next
    bits of some nodes begin; a sample point at the start of another node's bit comes first. `level`: on the bus, since
    the last edge; `quiet_from`: the tick since which it is recessive; `levels`: edges (tick, level) since the last open
    bit; `inverted_until`: the end of an inversion. A node that is idle, joins, or is in the last bit of intermission
    synchronises to an edge from recessive to dominant: its bit begins there, and one that joins counts its recessive
    bits anew. No node does so within a frame.
    """

    machines: list
    levels: list
    aborting: list
    buffers: "TransmitBuffers"
    disturbance: "Disturbance"
    first_bit: cython.longlong
    bit: cython.longlong
    quiet: cython.longlong
    received_bit: cython.longlong
    sent_bit: cython.longlong
    bitrate: cython.longlong
    tampering: object
    timing: "BitTiming"
    is_timed: cython.bint
    level: cython.longlong
    quiet_from: cython.longlong
    inverted_until: cython.longlong
    open: cython.bint
    at_rest: cython.bint
    away: cython.bint
    # the frame that began last, and the error frame under way
    identifier: cython.longlong
    flags: cython.longlong
    sender: cython.longlong
    in_error: cython.bint
    counted: cython.bint
    error_field: cython.longlong
    error_begun: cython.longlong
    error_position: cython.longlong

    def __init__(self, buffers, disturbance, bitrate, timing) -> None:
        self.timing = timing
        self.is_timed = timing.is_fd
        self.level = RECESSIVE
        self.quiet_from = 0
        self.inverted_until = 0
        self.buffers = buffers
        self.disturbance = disturbance
        self.bitrate = bitrate
        self.tampering = None
        self.machines = []
        self.levels = []
        self.aborting = []
        self.first_bit = 0
        self.bit = 0
        self.quiet = 0
        self.received_bit = -1
        self.sent_bit = -1
        self.open = False
        self.at_rest = False
        self.away = False
        self._forget_frame()
        self.in_error = False
        self.counted = False
        self.error_field = 0
        self.error_begun = 0
        self.error_position = 0

    def _forget_frame(self) -> None:
        self.identifier = 0
        self.flags = FLAG_ERROR
        self.sender = -1

    def add_node(self, node) -> None:
        """Add a node."""
        machine = MediumAccess(node, self.timing)
        self.machines.append(machine)
        machine.place(self.bit, self.bit)

    @cython.cfunc
    def begin(self, bit: cython.longlong, free_bit: cython.longlong) -> None:
        """The bus is idle up to `bit` and has been since `free_bit`."""
        self.first_bit = bit
        self.bit = bit
        self.quiet = bit - free_bit + SEQUENCE_BITS
        self.quiet_from = free_bit - SEQUENCE_BITS * self.timing.nominal
        self.level = RECESSIVE
        self.inverted_until = 0
        self.levels.clear()
        self.aborting.clear()
        self._forget_frame()
        for machine in self.machines:
            cython.cast(MediumAccess, machine).place(bit, free_bit)

    @cython.cfunc
    def prepare_bit(self) -> None:
        """Set `open`, `at_rest` and `away` for the next bit."""
        machine: MediumAccess
        quiet: cython.bint = self.quiet >= SEQUENCE_BITS
        if self.is_timed:
            quiet = self.bit - self.quiet_from >= SEQUENCE_BITS * self.timing.nominal
        self.open = False
        self.at_rest = quiet or self.is_timed  # nodes out of step may all be idle a little earlier
        self.away = False
        for machine in self.machines:
            if machine.may_start():  # on a CAN FD bus also in a bit that has begun: an edge may begin it anew
                self.open = True
            if not machine.is_at_rest():
                self.at_rest = False
            elif machine.node.mode == RESET or machine.node.mode == BUS_OFF:
                self.away = True
                if quiet and machine.node.mode == RESET:
                    self.open = True
        if self.is_timed and self.at_rest:  # nodes that are all idle are in step
            for machine in self.machines:
                if machine.state != MAC_AWAY:
                    machine.next_start = self.bit
                    machine.sample_at = NEVER

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_elsewhere(self, machine: MediumAccess) -> cython.bint:
        """True when none of the node's bits begins at `bit`."""
        return self.is_timed and machine.next_start != self.bit

    # ---- frames that begin

    @cython.cfunc
    def start_frames(self) -> None:
        """In an open bit, every node that may start and has a frame for this bit starts it."""
        machine: MediumAccess
        best: cython.longlong = -1
        key: cython.longlong
        best_key: cython.longlong = 0
        for machine in self.machines:
            if self._is_elsewhere(machine):
                continue
            machine.offered = self._offer(machine) if machine.may_start() else -1
            if machine.offered >= 0 and machine.state == MAC_IDLE:
                key = arbitration_key(
                    self.buffers.slots[machine.offered + IDENTIFIER], self.buffers.slots[machine.offered + FLAGS]
                )
                if best < 0 or key < best_key:
                    best = machine.offered
                    best_key = key
                self._load(machine)
                machine.start(machine.own_bit if machine.own_rate else self.bit)
        if best >= 0:
            self._note_start(best, self.bit)
            if self.is_timed:
                self._start_with()

    @cython.cfunc
    def _start_with(self) -> None:
        """Nodes in an idle bit that would end after `bit`, at which another node starts a frame, start with it."""
        machine: MediumAccess
        for machine in self.machines:
            if machine.state == MAC_IDLE and machine.met == 0 and self.bit < machine.next_start < NEVER:
                machine.next_start = self.bit
                machine.offered = self._offer(machine)
                if machine.offered >= 0:
                    self._load(machine)
                    machine.start(self.bit)

    @cython.cfunc
    def start_late(self, machine: MediumAccess) -> None:
        """The dominant last bit of intermission serves as the start of frame of the frame that the node offers."""
        self._load(machine)
        self._note_start(machine.offered, machine.begun)

    @cython.cfunc
    def _load(self, machine: MediumAccess) -> None:
        rows = self.buffers.rows
        flags = rows[machine.offered + FLAGS]
        if flags & FLAG_FD:
            shown = machine.node.passive or flags & ESI_REQUESTED
            rows[machine.offered + FLAGS] = flags & ~FLAG_ESI | (FLAG_ESI if shown else 0)
        bits, fields = self.buffers.wire(machine.offered)
        extended = self.buffers.rows[machine.offered + FLAGS] & FLAG_EXTENDED
        # a stuff bit after RTR belongs to the control field: rule (c) covers those before it
        machine.send(machine.offered, bits, fields.index(FIELD_RTR if extended else FIELD_SRTR) + 1)

    @cython.cfunc
    def _note_start(self, row: cython.longlong, bit: cython.longlong) -> None:
        """The frame in `row` begins at `bit`, perhaps together with others."""
        slots: cython.p_longlong = self.buffers.slots
        if self.disturbance.frames_left > 0:
            if self.is_timed:
                self._hit_frame(row, bit)
            else:
                length: cython.longlong = (
                    measure(slots[row + IDENTIFIER], slots[row + FLAGS], slots[row + LOW], slots[row + HIGH])
                    & MEASURED_BITS
                )
                self.disturbance.meet_frame(bit, length, slots[row + FLAGS])
        self.identifier = slots[row + IDENTIFIER]
        self.flags = slots[row + FLAGS] & RECEIVERS_SEE | FLAG_ERROR
        self.sender = row >> NODE_SHIFT
        if self.tampering is not None:
            self.tampering.frame_begins(self, row, bit)

    def tick_of(self, row, place) -> int:
        """On a CAN FD bus: ticks from the start of the frame in `row` to the start of its bit `place`."""
        bits, fields = self.buffers.wire(row)
        switches = self.buffers.rows[row + FLAGS] & FLAG_BRS
        brs, delimiter = (fields.index(FIELD_BRS), fields.index(FIELD_CRC_DELIMITER)) if switches else (-1, -1)
        return self.timing.offset(place, brs, delimiter)

    def ticks_of(self, row, places) -> list:
        """Ticks from the start of the frame in `row` to bits of it; after the first place an error frame may follow.

        `places`: one bit, or two: an error, and a bit of its error flag.
        """
        if not self.is_timed:
            return list(places)
        first = self.tick_of(row, places[0])
        found = [first]
        timing = self.timing
        bit_end = self.tick_of(row, places[0] + 1)
        if bit_end - first == timing.data:  # the flag follows at the nominal rate, from the sample point on
            bit_end = first + timing.data_sample + timing.nominal - timing.sample
        for place in places[1:]:
            found.append(bit_end + (place - places[0] - 1) * timing.nominal)
        return found

    def _hit_frame(self, row, bit) -> None:
        """On a CAN FD bus: plan the bit of the frame in `row`, which begins at `bit`, that is to be inverted."""
        flags = self.buffers.rows[row + FLAGS]
        length = len(self.buffers.wire(row)[0])
        place = self.disturbance.place_in(length, flags)
        first = bit + self.tick_of(row, place)
        self.disturbance.spans[first] = bit + self.tick_of(row, place + 1) - first
        self.disturbance.hit_bit(first)

    @cython.cfunc
    @cython.exceptval(-2, check=True)
    def _offer(self, machine: MediumAccess) -> cython.longlong:
        """The row of the lowest frame of a node that is ready for the next bit, -1 for none."""
        slots: cython.p_longlong = self.buffers.slots
        row: cython.longlong = self.buffers.first
        best: cython.longlong = -1
        best_key: cython.longlong = 0
        key: cython.longlong
        while row >= 0:
            if row >> NODE_SHIFT == machine.node.index and slots[row + READY] <= self.bit:
                key = arbitration_key(slots[row + IDENTIFIER], slots[row + FLAGS])
                if best < 0 or key < best_key or (key == best_key and row < best):
                    best = row
                    best_key = key
            row = slots[row + NEXT]
        return best

    # ---- a bit

    @cython.cfunc
    def pass_bit(self) -> None:
        """Pass the next bit: the levels that all nodes drive and sample, and the result (`MediumAccess.met`)."""
        machine: MediumAccess
        level: cython.longlong = RECESSIVE
        driven: cython.longlong
        struck: cython.longlong = 0
        wrong: cython.bint = False
        for machine in self.machines:
            driven = machine.drive()
            if not machine.node.silent:
                level &= driven
        if self.disturbance.next_bit <= self.bit:
            self.disturbance.strike(self.bit)
            level = 1 - level
        if self.disturbance.next_misread <= self.bit:
            struck = self.disturbance.misreading(self.bit)
        for machine in self.machines:
            if machine.own_rate:
                machine.met = self._sample_at_own_rate(machine)
            else:
                machine.met = machine.sample(level ^ (struck >> machine.node.index & 1), self.bit)
            if machine.met & MET_ERROR:
                wrong = True
        if wrong and not self.in_error:
            self._note_error()
        self.levels.append(level)
        self.quiet = self.quiet + 1 if level == RECESSIVE else 0
        self.bit += 1

    # ---- CAN FD

    @cython.cfunc
    def pass_ticks(self) -> None:
        """Pass the bits that begin at `bit`, and every sample point up to the next start of a bit."""
        machine: MediumAccess
        tick: cython.longlong
        level: cython.longlong
        following: cython.longlong
        was: cython.longlong = self.level
        for machine in self.machines:
            if machine.next_start == self.bit:
                machine.met = 0
                machine.drive()
                machine.begin_bit(self.bit)
        level = self._wired_and()
        self._note_level(level, self.bit)
        if was == RECESSIVE and level == DOMINANT:
            self._synchronise()
        while True:
            tick = NEVER
            following = NEVER
            for machine in self.machines:
                tick = min(tick, machine.sample_at)
                following = min(following, machine.next_start)
            if tick == NEVER or following < tick:
                break
            self._sample_all(level, tick)
            level = self._wired_and()  # a node that goes bus-off drives nothing any more
        self.bit = following if following < NEVER else self.bit + self.timing.nominal

    @cython.cfunc
    @cython.exceptval(check=False)
    def _wired_and(self) -> cython.longlong:
        """The level that the nodes drive together."""
        machine: MediumAccess
        level: cython.longlong = RECESSIVE
        for machine in self.machines:
            if not machine.node.silent:
                level &= machine.driven
        return level

    @cython.cfunc
    def _note_level(self, level: cython.longlong, tick: cython.longlong) -> None:
        """The bus has `level` from `tick` on."""
        if level != self.level:
            self.level = level
            self.quiet_from = tick if level == RECESSIVE else NEVER
            self.levels.append((tick, level))

    @cython.cfunc
    def _synchronise(self) -> None:
        """An edge to dominant at `bit`: the bits of nodes that are outside of frames begin there."""
        machine: MediumAccess
        for machine in self.machines:
            if machine.bit_start < self.bit and self._may_synchronise(machine):
                if machine.met == 0 or machine.sample_at < NEVER:
                    machine.begin_bit(self.bit)
                    if machine.state == MAC_JOINING:  # else bits of a data phase could all be sampled recessive
                        machine.count = 0
                    if machine.state == MAC_INTERMISSION:
                        machine.offered = self._offer(machine)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _may_synchronise(self, machine: MediumAccess) -> cython.bint:
        if machine.state == MAC_INTERMISSION:
            return machine.count == INTERMISSION_BITS - 1
        return machine.state == MAC_IDLE or machine.state == MAC_SUSPENDED or machine.state == MAC_JOINING

    @cython.cfunc
    def _sample_all(self, level: cython.longlong, tick: cython.longlong) -> None:
        """Every node whose sample point is at `tick` samples."""
        machine: MediumAccess
        seen: cython.longlong
        wrong: cython.bint = False
        while self.disturbance.next_bit <= tick:
            self.inverted_until = max(self.inverted_until, self.disturbance.take_strike())
        if tick < self.inverted_until:
            level = 1 - level
        for machine in self.machines:
            if machine.sample_at == tick:
                seen = level
                if self.disturbance.next_misread <= tick and self.disturbance.misreads(tick, machine.node.index):
                    seen = 1 - level
                if machine.sample_at_tick(seen, tick) & MET_ERROR:
                    wrong = True
        if wrong and not self.in_error:
            self._note_error()

    @cython.cfunc
    def _sample_at_own_rate(self, machine: MediumAccess) -> cython.longlong:
        """Sample for a node whose bits are longer or shorter than the bus's: none, one or more of them end in this bit.

        It does not resynchronise to the edges of others: at such rates that would not help it (`set_rate_of`).
        """
        other: MediumAccess
        level: cython.longlong = RECESSIVE
        met: cython.longlong = 0
        for other in self.machines:
            if other is not machine and not other.node.silent:
                level &= other.driven
        machine.own_rest += machine.own_rate
        while machine.own_rest >= self.bitrate and met == 0:  # report the result of one to the bus before the next
            machine.own_rest -= self.bitrate
            met = machine.sample(level & machine.drive(), machine.own_bit)
            machine.own_bit += 1
        return met

    @cython.cfunc
    def _note_error(self) -> None:
        """An error frame begins: that of the first transmitter that saw the cause, else of the first node."""
        machine: MediumAccess
        found: MediumAccess = None
        for machine in self.machines:
            if machine.met & MET_FAILURE or (machine.met & MET_ERROR and found is None):
                found = machine
                if machine.met & MET_FAILURE:
                    self.identifier = self.buffers.slots[machine.row + IDENTIFIER]
                    self.flags = self.buffers.slots[machine.row + FLAGS] & RECEIVERS_SEE | FLAG_ERROR
                    self.sender = machine.node.index
                    break
        self.in_error = True
        self.error_field = found.capture >> ICR_FIELD_SHIFT & ICR_FIELD_MASK
        self.error_begun = found.begun
        self.error_position = found.position - 1 if self.is_timed else self.bit - found.begun

    @cython.cfunc
    def error_is_over(self) -> cython.bint:
        """True when no node is in an error frame any more, and none still receives a frame that is no longer sent.

        The latter happens when the transmitter has gone bus-off: its receivers have yet to detect an error.
        """
        machine: MediumAccess
        carried: cython.bint = False
        any_received: cython.bint = False
        for machine in self.machines:
            if machine.signals_error():
                return False
            if machine.state == MAC_FRAME and machine.begun == self.error_begun:
                if machine.sending:
                    carried = True
                else:
                    any_received = True
        return carried or not any_received

    # ---- nodes that leave and join

    def leave(self, node) -> None:
        """A node no longer takes part."""
        self.machines[node.index].place(self.bit, self.bit)

    def join(self, node, since) -> int:
        """A node waits for its sequences, and has from bit `since` on: the result of the last bit passed (MET_*)."""
        machine: MediumAccess = self.machines[node.index]
        met = 0
        machine.place(self.bit, self.bit)
        machine.count = 0
        if self.is_timed:
            return self._join_late(machine, since)
        for level in self.levels[max(since - self.bit + len(self.levels), 0) :]:
            met = machine.sample(level, self.bit)
        return met

    def _join_late(self, machine: MediumAccess, since) -> int:
        """`join` on a CAN FD bus, by the edges since the last open bit."""
        edges = list(self.levels)
        level = 1 - edges[0][1] if edges else self.level
        start = since
        while True:
            sampled = start + self.timing.sample
            while edges and edges[0][0] <= sampled:
                tick, level = edges.pop(0)
                if level == DOMINANT and tick > start:
                    start = tick
                    sampled = start + self.timing.sample
                    machine.count = 0
            if sampled >= self.bit:
                break
            if machine.sample(level, start) & MET_JOIN:
                machine.next_start = max(start + self.timing.nominal, self.bit)
                return MET_JOIN
            start += self.timing.nominal
        if start >= self.bit:
            machine.next_start = start
        else:
            machine.begin_bit(start)
        return 0

    def is_sending(self, row) -> bool:
        """True while the frame in `row` is on the bus."""
        machine = self.machines[row >> NODE_SHIFT]
        return machine.row == row and machine.sending and machine.state == MAC_FRAME

    def forget(self, row) -> None:
        """The frame in `row` is over, sent or not."""
        machine = self.machines[row >> NODE_SHIFT]
        if machine.row == row:
            machine.row = -1
        if row in self.aborting:
            self.aborting.remove(row)
