cimport cython

from ranger_sim.can_bus.node cimport WARNING_LIMIT
from ranger_sim.firmware_sim.lpc2194.block cimport Block
from ranger_sim.firmware_sim.lpc2194.vic cimport CAN1_RX_INPUT, CAN1_TX_INPUT, CAN_INPUT
from ranger_sim.firmware_sim.peripherals.can_controller cimport CMR_SRR, ICR_RI, MOD_RESET, CanController
from ranger_sim.foundation.events cimport NEVER

cpdef enum:
    AFMR_OFF = 1
    AFMR_BYPASS = 2
    RFS_BP = 0x400
    TX_BITS = 0x602
    MOD_KNOWN = 0x09

@cython.final
cdef class CanFilterBlock(Block):
    cdef public list controllers
    cdef public long long mode
    cdef public long long[8] table

@cython.final
cdef class CanBlock(Block):
    cdef public CanController can
    cdef public CanFilterBlock acceptance
    cdef public long long number
    cdef public bint set_up
    cpdef object tell_ends(self)
