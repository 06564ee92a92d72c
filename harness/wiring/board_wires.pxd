cimport cython

from ranger_sim.can_bus.bus cimport Bus
from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.firmware_sim.peripherals.ssp cimport SspSegment
from ranger_sim.foundation.events cimport (
    CAN_ABORT,
    CAN_MODE,
    CAN_REQUEST,
    ORDER_INTERRUPTS,
    PIN_OUTPUT,
    PWM_UPDATE,
    SSP_LOAD,
    SSP_SEGMENT,
    SSP_START,
    UART_OUTPUT,
    EventQueue,
    Outbox,
)
from ranger_sim.foundation.row_stream cimport RowStream
from ranger_sim.plant.bridge cimport Bridge

@cython.final
cdef class WordWire:
    cdef public long long source, word
    cdef public Board board

@cython.final
cdef class SspWire:
    cdef public EventQueue master, slave
    cdef public long long exchange_ns, exchanges
    cdef public object loaded, tampering
    cdef public RowStream watch
    cpdef void start(self, long long time_ns, object segment) noexcept
    cpdef void load(self, object segment) noexcept
    cdef void _note(self, long long time_ns, SspSegment segment, long long from_slave) noexcept

@cython.final
cdef class BoardWires(Outbox):
    cdef public Board board
    cdef public Bridge drive
    cdef public long long window_ns, silent_until, watchdog_pin, low_side_2_pin, low_side_6_pin
    cdef public bint low_side_2, low_side_6
    cdef public list buses
    cdef public long long[5] nodes
    cdef public SspWire link
    cdef public RowStream watch
    cdef public dict can_lines, serial_lines
    cdef int _note(self, long long time, long long kind, long long a, long long b, long long c) except -1
