# The C twins of the functions in shared_words.py: sequentially consistent words, and a bell (an eventfd).

cdef extern from *:
    """
    #include <stdint.h>
    #ifdef _MSC_VER  /* so that it compiles: Windows runs no board as a process */
    #include <intrin.h>
    #include <io.h>
    #define read _read
    #define write _write
    static inline long long rs_load(long long *p) { return _InterlockedOr64(p, 0); }
    static inline void rs_store(long long *p, long long v) { _InterlockedExchange64(p, v); }
    #else
    #include <unistd.h>
    static inline long long rs_load(long long *p) { return __atomic_load_n(p, __ATOMIC_SEQ_CST); }
    static inline void rs_store(long long *p, long long v) { __atomic_store_n(p, v, __ATOMIC_SEQ_CST); }
    #endif
    static inline long long rs_mix(long long h, long long w) {
        return (long long)(((uint64_t)h ^ (uint64_t)w) * 1099511628211ULL);
    }
    static inline void rs_post(int fd) {
        uint64_t one = 1;
        if (write(fd, &one, sizeof one) < 0) { }
    }
    static inline void rs_pause(int fd) {
        uint64_t count;
        if (read(fd, &count, sizeof count) < 0) { }
    }
    """
    long long rs_load(long long *p) noexcept nogil
    void rs_store(long long *p, long long v) noexcept nogil
    long long rs_mix(long long h, long long w) noexcept nogil
    void rs_post(int fd) noexcept nogil
    void rs_pause(int fd) noexcept nogil

cdef inline long long load(long long[::1] words, long long place) noexcept:
    return rs_load(&words[place])

cdef inline void store(long long[::1] words, long long place, long long value) noexcept:
    rs_store(&words[place], value)

cdef inline long long mix(long long so_far, long long word) noexcept:
    return rs_mix(so_far, word)

cdef inline void post(long long descriptor) noexcept:
    rs_post(<int>descriptor)

cdef inline void pause(long long descriptor) noexcept:
    rs_pause(<int>descriptor)
