from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.foundation.events cimport PIN_OUTPUT

cdef class Gpio(Peripheral):
    cdef public long long[64] outputs
    cpdef long long level(self, long long pin) except? <long long>-1
    cpdef int write(self, long long pin, long long level) except -1
    cpdef int toggle(self, long long pin) except -1
    cdef int _drive(self, long long pin, long long level) except -1
    cpdef int IOSET(self, long long port, long long mask) except -1
    cpdef int IOCLR(self, long long port, long long mask) except -1
    cpdef long long IOPIN(self, long long port) except? <long long>-1
