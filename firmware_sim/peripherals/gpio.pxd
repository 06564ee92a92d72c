from firmware_sim.microcontroller cimport Peripheral

cdef class Gpio(Peripheral):
    cdef public long long[::1] levels, directions
    cdef public long long writes, changes
    cpdef long long level(self, long long pin)
    cpdef void write(self, long long pin, long long level)
    cpdef int toggle(self, long long pin) except -1
    cpdef int IOSET(self, long long port, long long mask) except -1
    cpdef int IOCLR(self, long long port, long long mask) except -1
    cpdef long long IOPIN(self, long long port)
