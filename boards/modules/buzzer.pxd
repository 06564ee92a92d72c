cdef class Buzzer:
    cdef public bint beeps, repeats
    cdef public long long hertz, mr0, mr5
    cdef public long long frequency_command, amplitude_command, song_command
    cdef public bint playing
    cdef public long long note, note_left_ms, beep_left_ms, beep_hertz, beep_next, beeps_waiting, silence_left_ms
    cdef public long long[::1] tune_hertz, tune_ms, pitches, beep_queue
    cdef public long long tunes_started, beeps_made
    cpdef void tone(self, long long hertz)
    cpdef long long set_frequency(self, long long word0, long long word1)
    cpdef long long set_amplitude(self, long long word0, long long word1)
    cpdef long long set_song(self, long long word0, long long word1)
    cpdef long long set_error_frame(self, long long word0, long long word1)
    cpdef void start_tune(self)
    cpdef void stop_tune(self)
    cpdef void error_sound(self, long long code)
    cpdef long long update(self)
