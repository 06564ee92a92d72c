cpdef long long quotient(long long a, long long b) noexcept
