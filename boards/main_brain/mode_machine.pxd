from ranger_sim.boards.main_brain.estimator cimport Estimator
from ranger_sim.boards.main_brain.state_machine cimport State, StateMachine
from ranger_sim.boards.main_brain.steering_machine cimport SteeringMachine
from ranger_sim.datatable.store cimport DataStore
from ranger_sim.foundation.numbers cimport elapsed_u32

cpdef enum:
    KEY_0 = 1
    KEY_1 = 2
    KEY_2 = 4
    PAGES = 3

cdef class ModeMachine:
    cdef public DataStore store
    cdef public Estimator estimator
    # variables of the data table
    cdef public long long TIMESTAMP, UI_BUTTONS, MCH_BATT_VOLTAGE, E_STEP_COUNT, E_DISTANCE
    cdef public long long E_SWING_LEG, E_FO_PP2HS_TIME, E_FI_PP2HS_TIME, P_UI_LCD_TIME
    cdef public long long P_UI_SONG_STEPS, P_UI_PP2HS_TTIME, D_UI_STOP_ON_FALL
    cdef public long long FSM_UI, FSM_RESET, EST_UI_FSM_MODE, UI_SET_LED_1, UI_SET_LED_3
    cdef public long long UI_EMPTY_TX2, MCSI_COMMAND_CURRENT, MCSI_STIFFNESS, MCSI_DAMPNESS
    cdef public list lcd_ids
    cdef public object leg, hip, inner_foot, outer_foot  # of whichever program
    cdef public SteeringMachine steering
    cdef public long long buttons, pressed, last_song_steps, page, page_time, late_push_light
    cdef public StateMachine machine
    cpdef int update(self) except -1
    cpdef int publish_state(self, number) except -1
    cpdef int motors_off(self) except -1
    cpdef int steering_off(self) except -1
    cpdef int enter_calibrate(self) except -1
    cpdef int enter_standby(self) except -1
    cpdef int enter_stop(self) except -1
    cpdef int enter_walk(self) except -1
    cpdef int leave_walk(self) except -1
    cpdef int walk_display(self) except -1
    cpdef int show_page(self) except -1
    cpdef int show_mode(self, name, colour) except -1
    cpdef int show(self, upper, lower) except -1
    cpdef bint key_0(self) except? -1
    cpdef bint key_1(self) except? -1
    cpdef bint key_2(self) except? -1
    cpdef bint robot_fell(self) except? -1
