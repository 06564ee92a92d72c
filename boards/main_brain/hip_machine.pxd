from ranger_sim.boards.main_brain.command cimport MotorCommand
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class HipMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long MCH_ANGLE, E_MCH_ANG_RATE, E_LO_ANGLE, E_LI_ANGLE, E_SWING_LEG
    cdef public long long E_T_AFTER_HS, E_AM_L_ABSRATE, E_AM_H_ANG, E_AM_H_RATE, E_AM_TIMER
    cdef public long long MCFO_RIGHT_ANKLE_RATE, MCFI_ANKLE_RATE, FSM_LEG, FSM_RESET
    cdef public long long C_H_OUTER_STIFFNESS, C_H_PM_H_RATE, P_H_PM_H_TRATE, P_H_PM_TIME
    cdef public long long P_H_PM_F_RATE, C_HI_SH_H_ANG, C_HI_SH_H_RATE, P_HI_SH_H_TANG
    cdef public long long C_H_EH_H_ANG, C_H_EH_H_RATE, P_H_EH_H_TANG, P_H_EHOLD_ANG
    cdef public long long P_H_EHOLD_ANG2, P_H_EH_L_TRATE, D_H_ON, DP_F_PP_L_ABSRATE, DP_H_AM_H_ANG
    cdef public long long DP_H_AM_L_ABSRATE, DP_H_AM_H_RATE, DP_H_AM_TIME1, DP_H_AM_TIME2
    cdef public long long DC2_H_AM_H_ANG1, DC2_H_AM_H_ANG2, DC2_H_AM_H_RATE1, DC2_H_AM_H_RATE2
    cdef public long long DC3_H_AM_H_ANG1, DC3_H_AM_H_ANG2, DC3_H_AM_L_ABSRATE1
    cdef public long long DC3_H_AM_L_ABSRATE2, DC3_H_AM_H_RATE1, DC3_H_AM_H_RATE2
    cdef public long long E_H_DI1, E_H_DI2, FSM_HIP
    cdef public MotorCommand motor
    cdef public long long premid_time, leg_lo_aftermid, leg_li_aftermid
    cdef public double first_correction, second_correction
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef int hold_start(self) except -1
    cpdef int hold_inner_ahead(self) except -1
    cpdef int hold_outer_ahead(self) except -1
    cpdef int enter_premid(self) except -1
    cpdef int enter_aftermid(self) except -1
    cpdef double correction(self) except? -1
    cpdef double base_current(self, double direction) except? -1
    cpdef int swing_inner(self) except -1
    cpdef int swing_inner_corrected(self) except -1
    cpdef int swing_outer(self) except -1
    cpdef int swing_outer_corrected(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint inner_struck(self) except? -1
    cpdef bint outer_struck(self) except? -1
    cpdef bint inner_foot_flips_up(self) except? -1
    cpdef bint outer_foot_flips_up(self) except? -1
    cpdef bint outer_stance_past_mid(self) except? -1
    cpdef bint inner_stance_past_mid(self) except? -1
    cpdef bint hangs(self, double direction) except? -1
    cpdef bint inner_leg_hangs(self) except? -1
    cpdef bint outer_leg_hangs(self) except? -1
