"""A controller on a bus, and its error confinement (ISO 11898-1): error counters, error states, bus-off recovery.

A node is error active until one of its counters reaches PASSIVE_LIMIT; then it is error passive: its error flags are
recessive and destroy no other node's frame, and after sending it suspends transmission. At BUS_OFF_LIMIT transmit
errors it is bus-off and takes no part. The bus decides the result of a frame and reports it to the nodes; the nodes
count, change state and notify their programs.
"""

from typing import Final

import cython

from ranger_sim.can_bus.acceptance import Acceptance
from ranger_sim.can_bus.transmit_ends import TransmitEnds
from ranger_sim.foundation.events import CAN_STATUS, CAN_TX_DONE, EventQueue

# Modes: `Bus.set_mode` takes the first two, `Node.mode` shows all.
OPERATING: Final = 0
RESET: Final = 1  # off the bus: neither sends, receives nor acknowledges
BUS_OFF: Final = 2  # removed by its transmit error counter
JOINING: Final = 3  # waits for recessive sequences before it takes part
UNPLUGGED: Final = 4  # no wire leads from it to this bus (`Bus.unplug`)

# Interrupt bits of a CAN_STATUS message: CxICR of the LPC2194 (user manual UM10114, table of CANICR).
ICR_ERROR_WARNING: Final = 0x4  # bit 2, EI: the warning limit was crossed either way, or bus-off entered or left
ICR_ERROR_PASSIVE: Final = 0x20  # bit 5, EPI: error passive entered or left
ICR_BUS_ERROR: Final = 0x80  # bit 7, BEI: an error frame; the capture fields below are valid
ICR_FIELD_SHIFT: Final = 16  # bits 16-20: FIELD_* of can_bus.frame
ICR_FIELD_MASK: Final = 31
ICR_RECEIVING: Final = 0x200000  # bit 21, ERRDIR: the error was met while receiving
ICR_KIND_SHIFT: Final = 22  # bits 22-23: KIND_*
KIND_BIT: Final = 0
KIND_FORM: Final = 1
KIND_STUFF: Final = 2
KIND_OTHER: Final = 3

# Error confinement: ISO 11898-1, unless noted otherwise.
WARNING_LIMIT: Final = 96  # CxEWL after reset; ISO 11898-1 recommends the same
PASSIVE_LIMIT: Final = 128  # error passive from here
BUS_OFF_LIMIT: Final = 256  # bus-off from here (transmit errors)
RECEIVE_ERRORS_MOST: Final = (
    255  # RXERR of the LPC2194 has eight bits; beyond the passive limit the value has no further meaning
)
RECEIVER_CALMED: Final = 119  # an error-passive receiver after a good frame; the standard allows 119 ... 127
SENDER_PENALTY: Final = 8  # transmit errors that an error costs the sender; the heavier ones cost a receiver as much
SUSPEND_BITS: Final = 8  # suspend transmission: how long an error-passive sender waits after the intermission
SEQUENCE_BITS: Final = 11  # a recessive sequence, as between two frames
RECOVERY_SEQUENCES: Final = 128  # number of them for which a bus-off node waits before it returns
# What a node makes of a recessive FDF bit, r0 (extended frames: r1) of classic CAN.
FDF_IGNORED: Final = 0  # a reserved bit, as in CAN 2.0: either level is accepted; so on a classic bus
FDF_REFUSED: Final = 1  # a form error: a classic node on a CAN FD bus
FDF_KNOWN: Final = 2  # a CAN FD frame
TRANSMIT_ERRORS_OFF: Final = 127  # reading of the transmit counter of an LPC2194 while it is bus-off


@cython.final
@cython.cclass
class Node:
    """A controller on a bus, with its error counters and statistics.

    `following`: the next node of the bus; the last is followed by the first. `listening`: it wants received frames (a
    node that does not still acknowledges). `acceptance`: the frames that its acceptance filter lets through, None: all;
    the others are counted in `filtered`. `silent`: it drives nothing, not even an acknowledgement (`Bus.set_silent`).
    `flushed`: frames that waited when it went bus-off. `refused`: requests into an occupied buffer or while off the
    bus. `ends`: where the ends of its transmissions are written, unless they shall be messages. `suspend_bit`: it sends
    nothing before that bit. `off_ns`: when it went bus-off last; earlier requests of its program do not bring it back.
    `sending_end`: the last bit of a frame that it sent together with another node. While it is joining,
    `sequences_left` recessive sequences, of which the first begins at bit `join_from` or later, are missing.
    `fdf`: FDF_*. `iso`: how it codes CAN FD frames (`fd_frame`). `sequence`: SEQUENCE_BITS in the bus's unit of time.
    """

    # fields used by every frame come first: few cache lines
    inbox: "EventQueue"
    following: "Node"
    ends: TransmitEnds
    index: cython.longlong
    order: cython.longlong
    controller: cython.longlong
    mode: cython.longlong
    transmit_errors: cython.longlong
    receive_errors: cython.longlong
    listening: cython.bint
    acceptance: Acceptance
    passive: cython.bint
    silent: cython.bint
    sent: cython.longlong
    received: cython.longlong
    filtered: cython.longlong
    warning: cython.bint
    name: str
    sequences_left: cython.longlong
    join_from: cython.longlong
    suspend_bit: cython.longlong
    off_ns: cython.longlong
    sending_end: cython.longlong
    refused: cython.longlong
    aborted: cython.longlong
    single_shot_skipped: cython.longlong
    flushed: cython.longlong
    arbitrations_lost: cython.longlong
    retries: cython.longlong
    fdf: cython.longlong
    iso: cython.bint
    sequence: cython.longlong

    def __init__(self, name, index, inbox, controller, order) -> None:
        self.inbox = inbox
        self.ends = TransmitEnds(by_message=True)
        self.following = self
        self.order = order
        self.controller = controller
        self.mode = OPERATING
        self.listening = True
        self.acceptance = None
        self.filtered = 0
        self.silent = False
        self.sent = 0
        self.received = 0
        self.index = index
        self.sequences_left = 0
        self.join_from = 0
        self.sending_end = -1
        self.refused = 0
        self.aborted = 0
        self.single_shot_skipped = 0
        self.flushed = 0
        self.arbitrations_lost = 0
        self.retries = 0
        self.fdf = FDF_IGNORED
        self.iso = True
        self.sequence = SEQUENCE_BITS
        self.renew(name)

    def renew(self, name) -> None:
        """Error confinement as of a new controller, called `name`."""
        self.name = name
        self.suspend_bit = 0
        self.off_ns = 0
        self.forgive()

    def connect(self, ends) -> None:
        """The ends of transmissions are written into `ends` from now on, None: all are messages."""
        self.ends = TransmitEnds(by_message=True) if ends is None else ends
        self.ends.order = self.order

    def end_unsent(self, buffer, time, status) -> None:
        """The transmission from `buffer` ends at `time` (ns) without success: TX_ABORTED or TX_LOST."""
        if not self.ends.write(buffer, time, status):
            self.inbox.push(time, self.order, CAN_TX_DONE, self.controller, buffer, status)

    @cython.cfunc
    @cython.exceptval(check=False)
    def takes(self, identifier: cython.longlong, flags: cython.longlong) -> cython.bint:
        """Whether its acceptance filter lets a frame through; counts it otherwise."""
        if self.acceptance is None or self.acceptance.accepts(identifier, flags):
            return True
        self.filtered += 1
        return False

    # ---- error counters

    def forgive(self) -> None:
        """Both error counters at zero: error active."""
        self.transmit_errors = 0
        self.receive_errors = 0
        self.passive = False
        self.warning = False

    @cython.cfunc
    def count_success(self) -> None:
        """Count a frame that it has sent successfully when it had transmit errors."""
        self.transmit_errors -= 1

    @cython.cfunc
    def count_reception(self) -> None:
        """Count a good frame that it received when it had receive errors."""
        self.receive_errors = self.receive_errors - 1 if self.receive_errors < PASSIVE_LIMIT else RECEIVER_CALMED

    @cython.ccall
    def count_receive_errors(self, penalty: cython.longlong) -> None:
        """Count an error that it detected as a receiver."""
        self.receive_errors = min(self.receive_errors + penalty, RECEIVE_ERRORS_MOST)

    @cython.ccall
    def confine(self, time: cython.longlong, interrupts: cython.longlong) -> cython.bint:
        """Derive the error state from the counters, and report it at `time` (ns) with `interrupts` (ICR_*).

        True when the node goes bus-off by that.
        """
        worst: cython.longlong = max(self.transmit_errors, self.receive_errors)
        off: cython.bint = self.transmit_errors >= BUS_OFF_LIMIT
        if (worst >= WARNING_LIMIT) != self.warning:
            self.warning = not self.warning
            interrupts |= ICR_ERROR_WARNING
        if (worst >= PASSIVE_LIMIT) != self.passive:
            self.passive = not self.passive
            interrupts |= ICR_ERROR_PASSIVE
        if off:
            self.mode = BUS_OFF
            interrupts |= ICR_ERROR_WARNING
        self.report_status(time, interrupts)
        return off

    @cython.cfunc
    def report_status(self, time: cython.longlong, interrupts: cython.longlong) -> None:
        """CAN_STATUS to the node's program."""
        off: cython.longlong = 1 if self.mode == BUS_OFF else 0
        shown: cython.longlong = TRANSMIT_ERRORS_OFF if off else self.transmit_errors
        self.inbox.push(time, self.order, CAN_STATUS, self.controller, interrupts, shown, self.receive_errors, off)

    # ---- off the bus and back

    def leave(self) -> None:
        """Enter reset. A node that went bus-off must still recover afterwards."""
        self.mode = BUS_OFF if self.transmit_errors >= BUS_OFF_LIMIT else RESET

    def unplug(self) -> None:
        """Leave the bus permanently: the next user of this place is a new controller."""
        self.mode = RESET

    def take_over(self, other) -> None:
        """Take the counters of `other`, the same controller on another bus or on the other side of a cut."""
        self.transmit_errors = other.transmit_errors
        self.receive_errors = other.receive_errors
        self.passive = other.passive
        self.warning = other.warning
        self.listening = other.listening
        self.acceptance = other.acceptance
        self.silent = other.silent
        self.off_ns = other.off_ns
        self.fdf = other.fdf

    def start_joining(self, bit) -> None:
        """Wait from `bit` on: after reset for one recessive sequence, after bus-off for its recovery."""
        self.sequences_left = RECOVERY_SEQUENCES if self.mode == BUS_OFF else 1
        self.join_from = bit
        self.mode = JOINING

    @cython.cfunc
    @cython.exceptval(check=False)
    def joins_at(self, free_bit: cython.longlong) -> cython.longlong:
        """Bit at which the last recessive sequence is over, if no frame starts earlier.

        `free_bit`: where the bus is free. A frame and its intermission end in one recessive sequence.
        """
        return max(free_bit - self.sequence, self.join_from) + self.sequence * self.sequences_left

    def count_sequences(self, free_bit, start) -> None:
        """Count the sequences that have passed: a frame starts at bit `start`, the bus was free from `free_bit` on."""
        run = start - max(free_bit - self.sequence, self.join_from)
        self.sequences_left -= max(run, 0) // self.sequence

    def join(self) -> cython.bint:
        """Take part; True when that ends bus-off, with both counters at zero."""
        recovered: cython.bint = self.transmit_errors >= BUS_OFF_LIMIT
        self.mode = OPERATING
        self.sequences_left = 0
        if recovered:
            self.forgive()
        return recovered
