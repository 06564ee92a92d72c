from ranger_sim.foundation.events cimport EventQueue
from ranger_sim.foundation.random_stream cimport RandomStream
from ranger_sim.foundation.row_stream cimport FrameStream
from ranger_sim.can_bus.frame cimport arbitration_key, measure
from ranger_sim.can_bus.transmit_ends cimport TransmitEnds

from libc.math cimport log

cimport cython

# In both classes what every frame touches stands in front: few lines of the processor's cache.

@cython.final
cdef class Node:
    cdef public EventQueue inbox
    cdef public Node following
    cdef public TransmitEnds ends
    cdef public long long index, order
    cdef public long long controller, mode, transmit_errors, receive_errors
    cdef public bint listening, passive
    cdef public long long sent, received
    cdef public bint warning
    cdef public str name
    cdef public long long sequences_left, join_from, suspend_bit, sending_end
    cdef public long long refused, aborted, single_shot_skipped, flushed
    cdef public long long arbitrations_lost, retries

@cython.final
cdef class Bus:
    # times in ns and in bits since power-up, transmit buffers: what a request and a frame touch
    cdef public long long next_time, next_bit, advanced, free_time, free_bit, hindered_until, next_change
    cdef long long* slots
    cdef public long long bitrate, first
    cdef public long long pending_count, node_count, acknowledging, wake_place
    cdef long long* due
    # what a frame touches
    cdef public long long next_strike, second_bit, second_ns
    cdef public long long bit_ns, bit_rest, intermission_ns, intermission_rest
    cdef public list nodes
    cdef public FrameStream trace
    cdef public long long frames, bits, window_busy, window_end
    cdef long long* counts
    # what those three addresses lead into: kept here, exchanged only by methods that set them too
    cdef readonly long long[::1] rows, identifiers, wakes
    cdef public str name
    cdef public object seed
    cdef public EventQueue commands
    cdef public long long joining, suspended_until
    # disturbances
    cdef public RandomStream noise
    cdef public double bit_error_rate
    cdef public long long next_noise_bit, next_planned_bit, strikes_left, strike_position
    cdef public list planned_bits
    # statistics
    cdef public long long merged, lost, single_shot_skipped, single_shot_dropped, retries, errors, refused
    cdef public long long arbitrations_lost, aborted, flushed, late_results, late_requests
    cdef public dict frames_by_extended_identifier
    cdef public long long origin_bit, window_bits, window_busy_max, window_count
    cdef public long long[::1] windows
    # frame log
    cdef public long long[::1] log
    cdef public long long log_capacity, log_count, log_dropped
    cdef public object log_sink

    cpdef long long bit_of(self, long long time) noexcept
    cpdef long long edge_ns(self, long long bit) noexcept
    cpdef bint request(
        self, long long node, long long buffer, long long time, long long identifier, long long flags,
        long long lo, long long hi,
    ) except? -1
    cpdef void abort(self, long long node, long long buffer, long long time)
    cpdef void set_mode(self, long long node, long long mode, long long time)
    cpdef long long advance(self, long long until) except? <long long>-1
    cpdef long long pending_of(self, long long node) noexcept
    cdef bint _change(self, long long until) except? -1
    cdef long long _next_join(self) except? <long long>-1
    cdef void _look_ahead(self) noexcept
    cdef void _remove(self, long long row) noexcept
    cdef long long _attempt(self, long long k) except? <long long>-1
    cdef int _no_such_buffer(self, long long node, long long buffer) except -1
    cdef int _check_frame(self, long long identifier, long long flags) except -1
    cdef int _refuse(self, long long node, long long flags) except -1
    cdef long long _hindered(
        self, long long node, long long buffer, long long time, long long flags, long long first
    ) except? <long long>-1
    cdef bint _disturbed(self, long long k, long long best, long long bits, bint merged) except? -1
    cdef int _after_success(self, Node node, long long end, long long done) except -1
    cdef int _calm_receiver(self, Node node, long long time) except -1
    cdef int _count_extended(self, long long identifier) except -1
    cdef long long _key(self, long long row) noexcept
    cdef long long _arbitrate(self, long long k) except? <long long>-1
    cdef bint _contend(self, long long k, long long best, long long best_key) except? -1
    cdef void _split_windows(self, long long first) noexcept
    cdef void _roll(self, long long bit) noexcept
    cdef long long _record(
        self, long long time, long long identifier, long long flags, long long lo, long long hi, long long node
    ) except? <long long>-1
