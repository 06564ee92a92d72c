from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.boards.modules.sender cimport Sender
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller cimport EIGHT_BYTES, RFS_EIGHT_BYTES, CanController

cimport cython

cpdef enum:
    IDENTIFIERS = 2048
    RECEIVE_RING = 64
    RECEIVE_MASK = 63
    RECEIVED = 4
    SEND_RING = 8
    SEND_MASK = 7
    QUEUED = 3
    FIRST_BUFFER = 1
    SECOND_BUFFER = 2

@cython.final
cdef class CanLink(Sender):
    # what a frame touches
    cdef public CanController controller
    cdef public long long time_identifier, search_cycles
    cdef public list receivers
    cdef public long long rx_write, rx_read, tx_write, tx_read
    cdef public long long received, delivered, queued, ignored, most_waiting
    cdef public long long[256] rx_rows
    cdef public long long[24] tx_rows
    # the rest
    cdef public Microcontroller chip
    cdef public ErrorModule errors
    cdef public object controller_errors
    cdef public bint report_full, full_ring_kills, stuck
    cdef public long long receive_lost, send_lost
    cdef public long long code_receive_full, code_send_full
    cdef public bint built
    cdef public long long built_identifier, built_value, built_time
    cpdef object feed(self)
    cpdef int transmit(self) except -1
