from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cdef class Keypad:
    cdef public Gpio gpio
    cdef public long long[6] pins
    cdef public object report
    cdef public long long code_index
    cpdef bint pressed(self, long long key) except? -1
    cpdef long long buttons(self) except? -1
