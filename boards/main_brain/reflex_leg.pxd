from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class ReflexLegMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long E_LO_ANGLE, E_LI_ANGLE, E_LO_RATE, E_LI_RATE, E_SWING_LEG, FSM_RESET
    cdef public long long R_W_REF, R_DW_MAX, E_AM_L_ABSRATE, E_R_DW, FSM_LEG
    cdef public StateMachine machine
    cpdef int preset(self) except -1
    cpdef int publish_state(self, number) except -1
    cpdef int judge_inner(self) except -1
    cpdef int judge_outer(self) except -1
    cpdef int judge(self, double forward_rate) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint outer_leg_past_vertical(self) except? -1
    cpdef bint inner_leg_past_vertical(self) except? -1
    cpdef bint inner_struck(self) except? -1
    cpdef bint outer_struck(self) except? -1
