cdef class ColourLeds:
    cdef public long long[::1] ports
    cdef public long long[::1] configuration
    cdef public long long writes
    cpdef void write(self, long long device, long long register, long long value)
    cpdef long long set_led(self, long long led, long long word)
    cpdef long long set_colour(self, long long led, long long colour, long long level)
    cpdef long long set_led_1(self, long long word0, long long word1)
    cpdef long long set_led_2(self, long long word0, long long word1)
    cpdef long long set_led_3(self, long long word0, long long word1)
    cpdef long long set_led_4(self, long long word0, long long word1)
    cpdef long long set_led_5(self, long long word0, long long word1)
    cpdef long long set_led_6(self, long long word0, long long word1)
    cpdef long long level(self, long long led, long long colour)
    cpdef long long colour(self, long long led)
