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
    cdef public long long size, head, tail, head_time, pushed
    cdef public long long[::1] rows
    cdef public list refs
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef public object ref
    cdef public long long[::1] came, due
    cdef public long long place, urgent_until
    cpdef long long put(
        self, long long time, long long order, long long kind,
        long long a, long long b, long long c, long long d, long long e, long long f,
    ) noexcept
    cdef void _move_up(self, long long at) noexcept
    cpdef bint take(self) noexcept
    cpdef void clear(self) noexcept
