from libc.math cimport sin

from ranger_sim.boards.main_brain.command cimport MotorCommand
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class HeadHip:
    cdef public DataStore store
    # variables of the data table
    cdef public long long E_LO_ANGLE, E_LI_ANGLE, E_LO_RATE, E_LI_RATE, FSM_LEG, FSM_RESET, CTRL_HIP_KP, CTRL_HIP_KD
    cdef public long long CTRL_WALK_SCISSOR_GAIN, CTRL_WALK_SCISSOR_OFFSET, HD_H_HOLD, HD_H_SPRING, HD_H_GRAVITY
    cdef public long long state_number
    cdef public MotorCommand motor
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint walking(self) except? -1
    cpdef int track(self) except -1
    cpdef int scissor(self, double sign, double lean, double rate) except -1
    cpdef int follow(self, double target, double rate, double sign) except -1

cdef class HeadAnkle:
    cdef public DataStore store
    cdef public bint flips_in_flight
    # variables of the data table
    cdef public long long FSM_LEG, FSM_RESET, CTRL_ANK_PUSH_KP, CTRL_ANK_PUSH_KD, CTRL_ANK_STANCE_KP, CTRL_ANK_STANCE_KD
    cdef public long long CTRL_ANK_SWING_KP, CTRL_ANK_SWING_KD, HD_F_SPRING, HD_F_ZERO, HD_F_HOLD, HD_F_PUSH, HD_F_FLIP
    cdef public long long own_swing, own_push, own_lean, own_rate, state_number
    cdef public MotorCommand motor
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint walking(self) except? -1
    cpdef int track(self) except -1
    cpdef int follow(self, double foot_target, double kp, double kd) except -1
