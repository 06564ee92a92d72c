from ranger_sim.boards.modules.front_panel cimport LIGHTS_PER_DRIVER, PORTS_USED
from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio
from ranger_sim.firmware_sim.peripherals.ssp cimport SspMaster

cdef class ColourLeds:
    cdef public SspMaster ssp
    cdef public Gpio gpio
    cdef public long long select_pin
    cdef int _send(self, long long far, long long near) except -1
    cpdef int write(self, long long device, long long register, long long value) except -1
    cpdef long long set_led(self, long long led, long long word) except? -1
    cpdef long long set_colour(self, long long led, long long colour, long long level) except? -1

cdef class LedReceiver(Receiver):
    cdef public ColourLeds leds
    cdef public long long led
