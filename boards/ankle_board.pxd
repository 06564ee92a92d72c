from ranger_sim.boards.modules.foot_contact cimport FootContact
from ranger_sim.boards.modules.joint_safety cimport AnkleSafety
from ranger_sim.boards.modules.limit_switch cimport LimitSwitch
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.boards.motor_board cimport MotorBoard

cpdef enum:
    LEFT_FOOT = 2
    RIGHT_FOOT = 3

cdef class AnkleBoard(MotorBoard):
    cdef public QuadratureDecoder joint
    cdef public AnkleSafety safety
    cdef public FootContact left_foot, right_foot
    cdef public LimitSwitch left_switch, right_switch
    cdef public double rezero_share, rezero_angle, rezero_rate
    cpdef int set_start_values(self) except -1
    cpdef long long right_heel_sense(self) noexcept
    cpdef long long left_heel_sense(self) noexcept
