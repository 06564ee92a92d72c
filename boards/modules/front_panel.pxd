cimport cython

from ranger_sim.boards.modules.buzzer cimport Buzzer
from ranger_sim.boards.modules.colour_leds cimport ColourLeds
from ranger_sim.boards.modules.keypad cimport Keypad
from ranger_sim.boards.modules.lcd cimport CharacterDisplay, Lcd
from ranger_sim.boards.modules.sync_light cimport SyncLight

cpdef enum:
    CHARACTERS = 0
    LIGHTS = 16
    TONE_HZ = 22
    SYNC = 23
    KEYS = 24
    WORDS = 25
    CHARACTERS_PER_LINE = 8
    SECOND_LINE_AT = 0x40
    LIGHT_COUNT = 6

@cython.final
cdef class FrontPanel:
    cdef public Lcd lcd
    cdef public ColourLeds leds
    cdef public Buzzer buzzer
    cdef public SyncLight sync_light
    cdef public Keypad keypad
    cdef public long long[::1] words
    cdef public long long seen_commands, seen_characters, seen_writes
    @cython.locals(display=CharacterDisplay)
    cpdef int show(self) except -1
    cpdef int move(self, words) except -1
