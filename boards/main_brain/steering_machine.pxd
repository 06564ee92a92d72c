from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cdef class SteeringMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long MCH_ANGLE, E_SWING_LEG, UI_RC_0, FSM_RESET, P_S_NULL_H_TANG, P_S_MAX_CUR
    cdef public long long P_S_ILST_TWITCH_FRAC, P_S_ILST_TWITCH_TIME, P_S_RC_DEADBAND, D_S_SHUT_DOWN
    cdef public long long MCSI_COMMAND_CURRENT, MCSI_STIFFNESS, MCSI_DAMPNESS, MCSI_SHUTDOWN
    cdef public long long E_RC_STEER, FSM_STEER
    cdef public double twist, ramp_start, ramp_change, ramp_fraction
    cdef public long long shut_down
    cdef public StateMachine machine
    cpdef int publish_state(self, number) except -1
    cpdef int send(self, double counts) except -1
    cpdef int switch(self, long long shut_down) except -1
    cpdef int off(self) except -1
    cpdef double radio_command(self) except? -1
    cpdef int enter_back(self) except -1
    cpdef int send_twist(self) except -1
    cpdef int enter_front(self) except -1
    cpdef int enter_stance(self) except -1
    cpdef int ramp_to_other_side(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint inner_struck(self) except? -1
    cpdef bint outer_struck(self) except? -1
    cpdef bint inner_falls_behind(self) except? -1
    cpdef bint inner_comes_forward(self) except? -1
