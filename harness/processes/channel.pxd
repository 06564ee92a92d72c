from ranger_sim.foundation.events cimport CAN_REQUEST, FLAG_EXTENDED, EventQueue, Outbox
from ranger_sim.firmware_sim.peripherals.ssp cimport SspSegment
from ranger_sim.harness.processes.places cimport (
    DIRECTION,
    LEAST_PAYLOAD,
    LIMIT_SIZE,
    MOST_PAYLOAD,
    RANGES,
    SSP_USED,
    SSP_WORDS,
)

cpdef enum:
    VERSION = 1
    SLOT_WORDS = 12
    STAMP_WORD = 1
    ORDER_WORD = 2
    FIELDS_WORD = 3
    CHECK_WORD = 11
    FIELD_COUNT = 6
    LONGEST = 23
    FIRST_OWN_KIND = 64
    LAST_KIND = 127
    KIND_MASK = 255
    VERSION_SHIFT = 8
    PAYLOAD_SHIFT = 16
    PAYLOAD_MASK = 65535
    NUMBER_SHIFT = 32
    NUMBER_MASK = 16777215
    LAST_STANDARD_ID = 2047
    FARTHEST_NS = 1000000000
    OF_UNKNOWN_KIND = 1
    OF_OTHER_VERSION = 2
    TOO_LONG = 3
    CHECK_WRONG = 4
    NO_IDENTIFIER = 5
    BAD_PAYLOAD = 6
    OUT_OF_TIME = 7
    FIELD_WRONG = 16

# What a shared word needs that a plain array does not: order between processes, and a bell (an eventfd).
cdef extern from *:
    """
    #include <stdint.h>
    #include <unistd.h>
    static inline long long rs_load(long long *p) { return __atomic_load_n(p, __ATOMIC_SEQ_CST); }
    static inline void rs_store(long long *p, long long v) { __atomic_store_n(p, v, __ATOMIC_SEQ_CST); }
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

cdef class Bell:
    cdef public long long[::1] words
    cdef public long long count, sleeper, descriptor, rung
    cpdef void ring(self) noexcept
    cpdef bint wait(self, long long count) noexcept

cdef class Mailbox:
    cdef public long long[::1] words, limits
    cdef public str name
    cdef public long long first, slots, used_word, direction, until
    cdef public long long sequence, used, at, closed, damaged, kinds, bit_of_kind
    cdef public str last_damage
    cdef public list notes
    cpdef bint put(self, EventQueue queue)
    cpdef void send(self) noexcept
    cpdef bint take(self, Outbox queue)
    cdef long long _write_payload(self, long long kind, object ref, long long at)
    cdef object _read_payload(self, long long at, long long count, long long kind)
    cdef long long _check(self, long long at, long long payload) noexcept
    cdef long long _fault(self, long long at) noexcept
