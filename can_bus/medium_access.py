"""One controller's medium access, bit by bit: frames, error and overload frames, intermission (ISO 11898-1).

The standard's medium access control sublayer and its fault confinement entity as one state machine. In every bit the
controller drives a level, samples the level on the bus, and decides from that alone its action in the next bit. No
controller here knows another one: the behaviour that the standard requires results from all of them together.

The rules of fault confinement are cited by their letters, in the order in which ISO 11898-1 and, before it, the CAN
Specification 2.0 give them:
(a) a receiver that detects an error: receive errors + 1, unless (e) holds.
(b) a receiver that samples a dominant bit as the first one after its error flag: receive errors + 8.
(c) a transmitter that sends an error flag: transmit errors + 8. Exception 1: it is error passive, no node acknowledged,
and no bit was dominant while it sent its passive flag. Exception 2: a stuff error in the arbitration field, the
    stuff bit having been sent recessive and sampled dominant.
(d), (e) a bit error in an active error flag or an overload flag: + 8, of a transmitter (d) or a receiver (e).
(f) up to seven dominant bits after any flag are tolerated: the eighth, and each eighth more, + 8.
(g) a frame sent (acknowledged, and without error to its last bit): transmit errors - 1.
(h) a frame received (without error to the ACK slot, and the ACK bit sent): receive errors - 1, or to 119 from above
    127.

CAN FD (ISO 11898-1:2015). A recessive FDF makes a frame an FD frame, to a node that knows these; from the sample point
of a recessive BRS to that of the CRC delimiter the node is `fast`, at the data rate. An error ends that at once, so
error flags are at the nominal rate. A fixed stuff bit equal to the bit before it is a form error, as is a recessive
res (protocol exceptions are disabled); a wrong stuff count is a CRC error. Not modelled: the second bit of CRC
delimiter and ACK slot that real nodes tolerate, because of propagation times that do not exist here.
"""

from typing import Final

import cython

from ranger_sim.can_bus.bit_timing import BitTiming
from ranger_sim.can_bus.fd_frame import (
    CRC17_BITS,
    CRC17_POLYNOMIAL,
    CRC21_BITS,
    CRC21_POLYNOMIAL,
    FIELD_BRS,
    FIELD_ESI,
    FIELD_RES,
    FIELD_STUFF_COUNT,
    FIXED_STUFF_EVERY,
    LENGTHS,
    SHORT_CRC_UP_TO,
    STUFF_COUNT_BITS,
    STUFF_COUNT_CODES,
    next_crc,
)
from ranger_sim.can_bus.frame import (
    CRC_BITS,
    CRC_MASK,
    CRC_POLYNOMIAL,
    DATA_BITS,
    DOMINANT,
    FIELD_ACK_DELIMITER,
    FIELD_ACK_SLOT,
    FIELD_ACTIVE_FLAG,
    FIELD_CRC,
    FIELD_CRC_DELIMITER,
    FIELD_DATA,
    FIELD_DELIMITER,
    FIELD_DLC,
    FIELD_END,
    FIELD_ID_4_0,
    FIELD_ID_12_5,
    FIELD_ID_17_13,
    FIELD_ID_20_18,
    FIELD_ID_28_21,
    FIELD_IDE,
    FIELD_INTERMISSION,
    FIELD_OVERLOAD_FLAG,
    FIELD_PASSIVE_FLAG,
    FIELD_R0,
    FIELD_R1,
    FIELD_RTR,
    FIELD_SRTR,
    FIELD_START,
    FIELD_TOLERATED,
    INTERMISSION_BITS,
    LENGTH_CODE,
    RECESSIVE,
    STUFF_AFTER,
)
from ranger_sim.can_bus.node import (
    FDF_IGNORED,
    FDF_KNOWN,
    FDF_REFUSED,
    ICR_BUS_ERROR,
    ICR_FIELD_SHIFT,
    ICR_KIND_SHIFT,
    ICR_RECEIVING,
    JOINING,
    KIND_BIT,
    KIND_FORM,
    KIND_OTHER,
    KIND_STUFF,
    OPERATING,
    SENDER_PENALTY,
    SEQUENCE_BITS,
    SUSPEND_BITS,
    Node,
)
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE, NEVER

# States.
MAC_AWAY: Final = 0  # in reset or bus-off
MAC_JOINING: Final = 1  # waits for recessive sequences
MAC_IDLE: Final = 2
MAC_FRAME: Final = 3
MAC_ACTIVE_FLAG: Final = 4
MAC_PASSIVE_FLAG: Final = 5
MAC_OVERLOAD_FLAG: Final = 6
MAC_TOLERATING: Final = 7  # after a flag, until a bit is recessive: the first one of the delimiter
MAC_DELIMITER: Final = 8  # of an error frame or an overload frame
MAC_INTERMISSION: Final = 9
MAC_SUSPENDED: Final = 10  # suspend transmission

# Results of a bit, as `sample` returns them.
MET_RECEIVED: Final = 1  # the sixth bit of EOF: a receiver has the frame
MET_SENT: Final = 2  # the last bit of EOF: a transmitter is done
MET_LOSS: Final = 4  # arbitration lost
MET_ERROR: Final = 8  # an error detected: an error flag begins with the next bit
MET_FAILURE: Final = 16  # with it: that was an attempt to send a frame
MET_COUNTER: Final = 32  # error confinement has something to report; `capture` is its ICR_*
MET_SETTLED: Final = 64  # the error frame after a failure is over
MET_START: Final = 128  # the dominant last bit of intermission serves as the start of frame of `offered`
MET_JOIN: Final = 256  # all recessive sequences seen

RECEIVER_PENALTY: Final = 1  # rule (a)
FLAG_BITS: Final = 6  # of an error or overload flag
DELIMITER_BITS: Final = 8  # recessive, after the last flag
TOLERATED_BITS: Final = 8  # rule (f)

CLASSIC = BitTiming("a classic bus", 1)


@cython.final
@cython.cclass
class MediumAccess:
    """Bus access of `node`. Counts its errors in the node; the bus then has the node derive its error state from them.

    `count`: bits of the present state. `sending`: it is the transmitter, and remains so until the bus is idle or
    another frame begins. `begun`: bit at which its frame began; `position`: bits since. `field` (FIELD_*) is its
    current field, with `left` bits still to come. `row`: the frame that it sends; `offered`: the one that it may begin
    in this bit, -1 for none. `failed`: an error frame has been under way since then. `after_error`: the previous flag
    was an error flag, not an overload flag. `unacknowledged`: exception 1 of rule (c) may hold. `unheeded`: the frame
    is not for it. `met`: result of the last bit. `stuff_run`, `stuff_level`: equal bits seen last. `own_rate`: its bit
    rate where it differs from the bus's (0: it does not); then `own_bit` counts its own bits, and `own_rest` is the
    part of the next one that has passed.

    On a CAN FD bus: `payload`: the data of an FD frame. `fixed_left`: bits to the next fixed stuff bit, -1 outside the
    CRC field. `stuffed`: stuff bits so far, -1 once the stuff count was wrong. `short_register`, `long_register`:
    CRC-17 and CRC-21. `fast`: it is at the data rate. Ticks: `bit_start` of its present bit, `sample_at` its sample
    point (NEVER once sampled), `next_start` the start of the next one (NEVER until sampled); `timing`: its bits.
    """

    node: Node
    state: cython.longlong
    count: cython.longlong
    driven: cython.longlong
    sending: cython.bint
    failed: cython.bint
    after_error: cython.bint
    unacknowledged: cython.bint
    unheeded: cython.bint
    # the frame
    begun: cython.longlong
    position: cython.longlong
    field: cython.longlong
    left: cython.longlong
    stuff_run: cython.longlong
    stuff_level: cython.longlong
    register: cython.longlong
    identifier: cython.longlong
    flags: cython.longlong
    lo: cython.longlong
    hi: cython.longlong
    # the frame that it sends
    row: cython.longlong
    offered: cython.longlong
    arbitration_bits: cython.longlong
    bits: list
    run_level: cython.longlong
    capture: cython.longlong
    met: cython.longlong
    # a node at a wrong bit rate
    own_rate: cython.longlong
    own_bit: cython.longlong
    own_rest: cython.longlong
    # CAN FD
    fast: cython.bint
    payload: bytearray
    fixed_left: cython.longlong
    stuffed: cython.longlong
    short_register: cython.longlong
    long_register: cython.longlong
    timing: BitTiming
    bit_start: cython.longlong
    sample_at: cython.longlong
    next_start: cython.longlong

    def __init__(self, node, timing=CLASSIC) -> None:
        self.node = node
        self.timing = timing
        self.fast = False
        self.payload = bytearray()
        self.bit_start = 0
        self.sample_at = NEVER
        self.next_start = NEVER
        self.state = MAC_AWAY
        self.count = 0
        self.driven = RECESSIVE
        self.sending = False
        self.failed = False
        self.after_error = False
        self.unacknowledged = False
        self.begun = 0
        self.field = FIELD_INTERMISSION
        self.left = 0
        self._forget_frame()
        self.row = -1
        self.offered = -1
        self.arbitration_bits = 0
        self.bits = []
        self.run_level = RECESSIVE
        self.capture = 0
        self.met = 0
        self.own_rate = 0
        self.own_bit = 0
        self.own_rest = 0

    @cython.cfunc
    def _forget_frame(self) -> cython.void:
        """Reset: nothing of a frame has been seen."""
        self.position = 0
        self.stuff_run = 0
        self.stuff_level = RECESSIVE
        self.register = 0
        self.identifier = 0
        self.flags = 0
        self.lo = 0
        self.hi = 0
        self.unheeded = False
        self.fast = False
        self.fixed_left = -1
        if self.node.fdf == FDF_KNOWN:
            self._forget_fd()

    @cython.cfunc
    def _forget_fd(self) -> cython.void:
        """The part of it for nodes that know CAN FD."""
        one: cython.longlong = 1 if self.node.iso else 0
        self.payload = bytearray()
        self.stuffed = 0
        self.short_register = one << (CRC17_BITS - 1)
        self.long_register = one << (CRC21_BITS - 1)

    @cython.ccall
    def place(self, bit: cython.longlong, free_bit: cython.longlong) -> cython.void:
        """Set the node's state at `bit`, when nothing has been on the bus since `free_bit`."""
        node: Node = self.node
        self.sending = False
        self.failed = False
        self.row = -1
        self.offered = -1
        self.count = 0
        self.field = FIELD_INTERMISSION
        self.driven = RECESSIVE
        self.fast = False
        self.next_start = bit
        self.sample_at = NEVER
        self.met = 0
        if node.mode == OPERATING:
            self.state = MAC_IDLE
            if node.suspend_bit > bit:
                self.state = MAC_SUSPENDED
                self.count = SUSPEND_BITS - (node.suspend_bit - bit) // self.timing.nominal
        elif node.mode == JOINING:
            self.state = MAC_JOINING
            self.count = (
                max(bit - max(free_bit - node.sequence, node.join_from), 0) // self.timing.nominal % SEQUENCE_BITS
            )
        else:
            self.state = MAC_AWAY
            self.next_start = NEVER

    @cython.cfunc
    @cython.exceptval(check=False)
    def may_start(self) -> cython.bint:
        """True when a request could make it begin a frame in this bit."""
        return self.state == MAC_IDLE or (self.state == MAC_INTERMISSION and self.count == INTERMISSION_BITS - 1)

    @cython.cfunc
    @cython.exceptval(check=False)
    def is_at_rest(self) -> cython.bint:
        """True when it sees an idle bus, or takes no part."""
        return self.state <= MAC_IDLE or self.state == MAC_SUSPENDED

    @cython.cfunc
    @cython.exceptval(check=False)
    def signals_error(self) -> cython.bint:
        """True in an error frame."""
        if self.state == MAC_ACTIVE_FLAG or self.state == MAC_PASSIVE_FLAG:
            return True
        return self.after_error and (self.state == MAC_TOLERATING or self.state == MAC_DELIMITER)

    # ---- sending

    @cython.cfunc
    def send(self, row: cython.longlong, bits: list, arbitration_bits: cython.longlong) -> cython.void:
        """Send the frame in `row`: `bits` on the wire, and the number of them to the end of arbitration."""
        self.row = row
        self.bits = bits
        self.arbitration_bits = arbitration_bits
        self.sending = True

    @cython.cfunc
    def start(self, bit: cython.longlong) -> cython.void:
        """A frame begins at `bit`: its start of frame comes next."""
        self.state = MAC_FRAME
        self.begun = bit
        self.field = FIELD_START
        self.left = 1
        self._forget_frame()

    @cython.cfunc
    @cython.exceptval(-2, check=True)
    def drive(self) -> cython.longlong:
        """The level that it drives in this bit."""
        level: cython.longlong = RECESSIVE
        if self.state == MAC_FRAME:
            if self.sending:
                level = self.bits[self.position]
            elif self.field == FIELD_CRC_DELIMITER and self.left == 0 and self.register == 0:
                level = DOMINANT  # the ACK slot, after a right CRC
        elif self.state == MAC_ACTIVE_FLAG or self.state == MAC_OVERLOAD_FLAG:
            level = DOMINANT
        self.driven = level
        return level

    # ---- sampling

    @cython.ccall
    def sample(self, wire_level: cython.longlong, bit: cython.longlong) -> cython.longlong:
        """Sample `wire_level` of the bus during `bit`; returns the result (MET_*).

        A silent node drives nothing on the bus; what it would drive is looped back to it (bus monitoring mode).
        """
        level: cython.longlong = wire_level & self.driven if self.node.silent else wire_level
        met: cython.longlong
        if self.state == MAC_AWAY:
            return 0
        if self.state == MAC_JOINING:
            return self._sample_joining(level)
        if self.state == MAC_IDLE or self.state == MAC_SUSPENDED:
            return self._sample_idle(level, bit)
        if self.state == MAC_FRAME:
            met = self._sample_frame(level, wire_level)
        elif self.state == MAC_ACTIVE_FLAG or self.state == MAC_OVERLOAD_FLAG:
            met = self._sample_dominant_flag(level)
        elif self.state == MAC_PASSIVE_FLAG:
            met = self._sample_passive_flag(level)
        elif self.state == MAC_TOLERATING:
            met = self._tolerate(level)
        elif self.state == MAC_DELIMITER:
            met = self._sample_delimiter(level)
        else:
            met = self._sample_intermission(level, bit)
        if self.timing.is_fd:
            self.position += 1
        else:
            self.position = bit + 1 - self.begun
        return met

    @cython.cfunc
    @cython.exceptval(check=False)
    def begin_bit(self, tick: cython.longlong) -> cython.void:
        """On a CAN FD bus: its bit begins at `tick`, or again there, by hard synchronisation to an edge."""
        self.bit_start = tick
        self.sample_at = tick + (self.timing.data_sample if self.fast else self.timing.sample)
        self.next_start = NEVER

    @cython.cfunc
    def sample_at_tick(self, level: cython.longlong, tick: cython.longlong) -> cython.longlong:
        """On a CAN FD bus: `sample` at `tick`; the rate after the sample point is that of the state it leads to."""
        self.met = self.sample(level, self.bit_start)
        self.sample_at = NEVER
        timing: BitTiming = self.timing
        self.next_start = tick + (timing.data - timing.data_sample if self.fast else timing.nominal - timing.sample)
        return self.met

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_joining(self, level: cython.longlong) -> cython.longlong:
        """Recessive sequences are counted; the last one lets it take part."""
        self.count = self.count + 1 if level == RECESSIVE else 0
        if self.count == SEQUENCE_BITS:
            self.count = 0
            self.node.sequences_left -= 1
            if self.node.sequences_left <= 0:
                self.state = MAC_IDLE
                return MET_JOIN
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_idle(self, level: cython.longlong, bit: cython.longlong) -> cython.longlong:
        """On an idle bus, and while transmission is suspended, a dominant bit is a start of frame."""
        if level == DOMINANT:
            self.sending = False
            self.start(bit)
            self._receive(level)
            self.position = 1
        elif self.state == MAC_SUSPENDED:
            self.count += 1
            if self.count == SUSPEND_BITS:
                self.state = MAC_IDLE
        return 0

    # ---- a frame

    @cython.cfunc
    def _sample_frame(self, level: cython.longlong, wire_level: cython.longlong) -> cython.longlong:
        """A bit of a frame, which its transmitter compares with what it sent."""
        stuffed: cython.bint = self.stuff_run == STUFF_AFTER
        met: cython.longlong = 0
        if not stuffed and self.left == 0:
            self._next_field()
        if not self.sending:
            if self.field == FIELD_ACK_SLOT and self.node.silent and wire_level == RECESSIVE:
                # ROBOT PARITY: a real silent controller receives a frame that no node acknowledged, once per
                # repetition; ours does not, so that a bus without other receivers may rest
                # (`edge.paced.alone_and_passive`).
                self.unheeded = True
            return self._receive(level)
        if level != self.driven:
            if self.driven == RECESSIVE and self.position < self.arbitration_bits:
                if stuffed:  # rule (c), exception 2
                    return self._error(KIND_STUFF, 0, 0)
                self.sending = False
                met = MET_LOSS
            elif self.field != FIELD_ACK_SLOT:
                return self._error(KIND_BIT, SENDER_PENALTY, 0)
        elif self.field == FIELD_ACK_SLOT:
            if self.node.passive:  # rule (c), exception 1, unless its passive flag meets a dominant bit
                self._error(KIND_OTHER, 0, 0)
                self.unacknowledged = True
                return MET_ERROR | MET_FAILURE | MET_COUNTER
            return self._error(KIND_OTHER, SENDER_PENALTY, 0)
        return met | self._receive(level)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _receive(self, level: cython.longlong) -> cython.longlong:
        """The next bit of a frame, as every node reads it."""
        if self.stuff_run == STUFF_AFTER:
            if level == self.stuff_level:
                return self._error(KIND_STUFF, SENDER_PENALTY, RECEIVER_PENALTY)
            self.stuff_run = 1
            self.stuff_level = level
            if self.node.fdf == FDF_KNOWN:
                self.stuffed += 1
                self._to_long_crcs(level)
            return 0
        if self.fixed_left == 0:
            self.fixed_left = FIXED_STUFF_EVERY
            if level == self.stuff_level:
                return self._error(KIND_FORM, SENDER_PENALTY, RECEIVER_PENALTY)
            self.stuff_level = level
            return 0
        self.left -= 1
        if self.field >= FIELD_CRC_DELIMITER:
            return self._fixed_form(level)
        self.stuff_run = self.stuff_run + 1 if level == self.stuff_level else 1
        self.stuff_level = level
        if self.node.fdf != FDF_IGNORED and self._is_refused(level):
            return self._error(KIND_FORM, SENDER_PENALTY, RECEIVER_PENALTY)
        self._take(level)
        if self.flags & FLAG_FD and self.left == 0:
            if self.field == FIELD_DATA or (self.field == FIELD_DLC and not self.flags & LENGTH_CODE):
                self.stuff_run = 0  # a fixed stuff bit follows, in the place of a dynamic one
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _is_refused(self, level: cython.longlong) -> cython.bint:
        """On a CAN FD bus: a recessive FDF for a classic node, or a recessive res."""
        if level == DOMINANT:
            return False
        if self.field == FIELD_RES:
            return True
        if self.node.fdf != FDF_REFUSED:
            return False
        # the r0 of an extended frame, behind a dominant r1, is a reserved bit also on a CAN FD bus
        return self.field == FIELD_R1 or (self.field == FIELD_R0 and not self.flags & FLAG_EXTENDED)

    @cython.cfunc
    @cython.exceptval(check=False)
    def _to_long_crcs(self, level: cython.longlong) -> cython.void:
        """A bit that CRC-17 and CRC-21 cover."""
        self.short_register = next_crc(self.short_register, level, CRC17_BITS, CRC17_POLYNOMIAL)
        self.long_register = next_crc(self.long_register, level, CRC21_BITS, CRC21_POLYNOMIAL)

    @cython.cfunc
    def _next_field(self) -> cython.void:
        """A field is over: enter the next one, with its length in bits."""
        field: cython.longlong = self.field
        self.left = 1
        if field == FIELD_START:
            self.field = FIELD_ID_28_21
            self.left = 8
        elif field == FIELD_ID_28_21:
            self.field = FIELD_ID_20_18
            self.left = 3
        elif field == FIELD_ID_20_18:
            self.field = FIELD_SRTR
        elif field == FIELD_SRTR:
            self.field = FIELD_IDE
        elif field == FIELD_IDE and self.flags & FLAG_EXTENDED:
            self.flags &= ~FLAG_REMOTE  # that was SRR
            self.field = FIELD_ID_17_13
            self.left = 5
        elif field == FIELD_ID_17_13:
            self.field = FIELD_ID_12_5
            self.left = 8
        elif field == FIELD_ID_12_5:
            self.field = FIELD_ID_4_0
            self.left = 5
        elif field == FIELD_ID_4_0:
            self.field = FIELD_RTR
        elif field == FIELD_RTR:
            self.field = FIELD_R1
        elif self.flags & FLAG_FD and field != FIELD_CRC and field < FIELD_CRC_DELIMITER:
            self._next_fd_field()
        elif field == FIELD_IDE or field == FIELD_R1:
            self.field = FIELD_R0
        elif field == FIELD_R0:
            self.field = FIELD_DLC
            self.left = 4
        elif field == FIELD_DLC and not self.flags & FLAG_REMOTE and self.flags & LENGTH_CODE:
            self.field = FIELD_DATA
            self.left = min(8 * (self.flags & LENGTH_CODE), DATA_BITS)
            self.count = 0
        elif field == FIELD_DLC or field == FIELD_DATA:
            self.field = FIELD_CRC
            self.left = CRC_BITS
        elif field == FIELD_CRC:
            self.field = FIELD_CRC_DELIMITER
            if self.flags & FLAG_FD:
                self.fixed_left = -1
                self.register = self.long_register if self._has_long_crc() else self.short_register
                if self.stuffed < 0:
                    self.register = 1
        elif field == FIELD_CRC_DELIMITER:
            self.field = FIELD_ACK_SLOT
        elif field == FIELD_ACK_SLOT:
            self.field = FIELD_ACK_DELIMITER
        else:
            self.field = FIELD_END
            self.left = 7

    @cython.cfunc
    def _next_fd_field(self) -> cython.void:
        """`_next_field` of a CAN FD frame, from FDF to the stuff count."""
        field: cython.longlong = self.field
        if field == FIELD_R0 or field == FIELD_R1:  # FDF
            self.field = FIELD_RES
        elif field == FIELD_RES:
            self.field = FIELD_BRS
        elif field == FIELD_BRS:
            self.field = FIELD_ESI
        elif field == FIELD_ESI:
            self.field = FIELD_DLC
            self.left = 4
        elif field == FIELD_DLC and self.flags & LENGTH_CODE:
            self.field = FIELD_DATA
            self.left = 8 * LENGTHS[self.flags & LENGTH_CODE]
            self.count = 0
        elif field == FIELD_STUFF_COUNT or not self.node.iso:
            self.field = FIELD_CRC
            self.left = CRC21_BITS if self._has_long_crc() else CRC17_BITS
        else:
            self.field = FIELD_STUFF_COUNT
            self.left = STUFF_COUNT_BITS
            self.count = 0
        if self.fixed_left < 0 and (self.field == FIELD_STUFF_COUNT or self.field == FIELD_CRC):
            self.fixed_left = 0

    @cython.cfunc
    def _has_long_crc(self) -> cython.bint:
        return LENGTHS[self.flags & LENGTH_CODE] > SHORT_CRC_UP_TO

    @cython.cfunc
    def _take_fd(self, level: cython.longlong) -> cython.void:
        """`_take` of a bit that only CAN FD frames have, or have otherwise."""
        field: cython.longlong = self.field
        if field == FIELD_DATA:
            if self.count & 7 == 0:
                self.payload.append(0)
            self.payload[self.count >> 3] |= level << (7 - (self.count & 7))
            self.count += 1
        elif field == FIELD_BRS:
            if level:
                self.flags |= FLAG_BRS
                self.fast = True
        elif field == FIELD_ESI:
            self.flags |= FLAG_ESI if level else 0
        elif field == FIELD_STUFF_COUNT:
            self.count = self.count << 1 | level
            if self.left == 0 and self.count != STUFF_COUNT_CODES[self.stuffed & 7]:
                self.stuffed = -1

    @cython.cfunc
    def _take(self, level: cython.longlong) -> cython.void:
        """A bit that is neither stuffed nor of fixed form: to the CRC register, and to the field where it belongs."""
        field: cython.longlong = self.field
        place: cython.longlong
        feedback: cython.longlong = level ^ self.register >> (CRC_BITS - 1)
        self.register = self.register << 1 & CRC_MASK
        if feedback:
            self.register ^= CRC_POLYNOMIAL
        if self.node.fdf == FDF_KNOWN:
            self._to_long_crcs(level)
        if self.fixed_left > 0:
            self.fixed_left -= 1
            self.stuff_run = 0  # no dynamic stuff bits
        if self.flags & FLAG_FD and field != FIELD_DLC:
            self._take_fd(level)
        elif field == FIELD_DATA:
            place = (self.count & 24) + 7 - (self.count & 7)  # bytes little-endian, their bits not
            if self.count < 32:
                self.lo |= level << place
            else:
                self.hi |= level << place
            self.count += 1
        elif field == FIELD_R1 or (field == FIELD_R0 and not self.flags & FLAG_EXTENDED):
            if level and self.node.fdf == FDF_KNOWN:
                self.flags = (self.flags | FLAG_FD) & ~FLAG_REMOTE  # RRS may have either level
        elif field == FIELD_CRC or field == FIELD_START or field == FIELD_R0:
            return
        elif field == FIELD_DLC:
            self.flags |= level << self.left
        elif field == FIELD_SRTR or field == FIELD_RTR:
            self.flags |= FLAG_REMOTE if level else 0
        elif field == FIELD_IDE:
            self.flags |= FLAG_EXTENDED if level else 0
        else:
            self.identifier = self.identifier << 1 | level

    @cython.cfunc
    @cython.exceptval(check=False)
    def _fixed_form(self, level: cython.longlong) -> cython.longlong:
        """A bit after the CRC: recessive, except for the ACK slot. `register` is 0 when the CRC was right."""
        self.fast = False
        if self.field == FIELD_ACK_SLOT:
            if not self.sending and self.driven == DOMINANT:
                if level == RECESSIVE:
                    return self._error(KIND_BIT, 0, RECEIVER_PENALTY)
                if self.node.receive_errors > 0 and not self.unheeded:  # rule (h)
                    self.node.count_reception()
                    self.capture = 0
                    return MET_COUNTER
            return 0
        if level == DOMINANT:
            if self.field == FIELD_END and self.left == 0:  # a receiver has the frame already
                return self._overload()
            return self._error(KIND_FORM, SENDER_PENALTY, RECEIVER_PENALTY)
        if self.field == FIELD_ACK_DELIMITER and self.register != 0:  # a CRC error is signalled after it
            return self._error(KIND_OTHER, SENDER_PENALTY, RECEIVER_PENALTY)
        if self.field == FIELD_END and self.left == 1 and not self.sending:
            return 0 if self.unheeded else MET_RECEIVED
        if self.field == FIELD_END and self.left == 0:
            self._intermission()
            if self.sending:
                self.capture = 0
                if self.node.transmit_errors > 0:  # rule (g)
                    self.node.count_success()
                    return MET_SENT | MET_COUNTER
                return MET_SENT
        return 0

    # ---- error and overload frames

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_dominant_flag(self, level: cython.longlong) -> cython.longlong:
        """An active error flag or an overload flag: six dominant bits."""
        if level == RECESSIVE:  # rules (d) and (e)
            return self._error(KIND_BIT, SENDER_PENALTY, SENDER_PENALTY)
        self.count += 1
        if self.count == FLAG_BITS:
            self._end_flag()
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_passive_flag(self, level: cython.longlong) -> cython.longlong:
        """A passive error flag is complete when six equal bits, whatever their level, have been seen."""
        met: cython.longlong = 0
        self.count = self.count + 1 if level == self.run_level else 1
        self.run_level = level
        if level == DOMINANT and self.unacknowledged:  # so exception 1 of rule (c) does not hold
            self.unacknowledged = False
            met = self._count_domination(KIND_BIT)
        if self.count == FLAG_BITS:
            self._end_flag()
        return met

    @cython.cfunc
    def _end_flag(self) -> cython.void:
        """A flag is complete."""
        self.state = MAC_TOLERATING
        self.field = FIELD_TOLERATED
        self.count = 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _tolerate(self, level: cython.longlong) -> cython.longlong:
        """Dominant bits after a flag are other nodes'; the first recessive one begins the delimiter."""
        self.unacknowledged = False
        if level == RECESSIVE:
            self.state = MAC_DELIMITER
            self.field = FIELD_DELIMITER
            self.count = 1
            return 0
        self.count += 1
        if self.count % TOLERATED_BITS == 0:  # rule (f)
            return self._count_domination(KIND_OTHER)
        if self.count == 1 and self.after_error and not self.sending:  # rule (b)
            return self._count_domination(KIND_OTHER)
        return 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_delimiter(self, level: cython.longlong) -> cython.longlong:
        """Eight recessive bits; the last one may be dominant where another node is a bit ahead."""
        self.count += 1
        if level == DOMINANT:
            if self.count == DELIMITER_BITS:
                return self._overload()
            return self._error(KIND_FORM, SENDER_PENALTY, RECEIVER_PENALTY)
        return self._intermission() if self.count == DELIMITER_BITS else 0

    @cython.cfunc
    @cython.exceptval(check=False)
    def _error(
        self, kind: cython.longlong, sender_penalty: cython.longlong, receiver_penalty: cython.longlong
    ) -> cython.longlong:
        """An error of `kind` (KIND_*) in this bit: the error flag begins with the next one, in any state.

        Which flag is decided before the counters move: the error that makes a node passive is signalled actively.
        """
        met: cython.longlong = MET_ERROR | MET_COUNTER
        node: Node = self.node
        if self.state == MAC_FRAME and self.sending:
            met |= MET_FAILURE
            self.failed = True
        self._note_error(kind)
        if self.sending:
            node.transmit_errors += sender_penalty
        else:
            node.count_receive_errors(receiver_penalty)
        self.state = MAC_PASSIVE_FLAG if node.passive else MAC_ACTIVE_FLAG
        self.field = FIELD_PASSIVE_FLAG if node.passive else FIELD_ACTIVE_FLAG
        self.count = 0
        self.fast = False
        self.after_error = True
        self.unacknowledged = False
        return met

    @cython.cfunc
    @cython.exceptval(check=False)
    def _count_domination(self, kind: cython.longlong) -> cython.longlong:
        """Dominant bits where none should be cost eight: rules (b) and (f), and (c) without its exception 1."""
        self._note_error(kind)
        if self.sending:
            self.node.transmit_errors += SENDER_PENALTY
        else:
            self.node.count_receive_errors(SENDER_PENALTY)
        return MET_COUNTER

    @cython.cfunc
    def _note_error(self, kind: cython.longlong) -> cython.void:
        self.capture = ICR_BUS_ERROR | self.field << ICR_FIELD_SHIFT | kind << ICR_KIND_SHIFT
        if not self.sending:
            self.capture |= ICR_RECEIVING

    @cython.cfunc
    @cython.exceptval(check=False)
    def _overload(self) -> cython.longlong:
        """An overload condition, which is not an error: the overload flag begins with the next bit."""
        settled: cython.longlong = MET_SETTLED if self.failed else 0
        self.state = MAC_OVERLOAD_FLAG
        self.field = FIELD_OVERLOAD_FLAG
        self.count = 0
        self.after_error = False
        self.failed = False
        return settled

    # ---- between frames

    @cython.cfunc
    @cython.exceptval(check=False)
    def _intermission(self) -> cython.longlong:
        """Intermission begins with the next bit."""
        settled: cython.longlong = MET_SETTLED if self.failed else 0
        self.state = MAC_INTERMISSION
        self.field = FIELD_INTERMISSION
        self.count = 0
        self.failed = False
        return settled

    @cython.cfunc
    @cython.exceptval(check=False)
    def _sample_intermission(self, level: cython.longlong, bit: cython.longlong) -> cython.longlong:
        """Three recessive bits. A dominant one is an overload condition, but the third a start of frame.

        Suspend transmission: a transmitter that is error passive when intermission ends waits eight bits more, and
        begins no frame in its last bit. The state at that time counts, after the counters of its frame have changed: a
        transmitter at 128 whose frame succeeded is error active again and does not wait (ISO 11898-1 refers to an
        error-passive node that has been the transmitter, not to one that was error passive while it sent).
        """
        suspended: cython.bint = self.sending and self.node.passive
        self.count += 1
        if level == DOMINANT:
            if self.count < INTERMISSION_BITS:
                return self._overload()
            self.sending = False
            self.start(bit)
            self._receive(level)
            return MET_START if self.offered >= 0 and not suspended else 0
        if self.count == INTERMISSION_BITS:
            self.state = MAC_SUSPENDED if suspended else MAC_IDLE
            self.count = 0
        return 0
