# cython: boundscheck=False, wraparound=False
# (every index below is a half-word 0 ... 30 of a segment, in a ring a place that is wrapped where it is moved, or a
# frame of the 96 that the 16 segments of the main brain can hold)
"""The serial link between the router and the main brain: both ends, as logic on segments.

A segment is 31 half-words: up to six frames of five half-words, zeros, and a checksum. The router is the
master and starts an exchange every 200 us; 496 bits at 3.0 Mbit/s take 165.3 us, full duplex. A frame is
(header, value high, value low, time high, time low); a header has the identifier in bits 0-10, ones in
bits 11-14, and the remote bit in 15. The checksum is (1 + sum of the other 30) modulo 65536. Source: facts
network-and-boards 1.6.

Empty segments are one shared object per end and queued ones come from a pool, so nobody may write to a
segment that was handed over: a fault makes its own with `corrupted_copy`.
"""

import cython

from datatable.generated import errors
from firmware_sim.peripherals.ssp import SspSegment
from foundation.numbers import integers

SEGMENT_HALF_WORDS = 31
FRAME_HALF_WORDS = 5
FRAMES_PER_SEGMENT = 6
HEADER_ONES = 0x7800  # bits 11-14 of every header
SEGMENT_PERIOD_NS = 200_000  # Timer1 of the router, match 11 999 at 60 MHz
EXCHANGE_NS = 165_333  # 496 bits at 3.0 Mbit/s
ROUTER_RING_HALF_WORDS = 500  # one stays free: 99 frames
ROUTER_RECEIVE_SEGMENTS = 8
MAIN_BRAIN_SEGMENTS = 16  # each way


def checksum(segment: SspSegment) -> cython.longlong:
    """(1 + sum of the first 30 half-words) modulo 65536; half-words from `used` on are zeros."""
    total: cython.longlong = 1
    i: cython.longlong
    for i in range(segment.used):
        total += segment.words[i]
    return total & 0xFFFF


def finish(segment: SspSegment, used: cython.longlong) -> cython.void:
    """Zero what an earlier use left behind `used` half-words, and write the checksum."""
    i: cython.longlong
    for i in range(used, segment.used):
        segment.words[i] = 0
    segment.used = used
    segment.words[30] = checksum(segment)


def empty_segment() -> SspSegment:
    """A valid segment without frames: 30 zeros and the checksum 1."""
    segment: SspSegment = SspSegment()
    finish(segment, 0)
    return segment


def corrupted_copy(segment: SspSegment, index: cython.longlong, flipped_bits: cython.longlong) -> SspSegment:
    """A copy of `segment` with bits of half-word `index` (0-30) flipped: a disturbance on the wires."""
    copy: SspSegment = SspSegment()
    i: cython.longlong
    for i in range(31):
        copy.words[i] = segment.words[i]
    copy.used = segment.used
    copy.words[index] ^= flipped_bits & 0xFFFF
    if index < 30 and index >= copy.used:
        copy.used = index + 1
    return copy


class MainBrainSspLink:
    """The slave's end: 16 segments each way, parsed and filled once per slot of the main brain.

    `report(code)` is called for every error; `last_id` is the highest identifier the data table has.
    After `parse()` the frames stand in `ids`, `words0`, `words1`, indices 0 ... `frames`-1.
    """

    def __init__(self, report, last_id, first_is_junk=True) -> None:
        self.report = report
        self.last_id = last_id
        # the receive DMA is armed in the middle of nowhere, so the first segment comes shifted (facts 1.6)
        self.first_is_junk = first_is_junk
        self.received_words = integers(16 * 31)
        self.received_used = integers(16)
        self.received_read = 0
        self.received_count = 0
        # 16 queued, one being exchanged, one being packed
        self.queue = [empty_segment() for _ in range(18)]
        self.empty = empty_segment()
        self.packing = None
        self.queue_read = 0
        self.queue_count = 0
        self.ids = integers(16 * 6)
        self.words0 = integers(16 * 6)
        self.words1 = integers(16 * 6)
        self.frames = 0
        self.segments_received = 0
        self.segments_sent = 0
        self.frames_received = 0
        self.frames_sent = 0
        self.checksum_errors = 0
        self.receive_full = 0
        self.transmit_full = 0
        self.ids_out_of_range = 0
        self.code_checksum = errors.MB_SSP_CHKSUM
        self.code_receive_full = errors.MB_SSP_RX_FULL
        self.code_transmit_full = errors.MB_SSP_TX_FULL
        self.code_id_out_of_range = errors.MB_SSP_ID_OOR

    def exchanged(self, segment: SspSegment) -> SspSegment:
        """Both slave-select edges: keep what came, return the segment to load for the next exchange."""
        self.receive(segment)
        return self.next_segment()

    def receive(self, segment: SspSegment) -> cython.bint:
        """Copy a received segment into the next of the 16 places, as the receive DMA does; False when it is lost.

        With all places full the segment is dropped and MB_SSP_RX_FULL reported (dropping the newest is
        chosen by us, because the facts name only the error).
        """
        slot: cython.longlong
        base: cython.longlong
        used: cython.longlong = segment.used
        i: cython.longlong
        if self.received_count == 16:
            self.receive_full += 1
            self.report(self.code_receive_full)
            return False
        slot = (self.received_read + self.received_count) & 15
        base = slot * 31
        for i in range(used):
            self.received_words[base + i] = segment.words[i]
        for i in range(used, self.received_used[slot]):
            self.received_words[base + i] = 0
        self.received_used[slot] = used
        self.received_words[base + 30] = segment.words[30]
        if self.segments_received == 0 and self.first_is_junk:
            for i in range(30):
                self.received_words[base + i] = self.received_words[base + i + 1]
            self.received_words[base + 30] = 0
            self.received_used[slot] = 30
        self.received_count += 1
        self.segments_received += 1
        return True

    def next_segment(self) -> SspSegment:
        """The oldest queued segment, or the empty one: what the transmit DMA is started on."""
        segment: SspSegment
        self.segments_sent += 1
        if self.queue_count == 0:
            return self.empty
        segment = self.queue[self.queue_read]
        self.queue_read += 1
        if self.queue_read == 18:
            self.queue_read = 0
        self.queue_count -= 1
        return segment

    def parse(self) -> cython.longlong:
        """Unpack every waiting segment; return how many segments were read.

        A wrong checksum drops the segment (MB_SSP_CHKSUM). A half-word whose top five bits are not 01111
        where a header should be ends the segment. An identifier above `last_id` drops its frame
        (MB_SSP_ID_OOR).
        """
        segments: cython.longlong = self.received_count
        n: cython.longlong = 0
        i: cython.longlong
        base: cython.longlong
        used: cython.longlong
        total: cython.longlong
        header: cython.longlong
        for _segment in range(segments):
            base = self.received_read * 31
            used = self.received_used[self.received_read]
            self.received_read = (self.received_read + 1) & 15
            self.received_count -= 1
            total = 1
            for i in range(used):
                total += self.received_words[base + i]
            if (total & 0xFFFF) != self.received_words[base + 30]:
                self.checksum_errors += 1
                self.report(self.code_checksum)
                continue
            i = 0
            while i < used and i <= 25:
                header = self.received_words[base + i]
                if (header >> 11) != 0x0F:
                    break
                header &= 0x7FF
                if header > self.last_id:
                    self.ids_out_of_range += 1
                    self.report(self.code_id_out_of_range)
                else:
                    self.ids[n] = header
                    self.words0[n] = (self.received_words[base + i + 1] << 16) | self.received_words[base + i + 2]
                    self.words1[n] = (self.received_words[base + i + 3] << 16) | self.received_words[base + i + 4]
                    n += 1
                i += 5
        self.frames = n
        self.frames_received += n
        return segments

    def send(self, identifier: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """Pack one frame; False (and MB_SSP_TX_FULL) when all 16 segments are queued.

        Call `flush` after the last frame of a slot.
        """
        segment: SspSegment
        used: cython.longlong
        if self.packing is None:
            if self.queue_count >= 16:
                self.transmit_full += 1
                self.report(self.code_transmit_full)
                return False
            segment = self.queue[(self.queue_read + self.queue_count) % 18]
            finish(segment, 0)
            self.packing = segment
        else:
            segment = self.packing
        used = segment.used
        segment.words[used] = (identifier & 0x7FF) | 0x7800
        segment.words[used + 1] = (word0 >> 16) & 0xFFFF
        segment.words[used + 2] = word0 & 0xFFFF
        segment.words[used + 3] = (word1 >> 16) & 0xFFFF
        segment.words[used + 4] = word1 & 0xFFFF
        segment.used = used + 5
        self.frames_sent += 1
        if used + 5 == 30:
            self.flush()
        return True

    def flush(self) -> cython.longlong:
        """Queue the segment being packed, padded with zeros; return how many segments are queued."""
        segment: SspSegment
        if self.packing is not None:
            segment = self.packing
            segment.words[30] = checksum(segment)
            self.packing = None
            self.queue_count += 1
        return self.queue_count


class RouterSspLink:
    """The master's end: a transmit ring of 500 half-words and 8 received segments.

    `frames_may_straddle`: the firmware moves half-words, so a frame that is only partly in the ring when a
    segment is filled is cut, and with a ring that never runs empty nothing re-aligns the frames that
    follow (a quirk of the facts, 1.6); without it only whole frames enter a segment.

    ROBOT PARITY: a segment is filled at its start; the robot fills its FIFO of eight half-words during
    the exchange, so a frame queued in the first microseconds after the tick goes out 200 us later here.
    """

    def __init__(self, report, frames_may_straddle=False) -> None:
        self.report = report
        self.frames_may_straddle = frames_may_straddle
        self.ring = integers(500)
        self.ring_write = 0
        self.ring_read = 0
        self.push_time = -1_000_000
        # six instructions per half-word pushed, about 12 cycles: chosen by us, because no listing says
        self.push_step_ns = 200
        # one being exchanged, one being delivered, two to spare for consumers a little late
        self.pool = [empty_segment() for _ in range(4)]
        self.empty = empty_segment()
        self.pool_next = 0
        self.received_words = integers(8 * 31)
        self.received_used = integers(8)
        self.received_write = 0
        self.received_read = 0
        self.position = 0
        self.exchange_running = False
        self.exchange_done = False
        self.frame_waiting = False
        self.rx_id = 0
        self.rx_flags = 0
        self.rx_word0 = 0
        self.rx_word1 = 0
        self.segments_sent = 0
        self.segments_received = 0
        self.frames_sent = 0
        self.frames_received = 0
        self.checksum_errors = 0
        self.receive_overwritten = 0
        self.transmit_lost = 0
        self.low_rate = 0
        self.code_receive_overwritten = errors.SSP_RX_BUF_OF
        self.code_low_rate = errors.SSP_LOW_RATE
        self.code_checksum = errors.SSP_BAD_CHKSM
        self.code_transmit_full = errors.SSP_TX_BUF_OF

    def half_words_waiting(self) -> cython.longlong:
        """Half-words in the transmit ring."""
        waiting: cython.longlong = self.ring_write - self.ring_read
        return waiting if waiting >= 0 else waiting + 500

    def push(
        self,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
        now: cython.longlong,
    ) -> cython.bint:
        """Put a frame into the transmit ring; a full ring drops it whole (SSP_TX_BUF_OF), False.

        `flags` as in foundation.events; `now` is the instant in ns at which the pushing begins.
        """
        write: cython.longlong = self.ring_write
        header: cython.longlong = (identifier & 0x7FF) | 0x7800
        waiting: cython.longlong = write - self.ring_read
        if waiting < 0:
            waiting += 500
        if waiting > 494:
            self.transmit_lost += 1
            self.report(self.code_transmit_full)
            return False
        if flags & 16:  # FLAG_REMOTE
            header |= 0x8000
        self.ring[write] = header
        self.ring[write + 1] = (word0 >> 16) & 0xFFFF
        self.ring[write + 2] = word0 & 0xFFFF
        self.ring[write + 3] = (word1 >> 16) & 0xFFFF
        self.ring[write + 4] = word1 & 0xFFFF
        write += 5
        self.ring_write = write if write < 500 else 0  # 500 are 100 frames: none is split by the end of the ring
        self.push_time = now
        return True

    def next_segment(self, now: cython.longlong) -> SspSegment:
        """Fill a segment from the ring at instant `now` (ns).

        Of a frame being pushed at that moment only the half-words already written are seen.
        """
        take: cython.longlong
        word: cython.longlong
        total: cython.longlong = 1
        i: cython.longlong
        read: cython.longlong = self.ring_read
        segment: SspSegment
        self.segments_sent += 1
        if read == self.ring_write:
            return self.empty
        take = self.half_words_waiting()
        if now - self.push_time < 5 * self.push_step_ns:
            take -= 5
            if now > self.push_time:
                take += (now - self.push_time) // self.push_step_ns
            if take < 0:
                take = 0
        if take > 30:
            take = 30
        if not self.frames_may_straddle:
            take = take - take % 5
        if take == 0:
            return self.empty
        segment = self.pool[self.pool_next]
        self.pool_next = (self.pool_next + 1) & 3
        for i in range(take):
            word = self.ring[read]
            segment.words[i] = word
            total += word
            read += 1
            if read == 500:
                read = 0
        for i in range(take, segment.used):
            segment.words[i] = 0  # what an earlier use left behind
        segment.used = take
        segment.words[30] = total & 0xFFFF  # the checksum
        self.ring_read = read
        self.frames_sent += take // 5
        return segment

    def tick(self, now: cython.longlong) -> SspSegment:
        """The 200 us interrupt: judge the exchange that should be over, return the next segment.

        An exchange that did not bring 31 half-words is SSP_LOW_RATE. With all places full the newest
        segment is overwritten by the next (SSP_RX_BUF_OF).
        """
        following: cython.longlong
        if self.exchange_running:
            if not self.exchange_done:
                self.low_rate += 1
                self.report(self.code_low_rate)
            else:
                following = (self.received_write + 1) & 7
                if following == self.received_read:
                    self.receive_overwritten += 1
                    self.report(self.code_receive_overwritten)
                else:
                    self.received_write = following
        self.exchange_running = True
        self.exchange_done = False
        return self.next_segment(now)

    def receive(self, segment: SspSegment) -> cython.void:
        """The end of an exchange: the main brain's half-words lie in the current place."""
        base: cython.longlong = self.received_write * 31
        i: cython.longlong
        for i in range(segment.used):
            self.received_words[base + i] = segment.words[i]
        for i in range(segment.used, self.received_used[self.received_write]):
            self.received_words[base + i] = 0
        self.received_words[base + 30] = segment.words[30]
        self.received_used[self.received_write] = segment.used
        self.exchange_done = True
        self.segments_received += 1

    def has_segments(self) -> cython.bint:
        """True while a received segment waits to be read, empty or not."""
        return self.received_read != self.received_write

    def take(self) -> cython.bint:
        """Move the next received frame into rx_id, rx_flags, rx_word0, rx_word1; False if there is none.

        A segment that starts with zero is passed over without a look at its checksum, as the robot does;
        a wrong checksum drops the segment (SSP_BAD_CHKSM). The data length of a frame becomes 8.
        """
        base: cython.longlong
        used: cython.longlong
        total: cython.longlong
        header: cython.longlong
        i: cython.longlong
        while self.received_read != self.received_write:
            base = self.received_read * 31
            used = self.received_used[self.received_read]
            if self.position == 0 and used > 0 and self.received_words[base] != 0:
                total = 1
                for i in range(used):
                    total += self.received_words[base + i]
                if (total & 0xFFFF) != self.received_words[base + 30]:
                    self.checksum_errors += 1
                    self.report(self.code_checksum)
                    self.received_read = (self.received_read + 1) & 7
                    continue
            i = self.position
            if i < used and i <= 25:
                header = self.received_words[base + i]
                if (header >> 11) == 0x0F:
                    self.rx_id = header & 0x7FF
                    self.rx_flags = 8
                    self.rx_word0 = (self.received_words[base + i + 1] << 16) | self.received_words[base + i + 2]
                    self.rx_word1 = (self.received_words[base + i + 3] << 16) | self.received_words[base + i + 4]
                    self.position = i + 5
                    self.frames_received += 1
                    return True
            self.position = 0
            self.received_read = (self.received_read + 1) & 7
        return False
