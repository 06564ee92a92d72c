from firmware_sim.peripherals.ssp cimport SspSegment

cimport cython

@cython.final
cdef class UnpackedFrames:
    cdef public long long[288] rows
    cpdef long long unpack(self, SspSegment segment, long long place) noexcept
    cpdef void move(self, long long place, long long to) noexcept

@cython.final
cdef class MainBrainSspLink:
    # what a segment touches
    cdef public UnpackedFrames unpacked
    cdef public SspSegment empty, packing
    cdef public list queue
    cdef public long long queue_read, queue_count
    cdef public long long received_count, received_frames, last_id, frames
    cdef public long long segments_received, segments_sent, frames_received, frames_sent
    cdef public bint first_is_junk
    cdef public list received_errors
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
    cdef int _note(self, long long code) except -1

@cython.final
cdef class RouterSspLink:
    # what a frame and a segment touch
    cdef public long long received_write, received_read, position
    cdef public SspSegment packing
    cdef public long long half_words, push_time, first, last
    cdef public list segments
    cdef public UnpackedFrames unpacked
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
    cdef bint _put_over_the_end(self, long long header, long long word0, long long word1) except? -1
    cdef int _miss_segment(self) except -1
    cdef int _drop_segment(self) except -1
    cdef void _begin_segment(self) noexcept
    cdef void _put(self, long long word) noexcept
    cdef void _cut(self, SspSegment segment, long long used) noexcept

cpdef long long checksum(SspSegment segment) noexcept
cpdef void finish(SspSegment segment, long long used) noexcept
cpdef void restart(SspSegment segment) noexcept
cpdef long long add_frame(SspSegment segment, long long header, long long word0, long long word1) noexcept
cpdef SspSegment empty_segment()
cpdef SspSegment corrupted_copy(SspSegment segment, long long index, long long flipped_bits)
