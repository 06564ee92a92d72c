cdef short CRC_1[256]
cdef short CRC_2[256]
cdef short CRC_3[256]
cdef short CRC_4[256]
cdef short STUFF_STEP[2048]
cdef short HEADER_CRC[1024]
cdef short HEADER_STUFF[1024]
cpdef long long measure(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long crc15(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long stuff_bits(long long identifier, long long flags, long long lo, long long hi)
cpdef long long frame_bits(long long identifier, long long flags, long long lo, long long hi) noexcept
cpdef long long arbitration_key(long long identifier, long long flags) noexcept
