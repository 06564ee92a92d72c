cimport cython

cdef long long _NEVER

cdef class Outbox:
    cpdef int push(
        self, long long time, long long order, long long kind,
        long long a=*, long long b=*, long long c=*, long long d=*, long long e=*, long long f=*,
        object ref=*,
    ) except -1
    cpdef int request(
        self, long long time, long long controller, long long buffer, long long identifier, long long flags,
        long long lo, long long hi,
    ) except -1

@cython.final
cdef class EventQueue(Outbox):
    # what a message touches
    cdef public long long head, tail, head_time, size
    cdef long long* rows
    cdef public long long place, pushed
    cdef long long* came
    cdef public object ref
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef long long* due
    cdef public long long urgent_until
    cdef public list refs
    # what the three addresses lead into: kept here, exchanged only by methods that set them too
    cdef readonly long long[::1] rows_kept, came_kept, due_kept
    cpdef long long put(
        self, long long time, long long order, long long kind,
        long long a, long long b, long long c, long long d, long long e, long long f,
    ) noexcept
    cdef int _find_numbers(self) except -1
    cdef void _move_up(self, long long at) noexcept
    cpdef bint take(self) noexcept
    cpdef void clear(self) noexcept
