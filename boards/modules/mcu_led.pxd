from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cimport cython

cpdef enum:
    GREEN = 0
    RED = 1
    BLUE = 2
    FIRST_PIN = 55
    HEARTBEAT_MS = 50
    HEARTBEAT_BIT = 8

cdef class McuLed:
    cdef public long long lit, remaining_green, remaining_red, remaining_blue
    cdef public Gpio gpio
    cdef public double slots_per_ms
    cpdef long long pin(self, long long led) noexcept
    cpdef int set_remaining(self, long long led, long long slots) except -1
    cpdef int flash(self, long long led, long long ms) except -1
    cpdef int on(self, long long led) except -1
    cpdef int off(self, long long led) except -1

@cython.final
cdef class Heartbeat(McuLed):
    cdef public NetworkTime time
    cdef public long long last_bit, beats
