cdef class EventQueue:
    cdef public long long capacity, count, head, tail, free, head_time, pushed
    cdef public long long[::1] times, orders, kinds, values, nexts, previous
    cdef public list refs
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef public object ref
    cpdef void push(
        self, long long time, long long order, long long kind,
        long long a=*, long long b=*, long long c=*, long long d=*, long long e=*, long long f=*,
        object ref=*,
    )
    cpdef bint take(self)
    cpdef void clear(self)
