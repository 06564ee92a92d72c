from ranger_sim.boards.main_brain.command cimport MotorCommand
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class FootMachine:
    cdef public DataStore store
    cdef public bint inner, wait_for_strike, strike_logged
    cdef public double hip_sign, hip_margin, push_gain, push_base, push_angle, push_start, turned
    cdef public long long own_swing, push_ms, passive_ms
    # variables of the data table
    cdef public long long MCH_ANGLE, E_SWING_LEG, E_ANKLE_HEIGHT, E_AM_L_ABSRATE, FSM_RESET
    cdef public long long C_F_ST_F_ANG, C_F_ST_F_RATE, P_F_ST_F_TANG, C_F_PP_F_ANG, C_F_PP_F_RATE
    cdef public long long P_F_PP_F_TANG, P_F_PP_FRAC_ANG, P_F_PP_F_ABSANG, C_F_FU_F_ANG
    cdef public long long C_F_FU_F_RATE, P_F_FU_F_TANG, P_F_FU_H_ANG, P_F_FU_F_CABL_STRETCH
    cdef public long long C_F_FD_F_ANG, C_F_FD_F_RATE, P_F_FD_F_TANG, C_F_SST_F_ANG
    cdef public long long C_F_SST_F_RATE, P_F_SST_F_TANG, P_F_AP_TIME, D_F_ON, DP_F_PP_L_ABSRATE
    cdef public long long DP_H_AM_L_ABSRATE, DC_F_PP_L_ABSRATE, DC_F_PP_L_ABSRATE2
    cdef public long long motor_position, ankle_angle, own_absolute, other_absolute
    cdef public long long push_height, push_to_strike, missed_pushes, state_number
    cdef public MotorCommand motor
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef int track_absolute(self, double target, double stiffness, double dampness) except -1
    cpdef int track_motor(self, double target, double stiffness, double dampness) except -1
    cpdef int hold_flipped_down(self) except -1
    cpdef int hold_standing(self) except -1
    cpdef int track_stance(self) except -1
    cpdef int enter_prepush(self) except -1
    cpdef int push(self) except -1
    cpdef bint correction_applies(self) except? -1
    cpdef double push_target(self) except? -1
    cpdef int enter_afterpush(self) except -1
    cpdef int go_limp(self) except -1
    cpdef int flip_up(self) except -1
    cpdef int flip_down(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint own_foot_struck(self) except? -1
    cpdef bint other_foot_struck(self) except? -1
    cpdef bint push_is_due(self) except? -1
    cpdef bint push_is_done(self) except? -1
    cpdef bint cable_is_slack_enough(self) except? -1
    cpdef bint own_leg_is_ahead(self) except? -1
