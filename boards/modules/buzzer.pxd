from ranger_sim.boards.modules.receiver cimport Receiver
from ranger_sim.firmware_sim.peripherals.pwm cimport LER_MR0, LER_MR5, Pwm

cdef class Buzzer:
    cdef public Pwm pwm
    cdef public bint beeps, repeats, playing
    cdef public long long silence_left_ms, beep_left_ms, beeps_waiting, hertz
    cdef public long long frequency_hertz, note, note_left_ms, beep_hertz, beep_next
    cdef public long long[::1] tune_hertz, tune_ms, pitches, beep_queue
    cdef public long long tunes_started, beeps_made
    cpdef int tone(self, long long hertz) except -1
    cpdef void start_tune(self) noexcept
    cpdef void error_sound(self, long long code) noexcept
    cpdef long long update(self) except? -1

cdef class BuzzerFrequency(Receiver):
    cdef public Buzzer buzzer

cdef class TuneStart(Receiver):
    cdef public Buzzer buzzer

cdef class ErrorSound(Receiver):
    cdef public Buzzer buzzer
