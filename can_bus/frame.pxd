cdef short CRC_OF_BYTE[2048]
cdef unsigned long long STUFF[256]
cdef int BEGUN[2048]

cdef long long _feed(long long chain, long long value, long long count) noexcept
cdef long long _header(long long identifier, long long flags) noexcept
cdef long long _measure_bitwise(long long identifier, long long flags, long long lo, long long hi) noexcept
cdef long long _measure_by_bytes(long long identifier, long long lo, long long hi) noexcept
cpdef long long measure(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long crc15(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long stuff_bits(long long identifier, long long flags, long long lo, long long hi)
cpdef long long frame_bits(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long arbitration_key(long long identifier, long long flags) noexcept
