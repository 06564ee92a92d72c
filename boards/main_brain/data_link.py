"""The line to the computer: data points out by rate and priority, parameters in (robot.md N4.15).

To the computer go segments of 92 bytes: nine points of identifier (16 bits), value and time stamp (32 bits each),
and a checksum, the sum of the 90 bytes before it plus 1; everything big-endian, no start byte. Twenty segments form
a ring that DMA empties. From the computer come packets of 8 bytes: identifier, value, and the sum of these six bytes
plus 1. After a wrong sum the reader goes on one byte later.

What is sent: in each cycle every variable of the fast list that is new, the next one of the medium list that is new
(the search ends at the list's end and begins anew in the next cycle), and the next of all variables whether new or
not. 48 variables of the table, LV_CH_0 ... LV_CH_47, choose: identifier
plus 65536 for the medium list, plus 131072 for the fast one. How many steps of this a slot may take follows from how
full the ring is: an integral controller keeps it half filled. A step is one check of a list entry, sent or skipped, or
the return to the start of the cycle. The end of the fast or the medium list costs no step.
"""

import array
from typing import TYPE_CHECKING, Final

import cython

from ranger_sim.datatable.generated import all_variables, errors
from ranger_sim.datatable.generated import mb as table
from ranger_sim.firmware_sim.peripherals.uart_hs import HsUart
from ranger_sim.firmware_sim.vic import SOFTWARE, InterruptSource
from ranger_sim.foundation.events import EventQueue
from ranger_sim.foundation.numbers import float_of_word, wrap_i32

if TYPE_CHECKING:
    from ranger_sim.datatable.store import DataStore
    from ranger_sim.firmware_sim.microcontroller import Microcontroller

POINTS_PER_SEGMENT: Final = 9
POINT_BYTES: Final = 10
SEGMENT_BYTES: Final = 92
SEGMENT_SUM: Final = 90  # the place of its checksum
RING_SEGMENTS: Final = 20
MOST_FULL: Final = 18  # of them: one is being filled, and one stays between writer and reader
HALF_FULL: Final = 10  # what the rate controller aims at, with the one being filled
PACKET_BYTES: Final = 8
PACKET_SUM: Final = 6  # the place of its checksum
RECEIVE_RING: Final = 500  # one place stays empty, as in all rings of the firmware
CHANNELS: Final = 48
# Added to the identifier in a channel's value; below 2 x FAST it is such a value.
MEDIUM: Final = 65536
FAST: Final = 131072
IDENTIFIER: Final = 65535
# The rate controller's sum, clipped to this, either way; its steps are the sum by 4096.
LARGEST_SUM: Final = 40960
STEP_SHIFT: Final = 12
# Phases of a cycle.
FAST_LIST: Final = 0
MEDIUM_LIST: Final = 1
ALL_VARIABLES: Final = 2
RETURN: Final = 3
# Bits of what is unread: BLUETOOTH, by which this link goes; and LABVIEW, which the error distribution asks.
NEW_FOR_COMPUTER: Final = 1
COMPUTERS_BITS: Final = 5
BYTE: Final = 0xFF
# How a word that the computer writes is to be read.
NOT_ITS_OWN: Final = 0
SINGLE: Final = 1
SIGNED: Final = 2
UNSIGNED: Final = 3

KINDS = {"f32": SINGLE, "i32": SIGNED, "u32": UNSIGNED}


@cython.cclass
class DataLink:
    """Both directions. `report(code)` receives the errors; `checked`: only parameters can be written, each
    within its limits (ROBOT PARITY: the real robot takes any value for any variable).

    Its 45 fields are two rings, three lists and the counters of both directions, each a number of the firmware's.

    Counters: points, segments, steps, packets (good ones), bad_packets (bytes skipped), refused (writes to a variable
    that is not a parameter, or beyond its limits), ring_full (bytes lost because they arrived faster than they were
    parsed).
    """

    chip: "Microcontroller"
    uart: HsUart
    store: "DataStore"
    report: object
    checked: cython.bint
    dma_was_off: cython.bint
    restart_source: "InterruptSource"
    code_full: cython.longlong
    code_buffer_full: cython.longlong
    code_dma_off: cython.longlong
    code_checksum: cython.longlong
    code_no_parameter: cython.longlong
    code_limit: cython.longlong
    code_id_out_of_range: cython.longlong
    last_id: cython.longlong
    first_channel: cython.longlong
    kinds: cython.longlong[::1]
    fast: cython.longlong[::1]
    medium: cython.longlong[::1]
    ring: cython.longlong[::1]
    least: cython.double[::1]
    most: cython.double[::1]
    segments: cython.uchar[::1]
    filling: cython.longlong
    sending: cython.longlong
    used: cython.longlong
    in_segment: cython.longlong
    checksum: cython.longlong
    fast_count: cython.longlong
    medium_count: cython.longlong
    phase: cython.longlong
    fast_place: cython.longlong
    medium_place: cython.longlong
    slow_id: cython.longlong
    rate_sum: cython.longlong
    calls_to_wait: cython.longlong
    points: cython.longlong
    segments_sent: cython.longlong
    steps: cython.longlong
    ring_write: cython.longlong
    ring_read: cython.longlong
    packets: cython.longlong
    bad_packets: cython.longlong
    refused: cython.longlong
    ring_full: cython.longlong

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
        self.code_limit = errors.MB_PARAMETER_LIMIT
        self.code_id_out_of_range = errors.MB_IO_ID_OOR
        self.last_id = all_variables.ID_OF_LAST
        # how the word of what the computer may write is read, and between which numbers it has to be
        self.kinds = array.array("q", [0]) * all_variables.TABLE_SIZE
        self.least = array.array("d", [0.0]) * all_variables.TABLE_SIZE
        self.most = array.array("d", [0.0]) * all_variables.TABLE_SIZE
        for number, (least, most) in all_variables.WRITABLE.items():
            self.kinds[number] = KINDS[all_variables.TYPES[number]]
            self.least[number], self.most[number] = least, most
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
        self.phase = FAST_LIST
        self.fast_place = 0
        self.medium_place = 0
        self.slow_id = 0
        self.rate_sum = 0
        self.calls_to_wait = 0
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

    @cython.ccall
    def build_lists(self) -> None:
        """Row task: what the 48 channels ask for. Identifiers beyond the table are reported and left out."""
        i: cython.longlong
        wanted: cython.longlong
        number: cython.longlong
        value: cython.double
        self.fast_count = 0
        self.medium_count = 0
        for i in range(CHANNELS):
            value = self.store.get_float(self.first_channel + i)
            if not MEDIUM <= value < 2 * FAST:
                continue  # neither list, or no number at all
            wanted = cython.cast(cython.longlong, value) if cython.compiled else int(value)
            number = wanted & IDENTIFIER
            if number > self.last_id:
                self.report(self.code_id_out_of_range)
                continue
            if wanted & MEDIUM:
                self.medium[self.medium_count] = number
                self.medium_count += 1
            if wanted & FAST:
                self.fast[self.fast_count] = number
                self.fast_count += 1

    @cython.ccall
    def allowed_steps(self) -> cython.longlong:
        """The rate controller: steps of this call, 0 ... 10; with a sum not above 0 one, and then calls without."""
        self.rate_sum += MOST_FULL - self.used - HALF_FULL
        if self.rate_sum > LARGEST_SUM:
            self.rate_sum = LARGEST_SUM
        elif self.rate_sum < -LARGEST_SUM:
            self.rate_sum = -LARGEST_SUM
        if self.rate_sum > 0:
            return self.rate_sum >> STEP_SHIFT
        if self.calls_to_wait > 0:
            self.calls_to_wait -= 1
            return 0
        self.calls_to_wait = -(self.rate_sum >> STEP_SHIFT)  # a shift rounds down: -1 is one call
        return 1

    @cython.ccall
    def send_data(self) -> object:
        """Slot task: as many steps as are allowed; returns how many were done. A full ring ends the call."""
        allowed: cython.longlong = self.allowed_steps()
        done: cython.longlong = 0
        while done < allowed and self.used < MOST_FULL:
            self._step()
            done += 1
        self.steps += done
        return done

    @cython.cfunc
    @cython.exceptval(check=True)
    def _step(self) -> cython.void:
        number: cython.longlong
        if self.phase == FAST_LIST:
            if self.fast_place < self.fast_count:
                number = self.fast[self.fast_place]
                self.fast_place += 1
                if self.store.unread[number] & NEW_FOR_COMPUTER:
                    self._put(number)
                return
            self.phase = MEDIUM_LIST
        if self.phase == MEDIUM_LIST:
            if self.medium_place < self.medium_count:
                number = self.medium[self.medium_place]
                self.medium_place += 1
                if self.store.unread[number] & NEW_FOR_COMPUTER:
                    self._put(number)
                    self.phase = ALL_VARIABLES
                return
            self.phase = ALL_VARIABLES
        if self.phase == ALL_VARIABLES:
            self.phase = RETURN
            self._put(self.slow_id)
            self.slow_id += 1
            if self.slow_id > self.last_id:
                self.slow_id = 0
        else:
            self.phase = FAST_LIST
            self.fast_place = 0
            if self.medium_place >= self.medium_count:
                self.medium_place = 0

    @cython.cfunc
    def _put(self, number: cython.longlong) -> None:
        """One point into the segment being filled; the computer has now read that variable."""
        at: cython.longlong = self.filling * SEGMENT_BYTES + self.in_segment * POINT_BYTES
        self._byte(at, number >> 8)
        self._byte(at + 1, number & BYTE)
        self._word(at + 2, self.store.words[number])
        self._word(at + 6, self.store.stamps[number])
        self.store.unread[number] &= ~COMPUTERS_BITS
        self.points += 1
        self.in_segment += 1
        if self.in_segment == POINTS_PER_SEGMENT:
            at = self.filling * SEGMENT_BYTES + SEGMENT_SUM
            self.segments[at] = self.checksum >> 8 & BYTE
            self.segments[at + 1] = self.checksum & BYTE
            self.in_segment = 0
            self.checksum = 1
            self.filling = (self.filling + 1) % RING_SEGMENTS
            self.used += 1
            if not self.uart.busy:
                self.chip.request(self.restart_source)

    @cython.cfunc
    def _byte(self, at: cython.longlong, byte: cython.longlong) -> None:
        self.segments[at] = byte
        self.checksum += byte

    @cython.cfunc
    def _word(self, at: cython.longlong, word: cython.longlong) -> None:
        self._byte(at, word >> 24 & BYTE)
        self._byte(at + 1, word >> 16 & BYTE)
        self._byte(at + 2, word >> 8 & BYTE)
        self._byte(at + 3, word & BYTE)

    def on_restart(self, queue: EventQueue) -> None:
        """Software interrupt: the ring was empty and has a segment again."""
        if not self.uart.busy:
            self._start()

    def on_sent(self, queue: EventQueue) -> None:
        """DMA channel 3 is through with a segment: its place is free, the next one goes."""
        self.sending = (self.sending + 1) % RING_SEGMENTS
        self.used -= 1
        self.segments_sent += 1
        self._start()

    @cython.cfunc
    def _start(self) -> None:
        at: cython.longlong = self.sending * SEGMENT_BYTES
        if self.used > 0:
            self.uart.transmit(bytes(self.segments[at : at + SEGMENT_BYTES]))

    # --- from the computer ------------------------------------------------------------------------------

    @cython.ccall
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
            following = (self.ring_write + 1) % RECEIVE_RING
            if following == self.ring_read:
                self.ring_full += count - i
                self.report(self.code_full)
                return i
            self.ring[self.ring_write] = uart.taken(i)
            self.ring_write = following
        return count

    @cython.ccall
    def waiting(self) -> cython.longlong:
        """Bytes in the ring."""
        return (self.ring_write - self.ring_read) % RECEIVE_RING

    @cython.ccall
    def parse(self) -> object:
        """Row task: every whole packet in the ring; returns how many places it looked at."""
        tested: cython.longlong = 0
        total: cython.longlong
        i: cython.longlong
        read: cython.longlong = self.ring_read
        left: cython.longlong = self.waiting()
        while left >= PACKET_BYTES:
            tested += 1
            total = 1
            for i in range(PACKET_SUM):
                total += self.ring[(read + i) % RECEIVE_RING]
            if total != self.ring[(read + 6) % RECEIVE_RING] << 8 | self.ring[(read + 7) % RECEIVE_RING]:
                self.bad_packets += 1
                self.report(self.code_checksum)
                read = (read + 1) % RECEIVE_RING
                left -= 1
                continue
            self._write(
                self.ring[read] << 8 | self.ring[(read + 1) % RECEIVE_RING],
                self.ring[(read + 2) % RECEIVE_RING] << 24
                | self.ring[(read + 3) % RECEIVE_RING] << 16
                | self.ring[(read + 4) % RECEIVE_RING] << 8
                | self.ring[(read + 5) % RECEIVE_RING],
            )
            read = (read + PACKET_BYTES) % RECEIVE_RING
            left -= PACKET_BYTES
        self.ring_read = read
        return tested

    @cython.cfunc
    @cython.exceptval(check=True)
    def _write(self, number: cython.longlong, word: cython.longlong) -> cython.void:
        """A good packet: the value into the table, if the computer may set it."""
        self.packets += 1
        if self.checked:
            if number > self.last_id or self.kinds[number] == NOT_ITS_OWN:
                self.refused += 1
                self.report(self.code_no_parameter)
                return
            if not self.least[number] <= self._number(number, word) <= self.most[number]:  # neither is what is none
                self.refused += 1
                self.report(self.code_limit)
                return
        self.store.set_word(number, word, self.store.stamps[0])

    @cython.cfunc
    @cython.exceptval(check=False)
    def _number(self, number: cython.longlong, word: cython.longlong) -> cython.double:
        """The value of a word in the variable `number`."""
        if self.kinds[number] == SINGLE:
            return float_of_word(word)
        return wrap_i32(word) if self.kinds[number] == SIGNED else word
