from ranger_sim.foundation.events cimport (
    CAN_RX, CAN_TX_DONE, FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE, FLAG_SINGLE_SHOT, NEVER, TX_ABORTED, TX_LOST, TX_SENT,
    EventQueue,
)
from ranger_sim.can_bus.bit_level cimport BitLevel
from ranger_sim.can_bus.bus_counters cimport BusCounters
from ranger_sim.can_bus.disturbance cimport Disturbance
from ranger_sim.can_bus.frame cimport (
    ACK_DELIMITER_FROM_END, EIGHT_BYTES, HIGHEST_EXTENDED, HIGHEST_STANDARD, INTERMISSION_BITS, LENGTH_CODE, MEASURED_BITS,
    RECEIVERS_SEE, SENDABLE, arbitration_key, measure, frame_bits,
)
from ranger_sim.can_bus.frame_log cimport SENDER_SHIFT, TIMES_BUFFER_SHIFT, FrameLog
from ranger_sim.can_bus.load_meter cimport LoadMeter
from ranger_sim.can_bus.medium_access cimport (
    MAC_JOINING, MAC_SUSPENDED, MET_COUNTER, MET_FAILURE, MET_JOIN, MET_LOSS, MET_RECEIVED, MET_SENT, MET_SETTLED,
    MET_START, MediumAccess,
)
from ranger_sim.can_bus.node cimport (
    BUS_OFF, ICR_ERROR_WARNING, JOINING, OPERATING, RESET, SUSPEND_BITS, UNPLUGGED, Node,
)
from ranger_sim.can_bus.transmit_buffers cimport (
    ASKED, BUFFER_MASK, BUFFER_SHIFT, BUFFERS, FLAGS, FREE_AT, HIGH, IDENTIFIER, LOW, NEXT, NODE_SHIFT, READY, ROW,
    TransmitBuffers,
)

cimport cython

cpdef enum:
    COMMAND_ABORT = 1
    COMMAND_MODE = 2
    SECOND_NS = 1000000000

@cython.final
cdef class Bus:
    # what every request and frame touches stands in front: few lines of the processor's cache
    cdef public long long next_time, next_bit, advanced, free_time, free_bit, hindered_until, next_change
    cdef public TransmitBuffers buffers
    cdef public long long bitrate, node_count, acknowledging, wake_place
    cdef long long* due
    cdef public long long next_strike, strike_bit, second_bit, second_ns
    cdef public bint disturbed
    cdef public long long bit_ns, bit_rest, intermission_ns, intermission_rest
    cdef public list nodes
    cdef public BusCounters counters
    cdef public LoadMeter load
    cdef public FrameLog log
    # what the address `due` leads into: exchanged only by `wake`, which sets both
    cdef readonly long long[::1] wakes
    cdef public str name
    cdef public Disturbance disturbance
    cdef public EventQueue commands
    cdef public BitLevel bit_level
    cdef public long long joining, suspended_until, rivals
    cdef public object tampering

    cpdef long long bit_of(self, long long time) noexcept
    cpdef long long edge_ns(self, long long bit) noexcept
    cpdef bint request(
        self, long long node, long long buffer, long long time, long long identifier, long long flags,
        long long lo, long long hi,
    ) except? -1
    cpdef void abort(self, long long node, long long buffer, long long time)
    cpdef void set_mode(self, long long node, long long mode, long long time)
    cpdef long long advance(self, long long until) except? <long long>-1
    cdef int _no_such_buffer(self, long long node, long long buffer) except -1
    cdef int _check_frame(self, long long identifier, long long flags) except -1
    cdef int _refuse(self, long long node, long long flags) except -1
    cdef long long _hindered(
        self, long long node, long long buffer, long long time, long long flags, long long first
    ) except? <long long>-1
    cdef bint _change(self, long long until) except? -1
    cdef long long _next_join(self) except? <long long>-1
    cdef void _look_ahead(self) noexcept
    cdef long long _attempt(self, long long k) except? <long long>-1
    cdef int _note_times(self, long long k, long long asked, long long done, long long row, long long flags) except -1
    cdef long long _key(self, long long row) noexcept
    cdef long long _arbitrate(self, long long k) except? <long long>-1
    cdef int _contend(self, long long k, long long best) except -1
    cdef bint _is_offered(self, long long row, long long key, long long k) noexcept
    cdef bint _is_disturbed(self, long long k, long long best, long long end, bint merged) except? -1
    cdef int _join(self, Node node, long long bit) except -1
    cdef int _decided(self, long long bit) except -1
    cdef int _sent(self, Node node, long long row, long long bit) except -1
    cdef int _after_success(self, Node node, long long end, long long done) except -1
    cdef int _confine(self, Node node, long long time, long long interrupts) except -1
    cdef int _note_result(self, long long time) except -1
