cdef long long _MASK, _SIGN
cpdef double float32(double value) noexcept
cpdef long long word_of_float(double value) noexcept
cpdef double float_of_word(long long word) noexcept
cpdef long long wrap_u32(long long value)
cpdef long long wrap_i32(long long value) noexcept
cpdef long long word_of_i32(long long value)
cpdef long long elapsed_u32(long long now, long long then)
cpdef long long fixed_of_float(double value) noexcept
cpdef double float_of_fixed(long long value) noexcept
cpdef long long fixed_multiply(long long a, long long b) noexcept
cpdef long long divide_toward_zero(long long numerator, long long denominator)
