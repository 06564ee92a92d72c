from ranger_sim.boards.modules.joint_safety cimport HipSafety
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.boards.motor_board cimport MotorBoard

cdef double REZERO_SHARE

cdef class HipBoard(MotorBoard):
    cdef public QuadratureDecoder joint
    cdef public HipSafety safety
    cpdef int set_start_values(self) except -1
    cpdef long long controlled_position(self) noexcept
