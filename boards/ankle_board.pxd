from ranger_sim.boards.modules.foot_contact cimport FootContact
from ranger_sim.boards.modules.joint_safety cimport AnkleSafety
from ranger_sim.boards.modules.limit_switch cimport LimitSwitch
from ranger_sim.boards.modules.quadrature_decoder cimport QuadratureDecoder
from ranger_sim.boards.motor_board cimport MotorBoard
from ranger_sim.foundation.numbers cimport fixed_of_float, float32, float_of_fixed

cdef class AnkleBoard(MotorBoard):
    cdef public QuadratureDecoder joint
    cdef public AnkleSafety safety
    cdef public FootContact left_foot, right_foot
    cdef public LimitSwitch left_switch, right_switch
    cdef public long long rezero_share, rezero_angle, rezero_rate
    cdef public long long id_right_hs, id_left_hs, id_right_heel_sense, id_left_heel_sense
    cdef public long long id_right_ls, id_left_ls, id_ankle_angle, id_ankle_rate
    cpdef int set_start_values(self) except -1
