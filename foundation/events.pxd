cimport cython

cdef long long _NEVER

cdef class Outbox:
    cpdef int push(
        self, long long time, long long order, long long kind,
        long long a=*, long long b=*, long long c=*, long long d=*, long long e=*, long long f=*,
        object ref=*,
    ) except -1

@cython.final
cdef class EventQueue(Outbox):
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef public object ref
    cdef public long long head, tail, head_time, size, pushed, place
    cdef public long long[::1] rows
    cdef public long long urgent_until
    cdef public long long[::1] came
    cdef public list refs
    cdef public long long[::1] due
    cpdef long long put(
        self, long long time, long long order, long long kind,
        long long a, long long b, long long c, long long d, long long e, long long f,
    ) noexcept
    cdef void _move_up(self, long long at) noexcept
    cpdef bint take(self) noexcept
    cpdef void clear(self) noexcept
