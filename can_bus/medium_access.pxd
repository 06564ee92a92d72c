from ranger_sim.can_bus.frame cimport (
    CRC_BITS, CRC_MASK, CRC_POLYNOMIAL, DATA_BITS, DOMINANT, FIELD_ACK_DELIMITER, FIELD_ACK_SLOT, FIELD_ACTIVE_FLAG,
    FIELD_CRC, FIELD_CRC_DELIMITER, FIELD_DATA, FIELD_DELIMITER, FIELD_DLC, FIELD_END, FIELD_ID_4_0, FIELD_ID_12_5,
    FIELD_ID_17_13, FIELD_ID_20_18, FIELD_ID_28_21, FIELD_IDE, FIELD_INTERMISSION, FIELD_OVERLOAD_FLAG,
    FIELD_PASSIVE_FLAG, FIELD_R0, FIELD_R1, FIELD_RTR, FIELD_SRTR, FIELD_START, FIELD_TOLERATED, INTERMISSION_BITS,
    LENGTH_CODE,
    RECESSIVE, STUFF_AFTER,
)
from ranger_sim.can_bus.node cimport (
    ICR_BUS_ERROR, ICR_FIELD_SHIFT, ICR_KIND_SHIFT, ICR_RECEIVING, JOINING, KIND_BIT, KIND_FORM, KIND_OTHER,
    KIND_STUFF, OPERATING, SENDER_PENALTY, SEQUENCE_BITS, SUSPEND_BITS, Node,
)
from ranger_sim.foundation.events cimport FLAG_EXTENDED, FLAG_REMOTE

cimport cython

cpdef enum:
    MAC_AWAY = 0
    MAC_JOINING = 1
    MAC_IDLE = 2
    MAC_FRAME = 3
    MAC_ACTIVE_FLAG = 4
    MAC_PASSIVE_FLAG = 5
    MAC_OVERLOAD_FLAG = 6
    MAC_TOLERATING = 7
    MAC_DELIMITER = 8
    MAC_INTERMISSION = 9
    MAC_SUSPENDED = 10
    MET_RECEIVED = 1
    MET_SENT = 2
    MET_LOSS = 4
    MET_ERROR = 8
    MET_FAILURE = 16
    MET_COUNTER = 32
    MET_SETTLED = 64
    MET_START = 128
    MET_JOIN = 256
    RECEIVER_PENALTY = 1
    FLAG_BITS = 6
    DELIMITER_BITS = 8
    TOLERATED_BITS = 8

@cython.final
cdef class MediumAccess:
    cdef public Node node
    cdef public long long state, count, driven
    cdef public bint sending, failed, after_error, unacknowledged, unheeded
    # the frame
    cdef public long long begun, position, field, left, stuff_run, stuff_level, register
    cdef public long long identifier, flags, lo, hi
    # what it sends
    cdef public long long row, offered, arbitration_bits
    cdef public list bits
    cdef public long long run_level, capture, met
    # a node at a wrong bit rate
    cdef public long long own_rate, own_bit, own_rest

    cdef void _forget_frame(self) noexcept
    cpdef void place(self, long long bit, long long free_bit) noexcept
    cdef bint may_start(self) noexcept
    cdef bint is_at_rest(self) noexcept
    cdef bint signals_error(self) noexcept
    cdef void send(self, long long row, list bits, long long arbitration_bits) noexcept
    cdef void start(self, long long bit) noexcept
    cdef long long drive(self) except? <long long>-2
    cpdef long long sample(self, long long wire_level, long long bit) except? <long long>-1
    cdef long long _sample_joining(self, long long level) noexcept
    cdef long long _sample_idle(self, long long level, long long bit) noexcept
    cdef long long _sample_frame(self, long long level, long long wire_level) except? <long long>-1
    cdef long long _receive(self, long long level) noexcept
    cdef void _next_field(self) noexcept
    cdef void _take(self, long long level) noexcept
    cdef long long _fixed_form(self, long long level) noexcept
    cdef long long _sample_dominant_flag(self, long long level) noexcept
    cdef long long _sample_passive_flag(self, long long level) noexcept
    cdef long long _tolerate(self, long long level) noexcept
    cdef long long _sample_delimiter(self, long long level) noexcept
    cdef long long _sample_intermission(self, long long level, long long bit) noexcept
    cdef long long _error(self, long long kind, long long sender_penalty, long long receiver_penalty) noexcept
    cdef long long _overload(self) noexcept
    cdef void _end_flag(self) noexcept
    cdef long long _intermission(self) noexcept
    cdef long long _count_domination(self, long long kind) noexcept
    cdef void _note_error(self, long long kind) noexcept
