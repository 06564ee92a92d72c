from ranger_sim.firmware_sim.peripherals.ssp cimport SspDevice

cimport cython

@cython.final
cdef class LedDrivers(SspDevice):
    cdef public long long select_pin, count, shift, writes
    cdef public bint selected
    cdef public long long[::1] registers
    cpdef bint on_select(self, long long level) except? -1
    cdef int _take(self, long long device, long long word) except -1
    cdef int _put(self, long long place, long long value) except -1
    cpdef long long level(self, long long device, long long port) except? <long long>-1
