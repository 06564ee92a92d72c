from ranger_sim.boards.main_brain.command cimport MotorCommand
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class ReflexFootMachine:
    cdef public DataStore store
    cdef public bint inner
    cdef public double hip_sign, zero
    cdef public long long own_swing, prepush_ms, push_ms
    # variables of the data table
    cdef public long long MCH_ANGLE, E_SWING_LEG, E_R_DW, FSM_RESET, C_F_SST_F_ANG, C_F_SST_F_RATE
    cdef public long long P_F_SST_F_TANG, R_F_ST_I0, R_F_ST_KP, R_F_ST_KV, R_F_PP_PHI, R_F_PP_I0
    cdef public long long R_F_PP_DW, R_F_PP_KV, R_F_PU_I0, R_F_PU_DW, R_F_PU_KV, R_F_PU_ANG
    cdef public long long R_F_PU_TIME, R_F_FU_I0, R_F_FU_KP, R_F_FU_KV, R_F_FD_PHI, R_F_FD_Q3
    cdef public long long R_F_FD_I0, R_F_FD_KP, R_F_FD_KV
    cdef public long long motor_position, own_angle, other_angle, push_to_strike, missed_pushes, state_number
    cdef public MotorCommand motor
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef int send(self, double I0, double Kp, double Kv) except -1
    cpdef int hold_standing(self) except -1
    cpdef int stand(self) except -1
    cpdef int enter_prepush(self) except -1
    cpdef int prepare_push(self) except -1
    cpdef int enter_push(self) except -1
    cpdef int push(self) except -1
    cpdef int flip_up(self) except -1
    cpdef int flip_down(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint own_foot_struck(self) except? -1
    cpdef bint other_foot_struck(self) except? -1
    cpdef bint leg_leans_far_enough(self) except? -1
    cpdef bint push_is_done(self) except? -1
    cpdef bint leg_swung_far_enough(self) except? -1
