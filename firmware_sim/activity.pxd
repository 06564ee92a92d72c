cimport cython

from ranger_sim.foundation.row_stream cimport RowStream

cpdef enum:
    TASK_RAN = 1
    WAIT_RAN = 2
    INTERRUPT_RAN = 3
    MAIN_LOOP_RAN = 4
    SLOT_BEGAN = 5
    SLOT_ENDED = 6
    SLOT_OVERRAN = 7
    TASK_DROPPED = 8
    COLUMN_KIND = 0
    COLUMN_NUMBER = 1
    COLUMN_START = 2
    COLUMN_END = 3
    COLUMN_CYCLES = 4
    COLUMN_LATENCY = 5
    COLUMN_ROW = 6
    COLUMN_ITEMS = 7
    ACTIVITY_COLUMNS = 8

@cython.final
cdef class ActivityLog(RowStream):
    cdef public list sinks
    cdef public long long handed, laps, keep_ns
    cdef public bint code_open, list_open, irq_open
    cdef public long long code_kind, code_number, code_start, code_cycles, code_row, code_items
    cdef public long long list_number, list_cycles
    cdef public long long irq_number, irq_start, irq_cycles, irq_latency, irq_row, irq_items
    cpdef int put(
        self, long long kind, long long number, long long start, long long end,
        long long cycles, long long latency, long long row, long long items,
    ) except -1
    cpdef int begin_code(
        self, long long kind, long long number, long long start, long long cycles, long long row, long long items
    ) except -1
    cpdef int end_code(self, long long time) except -1
    cpdef int begin_irq(
        self, long long number, long long start, long long cycles, long long latency, long long row, long long items
    ) except -1
    cpdef int end_irq(self, long long time) except -1
