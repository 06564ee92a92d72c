from ranger_sim.harness.wiring.board_wires cimport WordWire
from ranger_sim.harness.processes.places cimport (
    MOST_VOLTAGES,
    MOST_WORDS,
    ROW_ANALOG_END,
    ROW_ANALOG_START,
    ROW_END,
    ROW_SIZE,
    ROW_START,
    ROW_WORDS,
    STAGE_FIRST,
    STAGE_RING,
    STAGE_ROWS,
)
from ranger_sim.plant.ranger cimport RangerPlant

cdef class Stage:
    cdef public long long[::1] words, step_times
    cdef public double[::1] doubles
    cdef public RangerPlant plant
    cdef public list wires
    cdef public long long rows, shown_end, word_count, voltage_count
    cpdef void update(self) noexcept

cdef class Audience:
    cdef public long long[::1] words, step_times, board_words, sources, registers
    cdef public double[::1] doubles, analog_start, analog_end
    cdef public long long rows, word_count, voltage_count
    cpdef long long row_start(self, long long row) noexcept
    cpdef void show(self, long long row) noexcept
