cdef class Plant:
    # what every step looks at stands first, beside each other
    cdef public long long time_ns, step_ns, steps
    cdef public double distance_m
    cdef public bint fell
    cdef public long long[::1] words
    cdef public double[::1] analog_start, analog_end
    cdef public str fall_cause
    cdef public list bridges, encoders
    cdef public object sample_names
    cpdef object step(self)
    cpdef object fill_sample(self, double[::1] row)
