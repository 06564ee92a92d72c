from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.plant.ranger cimport RangerPlant

cdef class Stage:
    cdef public long long[::1] words, step_times, registers
    cdef public double[::1] doubles
    cdef public RangerPlant plant
    cdef public list boards
    cdef public long long rows, shown_end, word_count, voltage_count
    cpdef void update(self) noexcept

cdef class Audience:
    cdef public long long[::1] words, step_times, board_words, sources, registers
    cdef public double[::1] doubles, analog_start, analog_end
    cdef public long long rows, word_count, voltage_count
    cpdef long long row_start(self, long long row) noexcept
    cpdef void show(self, long long row) noexcept
