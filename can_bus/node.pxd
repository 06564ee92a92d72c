from ranger_sim.foundation.events cimport CAN_STATUS, CAN_TX_DONE, EventQueue
from ranger_sim.can_bus.transmit_ends cimport TransmitEnds

cimport cython

cpdef enum:
    OPERATING = 0
    RESET = 1
    BUS_OFF = 2
    JOINING = 3
    UNPLUGGED = 4
    ICR_ERROR_WARNING = 0x4
    ICR_ERROR_PASSIVE = 0x20
    ICR_BUS_ERROR = 0x80
    ICR_FIELD_SHIFT = 16
    ICR_FIELD_MASK = 31
    ICR_RECEIVING = 0x200000
    ICR_KIND_SHIFT = 22
    KIND_BIT = 0
    KIND_FORM = 1
    KIND_STUFF = 2
    KIND_OTHER = 3
    WARNING_LIMIT = 96
    PASSIVE_LIMIT = 128
    BUS_OFF_LIMIT = 256
    RECEIVE_ERRORS_MOST = 255
    RECEIVER_CALMED = 119
    SENDER_PENALTY = 8
    SUSPEND_BITS = 8
    SEQUENCE_BITS = 11
    RECOVERY_SEQUENCES = 128
    TRANSMIT_ERRORS_OFF = 127

@cython.final
cdef class Node:
    # what every frame touches stands in front: few lines of the processor's cache
    cdef public EventQueue inbox
    cdef public Node following
    cdef public TransmitEnds ends
    cdef public long long index, order
    cdef public long long controller, mode, transmit_errors, receive_errors
    cdef public bint listening, passive, silent
    cdef public long long sent, received
    cdef public bint warning
    cdef public str name
    cdef public long long sequences_left, join_from, suspend_bit, off_ns, sending_end
    cdef public long long refused, aborted, single_shot_skipped, flushed
    cdef public long long arbitrations_lost, retries

    cdef int count_success(self) except -1
    cdef int count_reception(self) except -1
    cpdef int count_receive_errors(self, long long penalty) except -1
    cpdef bint confine(self, long long time, long long interrupts) except? -1
    cdef int tell(self, long long time, long long interrupts) except -1
    cdef long long joins_at(self, long long free_bit) noexcept
