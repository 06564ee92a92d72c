from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cdef class Lcd:
    cdef public long long countdown, state, waiting, position, character
    cdef public Gpio gpio
    cdef public long long[8] data_pins
    cdef public long long rs_pin, rw_pin, enable_pin
    cdef public object report
    cdef public long long[::1] positions, characters, reads, counts
    cdef public long long code_full, code_position
    cdef public long long written, lost
    cpdef bint put(self, long long position, long long character) except? -1
    cpdef long long set_quarter(self, long long quarter, long long word) except? -1
    cdef int _write(self, long long rs, long long byte) except -1
    cpdef long long tick(self) except? -1

cdef class LcdQuarter(Receiver):
    cdef public Lcd lcd
    cdef public long long quarter
