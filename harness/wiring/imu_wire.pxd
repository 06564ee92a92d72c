cimport cython

from ranger_sim.foundation.edge_buffer cimport ByteBuffer
from ranger_sim.foundation.events cimport ORDER_PINS, UART_BYTE, EventQueue
from ranger_sim.harness.step_watch cimport SerialDevice
from ranger_sim.plant.sensors.imu cimport Imu

cpdef enum:
    MESSAGE_BYTES = 8
    WORD_BYTES = 4
    PAUSE_NS = 25000

@cython.final
cdef class ImuWire(SerialDevice):
    cdef public Imu imu
    cdef public EventQueue inbox
    cdef public long long uart
    cdef public object tap
    cdef public bint plugged
    cdef void _put_bytes(self) noexcept
