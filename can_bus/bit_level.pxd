from ranger_sim.can_bus.disturbance cimport Disturbance
from ranger_sim.can_bus.frame cimport (
    DOMINANT, FIELD_RTR, FIELD_SRTR, MEASURED_BITS, RECEIVERS_SEE, RECESSIVE, arbitration_key, measure,
)
from ranger_sim.can_bus.medium_access cimport MAC_FRAME, MAC_IDLE, MET_ERROR, MET_FAILURE, MediumAccess
from ranger_sim.can_bus.node cimport BUS_OFF, ICR_FIELD_MASK, ICR_FIELD_SHIFT, RESET, SEQUENCE_BITS, Node
from ranger_sim.can_bus.transmit_buffers cimport FLAGS, HIGH, IDENTIFIER, LOW, NEXT, NODE_SHIFT, READY, TransmitBuffers
from ranger_sim.foundation.events cimport FLAG_ERROR, FLAG_EXTENDED

cimport cython

@cython.final
cdef class BitLevel:
    cdef public list machines, levels, aborting
    cdef public TransmitBuffers buffers
    cdef public Disturbance disturbance
    cdef public long long first_bit, bit, quiet, heard_bit, sent_bit, bitrate
    cdef public object tampering
    cdef public bint open, at_rest, away
    # the frame that began last, and the error frame that goes on
    cdef public long long identifier, flags, sender
    cdef public bint in_error, counted
    cdef public long long error_field, error_begun, error_position

    cdef int begin(self, long long bit, long long free_bit) except -1
    cdef int look(self) except -1
    cdef int start_frames(self) except -1
    cdef long long _offer(self, MediumAccess machine) except? <long long>-2
    cdef int _load(self, MediumAccess machine) except -1
    cdef int start_late(self, MediumAccess machine) except -1
    cdef int _note_start(self, long long row, long long bit) except -1
    cdef int pass_bit(self) except -1
    cdef long long _sample_at_own_rate(self, MediumAccess machine) except? <long long>-1
    cdef int _note_error(self) except -1
    cdef bint error_is_over(self) except? -1
