from boards.modules.network_time cimport NetworkTime
from firmware_sim.peripherals.gpio cimport Gpio

cdef class McuLed:
    cdef public Gpio gpio
    cdef public double slots_per_ms
    cdef public long long remaining_green, remaining_red, remaining_blue, lit
    cpdef long long pin(self, long long led)
    cpdef void set_remaining(self, long long led, long long slots)
    cpdef void flash(self, long long led, long long ms)
    cpdef void on(self, long long led)
    cpdef void off(self, long long led)
    cpdef void update(self)

cdef class Heartbeat:
    cdef public NetworkTime time
    cdef public McuLed leds
    cdef public long long last_bit, beats
    cpdef void beat(self)
