from firmware_sim.microcontroller cimport Peripheral

cdef class Gpio(Peripheral):
    cdef public long long[::1] levels, directions
    cdef public long long writes, changes
    cpdef long long level(self, long long pin)
    cpdef void write(self, long long pin, long long level)
    cpdef void toggle(self, long long pin)
    cpdef void IOSET(self, long long port, long long mask)
    cpdef void IOCLR(self, long long port, long long mask)
    cpdef long long IOPIN(self, long long port)
