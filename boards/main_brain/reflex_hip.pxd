from ranger_sim.boards.main_brain.command cimport MotorCommand
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class ReflexHipMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long E_LO_ANGLE, E_LI_ANGLE, E_SWING_LEG, E_R_DW, FSM_RESET, C_HI_SH_H_ANG
    cdef public long long C_HI_SH_H_RATE, P_HI_SH_H_TANG, R_H_SW_I0, R_H_SW_DW, R_H_PL_PHI
    cdef public long long R_H_PL_I0, R_H_PL_DW, R_H_PL_KP, R_H_PL_KV, FSM_HIP
    cdef public MotorCommand motor
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef int hold_start(self) except -1
    cpdef int swing(self, double sign) except -1
    cpdef int place(self, double sign) except -1
    cpdef int swing_inner(self) except -1
    cpdef int swing_outer(self) except -1
    cpdef int place_inner(self) except -1
    cpdef int place_outer(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint inner_struck(self) except? -1
    cpdef bint outer_struck(self) except? -1
    cpdef bint outer_stance_far_enough(self) except? -1
    cpdef bint inner_stance_far_enough(self) except? -1
