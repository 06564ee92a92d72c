"""The line to the computer: data points out by rate and priority, parameters in (robot.md N4.15).

To the computer go segments of 92 bytes: nine points of identifier (16 bits), value and time stamp (32 bits each),
and a checksum, the sum of the 90 bytes before it plus 1; everything big-endian, no start byte. Twenty segments form
a ring that DMA empties. From the computer come packets of 8 bytes: identifier, value, and the sum of these six bytes
plus 1. After a wrong sum the reader goes on one byte later.

What is sent: in each cycle every variable of the fast list that is new, the next one of the medium list if it is new,
and the next of all variables whether new or not. 48 variables of the table, LV_CH_0 ... LV_CH_47, choose: identifier
plus 65536 for the medium list, plus 131072 for the fast one. How many steps of this a slot may take follows from how
full the ring is: an integral controller keeps it half filled. A step is one look at a list entry, sent or skipped, or
the return to the start of the cycle. The end of the fast list costs no step (chosen by us).
"""

import array

import cython

from ranger_sim.datatable.generated import all_variables, errors
from ranger_sim.datatable.generated import mb as table
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.vic import SOFTWARE
from ranger_sim.foundation.events import EventQueue

POINTS_PER_SEGMENT = 9
POINT_BYTES = 10
SEGMENT_BYTES = 92
RING_SEGMENTS = 20  # 18 may be full: one is being filled, and one stays between writer and reader
PACKET_BYTES = 8
RECEIVE_RING = 500  # one place stays empty, as in all rings of the firmware
CHANNELS = 48
MEDIUM, FAST = 1 << 16, 1 << 17  # added to the identifier in a channel's value


class DataLink:
    """Both directions. `report(code)` hears the errors; `checked`: only parameters can be written.

    Counters: points, segments, steps, packets (good ones), bad_packets (bytes skipped), refused (writes to what is no
    parameter), ring_full (bytes lost because they came faster than they were parsed).
    """

    def __init__(self, chip, uart, store, report, checked=True, dma_off_at_start=False) -> None:
        self.chip = chip
        self.uart = uart
        self.store = store
        self.report = report
        self.checked = checked
        self.dma_was_off = dma_off_at_start
        self.restart_source = chip.vic.source(SOFTWARE, 0)
        self.code_full = errors.MB_SER_RX_FULL
        self.code_buffer_full = errors.MB_SER_DMA_FLL
        self.code_dma_off = errors.MB_SER_DMA_OFF
        self.code_checksum = errors.MB_SER_CHKSUM
        self.code_no_parameter = errors.MB_UNKNOWN_PARAMETER
        self.code_id_out_of_range = errors.MB_IO_ID_OOR
        self.last_id = all_variables.ID_OF_LAST
        # 1 where the computer is the publisher: what it may write
        self.is_parameter = array.array(
            "q", [int(all_variables.PUBLISHERS[n] == "PC") for n in range(all_variables.TABLE_SIZE)]
        )
        self.first_channel = table.LV_CH_0
        # transmit
        self.segments = bytearray(RING_SEGMENTS * SEGMENT_BYTES)
        self.filling = 0  # number of the segment being filled
        self.sending = 0  # number of the oldest full one
        self.used = 0  # full ones, the one that DMA sends included
        self.in_segment = 0  # points in the one being filled
        self.checksum = 1
        self.fast = array.array("q", [0]) * CHANNELS
        self.fast_count = 0
        self.medium = array.array("q", [0]) * CHANNELS
        self.medium_count = 0
        self.phase = 0  # of a cycle: 0 fast list, 1 medium, 2 slow, 3 return to the start
        self.fast_place = 0
        self.medium_place = 0
        self.slow_id = 0
        self.rate_sum = 0
        self.calls_without_step = 0
        self.points = 0
        self.segments_sent = 0
        self.steps = 0
        # receive
        self.ring = array.array("q", [0]) * RECEIVE_RING
        self.ring_write = 0
        self.ring_read = 0
        self.packets = 0
        self.bad_packets = 0
        self.refused = 0
        self.ring_full = 0

    # --- to the computer --------------------------------------------------------------------------------

    def build_lists(self) -> None:
        """Row task: what the 48 channels ask for. Identifiers beyond the table are reported and left out."""
        i: cython.longlong
        wanted: cython.longlong
        number: cython.longlong
        value: cython.double
        self.fast_count = 0
        self.medium_count = 0
        for i in range(48):
            value = self.store.get_float(self.first_channel + i)
            if not 65536.0 <= value < 262144.0:
                continue  # neither list, or no number at all
            wanted = cython.cast(cython.longlong, value) if cython.compiled else int(value)
            number = wanted & 65535
            if number > self.last_id:
                self.report(self.code_id_out_of_range)
                continue
            if wanted & 65536:
                self.medium[self.medium_count] = number
                self.medium_count += 1
            if wanted & 131072:
                self.fast[self.fast_count] = number
                self.fast_count += 1

    def allowed_steps(self) -> cython.longlong:
        """The rate controller: steps of this call, 0 ... 10."""
        calls: cython.longlong
        self.rate_sum += 18 - self.used - 10
        if self.rate_sum > 40960:
            self.rate_sum = 40960
        elif self.rate_sum < -40960:
            self.rate_sum = -40960
        if self.rate_sum > 0:
            self.calls_without_step = 0
            return self.rate_sum >> 12
        calls = (-self.rate_sum >> 12) + 1
        self.calls_without_step += 1
        if self.calls_without_step < calls:
            return 0
        self.calls_without_step = 0
        return 1

    def send_data(self) -> object:
        """Slot task: as many steps as are allowed; returns how many were done. A full ring ends the call."""
        allowed: cython.longlong = self.allowed_steps()
        done: cython.longlong = 0
        while done < allowed and self.used < 18:
            self._step()
            done += 1
        self.steps += done
        return done

    def _step(self) -> cython.void:
        number: cython.longlong
        if self.phase == 0:
            if self.fast_place < self.fast_count:
                number = self.fast[self.fast_place]
                self.fast_place += 1
                if self.store.unread[number] & 1:  # new for BLUETOOTH
                    self._put(number)
                return
            self.phase = 1
        if self.phase == 1:
            self.phase = 2
            if self.medium_count > 0:
                if self.medium_place >= self.medium_count:
                    self.medium_place = 0
                number = self.medium[self.medium_place]
                self.medium_place += 1
                if self.store.unread[number] & 1:
                    self._put(number)
        elif self.phase == 2:
            self.phase = 3
            self._put(self.slow_id)
            self.slow_id += 1
            if self.slow_id > self.last_id:
                self.slow_id = 0
        else:
            self.phase = 0
            self.fast_place = 0

    def _put(self, number: cython.longlong) -> None:
        """One point into the segment being filled; the computer has now read that variable."""
        at: cython.longlong = self.filling * 92 + self.in_segment * 10
        self._byte(at, number >> 8)
        self._byte(at + 1, number & 255)
        self._word(at + 2, self.store.words[number])
        self._word(at + 6, self.store.stamps[number])
        # the computer's two bits: BLUETOOTH, by which this link goes, and LABVIEW, which the error distribution asks
        self.store.unread[number] &= ~5
        self.points += 1
        self.in_segment += 1
        if self.in_segment == 9:
            at = self.filling * 92 + 90
            self.segments[at] = self.checksum >> 8 & 255
            self.segments[at + 1] = self.checksum & 255
            self.in_segment = 0
            self.checksum = 1
            self.filling = (self.filling + 1) % 20
            self.used += 1
            if not self.uart.busy:
                self.chip.request(self.restart_source)

    def _byte(self, at: cython.longlong, byte: cython.longlong) -> None:
        self.segments[at] = byte
        self.checksum += byte

    def _word(self, at: cython.longlong, word: cython.longlong) -> None:
        self._byte(at, word >> 24 & 255)
        self._byte(at + 1, word >> 16 & 255)
        self._byte(at + 2, word >> 8 & 255)
        self._byte(at + 3, word & 255)

    def on_restart(self, queue: EventQueue) -> None:
        """Software interrupt: the ring was empty and has a segment again."""
        if not self.uart.busy:
            self._start()

    def on_sent(self, queue: EventQueue) -> None:
        """DMA channel 3 is through with a segment: its place is free, the next one goes."""
        self.sending = (self.sending + 1) % 20
        self.used -= 1
        self.segments_sent += 1
        self._start()

    def _start(self) -> None:
        at: cython.longlong = self.sending * 92
        if self.used > 0:
            self.uart.transmit(bytes(self.segments[at : at + 92]))

    # --- from the computer ------------------------------------------------------------------------------

    def swap_buffers(self) -> object:
        """Row task: the other DMA buffer receives, what the first one has goes into the ring; returns the bytes."""
        uart: HsUart = self.uart
        i: cython.longlong
        following: cython.longlong
        count: cython.longlong
        if uart.overrun:  # its transfer came to an end: the buffer is full and the channel off
            self.dma_was_off = True
            self.report(self.code_buffer_full)
        if self.dma_was_off:
            self.dma_was_off = False
            self.report(self.code_dma_off)
        count = uart.swap()
        for i in range(count):
            following = (self.ring_write + 1) % 500
            if following == self.ring_read:
                self.ring_full += count - i
                self.report(self.code_full)
                return i
            self.ring[self.ring_write] = uart.taken(i)
            self.ring_write = following
        return count

    def waiting(self) -> cython.longlong:
        """Bytes in the ring."""
        return (self.ring_write - self.ring_read) % 500

    def parse(self) -> object:
        """Row task: every whole packet in the ring; returns how many places it looked at."""
        tested: cython.longlong = 0
        total: cython.longlong
        i: cython.longlong
        read: cython.longlong = self.ring_read
        left: cython.longlong = self.waiting()
        while left >= 8:
            tested += 1
            total = 1
            for i in range(6):
                total += self.ring[(read + i) % 500]
            if total != self.ring[(read + 6) % 500] << 8 | self.ring[(read + 7) % 500]:
                self.bad_packets += 1
                self.report(self.code_checksum)
                read = (read + 1) % 500
                left -= 1
                continue
            self._write(
                self.ring[read] << 8 | self.ring[(read + 1) % 500],
                self.ring[(read + 2) % 500] << 24
                | self.ring[(read + 3) % 500] << 16
                | self.ring[(read + 4) % 500] << 8
                | self.ring[(read + 5) % 500],
            )
            read = (read + 8) % 500
            left -= 8
        self.ring_read = read
        return tested

    def _write(self, number: cython.longlong, word: cython.longlong) -> cython.void:
        """A good packet: the value into the table, if the computer may set it."""
        self.packets += 1
        if self.checked and (number > self.last_id or self.is_parameter[number] == 0):
            self.refused += 1
            self.report(self.code_no_parameter)
            return
        self.store.set_word(number, word, self.store.stamps[0])
