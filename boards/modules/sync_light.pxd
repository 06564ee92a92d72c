from ranger_sim.boards.modules.colour_leds cimport ColourLeds
from ranger_sim.boards.modules.keypad cimport Keypad
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cdef class SyncLight:
    cdef public Gpio gpio
    cdef public Keypad keypad
    cdef public ColourLeds leds
    cdef public bint running, lit
    cdef public long long held_slots, milliseconds, flashes, pin
    cpdef long long watch_key(self) except? -1
    cpdef long long update(self) except? -1
    cpdef int _show(self, bint on) except -1
