# The C twins of the functions in program.py.
#
# A program calls back on the thread that called it, which holds the interpreter's lock or has released it (cffi does).
# Taking the lock costs as much as most calls even where it is held, so that this is asked first.

cdef extern from *:
    """
    #include <stdint.h>
    typedef long long (*rs_answering)(void *, long long, long long, long long, long long, long long, long long);
    static rs_answering rs_answer;
    static inline int rs_has_lock(void) {
    #if PY_VERSION_HEX >= 0x030D0000
        return PyThreadState_GetUnchecked() != NULL;
    #else
        const PyThreadState *holder = _PyThreadState_UncheckedGet(); /* in 3.11 perhaps another thread's */
        return holder != NULL && holder->thread_id == PyThread_get_thread_ident();
    #endif
    }
    static int64_t rs_answered(void *host, int64_t call, int64_t a, int64_t b, int64_t c, int64_t d, int64_t e) {
        if (rs_has_lock())
            return rs_answer(host, call, a, b, c, d, e);
        PyGILState_STATE state = PyGILState_Ensure();
        const int64_t answer = rs_answer(host, call, a, b, c, d, e);
        PyGILState_Release(state);
        return answer;
    }
    static inline unsigned long long rs_answer_by(rs_answering function) {
        rs_answer = function;
        return (unsigned long long)(uintptr_t)rs_answered;
    }
    static inline long long rs_work(void *code) { return ((int32_t (*)(void))(uintptr_t)code)(); }
    static inline void rs_hook(void *code) { ((void (*)(void))(uintptr_t)code)(); }
    static inline long long rs_turn(void *code) { return ((int64_t (*)(void))(uintptr_t)code)(); }
    static inline void rs_set(void *place, long long value) { *(volatile uint32_t *)place = (uint32_t)value; }
    static inline void *rs_pointer(unsigned long long address) { return (void *)(uintptr_t)address; }
    """
    ctypedef long long (*rs_answering)(void*, long long, long long, long long, long long, long long, long long) noexcept
    unsigned long long rs_answer_by(rs_answering function) noexcept
    long long rs_work(void *code) noexcept
    void rs_hook(void *code) noexcept
    long long rs_turn(void *code) noexcept
    void rs_set(void *place, long long value) noexcept
    void *rs_pointer(unsigned long long address) noexcept

cdef inline void* pointer(object address) except? NULL:
    return rs_pointer(address)

cdef inline long long call_work(void* code) noexcept:
    return rs_work(code)

cdef inline void call_hook(void* code) noexcept:
    rs_hook(code)

cdef inline long long call_turn(void* code) noexcept:
    return rs_turn(code)

cdef inline void set_word(void* place, long long value) noexcept:
    rs_set(place, value)

cdef inline object answer_by(rs_answering function):
    return rs_answer_by(function)
