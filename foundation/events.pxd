cimport cython

@cython.final
cdef class EventQueue:
    cdef public long long capacity, count, head, tail, free, head_time, pushed
    cdef public long long[::1] rows
    cdef public list refs
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef public object ref
    cdef public long long[::1] wakes
    cdef public long long wake_place
    cpdef void push(
        self, long long time, long long order, long long kind,
        long long a=*, long long b=*, long long c=*, long long d=*, long long e=*, long long f=*,
        object ref=*,
    ) noexcept
    cpdef bint take(self) noexcept
    cpdef void clear(self) noexcept
