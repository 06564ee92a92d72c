from ranger_sim.firmware_sim.peripheral cimport Peripheral
from ranger_sim.firmware_sim.peripherals.character_display cimport CharacterDisplay
from ranger_sim.firmware_sim.peripherals.led_drivers cimport LedDrivers
from ranger_sim.firmware_sim.peripherals.pwm cimport Pwm

cimport cython

cpdef enum:
    CHARACTERS = 0
    LIGHTS = 16
    TONE_HZ = 22
    SYNC = 23
    KEYS = 24
    LEDS = 25
    WORDS = 26
    CHARACTERS_PER_LINE = 8
    LIGHT_COUNT = 6
    LIGHTS_PER_DRIVER = 3
    PORTS_USED = 9

@cython.final
cdef class FrontPanel(Peripheral):
    cdef public CharacterDisplay display
    cdef public LedDrivers ssp
    cdef public long long[::1] words
    cdef public long long[64] bit_of
    cdef public long long enable_pin, select_pin, sync_pin, first_led, last_led
    cdef int _set_bit(self, long long word, long long bit, long long level) except -1
    cdef int _show_characters(self) except -1
    cdef int _show_lights(self) except -1
    cdef long long _level(self, long long light, long long colour) except? <long long>-1
    cpdef long long colour(self, long long light) except? <long long>-1
