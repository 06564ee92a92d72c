cimport cython

from libc.math cimport exp
from ranger_sim.plant.electrics.battery cimport Battery
from ranger_sim.plant.sensors.foot_sensor cimport FootSensors
from ranger_sim.plant.electrics.motor_unit cimport MotorUnit
from ranger_sim.plant.sensors.noise cimport NoiseSource
from ranger_sim.plant.wiring_points cimport (
    ANALOG_COUNT, BATTERY_CURRENT, BATTERY_VOLTAGE, INNER_FOOT_LEFT, INNER_FOOT_RIGHT, MOTOR_COUNT, MOTOR_CURRENT,
    OUTER_FOOT_LEFT, OUTER_FOOT_RIGHT, PER_MOTOR, ROUTER_CURRENT, ROUTER_VOLTAGE, STEERING, STEERING_ANGLE,
)

@cython.final
cdef class Electrics:
    # what every step looks at stands first, beside each other
    cdef public MotorUnit hip, outer_ankle, inner_ankle, steering
    cdef public Battery battery
    cdef public double hip_rate, outer_rate, inner_rate, steering_rate
    cdef public double electronics_W, electronics_J, motor_current_A
    cdef public FootSensors outer_feet, inner_feet
    cdef public list motors
    cdef public NoiseSource noise
    cdef public double lag_h, lag_factor, pwm_offset_A, voltage_clip_V, steering_rad, steering_shown_rad
    cdef public bint has_terms, has_ripple
    # as long as there are motors and analog wiring points
    cdef public double[4] battery_A
    cdef public double[19] values, zero_V, slope_V, noise_V
    cdef public double[::1] analog_end, analog_start
    cdef public double battery_current_lag_s
    cdef public double[19] scale, offset, lag_s, state
    cdef public object parameters
    cpdef void step_motors(
        self, long long t0, long long t1, double hip_rate, double outer_rate, double inner_rate, double steering_rate,
        bint jumped=*,
    ) noexcept
    cpdef void turn_motors(
        self, long long t0, long long t1, double hip_rad, double outer_rad, double inner_rad, double hip_rate,
        double outer_rate, double inner_rate,
    ) noexcept
    cpdef void sense(
        self, long long t0, long long t1, bint outer_contact, double outer_load_N,
        bint inner_contact, double inner_load_N, double steering_rad,
    ) noexcept
    cpdef void settle(
        self, bint outer_contact, double outer_load_N, bint inner_contact, double inner_load_N, double steering_rad,
    ) noexcept
    cdef void _read(self, double h, double steering_rad) noexcept
    cdef void _apply_terms(self, double h) noexcept
