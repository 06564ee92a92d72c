from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.datatable.store cimport DataStore

cpdef enum:
    SETUP = 0
    INNER_SWING = 1
    OUTER_PUSH = 2
    OUTER_SWING = 3
    INNER_PUSH = 4
    FLIGHT = 5
    TICK_MS = 2

cdef class HeadWalkMachine:
    cdef public DataStore store
    # variables of the data table
    cdef public long long E_LO_ANGLE, EST_CONTACT_OUTER, EST_CONTACT_INNER, FSM_RESET
    cdef public long long HD_TRANS_ANG, HD_CONTACT, HD_FLIGHT_TICKS, HD_SETUP_TIME, FSM_LEG
    cdef public long long setup_ms, ticks_in_the_air
    cdef public StateMachine machine
    cpdef int preset(self) except -1
    cpdef int publish_state(self, number) except -1
    cpdef int enter_setup(self) except -1
    cpdef int wait(self) except -1
    cpdef int enter_flight(self) except -1
    cpdef int count_flight(self) except -1
    cpdef bint reset_wanted(self) except? -1
    cpdef bint is_set_up(self) except? -1
    cpdef bint flies(self) except? -1
    cpdef bint outer_feet_stand(self) except? -1
    cpdef bint inner_feet_stand(self) except? -1
    cpdef bint outer_leg_leans_forward(self) except? -1
    cpdef bint outer_leg_leans_back(self) except? -1
