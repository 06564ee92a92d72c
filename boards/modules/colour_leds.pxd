from ranger_sim.boards.modules.receiver cimport Receiver

cdef class ColourLeds:
    cdef public long long[::1] ports
    cdef public long long[::1] configuration
    cdef public long long writes
    cpdef void write(self, long long device, long long register, long long value)
    cpdef long long set_led(self, long long led, long long word) except? -1
    cpdef long long set_colour(self, long long led, long long colour, long long level) except? -1
    cpdef long long level(self, long long led, long long colour) except? -1
    cpdef long long colour(self, long long led) except? -1

cdef class LedReceiver(Receiver):
    cdef public ColourLeds leds
    cdef public long long led
