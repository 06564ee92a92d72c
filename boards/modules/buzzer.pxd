from ranger_sim.boards.modules.receiver cimport Receiver

cdef class Buzzer:
    cdef public bint beeps, repeats, playing
    cdef public long long silence_left_ms, beep_left_ms, beeps_waiting, hertz, mr0, mr5
    cdef public long long frequency_hertz, note, note_left_ms, beep_hertz, beep_next
    cdef public long long[::1] tune_hertz, tune_ms, pitches, beep_queue
    cdef public long long tunes_started, beeps_made
    cpdef void tone(self, long long hertz) noexcept
    cpdef void start_tune(self) noexcept
    cpdef void error_sound(self, long long code) noexcept
    cpdef long long update(self) except? -1

cdef class BuzzerFrequency(Receiver):
    cdef public Buzzer buzzer

cdef class TuneStart(Receiver):
    cdef public Buzzer buzzer

cdef class ErrorSound(Receiver):
    cdef public Buzzer buzzer
