# cython: boundscheck=False, wraparound=False
# (every index below is a place of a ring, which is masked, or an identifier held against the list's length)
"""A satellite's end of its CAN bus: frames to setters by identifier, values to frames
(robot.md N1.3, N4.14).

Receiving: the interrupt copies the controller's registers into a ring, a slot task delivers what waits.
Sending: frames are built with the last network time, wait in a ring of 8 and go into the hardware transmit
buffers 1 and 2 as these become free: checked whenever a frame is queued, and in every slot.
"""

from typing import Final

import cython

from ranger_sim.boards.modules.can_errors import CanErrors
from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.datatable.generated import errors as codes
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import EIGHT_BYTES, RFS_EIGHT_BYTES, CanController
from ranger_sim.firmware_sim.vic import IRQ_LATENCY
from ranger_sim.foundation.events import CAN_RX, CAN_STATUS, EventQueue
from ranger_sim.foundation.renamed import renamed
from ranger_sim.foundation.user_error import FirmwareError

IDENTIFIERS: Final = 2048
# rings: places are masked; one place stays empty
RECEIVE_RING: Final = 64
RECEIVE_MASK: Final = 63
RECEIVED: Final = 4  # numbers in a place: RFS, identifier, value and time
SEND_RING: Final = 8
SEND_MASK: Final = 7
QUEUED: Final = 3  # identifier, value and time
# transmit buffers of the controller, in the order in which they are filled; the third is the router's, for sync
FIRST_BUFFER: Final = 1
SECOND_BUFFER: Final = 2

# Two cycles per instruction (robot.md T2), latency included: 10 + 17 instructions for a frame received.
RECEIVE_CYCLES = 2 * 27
# Derived from it, because no error interrupt was counted: four registers are read in both, and the chain of tests is
# as long again.
ERROR_CYCLES = 2 * 50
# The same for a frame that finds the ring full: 18,800 of them in 20 ms (robot.md T4.1).
STORM_CYCLES = 64
# What follows in a line of the schedule when its frame is put into the ring: the ring, a transmit buffer and the way
# back. Fitted by us to the times at which the images' frames are asked for (test_original_images.py).
TRANSMIT_CYCLES = 2 * 30
# Of the receive list's search, per place (robot.md T2: the time is the second of MCH's list and the first of MCFI's,
# and there 127 - 115 instructions cheaper).
PLACE_CYCLES = 2 * 12


@cython.final
@cython.cclass
class CanLink(Sender):
    """The one CAN controller that a satellite uses.

    Ground truth for tests: `received`, `delivered`, `ignored` (no receiver, remote, or not 8 bytes),
    `receive_lost`, `queued`, `send_lost`, `most_waiting`. `report_full`: a full ring raises an error.
    """

    # what a frame touches
    controller: CanController
    time_identifier: cython.longlong
    search_cycles: cython.longlong
    receivers: list
    rx_write: cython.longlong
    rx_read: cython.longlong
    tx_write: cython.longlong
    tx_read: cython.longlong
    received: cython.longlong
    delivered: cython.longlong
    queued: cython.longlong
    ignored: cython.longlong
    most_waiting: cython.longlong
    rx_rows: cython.longlong[256]
    tx_rows: cython.longlong[24]
    # the rest
    chip: Microcontroller
    errors: ErrorModule
    controller_errors: object
    report_full: cython.bint
    full_ring_kills: cython.bint
    stuck: cython.bint
    receive_lost: cython.longlong
    send_lost: cython.longlong
    code_receive_full: cython.longlong
    code_send_full: cython.longlong
    built: cython.bint
    built_identifier: cython.longlong
    built_value: cython.longlong
    built_time: cython.longlong

    def __init__(
        self,
        chip: Microcontroller,
        controller: CanController,
        time: NetworkTime,
        errors: ErrorModule,
        report_full=True,
        full_ring_kills=True,
    ) -> None:
        Sender.__init__(self, time, TRANSMIT_CYCLES)
        self.chip = chip
        self.controller = controller
        self.errors = errors
        self.controller_errors = CanErrors(controller, errors.report)
        self.report_full = report_full
        self.full_ring_kills = full_ring_kills
        self.code_receive_full = getattr(codes, f"CAN{controller.number}_RX_BUF_OF")
        self.code_send_full = codes.CAN_TX_QUEUE_FULL
        self.receivers = [None] * IDENTIFIERS
        self.search_cycles = 0  # of the whole receive list
        self.time_identifier = -1  # whose frames bring `time`: every third frame
        self.rx_rows = [0] * 256  # RECEIVED x RECEIVE_RING
        self.rx_write = 0
        self.rx_read = 0
        self.tx_rows = [0] * 24  # QUEUED x SEND_RING
        self.tx_write = 0
        self.tx_read = 0
        self.built = False
        self.built_identifier = 0
        self.built_value = 0
        self.built_time = 0
        self.received = 0
        self.delivered = 0
        self.ignored = 0
        self.receive_lost = 0
        self.stuck = False  # a frame can no longer be released: the board is dead
        self.queued = 0
        self.send_lost = 0
        self.most_waiting = 0

    def attach(self, receive_slot=0, error_slot=8) -> None:
        """Take the controller's receive and error interrupts (VIC slots)."""
        number = self.controller.number
        self.chip.vic.attach(
            CAN_RX, number, self.on_receive, cost=RECEIVE_CYCLES - IRQ_LATENCY, slot=receive_slot, name="can_receive"
        )
        self.chip.vic.attach(
            CAN_STATUS, number, self.on_error, cost=ERROR_CYCLES - IRQ_LATENCY, slot=error_slot, name="can_error"
        )

    def subscribe(self, identifier, receiver: Receiver) -> None:
        """Deliver frames of `identifier` to `receiver` from now on; one receiver per identifier and the reverse.

        The list is searched from its first entry, so later ones cost more.
        """
        if not 0 <= identifier < IDENTIFIERS:
            raise FirmwareError(f"{self.chip.name}: identifier {identifier} is not 0 ... {IDENTIFIERS - 1}")
        if self.receivers[identifier] is not None:
            raise FirmwareError(f"{self.chip.name}: identifier {identifier} has two receivers")
        self.receivers[identifier] = receiver
        receiver.cycles += self.search_cycles
        self.search_cycles += PLACE_CYCLES
        if receiver is self.time:
            self.time_identifier = identifier

    def filter_frames(self) -> None:
        """Let the controller's acceptance filter refuse what the receive list has not."""
        self.controller.accept([each for each in range(IDENTIFIERS) if self.receivers[each] is not None])

    def listen(self, identifier, receiver: Receiver) -> None:
        """The old name of `subscribe`."""
        renamed("CanLink.listen", "subscribe")
        self.subscribe(identifier, receiver)

    # --- receiving --------------------------------------------------------------------------------------

    def on_receive(self, queue: EventQueue) -> None:
        """Interrupt: copy the frame into the ring and release the hardware buffer.

        A full ring kills the board where `full_ring_kills`: the interrupt is served for ever, and only others that come
        before it are (robot.md T4.1).
        """
        write: cython.longlong = self.rx_write
        after: cython.longlong = (write + 1) & RECEIVE_MASK
        row: cython.longlong = RECEIVED * write
        controller: CanController = self.controller
        if after == self.rx_read:
            if not self.stuck:  # or it is the same frame once more
                self.receive_lost += 1
            if self.report_full:
                self.errors.report(self.code_receive_full)
            if self.full_ring_kills:
                # the release goes to a wrong address: the buffer stays full and asks again as soon as this ends
                self.stuck = True
                self.chip.spend(STORM_CYCLES - RECEIVE_CYCLES)
                self.chip.request(controller.rx_source)
                return
        else:
            self.rx_rows[row] = controller.RFS
            self.rx_rows[row + 1] = controller.RID
            self.rx_rows[row + 2] = controller.RDA
            self.rx_rows[row + 3] = controller.RDB
            self.rx_write = after
            self.received += 1
        controller.release()

    def on_error(self, queue: EventQueue) -> None:
        """Interrupt: report the causes, restart after bus-off."""
        self.controller_errors.check()

    def receive_all(self) -> object:
        """Slot task: deliver every frame that waits; returns how many there were."""
        read: cython.longlong = self.rx_read
        write: cython.longlong = self.rx_write
        frames: cython.longlong = (write - read) & RECEIVE_MASK
        ignored: cython.longlong = 0
        cycles: cython.longlong = 0
        row: cython.longlong
        identifier: cython.longlong
        if frames == 0:
            return 0
        while read != write:
            row = RECEIVED * read
            identifier = self.rx_rows[row + 1]
            if self.rx_rows[row] != RFS_EIGHT_BYTES or identifier >= IDENTIFIERS:
                ignored += 1
            elif identifier == self.time_identifier:
                cycles += self.time.cycles
                self.time.deliver(self.rx_rows[row + 2], self.rx_rows[row + 3])
            elif self.receivers[identifier] is None:
                ignored += 1
                cycles += self.search_cycles
            else:
                cycles += cython.cast(Receiver, self.receivers[identifier]).cycles
                cython.cast(Receiver, self.receivers[identifier]).deliver(self.rx_rows[row + 2], self.rx_rows[row + 3])
            read = (read + 1) & RECEIVE_MASK
        if cycles > 0:
            self.chip.spend(cycles)
        self.rx_read = read
        self.ignored += ignored
        self.delivered += frames - ignored
        return frames

    # --- sending ----------------------------------------------------------------------------------------

    def build(self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong) -> None:
        """A line of the schedule has begun to make a frame, which `transmit` sends when the line's cycles are over.

        A second one in the same row sends the first.
        """
        if self.built:
            self.transmit()
        self.built = True
        self.built_identifier = identifier
        self.built_value = value_word
        self.built_time = time_word

    @cython.ccall
    def transmit(self) -> None:
        """Slot task, the end of can_transmit: put the frame that the row made, if it made one, into the ring."""
        if self.built:
            self.built = False
            self.send_words(self.built_identifier, self.built_value, self.built_time)

    def send_words(
        self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong
    ) -> cython.bint:
        """Queue a frame with both words given (0 ... 2^32-1); False when the ring is full and it is lost."""
        controller: CanController = self.controller
        write: cython.longlong = self.tx_write
        after: cython.longlong = (write + 1) & SEND_MASK
        row: cython.longlong
        waiting: cython.longlong
        if write == self.tx_read and controller.transmit_if_free(
            FIRST_BUFFER, identifier, EIGHT_BYTES, value_word, time_word
        ):
            # nothing waited: straight through the ring
            self.queued += 1
            if self.most_waiting == 0:
                self.most_waiting = 1
            return True
        if after == self.tx_read:
            self.send_lost += 1
            if self.report_full:
                self.errors.report(self.code_send_full)
            return False
        row = QUEUED * write
        self.tx_rows[row] = identifier
        self.tx_rows[row + 1] = value_word
        self.tx_rows[row + 2] = time_word
        self.tx_write = after
        self.queued += 1
        waiting = (after - self.tx_read) & SEND_MASK
        if waiting > self.most_waiting:
            self.most_waiting = waiting
        self.feed()
        return True

    @cython.ccall
    def feed(self) -> object:
        """Slot task, and after each queued frame: fill free hardware buffers, 1 before 2.

        Returns how many frames went there.
        """
        frames: cython.longlong = 0
        row: cython.longlong
        identifier: cython.longlong
        value: cython.longlong
        time: cython.longlong
        controller: CanController
        if self.tx_read == self.tx_write:
            return 0
        controller = self.controller
        while self.tx_read != self.tx_write:
            row = QUEUED * self.tx_read
            identifier = self.tx_rows[row]
            value = self.tx_rows[row + 1]
            time = self.tx_rows[row + 2]
            if not controller.transmit_if_free(
                FIRST_BUFFER, identifier, EIGHT_BYTES, value, time
            ) and not controller.transmit_if_free(SECOND_BUFFER, identifier, EIGHT_BYTES, value, time):
                break
            self.tx_read = (self.tx_read + 1) & SEND_MASK
            frames += 1
        return frames
