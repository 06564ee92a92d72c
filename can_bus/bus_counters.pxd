cimport cython

@cython.final
cdef class BusCounters:
    cdef public long long frames
    cdef long long* counts
    cdef public long long merged, lost, single_shot_skipped, single_shot_dropped, retries, errors, refused
    cdef public long long arbitrations_lost, aborted, flushed, late_results, late_requests
    # what the address `counts` leads into: exchanged only by `reset`, which sets both
    cdef readonly long long[::1] identifiers

    cdef void note_answer(self, long long identifier, long long response_ns) noexcept
