cdef long long[::1] CRC_STEP
cdef long long[::1] STUFF_STEP
cpdef long long crc15(long long identifier, long long flags, long long lo, long long hi)
cpdef long long stuff_bits(long long identifier, long long flags, long long lo, long long hi)
cpdef long long frame_bits(long long identifier, long long flags, long long lo, long long hi)
cpdef long long arbitration_key(long long identifier, long long flags)
