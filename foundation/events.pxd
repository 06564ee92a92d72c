cimport cython

cdef extern from *:
    """
    #define RANGER_SIM_NEVER 0x4000000000000000LL
    """
    const long long NEVER "RANGER_SIM_NEVER"

cpdef enum:
    STAGE_PLANT = 0
    STAGE_PINS = 1
    STAGE_BUS = 2
    STAGE_INTERRUPTS = 3
    STAGE_SLOTS = 4
    ORDER_PINS = 256
    ORDER_BUS = 512
    ORDER_INTERRUPTS = 768
    PIN_EDGE = 1
    CAN_RX = 2
    CAN_TX_DONE = 3
    CAN_STATUS = 4
    UART_BYTE = 5
    SSP_SEGMENT = 6
    CAN_REQUEST = 32
    CAN_ABORT = 33
    CAN_MODE = 34
    PWM_UPDATE = 35
    PIN_OUTPUT = 36
    SSP_START = 37
    SSP_LOAD = 38
    UART_OUTPUT = 39
    FLAG_REMOTE = 16
    FLAG_SINGLE_SHOT = 32
    FLAG_EXTENDED = 64
    FLAG_ERROR = 128
    TX_SENT = 0
    TX_ABORTED = 1
    TX_LOST = 2
    ROW = 10
    ROW_KIND = 2

cdef class Outbox:
    cpdef int push(
        self, long long time, long long order, long long kind,
        long long a=*, long long b=*, long long c=*, long long d=*, long long e=*, long long f=*,
        object ref=*,
    ) except -1
    cpdef int request(
        self, long long time, long long controller, long long buffer, long long identifier, long long flags,
        long long lo, long long hi,
    ) except -1

@cython.final
cdef class EventQueue(Outbox):
    # what a message touches
    cdef public long long head, tail, head_time, size
    cdef long long* rows
    cdef public long long place, pushed
    cdef long long* came
    cdef public object ref
    cdef public long long time, order, kind, a, b, c, d, e, f
    cdef long long* due
    cdef public long long urgent_until
    cdef public list refs
    # what the three addresses lead into: kept here, exchanged only by methods that set them too
    cdef readonly long long[::1] rows_kept, came_kept, due_kept
    cpdef long long put(
        self, long long time, long long order, long long kind,
        long long a, long long b, long long c, long long d, long long e, long long f,
    ) noexcept
    cdef int _find_numbers(self) except -1
    cdef void _move_up(self, long long at) noexcept
    cpdef bint take(self) noexcept
    cpdef void clear(self) noexcept
