cimport cython

from plant.absolute_encoder cimport AbsoluteEncoder
from plant.body cimport Body
from plant.electrics cimport Electrics
from plant.imu cimport Imu
from plant.incremental_encoder cimport IncrementalEncoder
from plant.motor_unit cimport MotorUnit
from plant.steering cimport Steering

@cython.final
cdef class RangerPlant:
    cdef public object parameters, floor, record, sample_names, model_file
    cdef public Body body
    cdef public Electrics electrics
    cdef public MotorUnit hip, outer_ankle, inner_ankle, steering_motor
    cdef public list motors, encoders
    cdef public Steering steering
    cdef public IncrementalEncoder hip_joint, hip_motor, outer_motor, outer_joint, inner_motor, inner_joint
    cdef public AbsoluteEncoder hip_word, outer_word, inner_word
    cdef public long long[::1] words
    cdef public Imu imu
    cdef public double[::1] analog_start, analog_end
    cdef public long long time_ns, step_ns, steps, strike_time_ns, lift_off_time_ns, changes
    cdef public double step_s, zero, step_length_m, distance_m
    cdef public bint fell, jumped
    cdef public str fall_cause
    cpdef void hold(
        self, object stance=*, double lean_rad=*, double hip_angle_rad=*, double outer_ankle_rad=*,
        double inner_ankle_rad=*, bint lifted=*,
    )
    cpdef void release(self, double rate_rad_s, double hip_rate_rad_s=*)
    cpdef void begin(self)
    cpdef void _settle(self)
    cpdef void step(self)
    cpdef void _note(self)
    cpdef void fill_sample(self, double[::1] row)
