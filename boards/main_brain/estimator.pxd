from libc.math cimport cos

from ranger_sim.boards.main_brain.filters cimport ButterworthFilter
from ranger_sim.boards.main_brain.geometry cimport FloorGeometry
from ranger_sim.datatable.store cimport DataStore

cpdef enum:
    SWING_BEHIND = 0
    AVERAGING = 1
    ARMED = 2
    WALKING = 2

cdef long long _MASK, _NEWEST

cdef class EnergyMeter:
    cdef public bint started
    cdef public long long stamp
    cdef public double power_W, energy_J
    cpdef bint update(self, double power_W, long long stamp_ms) except? -1

cdef class HeelSensor:
    cdef public double baseline
    cdef public long long count
    cpdef int restart(self, double raw) except -1
    cpdef int average(self, double raw) except -1
    cpdef bint touches(self, double raw, double threshold, double ticks, double base_limit) except? -1

cdef class Estimator:
    cdef public DataStore store
    cdef public object report
    cdef public long long code_time_violation, code_stutter, code_fall
    # variables of the data table
    cdef public long long TIMESTAMP, MCH_ANGLE, MCH_ANG_RATE, MCH_MOTOR_VELOCITY
    cdef public long long MCFO_RIGHT_ANKLE_ANGLE, MCFI_MID_ANKLE_ANGLE, MCFO_LEFT_HEEL_SENSE
    cdef public long long MCFO_RIGHT_HEEL_SENSE, MCFI_LEFT_HEEL_SENSE, MCFI_RIGHT_HEEL_SENSE
    cdef public long long UI_ANG_RATE_X, UI_ROLL, MCH_BATT_POWER, MCFO_BATT_POWER, MCFI_BATT_POWER
    cdef public long long MCSI_BATT_POWER, CSR_MCU_POWER, FSM_RESET, P_E_GYRO_BIAS, P_E_ROLL_BIAS
    cdef public long long P_E_RESET, P_E_HS_THRESHOLD, P_E_HS_BASE_LIMIT, P_E_HS_TICKS
    cdef public long long P_E_HS_H_ANG, P_E_HS_F_ANG, P_E_MIN_STEP_TIME, P_E_FALL_ANG
    cdef public long long E_MCH_ANG_RATE, E_H_MOTOR_RATE, E_LO_ANGLE, E_LI_ANGLE, E_LO_RATE
    cdef public long long E_LI_RATE, E_FO_ABSANG, E_FI_ABSANG, E_SWING_LEG, E_T_AFTER_HS
    cdef public long long E_HS_TIME, E_STEP_COUNT, E_DISTANCE, E_ANKLE_HEIGHT, E_SWING_HEIGHT
    cdef public long long E_LO_ERROR, E_HEEL_BASE_LEFT, E_HEEL_BASE_RIGHT, E_HEEL_STAGE
    cdef public long long EST_CONTACT_OUTER, EST_CONTACT_INNER, EST_LAST_STEP_LENGTH
    cdef public long long EST_LAST_STEP_ANGLE, EST_LAST_STEP_DURATION, EST_TOTAL_BATT_POWER
    cdef public long long EST_ENERGY_MCH, EST_ENERGY_MCFO, EST_ENERGY_MCFI, EST_ENERGY_MCSI
    cdef public long long EST_ENERGY_OVERHEAD
    cdef public bint per_tick_filter, use_filtered_sum, use_imu_roll, first_reset_is_full
    cdef public ButterworthFilter hip_rate, hip_motor_rate, gyro_rate, roll
    cdef public ButterworthFilter outer_left_sense, outer_right_sense
    cdef public ButterworthFilter inner_left_sense, inner_right_sense
    cdef public FloorGeometry floor
    cdef public double sweet_spot_m, ankle_zero, foot_offset
    cdef public HeelSensor left, right
    cdef public long long stage, swing_leg, last_reset, gyro_stamp, strike_time, steps, violations
    cdef public double outer_angle, outer_raw_rate, distance_m, front_foot
    cdef public bint gyro_started, first_step, fallen
    cdef public list meters
    cdef public EnergyMeter hip_energy, outer_energy, inner_energy, steer_energy, mcu_energy
    cpdef int restart(self) except -1
    cpdef int zero_way(self) except -1
    cpdef int zero_counters(self) except -1
    cpdef void update(self)
    cpdef int update_rates(self) except -1
    cpdef void update_outer_angle(self)
    cpdef void detect_strike(self, double hip, double outer_ankle, double inner_ankle)
    cpdef int set_stage(self, long long stage) except -1
    cpdef int update_contact_sums(self) except -1
    cpdef double contact_sum(self, bint inner) except? -1
    cpdef int strike(self, double hip, double outer_ankle, double inner_ankle) except -1
    cpdef int update_heights(self, double hip, double outer_ankle, double inner_ankle) except -1
    cpdef int update_energy(self) except -1
    cpdef void judge_fall(self, double hip)
