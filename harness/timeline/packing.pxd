cimport cython

cpdef enum:
    HOLE_BYTES = 8
    VARINT_BYTES = 10
    PACKET_TAG = 0x0A
    TIMESTAMP_TAG = 0x40
    OUTER_BEGINS = 0
    OUTER_ENDS = 1
    INNER_BEGINS = 2
    INNER_ENDS = 3

@cython.final
cdef class PacketPacker:
    cdef public object write
    cdef public long long flush_bytes, used, longest
    cdef public object buffer, text
    cdef public long long laid
    cdef public long long[::1] text_begins, hole_begins, hole_places
    cdef public list templates, holes
    cpdef int put(
        self, long long[::1] times, long long[::1] kinds, long long[::1] values, long long[::1] firsts
    ) except -1

cpdef long long nested(
    long long[::1] outer_start, long long[::1] outer_end, long long[::1] inner_start, long long[::1] inner_end,
    long long[::1] order,
) except? -1
cpdef long long index_packets(const unsigned char[::1] data, long long[::1] rows) except? -2
cdef long long take_varint(const unsigned char[::1] data, long long* cursor, long long end) noexcept
