# cython: boundscheck=False, wraparound=False
# (every index below is a place of a ring, which is masked, or an identifier held against the list's length)
"""A satellite's end of its CAN bus: frames to setters by identifier, values to frames
(robot.md N1.3, N4.14).

Receiving: the interrupt copies the controller's registers into a ring, a slot task delivers what waits.
Sending: frames are built with the last network time, wait in a ring of 8 and go into the hardware transmit
buffers 1 and 2 as these fall free: looked after whenever a frame is queued, and in every slot.
"""

import cython

from ranger_sim.boards.modules.error_module import ErrorModule
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.receiver import Receiver
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller import (
    ICR_BEI,
    ICR_DOI,
    ICR_EI,
    ICR_EPI,
    ICR_RI,
    ICR_TI1,
    CanController,
)
from ranger_sim.foundation.events import CAN_RX, CAN_STATUS, EventQueue
from ranger_sim.foundation.user_error import UserError

if not cython.compiled:
    from ranger_sim.foundation.numbers import word_of_float, word_of_i32

RECEIVE_RING = 64  # 63 usable
SEND_RING = 8  # 7 usable
IDENTIFIERS = 2048
ALL_INTERRUPTS = ICR_RI | ICR_EI | ICR_DOI | ICR_EPI | ICR_BEI
HIP_INTERRUPTS = ICR_RI | ICR_TI1 | ICR_EI | ICR_BEI  # its TX1 bit reaches no handler

# Chosen by us, no measurement is known: about 25 instructions with 4 register reads over the slow bus, and for an
# error the read of CxICR and a chain of tests.
RECEIVE_CYCLES = 110
ERROR_CYCLES = 150


class CanLink:
    """The one CAN controller that a satellite uses. `codes`: module of error codes.

    Ground truth for tests: `received`, `delivered`, `ignored` (no receiver, remote, or not 8 bytes),
    `receive_lost`, `queued`, `send_lost`, `most_waiting`. `report_full`: a full ring raises an error.
    """

    def __init__(
        self,
        chip: Microcontroller,
        controller: CanController,
        time: NetworkTime,
        errors: ErrorModule,
        codes,
        report_full=True,
    ) -> None:
        self.chip = chip
        self.controller = controller
        self.time = time
        self.errors = errors
        self.report_full = report_full
        prefix = f"CAN{controller.number}_"
        self.code_bus_off = getattr(codes, prefix + "TX_BUSOFF")
        self.code_warning = getattr(codes, prefix + "ERR_WARN")
        self.code_overrun = getattr(codes, prefix + "DATA_OVRN")
        self.code_passive = getattr(codes, prefix + "ERR_PASS")
        self.code_bus_rx = getattr(codes, prefix + "BUS_RX")
        self.code_bus_tx = getattr(codes, prefix + "BUS_TX")
        self.code_receive_full = getattr(codes, prefix + "RX_BUF_OF")
        self.code_send_full = codes.CAN_TX_QUEUE_FULL
        self.receivers = [None] * IDENTIFIERS
        self.time_identifier = -1  # whose frames bring `time`: every third frame
        # rings of rows: RFS, identifier, value and time; and identifier, value and time
        self.rx_rows = [0] * 256  # 4 RECEIVE_RING; written and read from where a row begins
        self.rx_write = 0
        self.rx_read = 0
        self.tx_rows = [0] * 24  # 3 SEND_RING
        self.tx_write = 0
        self.tx_read = 0
        self.received = 0
        self.delivered = 0
        self.ignored = 0
        self.receive_lost = 0
        self.queued = 0
        self.send_lost = 0
        self.most_waiting = 0

    def attach(self, receive_slot=0, error_slot=8) -> None:
        """Take the controller's receive and error interrupts (VIC slots)."""
        number = self.controller.number
        self.chip.vic.attach(
            CAN_RX, number, self.on_receive, cost=RECEIVE_CYCLES, slot=receive_slot, name="can_receive"
        )
        self.chip.vic.attach(CAN_STATUS, number, self.on_error, cost=ERROR_CYCLES, slot=error_slot, name="can_error")

    def listen(self, identifier, receiver: Receiver) -> None:
        """Frames of `identifier` go to `receiver` from now on; one receiver per identifier."""
        if not 0 <= identifier < IDENTIFIERS:
            raise UserError(f"{self.chip.name}: identifier {identifier} is not 0 ... {IDENTIFIERS - 1}")
        if self.receivers[identifier] is not None:
            raise UserError(f"{self.chip.name}: identifier {identifier} has two receivers")
        self.receivers[identifier] = receiver
        if receiver is self.time:
            self.time_identifier = identifier

    # --- receiving --------------------------------------------------------------------------------------

    def on_receive(self, queue: EventQueue) -> None:
        """Interrupt: copy the frame into the ring and release the hardware buffer."""
        row: cython.longlong = self.rx_write
        after: cython.longlong = (row + 4) & 255
        controller: CanController = self.controller
        if after == self.rx_read:
            self.receive_lost += 1
            if self.report_full:
                self.errors.report(self.code_receive_full)
        else:
            self.rx_rows[row] = controller.RFS
            self.rx_rows[row + 1] = controller.RID
            self.rx_rows[row + 2] = controller.RDA
            self.rx_rows[row + 3] = controller.RDB
            self.rx_write = after
            self.received += 1
        controller.release()

    def on_error(self, queue: EventQueue) -> None:
        """Interrupt: read CxICR, restart after bus-off, note what it was."""
        cause: cython.longlong = self.controller.read_ICR()
        if self.controller.bus_off:
            self.errors.report(self.code_bus_off)
            self.controller.write_MOD(0)
            return
        if cause & 4:
            self.errors.report(self.code_warning)
        if cause & 8:
            self.errors.report(self.code_overrun)
            self.controller.write_CMR(8)
        if cause & 32:
            self.errors.report(self.code_passive)
        if cause & 128:
            if cause >> 21 & 1:  # ERRDIR of the capture bits: while receiving
                self.errors.report(self.code_bus_rx)
            else:
                self.errors.report(self.code_bus_tx)

    def receive_all(self) -> object:
        """Slot task: deliver every frame that waits; returns how many there were."""
        read: cython.longlong = self.rx_read
        write: cython.longlong = self.rx_write
        frames: cython.longlong = ((write - read) & 255) >> 2
        ignored: cython.longlong = 0
        identifier: cython.longlong
        if frames == 0:
            return 0
        while read != write:
            identifier = self.rx_rows[read + 1]
            # DLC 8 and neither remote nor extended, as the bits stand in RFS
            if self.rx_rows[read] != 524288 or identifier > 2047:
                ignored += 1
            elif identifier == self.time_identifier:
                self.time.deliver(self.rx_rows[read + 2], self.rx_rows[read + 3])
            elif self.receivers[identifier] is None:
                ignored += 1
            else:
                cython.cast(Receiver, self.receivers[identifier]).deliver(
                    self.rx_rows[read + 2], self.rx_rows[read + 3]
                )
            read = (read + 4) & 255
        self.rx_read = 0  # empty: the next frame goes to the front again, which is in the cache
        self.rx_write = 0
        self.ignored += ignored
        self.delivered += frames - ignored
        return frames

    # --- sending ----------------------------------------------------------------------------------------

    def send_words(
        self, identifier: cython.longlong, value_word: cython.longlong, time_word: cython.longlong
    ) -> cython.bint:
        """Queue a frame with both words given (0 ... 2^32-1); False when the ring is full and it is lost."""
        controller: CanController = self.controller
        write: cython.longlong = self.tx_write
        after: cython.longlong = (write + 1) & 7
        row: cython.longlong
        waiting: cython.longlong
        if write == self.tx_read and controller.transmit_if_free(1, identifier, 8, value_word, time_word):
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
        row = 3 * write
        self.tx_rows[row] = identifier
        self.tx_rows[row + 1] = value_word
        self.tx_rows[row + 2] = time_word
        self.tx_write = after
        self.queued += 1
        waiting = (after - self.tx_read) & 7
        if waiting > self.most_waiting:
            self.most_waiting = waiting
        self.feed()
        return True

    def send_float(self, identifier: cython.longlong, value: cython.double) -> cython.bint:
        """Queue `value` as a single float, stamped with the network time of now."""
        return self.send_words(identifier, word_of_float(value), self.time.ms)

    def send_int(self, identifier: cython.longlong, value: cython.longlong) -> cython.bint:
        """Queue a 32-bit whole number, stamped with the network time of now."""
        return self.send_words(identifier, word_of_i32(value), self.time.ms)

    def send_error(self, identifier: cython.longlong) -> None:
        """Occasional task: send the error that waits longest, if one does."""
        if self.errors.take():
            self.send_words(identifier, self.errors.word, self.errors.stamp)

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
            row = 3 * self.tx_read
            identifier = self.tx_rows[row]
            value = self.tx_rows[row + 1]
            time = self.tx_rows[row + 2]
            if not controller.transmit_if_free(1, identifier, 8, value, time) and not controller.transmit_if_free(
                2, identifier, 8, value, time
            ):
                break
            self.tx_read = (self.tx_read + 1) & 7
            frames += 1
        return frames
