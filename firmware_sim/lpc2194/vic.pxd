cimport cython

from ranger_sim.firmware_sim.arm7.core cimport FIQ_LINE, IRQ_LINE
from ranger_sim.firmware_sim.lpc2194.block cimport Block

cpdef enum:
    TIMER0_INPUT = 4
    TIMER1_INPUT = 5
    UART0_INPUT = 6
    UART1_INPUT = 7
    SPI0_INPUT = 10
    SSP_INPUT = 11
    EINT0_INPUT = 14
    ADC_INPUT = 18
    CAN_INPUT = 19
    CAN1_TX_INPUT = 20
    CAN1_RX_INPUT = 26
    SLOTS = 16
    NO_SLOT = 16
    IDLE = 17

@cython.final
cdef class VicBlock(Block):
    cdef public long long raw, soft, enabled, selected, lines, serving, depth
    cdef public long long protection, default_address
    cdef public long long[16] addresses, controls
    cdef public long long[32] slot_of
    cdef public long long[18] served
    cdef long long settle(self) noexcept
    cdef long long first(self, long long irq) noexcept
    cdef long long begin(self) noexcept
    cdef void end(self) noexcept
    cpdef object place_slots(self)
