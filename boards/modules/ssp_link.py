# cython: boundscheck=False, wraparound=False, cdivision=True
# (what is divided is never below 0; every index below is a half-word 0 ... 30 of a segment, a segment of a circle,
# wrapped where it is moved, or a frame of those that the receiving end's segments can hold)
"""The serial link between the router and the main brain: both ends, as logic on segments.

A segment is 31 half-words: up to six frames of five half-words, zeros, and a checksum. The router is the
master and starts an exchange every 200 us; 496 bits at 3.0 Mbit/s take 165.3 us, full duplex. A frame is
(header, value high, value low, time high, time low); a header has the identifier in bits 0-10, ones in
bits 11-14, and the remote bit in 15. The checksum is (1 + sum of the other 30) modulo 65536. Source: facts
network-and-boards 1.6.

Frames are packed straight into the segment that will carry them, whose checksum grows with them, and are unpacked
straight out of the one that comes in; what is judged later (a checksum, an identifier) is judged on that.

Empty segments are one shared object per end and the others come round in a circle, so nobody may write to a
segment that was handed over: a fault makes its own with `corrupted_copy`.
"""

import cython

from datatable.generated import errors
from firmware_sim.peripherals.ssp import SspSegment

SEGMENT_HALF_WORDS = 31
FRAME_HALF_WORDS = 5
FRAMES_PER_SEGMENT = 6
HEADER_ONES = 0x7800  # bits 11-14 of every header
SEGMENT_PERIOD_NS = 200_000  # Timer1 of the router, match 11 999 at 60 MHz
EXCHANGE_NS = 165_333  # 496 bits at 3.0 Mbit/s
ROUTER_RING_HALF_WORDS = 500  # one stays free: 99 frames
ROUTER_SEGMENTS = 24  # 17 hold the ring; one in an exchange, one being delivered, and some for consumers a little late
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
    restart(segment)
    return segment


def restart(segment: SspSegment) -> cython.void:
    """Make it a valid segment without frames again."""
    segment.words = [0] * 31
    segment.words[30] = 1
    segment.used = 0


def add_frame(
    segment: SspSegment, header: cython.longlong, word0: cython.longlong, word1: cython.longlong
) -> cython.longlong:
    """Append a frame to a segment with room for five half-words, checksum included; returns how many are used."""
    used: cython.longlong = segment.used
    value_high: cython.longlong = (word0 >> 16) & 0xFFFF
    value_low: cython.longlong = word0 & 0xFFFF
    time_high: cython.longlong = (word1 >> 16) & 0xFFFF
    time_low: cython.longlong = word1 & 0xFFFF
    segment.words[used] = header
    segment.words[used + 1] = value_high
    segment.words[used + 2] = value_low
    segment.words[used + 3] = time_high
    segment.words[used + 4] = time_low
    segment.words[30] = (segment.words[30] + header + value_high + value_low + time_high + time_low) & 0xFFFF
    segment.used = used + 5
    return used + 5


def corrupted_copy(segment: SspSegment, index: cython.longlong, flipped_bits: cython.longlong) -> SspSegment:
    """A copy of `segment` with bits of half-word `index` (0-30) flipped: a disturbance on the wires."""
    copy: SspSegment = SspSegment()
    copy.copy_from(segment)
    copy.words[index] ^= flipped_bits & 0xFFFF
    if index < 30 and index >= copy.used:
        copy.used = index + 1
    return copy


class UnpackedFrames:
    """Frames as they come out of segments, 96 places: `rows` of identifier, first and second word."""

    def __init__(self) -> None:
        self.rows = [0] * 288

    def unpack(self, segment: SspSegment, place: cython.longlong) -> cython.longlong:
        """Put the frames of `segment` from `place` on; returns how many, -1 with a wrong checksum.

        A half-word whose top five bits are not 01111 where a header should be ends the frames.
        """
        used: cython.longlong = min(segment.used, 30)
        total: cython.longlong = 1
        frames: cython.longlong = 0
        row: cython.longlong = 3 * place
        i: cython.longlong = 0
        header: cython.longlong
        value_high: cython.longlong
        value_low: cython.longlong
        time_high: cython.longlong
        time_low: cython.longlong
        while i < used and i <= 25:
            header = segment.words[i]
            if header >> 11 != 0x0F:
                break
            value_high = segment.words[i + 1]
            value_low = segment.words[i + 2]
            time_high = segment.words[i + 3]
            time_low = segment.words[i + 4]
            total += header + value_high + value_low + time_high + time_low
            self.rows[row] = header & 0x7FF
            self.rows[row + 1] = value_high << 16 | value_low
            self.rows[row + 2] = time_high << 16 | time_low
            row += 3
            frames += 1
            i += 5
        while i < used:
            total += segment.words[i]
            i += 1
        return frames if total & 0xFFFF == segment.words[30] else -1

    def move(self, place: cython.longlong, to: cython.longlong) -> cython.void:
        """Copy the frame of one place to another."""
        i: cython.longlong
        for i in range(3):
            self.rows[3 * to + i] = self.rows[3 * place + i]


class MainBrainSspLink:
    """The slave's end: 16 segments each way, parsed and filled once per slot of the main brain.

    `report(code)` is called for every error; `last_id` is the highest identifier the data table has.
    After `parse()` the first `frames` rows of `unpacked` are what came in, until the next segment does.
    """

    def __init__(self, report, last_id, first_is_junk=True) -> None:
        self.report = report
        self.last_id = last_id
        # the receive DMA is armed in the middle of nowhere, so the first segment comes shifted (facts 1.6)
        self.first_is_junk = first_is_junk
        self.unpacked = UnpackedFrames()
        self.frames = 0
        self.received_count = 0  # segments and frames that wait for `parse`, and what it will report
        self.received_frames = 0
        self.received_errors = []
        # 16 queued, one being exchanged, one being packed
        self.queue = [empty_segment() for _ in range(18)]
        self.empty = empty_segment()
        self.packing = None
        self.queue_read = 0
        self.queue_count = 0
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
        """Keep what a received segment brings, as the receive DMA does in one of 16 places; False when it is lost.

        With all places full the segment is dropped and MB_SSP_RX_FULL reported (dropping the newest is
        chosen by us, because the facts name only the error). A wrong checksum drops the segment, an identifier
        above `last_id` its frame; `parse` reports them.
        """
        frames: cython.longlong
        place: cython.longlong = self.received_frames
        i: cython.longlong
        if self.received_count == 16:
            return self._miss()
        if self.segments_received == 0 and self.first_is_junk:
            segment = self.shifted(segment)
        self.received_count += 1
        self.segments_received += 1
        if segment.used == 0 and segment.words[30] == 1:
            return True
        frames = self.unpacked.unpack(segment, place)
        if frames < 0:
            self._note(self.code_checksum)
        for i in range(place, place + frames):
            if self.unpacked.rows[3 * i] > self.last_id:
                self._note(self.code_id_out_of_range)
                continue
            if place < i:
                self.unpacked.move(i, place)
            place += 1
        self.received_frames = place
        return True

    def _miss(self) -> cython.bint:
        """A segment finds no place: False."""
        self.receive_full += 1
        self.report(self.code_receive_full)
        return False

    def _note(self, code: cython.longlong) -> None:
        """Keep an error until `parse` reports it."""
        self.received_errors.append(code)

    @property
    def ids(self):
        """Identifiers of the unpacked frames, by place."""
        return list(self.unpacked.rows)[0::3]

    @property
    def words0(self):
        """Their first words."""
        return list(self.unpacked.rows)[1::3]

    @property
    def words1(self):
        """Their second words."""
        return list(self.unpacked.rows)[2::3]

    def shifted(self, segment: SspSegment) -> SspSegment:
        """A copy of `segment` as it looks from its second half-word on."""
        copy: SspSegment = SspSegment()
        i: cython.longlong
        for i in range(30):
            copy.words[i] = segment.words[i + 1]
        copy.used = 30
        return copy

    def next_segment(self) -> SspSegment:
        """The oldest queued segment, or the empty one: what the transmit DMA is started on."""
        segment: SspSegment
        self.segments_sent += 1
        if self.queue_count == 0:
            return self.empty
        segment = cython.cast(SspSegment, self.queue[self.queue_read])
        self.queue_read += 1
        if self.queue_read == 18:
            self.queue_read = 0
        self.queue_count -= 1
        return segment

    def parse(self) -> cython.longlong:
        """Hand over the frames of every waiting segment, and report the errors; returns how many segments were read.

        A wrong checksum drops the segment (MB_SSP_CHKSUM). A half-word whose top five bits are not 01111
        where a header should be ends the segment. An identifier above `last_id` drops its frame
        (MB_SSP_ID_OOR).
        """
        segments: cython.longlong = self.received_count
        if self.received_errors:
            for code in self.received_errors:
                if code == self.code_checksum:
                    self.checksum_errors += 1
                else:
                    self.ids_out_of_range += 1
                self.report(code)
            self.received_errors = []
        self.frames = self.received_frames
        self.frames_received += self.received_frames
        self.received_count = 0
        self.received_frames = 0
        return segments

    def send(self, identifier: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """Pack one frame; False (and MB_SSP_TX_FULL) when all 16 segments are queued.

        Call `flush` after the last frame of a slot.
        """
        if self.packing is None and not self._begin_segment():
            return False
        self.frames_sent += 1
        if add_frame(self.packing, (identifier & 0x7FF) | 0x7800, word0, word1) == 30:
            self.flush()
        return True

    def _begin_segment(self) -> cython.bint:
        """Let an empty segment be the one that is packed; False when all are queued."""
        if self.queue_count >= 16:
            self.transmit_full += 1
            self.report(self.code_transmit_full)
            return False
        self.packing = cython.cast(SspSegment, self.queue[(self.queue_read + self.queue_count) % 18])
        restart(self.packing)
        return True

    def flush(self) -> cython.longlong:
        """Queue the segment being packed, padded with zeros; return how many segments are queued."""
        if self.packing is not None:
            self.packing = None
            self.queue_count += 1
        return self.queue_count


class RouterSspLink:
    """The master's end: a transmit ring of 500 half-words and 8 received segments.

    The ring is a circle of segments: half-words go into the last of them, a segment is taken whole from the other end.

    `frames_may_straddle`: the firmware moves half-words, so a frame that is only partly in the ring when a
    segment is filled is cut, and with a ring that never runs empty nothing re-aligns the frames that
    follow (a quirk of the facts, 1.6); without it only whole frames enter a segment.

    ROBOT PARITY: a segment is filled at its start; the robot fills its FIFO of eight half-words during
    the exchange, so a frame queued in the first microseconds after the tick goes out 200 us later here.
    """

    def __init__(self, report, frames_may_straddle=False) -> None:
        self.report = report
        self.frames_may_straddle = frames_may_straddle
        self.segments = [empty_segment() for _ in range(ROUTER_SEGMENTS)]
        self.first = 0  # the segment that goes next
        self.last = 0  # the segment being packed, which is also
        self.packing = self.segments[0]
        self.half_words = 0  # in all of them
        self.push_time = -1_000_000
        # six instructions per half-word pushed, about 12 cycles: chosen by us, because no listing says
        self.push_step_ns = 200
        self.empty = empty_segment()
        # what came in, by place: six frames, and how many there are (-1: the checksum is wrong)
        self.unpacked = UnpackedFrames()
        self.received_frames = [0] * 8
        self.received_write = 0
        self.received_read = 0
        self.position = 0
        self.exchange_running = False
        self.exchange_done = False
        self.rx_id = 0
        self.rx_flags = 8  # every frame becomes one of eight bytes
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
        return self.half_words

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
        header: cython.longlong = (identifier & 0x7FF) | 0x7800
        if self.half_words > 494:
            return self._lose()
        if flags & 16:  # FLAG_REMOTE
            header |= 0x8000
        self.half_words += 5
        self.push_time = now
        if self.packing.used > 25:
            if self.packing.used < 30:  # a frame was cut before: this one straddles two segments
                return self._put_over_the_end(header, word0, word1)
            self._begin_segment()
        add_frame(self.packing, header, word0, word1)
        return True

    def _lose(self) -> cython.bint:
        """A frame finds no room: False."""
        self.transmit_lost += 1
        self.report(self.code_transmit_full)
        return False

    def _put_over_the_end(self, header: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """Append a frame of which only a part fits into the segment being packed: True."""
        for word in (header, word0 >> 16, word0, word1 >> 16, word1):
            self._put(word & 0xFFFF)
        return True

    def _begin_segment(self) -> cython.void:
        """Let the segment after the last be the one that is packed."""
        self.last += 1
        if self.last == 24:
            self.last = 0
        self.packing = cython.cast(SspSegment, self.segments[self.last])
        restart(self.packing)

    def _put(self, word: cython.longlong) -> cython.void:
        """Append one half-word, without the checksum of frames."""
        if self.packing.used == 30:
            self._begin_segment()
        self.packing.words[self.packing.used] = word
        self.packing.used += 1
        self.packing.words[30] = (self.packing.words[30] + word) & 0xFFFF

    def next_segment(self, now: cython.longlong) -> SspSegment:
        """The segment that is exchanged from instant `now` (ns) on.

        Of a frame being pushed at that moment only the half-words already written are seen.
        """
        take: cython.longlong
        segment: SspSegment
        self.segments_sent += 1
        if self.half_words == 0:
            return self.empty
        segment = cython.cast(SspSegment, self.segments[self.first])
        if now - self.push_time < 5 * self.push_step_ns:
            take = self.half_words - 5
            if now > self.push_time:
                take += (now - self.push_time) // self.push_step_ns
            if not self.frames_may_straddle:
                take -= take % 5
            if take <= 0:
                return self.empty
            if take < segment.used:
                self._cut(segment, take)
        if self.first == self.last:
            self._begin_segment()
        self.first += 1
        if self.first == 24:
            self.first = 0
        self.half_words -= segment.used
        self.frames_sent += segment.used // 5
        return segment

    def _cut(self, segment: SspSegment, used: cython.longlong) -> cython.void:
        """Leave `used` half-words in the first segment; the others, of the newest frame, go to the head of the last."""
        moved: cython.longlong = segment.used - used
        i: cython.longlong
        if self.first == self.last:
            self._begin_segment()
        for i in range(self.packing.used - 1, -1, -1):
            self.packing.words[i + moved] = self.packing.words[i]
        for i in range(moved):
            self.packing.words[i] = segment.words[used + i]
        finish(self.packing, self.packing.used + moved)
        finish(segment, used)

    def tick(self, now: cython.longlong) -> SspSegment:
        """The 200 us interrupt: judge the exchange that should be over, return the next segment.

        An exchange that did not bring 31 half-words is SSP_LOW_RATE. With all places full the newest
        segment is overwritten by the next (SSP_RX_BUF_OF).
        """
        following: cython.longlong
        if self.exchange_running:
            following = (self.received_write + 1) & 7
            if not self.exchange_done or following == self.received_read:
                self._miss_segment()
            else:
                self.received_write = following
        self.exchange_running = True
        self.exchange_done = False
        return self.next_segment(now)

    def _miss_segment(self) -> None:
        """The exchange brought no segment, or there is no place for it."""
        if not self.exchange_done:
            self.low_rate += 1
            self.report(self.code_low_rate)
        else:
            self.receive_overwritten += 1
            self.report(self.code_receive_overwritten)

    def receive(self, segment: SspSegment) -> cython.void:
        """The end of an exchange: the main brain's half-words lie in the current place."""
        frames: cython.longlong = 0
        # a segment that starts with zero is passed over without a look at its checksum, as the robot does
        if segment.used > 0 and segment.words[0] != 0:
            frames = self.unpacked.unpack(segment, self.received_write * 6)
        self.received_frames[self.received_write] = frames
        self.exchange_done = True
        self.segments_received += 1

    def _drop_segment(self) -> None:
        """The checksum of the segment that is read next is wrong."""
        self.checksum_errors += 1
        self.report(self.code_checksum)

    def has_segments(self) -> cython.bint:
        """True while a received segment waits to be read, empty or not."""
        return self.received_read != self.received_write

    def take(self) -> cython.bint:
        """Move the next received frame into rx_id, rx_flags, rx_word0, rx_word1; False if there is none.

        A wrong checksum drops the segment (SSP_BAD_CHKSM). The data length of a frame becomes 8.
        """
        frames: cython.longlong
        row: cython.longlong
        while self.received_read != self.received_write:
            frames = self.received_frames[self.received_read]
            if self.position < frames:
                row = 3 * (self.received_read * 6 + self.position)
                self.rx_id = self.unpacked.rows[row]
                self.rx_word0 = self.unpacked.rows[row + 1]
                self.rx_word1 = self.unpacked.rows[row + 2]
                self.position += 1
                self.frames_received += 1
                return True
            if frames < 0:
                self._drop_segment()
            self.position = 0
            self.received_read = (self.received_read + 1) & 7
        return False
