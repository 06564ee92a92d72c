from boards.main_brain.state_machine cimport State, StateMachine
from datatable.store cimport DataStore

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
    cpdef void publish_state(self, number)
    cpdef void send(self, double counts)
    cpdef void switch(self, long long shut_down)
    cpdef void off(self)
    cpdef double radio_command(self)
    cpdef void enter_back(self)
    cpdef void send_twist(self)
    cpdef void enter_front(self)
    cpdef void enter_stance(self)
    cpdef void ramp_to_other_side(self)
    cpdef bint reset_wanted(self)
    cpdef bint inner_struck(self)
    cpdef bint outer_struck(self)
    cpdef bint inner_falls_behind(self)
    cpdef bint inner_comes_forward(self)
