from ranger_sim.firmware_sim.peripherals.can_controller cimport EIGHT_BYTES
from ranger_sim.firmware_sim.peripherals.ssp cimport SspSegment
from ranger_sim.foundation.events cimport FLAG_REMOTE

cimport cython

cpdef enum:
    SEGMENT_HALF_WORDS = 31
    CHECKSUM = 30
    FRAME_HALF_WORDS = 5
    FRAME_ROW = 3
    SEGMENT_ROWS = 18
    HEADER_ONES = 0x7800
    HEADER_REMOTE = 0x8000
    HEADER_SHIFT = 11
    HEADER_MARK = 0x0F
    IDENTIFIER = 0x7FF
    HALF_WORD = 0xFFFF
    MOST_BEFORE_A_FRAME = 494
    ROUTER_RECEIVE_SEGMENTS = 8
    RECEIVE_MASK = 7
    MAIN_BRAIN_SEGMENTS = 16
    ROUTER_CIRCLE = 35
    MAIN_BRAIN_CIRCLE = 27

@cython.final
cdef class MainBrainSspLink:
    # what a segment touches
    cdef public SspSegment empty, packing
    cdef public list queue, received
    cdef public long long queue_read, queue_count
    cdef public long long received_count, segments, frames, last_id
    cdef public long long[16] received_frames
    cdef public long long segments_received, segments_sent, frames_received, frames_sent
    cdef public bint first_is_junk
    # the rest
    cdef public object report
    cdef public long long checksum_errors, receive_full, transmit_full, ids_out_of_range
    cdef public long long code_checksum, code_receive_full, code_transmit_full, code_id_out_of_range
    cpdef SspSegment exchanged(self, SspSegment segment)
    cpdef bint receive(self, SspSegment segment) except? -1
    cpdef SspSegment shifted(self, SspSegment segment)
    cpdef SspSegment next_segment(self)
    cpdef long long parse(self) except? <long long>-1
    cpdef bint send(self, long long identifier, long long word0, long long word1) except? -1
    cpdef long long flush(self) noexcept
    cdef bint _begin_segment(self) except? -1
    cdef bint _miss(self) except? -1
    cdef long long _drop_strangers(self, long long place, long long frames) except? <long long>-1

@cython.final
cdef class RouterSspLink:
    # what a frame and a segment touch
    cdef public long long received_write, received_read, position
    cdef public SspSegment packing
    cdef public long long half_words, push_time, first, last
    cdef public list segments, received
    cdef public long long[8] received_frames
    cdef public long long rx_id, rx_flags, rx_word0, rx_word1
    cdef public bint exchange_running, exchange_done, frames_may_straddle
    cdef public SspSegment empty
    cdef public long long push_step_ns
    cdef public long long segments_sent, segments_received, frames_sent, frames_received
    # the rest
    cdef public object report
    cdef public long long checksum_errors, receive_overwritten, transmit_lost, low_rate
    cdef public long long code_receive_overwritten, code_low_rate, code_checksum, code_transmit_full
    cpdef bint push(self, long long identifier, long long flags, long long word0, long long word1, long long now) except? -1
    cpdef long long half_words_waiting(self) noexcept
    cpdef SspSegment next_segment(self, long long now)
    cpdef SspSegment tick(self, long long now)
    cpdef void receive(self, SspSegment segment) noexcept
    cpdef bint take(self) except? -1
    cpdef bint has_segments(self) noexcept
    cdef bint _lose(self) except? -1
    cdef bint _put_half_words(self, long long header, long long word0, long long word1) except? -1
    cdef int _miss_segment(self) except -1
    cdef int _drop_segment(self) except -1
    cdef void _begin_segment(self) noexcept
    cdef int _put(self, long long word) except -1
    cdef int _cut(self, SspSegment segment, long long used) except -1

cpdef long long checksum(SspSegment segment) except? -1
cpdef int finish(SspSegment segment, long long used) except -1
cpdef long long add_frame(SspSegment segment, long long header, long long word0, long long word1) noexcept
cpdef long long frames_in(SspSegment segment) noexcept
cpdef SspSegment empty_segment()
cpdef SspSegment corrupted_copy(SspSegment segment, long long index, long long flipped_bits)
