# cython: boundscheck=False, wraparound=False, cdivision=True
# (dividends are never below 0; every index below is a row of a segment or a segment of a circle, wrapped where it is
# moved)
"""The serial link between the router and the main brain: both ends, as logic on segments.

A segment is 31 half-words: up to six frames of five half-words, zeros, and a checksum. The router is the
master and starts an exchange every 200 us; 496 bits at 3.0 Mbit/s take 165.3 us, full duplex. A frame is
(header, value high, value low, time high, time low); a header has the identifier in bits 0-10, ones in
bits 11-14, and the remote bit in 15. The checksum is (1 + sum of the other 30) modulo 65536. Source:
robot.md N1.6.

Frames are put straight into the segment that will carry them, and are taken straight out of the received one.

Empty segments are one shared object per end and the others come round in a circle, so a segment that was handed over
must not be written to: a fault makes its own with `corrupted_copy`. A circle is long enough for all that its end can
queue and for all that the other end can let wait.
"""

from typing import Final

import cython

from ranger_sim.datatable.generated import errors
from ranger_sim.firmware_sim.peripherals.can_controller import EIGHT_BYTES
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.foundation.events import FLAG_REMOTE

SEGMENT_HALF_WORDS: Final = 31
CHECKSUM: Final = 30  # its place: the half-words before it are frames and zeros
FRAME_HALF_WORDS: Final = 5
FRAME_ROW: Final = 3  # numbers of a frame in `SspSegment.rows`: header and two words
SEGMENT_ROWS: Final = 18  # of six frames
HEADER_ONES: Final = 0x7800  # bits 11-14 of every header
HEADER_REMOTE: Final = 0x8000
HEADER_SHIFT: Final = 11
HEADER_MARK: Final = 0x0F  # the bits above the identifier of a data frame
IDENTIFIER: Final = 0x7FF
HALF_WORD: Final = 0xFFFF
MOST_BEFORE_A_FRAME: Final = 494  # half-words in the ring of 500: with more a frame does not fit, as one stays free
ROUTER_RECEIVE_SEGMENTS: Final = 8
RECEIVE_MASK: Final = 7
MAIN_BRAIN_SEGMENTS: Final = 16  # each way
# 17 hold the ring; one in an exchange, one being delivered; and the 16 that wait at the main brain
ROUTER_CIRCLE: Final = 35
# 16 queued, one being packed; one in an exchange, one being delivered; and the 8 that wait at the router
MAIN_BRAIN_CIRCLE: Final = 27
EXCHANGE_NS = 165_333  # 496 bits at 3.0 Mbit/s


@cython.ccall
def checksum(segment: SspSegment) -> cython.longlong:
    """(1 + sum of the first 30 half-words) modulo 65536; half-words from `used` on are zeros."""
    return (1 + sum(segment.words[: segment.used])) & HALF_WORD


@cython.ccall
def finish(segment: SspSegment, used: cython.longlong) -> None:
    """Zero everything behind `used` half-words; the checksum is right."""
    segment.words = [*segment.words[:used], *[0] * (SEGMENT_HALF_WORDS - used)]
    segment.used = used
    segment.checksum_error = 0


@cython.ccall
def empty_segment() -> SspSegment:
    """A valid segment without frames: 30 zeros and the checksum 1."""
    return SspSegment()


@cython.ccall
@cython.exceptval(check=False)
def add_frame(
    segment: SspSegment, header: cython.longlong, word0: cython.longlong, word1: cython.longlong
) -> cython.longlong:
    """Append a frame to a segment that holds less than six, and nothing else; returns how many half-words are used."""
    used: cython.longlong = segment.used + FRAME_HALF_WORDS
    row: cython.longlong = FRAME_ROW * used // FRAME_HALF_WORDS
    segment.rows[row - 3] = header
    segment.rows[row - 2] = word0
    segment.rows[row - 1] = word1
    segment.used = used
    return used


@cython.ccall
@cython.exceptval(check=False)
def frames_in(segment: SspSegment) -> cython.longlong:
    """How many rows of a segment are frames; -1 with a wrong checksum.

    A half-word whose top five bits are not 01111 where a header should be ends the frames.
    """
    row: cython.longlong = 0
    if segment.checksum_error != 0:
        return -1
    while row < SEGMENT_ROWS and segment.rows[row] >> HEADER_SHIFT == HEADER_MARK:
        row += FRAME_ROW
    return row // FRAME_ROW


@cython.ccall
def corrupted_copy(segment: SspSegment, index: cython.longlong, flipped_bits: cython.longlong) -> SspSegment:
    """A copy of `segment` with bits of half-word `index` (0-30) flipped: a disturbance on the wires."""
    copy: SspSegment = SspSegment()
    half_words = segment.words
    half_words[index] ^= flipped_bits & HALF_WORD
    copy.words = half_words
    copy.used = index + 1 if segment.used <= index < CHECKSUM else segment.used
    return copy


@cython.final
@cython.cclass
class MainBrainSspLink:
    """The slave's end: 16 segments each way, parsed and filled once per slot of the main brain.

    `report(code)` is called for every error; `last_id` is the highest identifier the data table has.
    `parse()` leaves in `received` the first received `segments`, with `received_frames` frames each and `frames` in
    all; so it stays until the next segment comes in.
    """

    # what a segment touches
    empty: SspSegment
    packing: SspSegment
    queue: list
    received: list
    queue_read: cython.longlong
    queue_count: cython.longlong
    received_count: cython.longlong
    segments: cython.longlong
    frames: cython.longlong
    last_id: cython.longlong
    received_frames: cython.longlong[16]
    segments_received: cython.longlong
    segments_sent: cython.longlong
    frames_received: cython.longlong
    frames_sent: cython.longlong
    first_is_junk: cython.bint
    # the rest
    report: object
    checksum_errors: cython.longlong
    receive_full: cython.longlong
    transmit_full: cython.longlong
    ids_out_of_range: cython.longlong
    code_checksum: cython.longlong
    code_receive_full: cython.longlong
    code_transmit_full: cython.longlong
    code_id_out_of_range: cython.longlong

    def __init__(self, report, last_id, first_is_junk=True) -> None:
        self.report = report
        self.last_id = last_id
        # the receive DMA is armed in the middle of nowhere, so the first segment comes shifted (robot.md N1.6)
        self.first_is_junk = first_is_junk
        self.received = [None] * MAIN_BRAIN_SEGMENTS
        self.received_count = 0  # those that wait for `parse`
        self.received_frames = [0] * 16  # MAIN_BRAIN_SEGMENTS
        self.segments = 0
        self.frames = 0
        self.queue = [empty_segment() for _ in range(MAIN_BRAIN_CIRCLE)]
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

    @cython.ccall
    def exchanged(self, segment: SspSegment) -> SspSegment:
        """Both slave-select edges: keep the received segment, return the segment to load for the next exchange."""
        self.receive(segment)
        return self.next_segment()

    @cython.ccall
    def receive(self, segment: SspSegment) -> cython.bint:
        """Keep what a received segment brings, as the receive DMA does in one of 16 places; False when it is lost.

        With all places full the segment is dropped and MB_SSP_RX_FULL reported (dropping the newest is
        chosen by us, because only the error is known).
        """
        if self.received_count == MAIN_BRAIN_SEGMENTS:
            return self._miss()
        if self.segments_received == 0 and self.first_is_junk:
            segment = self.shifted(segment)
        self.received[self.received_count] = segment
        self.received_count += 1
        self.segments_received += 1
        return True

    @cython.cfunc
    def _miss(self) -> cython.bint:
        """Report a segment without a free place: False."""
        self.receive_full += 1
        self.report(self.code_receive_full)
        return False

    def parsed(self) -> list:
        """The frames that the last `parse` handed over: (identifier, first word, second word)."""
        found = []
        for segment, frames in zip(self.received[: self.segments], self.received_frames, strict=False):
            rows = list(segment.rows)
            found += [
                (rows[row] & IDENTIFIER, rows[row + 1], rows[row + 2])
                for row in range(0, FRAME_ROW * frames, FRAME_ROW)
            ]
        return found

    @cython.ccall
    def shifted(self, segment: SspSegment) -> SspSegment:
        """A copy of `segment` as it looks from its second half-word on."""
        copy: SspSegment = SspSegment()
        copy.words = [*segment.words[1:], 0]
        copy.used = CHECKSUM
        return copy

    @cython.ccall
    def next_segment(self) -> SspSegment:
        """The oldest queued segment, or the empty one: what the transmit DMA is started on."""
        segment: SspSegment
        self.segments_sent += 1
        if self.queue_count == 0:
            return self.empty
        segment = cython.cast(SspSegment, self.queue[self.queue_read])
        self.queue_read += 1
        if self.queue_read == MAIN_BRAIN_CIRCLE:
            self.queue_read = 0
        self.queue_count -= 1
        return segment

    @cython.ccall
    def parse(self) -> cython.longlong:
        """Hand over the frames of every waiting segment, and report the errors; returns how many segments were read.

        A wrong checksum drops the segment (MB_SSP_CHKSUM). A half-word whose top five bits are not 01111
        where a header should be ends the segment. An identifier above `last_id` drops its frame
        (MB_SSP_ID_OOR).
        """
        segment: SspSegment
        i: cython.longlong
        row: cython.longlong
        frames: cython.longlong
        self.segments = self.received_count
        self.received_count = 0
        self.frames = 0
        for i in range(self.segments):
            segment = cython.cast(SspSegment, self.received[i])
            frames = frames_in(segment)
            if frames < 0:
                frames = 0
                self.checksum_errors += 1
                self.report(self.code_checksum)
            for row in range(0, FRAME_ROW * frames, 3):  # FRAME_ROW: as a step it would make this Python's range
                if segment.rows[row] & IDENTIFIER > self.last_id:
                    frames = self._drop_unknown_frames(i, frames)
                    break
            self.received_frames[i] = frames
            self.frames += frames
        self.frames_received += self.frames
        return self.segments

    @cython.cfunc
    def _drop_unknown_frames(self, place: cython.longlong, frames: cython.longlong) -> cython.longlong:
        """Keep the received segment at `place` without the frames that no variable has; returns how many are left."""
        segment: SspSegment = self.received[place]
        known: SspSegment = SspSegment()
        for row in range(0, FRAME_ROW * frames, FRAME_ROW):
            if segment.rows[row] & IDENTIFIER > self.last_id:
                self.ids_out_of_range += 1
                self.report(self.code_id_out_of_range)
            else:
                add_frame(known, segment.rows[row], segment.rows[row + 1], segment.rows[row + 2])
        self.received[place] = known
        return known.used // FRAME_HALF_WORDS

    @cython.ccall
    def send(self, identifier: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """Pack one frame; False (and MB_SSP_TX_FULL) when all 16 segments are queued.

        Call `flush` after the last frame of a slot.
        """
        if self.packing is None and not self._begin_segment():
            return False
        self.frames_sent += 1
        if add_frame(self.packing, (identifier & IDENTIFIER) | HEADER_ONES, word0, word1) == CHECKSUM:
            self.flush()
        return True

    @cython.cfunc
    def _begin_segment(self) -> cython.bint:
        """Let an empty segment be the one that is packed; False when all are queued."""
        if self.queue_count >= MAIN_BRAIN_SEGMENTS:
            self.transmit_full += 1
            self.report(self.code_transmit_full)
            return False
        self.packing = cython.cast(SspSegment, self.queue[(self.queue_read + self.queue_count) % MAIN_BRAIN_CIRCLE])
        self.packing.clear()
        return True

    @cython.ccall
    @cython.exceptval(check=False)
    def flush(self) -> cython.longlong:
        """Queue the segment being packed, padded with zeros; return how many segments are queued."""
        if self.packing is not None:
            self.packing = None
            self.queue_count += 1
        return self.queue_count


@cython.final
@cython.cclass
class RouterSspLink:
    """The master's end: a transmit ring of 500 half-words and 8 received segments.

    The ring is a circle of segments: half-words go into the last of them, a segment is taken whole from the other end.

    `frames_may_straddle`: the firmware moves half-words, so a frame that is only partly in the ring when a
    segment is filled is cut, and with a ring that never runs empty nothing re-aligns the frames that
    follow (a quirk of robot.md N1.6); without it only whole frames enter a segment.

    ROBOT PARITY: a segment is filled at its start; the robot fills its FIFO of eight half-words during
    the exchange, so a frame queued in the first microseconds after the tick goes out 200 us later here.
    """

    # what a frame and a segment touch
    received_write: cython.longlong
    received_read: cython.longlong
    position: cython.longlong
    packing: SspSegment
    half_words: cython.longlong
    push_time: cython.longlong
    first: cython.longlong
    last: cython.longlong
    segments: list
    received: list
    received_frames: cython.longlong[8]
    rx_id: cython.longlong
    rx_flags: cython.longlong
    rx_word0: cython.longlong
    rx_word1: cython.longlong
    exchange_running: cython.bint
    exchange_done: cython.bint
    frames_may_straddle: cython.bint
    empty: SspSegment
    push_step_ns: cython.longlong
    segments_sent: cython.longlong
    segments_received: cython.longlong
    frames_sent: cython.longlong
    frames_received: cython.longlong
    # the rest
    report: object
    checksum_errors: cython.longlong
    receive_overwritten: cython.longlong
    transmit_lost: cython.longlong
    low_rate: cython.longlong
    code_receive_overwritten: cython.longlong
    code_low_rate: cython.longlong
    code_checksum: cython.longlong
    code_transmit_full: cython.longlong

    def __init__(self, report, frames_may_straddle=False) -> None:
        self.report = report
        self.frames_may_straddle = frames_may_straddle
        self.segments = [empty_segment() for _ in range(ROUTER_CIRCLE)]
        self.first = 0  # the segment that goes next
        self.last = 0  # the segment being packed, which is also
        self.packing = self.segments[0]
        self.half_words = 0  # in all of them
        self.push_time = -1_000_000
        # six instructions per half-word pushed, about 12 cycles: chosen by us, because no listing says
        self.push_step_ns = 200
        self.empty = empty_segment()
        # what came in, by place: the segment, and how many frames it has (-1: the checksum is wrong)
        self.received = [None] * ROUTER_RECEIVE_SEGMENTS
        self.received_frames = [0] * 8  # ROUTER_RECEIVE_SEGMENTS
        self.received_write = 0
        self.received_read = 0
        self.position = 0
        self.exchange_running = False
        self.exchange_done = False
        self.rx_id = 0
        self.rx_flags = EIGHT_BYTES  # every frame becomes one of eight bytes
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

    @cython.ccall
    @cython.exceptval(check=False)
    def half_words_waiting(self) -> cython.longlong:
        """Half-words in the transmit ring."""
        return self.half_words

    @cython.ccall
    def push(
        self,
        identifier: cython.longlong,
        flags: cython.longlong,
        word0: cython.longlong,
        word1: cython.longlong,
        now: cython.longlong,
    ) -> cython.bint:
        """Put a frame into the transmit ring; a full ring drops it whole (SSP_TX_BUF_OF), False.

        `flags` as in foundation.events; `now` is the time in ns at which the pushing begins.
        """
        header: cython.longlong = (identifier & IDENTIFIER) | HEADER_ONES
        if self.half_words > MOST_BEFORE_A_FRAME:
            return self._lose()
        if flags & FLAG_REMOTE:
            header |= HEADER_REMOTE
        self.half_words += FRAME_HALF_WORDS
        self.push_time = now
        if self.packing.used == CHECKSUM:
            self._begin_segment()
        elif self.frames_may_straddle and self.packing.used % FRAME_HALF_WORDS != 0:  # a frame was cut before
            return self._put_half_words(header, word0, word1)
        add_frame(self.packing, header, word0, word1)
        return True

    @cython.cfunc
    def _lose(self) -> cython.bint:
        """Report a frame that does not fit: False."""
        self.transmit_lost += 1
        self.report(self.code_transmit_full)
        return False

    @cython.cfunc
    def _put_half_words(self, header: cython.longlong, word0: cython.longlong, word1: cython.longlong) -> cython.bint:
        """Append a frame that does not lie as the others do, and may go on in the next segment: True."""
        for word in (header, word0 >> 16, word0, word1 >> 16, word1):
            self._put(word & HALF_WORD)
        return True

    @cython.cfunc
    def _begin_segment(self) -> cython.void:
        """Let the segment after the last be the one that is packed."""
        self.last += 1
        if self.last == ROUTER_CIRCLE:
            self.last = 0
        self.packing = cython.cast(SspSegment, self.segments[self.last])
        self.packing.clear()

    @cython.cfunc
    def _put(self, word: cython.longlong) -> None:
        """Append one half-word."""
        if self.packing.used == CHECKSUM:
            self._begin_segment()
        half_words = self.packing.words
        half_words[self.packing.used] = word
        self.packing.words = half_words
        finish(self.packing, self.packing.used + 1)

    @cython.ccall
    def next_segment(self, now: cython.longlong) -> SspSegment:
        """The segment that is exchanged from time `now` (ns) on.

        Of a frame being pushed at that moment only the half-words already written are seen.
        """
        take: cython.longlong
        segment: SspSegment
        self.segments_sent += 1
        if self.half_words == 0:
            return self.empty
        segment = cython.cast(SspSegment, self.segments[self.first])
        if now - self.push_time < FRAME_HALF_WORDS * self.push_step_ns:
            take = self.half_words - FRAME_HALF_WORDS
            if now > self.push_time:
                take += (now - self.push_time) // self.push_step_ns
            if not self.frames_may_straddle:
                take -= take % FRAME_HALF_WORDS
            if take <= 0:
                return self.empty
            if take < segment.used:
                self._cut(segment, take)
        if self.first == self.last:
            self._begin_segment()
        self.first += 1
        if self.first == ROUTER_CIRCLE:
            self.first = 0
        self.half_words -= segment.used
        self.frames_sent += segment.used // FRAME_HALF_WORDS
        return segment

    @cython.cfunc
    def _cut(self, segment: SspSegment, used: cython.longlong) -> None:
        """Leave `used` half-words in the first segment; the others, of the newest frame, go to the head of the last."""
        moved = segment.words[used : segment.used]
        if self.first == self.last:
            self._begin_segment()
        self.packing.words = [*moved, *self.packing.words[: SEGMENT_HALF_WORDS - len(moved)]]
        finish(self.packing, self.packing.used + len(moved))
        finish(segment, used)

    @cython.ccall
    def tick(self, now: cython.longlong) -> SspSegment:
        """The 200 us interrupt: judge the exchange that should be over, return the next segment.

        An exchange that did not bring 31 half-words is SSP_LOW_RATE, and so is the first tick, which no exchange
        precedes. With all places full the newest segment is overwritten by the next (SSP_RX_BUF_OF).
        """
        following: cython.longlong
        if self.exchange_running:
            following = (self.received_write + 1) & RECEIVE_MASK
            if not self.exchange_done or following == self.received_read:
                self._miss_segment()
            else:
                self.received_write = following
        else:  # no exchange has begun yet, so none has brought its half-words
            self._miss_segment()
        self.exchange_running = True
        self.exchange_done = False
        return self.next_segment(now)

    @cython.cfunc
    def _miss_segment(self) -> None:
        """Report that the exchange brought no segment, or that no place is free for it."""
        if not self.exchange_done:
            self.low_rate += 1
            self.report(self.code_low_rate)
        else:
            self.receive_overwritten += 1
            self.report(self.code_receive_overwritten)

    @cython.ccall
    def receive(self, segment: SspSegment) -> cython.void:
        """The end of an exchange: the main brain's half-words lie in the current place."""
        # a segment that starts with zero is skipped without a check of its checksum, as the robot does
        self.received_frames[self.received_write] = frames_in(segment) if segment.rows[0] != 0 else 0
        self.received[self.received_write] = segment
        self.exchange_done = True
        self.segments_received += 1

    @cython.cfunc
    def _drop_segment(self) -> None:
        """Report a wrong checksum of the segment that is read next."""
        self.checksum_errors += 1
        self.report(self.code_checksum)

    @cython.ccall
    @cython.exceptval(check=False)
    def has_segments(self) -> cython.bint:
        """True while a received segment waits to be read, empty or not."""
        return self.received_read != self.received_write

    @cython.ccall
    def take(self) -> cython.bint:
        """Move the next received frame into rx_id, rx_flags, rx_word0, rx_word1; False without one.

        A wrong checksum drops the segment (SSP_BAD_CHKSM). The data length of a frame becomes 8.
        """
        frames: cython.longlong
        row: cython.longlong
        segment: SspSegment
        while self.received_read != self.received_write:
            frames = self.received_frames[self.received_read]
            if self.position < frames:
                segment = cython.cast(SspSegment, self.received[self.received_read])
                row = FRAME_ROW * self.position
                self.rx_id = segment.rows[row] & IDENTIFIER
                self.rx_word0 = segment.rows[row + 1]
                self.rx_word1 = segment.rows[row + 2]
                self.position += 1
                self.frames_received += 1
                return True
            if frames < 0:
                self._drop_segment()
            self.position = 0
            self.received_read = (self.received_read + 1) & RECEIVE_MASK
        return False
