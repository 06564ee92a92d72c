from ranger_sim.boards.modules.joint_safety cimport HipSafety
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.boards.motor_board cimport MotorBoard
from ranger_sim.firmware_sim.scheduler cimport Schedule
from ranger_sim.foundation.numbers cimport float32, float_of_fixed

cdef long long REZERO_SHARE

cdef class HipBoard(MotorBoard):
    cdef public QuadratureDecoder joint
    cdef public HipSafety safety
    cdef public long long id_angle, id_ang_rate
    cpdef Schedule schedule(self)
    cpdef int set_start_values(self) except -1
    cpdef long long controlled_position(self) noexcept
