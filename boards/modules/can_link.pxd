from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller cimport CanController
from ranger_sim.foundation.numbers cimport word_of_float, word_of_i32

cimport cython

@cython.final
cdef class CanLink:
    # what a frame touches
    cdef public CanController controller
    cdef public NetworkTime time
    cdef public long long time_identifier
    cdef public list receivers
    cdef public long long rx_write, rx_read, tx_write, tx_read
    cdef public long long received, delivered, queued, ignored, most_waiting
    cdef public long long[256] rx_rows
    cdef public long long[24] tx_rows
    # the rest
    cdef public Microcontroller chip
    cdef public ErrorModule errors
    cdef public bint report_full
    cdef public long long receive_lost, send_lost
    cdef public long long code_bus_off, code_warning, code_overrun, code_passive, code_bus_rx, code_bus_tx
    cdef public long long code_receive_full, code_send_full
    cpdef bint send_words(self, long long identifier, long long value_word, long long time_word) except? -1
    cpdef bint send_float(self, long long identifier, double value) except? -1
    cpdef bint send_int(self, long long identifier, long long value) except? -1
    cpdef int send_error(self, long long identifier) except -1
    cpdef object feed(self)
