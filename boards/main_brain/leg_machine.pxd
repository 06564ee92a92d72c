from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class StanceLeg:
    cdef public LegMachine owner
    cdef public DataStore store
    cdef public StanceLeg other
    cdef public long long angle_id, preswing_ms
    cdef public double hip_sign
    cdef public double strike_angle, ss0_angle, ss0_rate
    cdef public double mid_rate, mid_hip, mid_hip_rate, mid_time
    cpdef double angle_before_vertical(self) except? -1
    cpdef double hip_ahead(self) except? -1
    cpdef int enter_preswing(self) except -1
    cpdef int count_preswing(self) except -1
    cpdef int leave_preswing(self) except -1
    cpdef int enter_premid(self) except -1
    cpdef void enter_aftermid(self)

cdef class LegMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long E_LO_ANGLE, E_LI_ANGLE, E_SWING_LEG, E_T_AFTER_HS, MCH_ANGLE
    cdef public long long MCFO_RIGHT_ANKLE_RATE, MCFI_ANKLE_RATE, FSM_RESET, P_H_PM_F_RATE
    cdef public long long P_L_START_ABSRATE, P_L_START_H_RATE
    cdef public long long E_AM_L_ABSRATE, E_AM_H_ANG, E_AM_H_RATE, E_AM_TIME, E_AM_TIMER
    cdef public long long E_PS_TIME, E_SS_L_ANG, E_SS_L_ABSRATE, FSM_LEG
    cdef public StanceLeg outer, inner
    cdef public double ss0_angle, ss0_hip
    cdef public long long ss0_time, aftermid_ms
    cdef public bint ss0_known, rate_of_previous_step
    cdef public StateMachine machine
    cpdef int preset(self) except -1
    cpdef int publish_state(self, number) except -1
    cpdef int count_aftermid(self) except -1
    cpdef int leave_aftermid(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint inner_foot_flips_up(self) except? -1
    cpdef bint outer_foot_flips_up(self) except? -1
    cpdef bint outer_leg_past_vertical(self) except? -1
    cpdef bint inner_leg_past_vertical(self) except? -1
    cpdef bint inner_struck(self) except? -1
    cpdef bint outer_struck(self) except? -1
