cimport cython

from ranger_sim.plant.sensors.absolute_encoder cimport AbsoluteEncoder
from ranger_sim.plant.mechanics.body cimport FALLEN, Body
from ranger_sim.plant.electrics.electrics cimport Electrics
from ranger_sim.plant.sensors.imu cimport Imu
from ranger_sim.plant.sensors.incremental_encoder cimport IncrementalEncoder
from ranger_sim.plant.mechanics.leg cimport INNER, OUTER, Leg
from ranger_sim.plant.walking.motion cimport advance
from ranger_sim.plant.electrics.motor_unit cimport MotorUnit
from ranger_sim.plant.plant cimport Plant
from ranger_sim.plant.mechanics.steering cimport Steering
from ranger_sim.plant.walking.watch cimport fall
from ranger_sim.plant.wiring_points cimport HIP_WORD, INNER_ANKLE_WORD, OUTER_ANKLE_WORD

@cython.final
cdef class RangerPlant(Plant):
    # what every step looks at stands first, beside each other
    cdef public long long changes
    cdef public double step_s, zero
    cdef public Body body
    cdef public Electrics electrics
    cdef public Steering steering
    cdef public MotorUnit hip, outer_ankle, inner_ankle, steering_motor
    cdef public IncrementalEncoder hip_joint, hip_motor, outer_motor, outer_joint, inner_motor, inner_joint
    cdef public AbsoluteEncoder hip_word, outer_word, inner_word
    cdef public Imu imu
    cdef public bint jumped
    cdef public long long strike_time_ns, lift_off_time_ns
    cdef public double step_length_m
    cdef public list motors
    cdef public object parameters, floor, record, model_file
    cpdef void hold(
        self, object stance=*, double lean_rad=*, double hip_angle_rad=*, double outer_ankle_rad=*,
        double inner_ankle_rad=*, bint lifted=*,
    )
    cpdef void release(self, double rate_rad_s, double hip_rate_rad_s=*)
    cpdef void begin(self)
    cpdef void _settle(self)
    cpdef int _note(self) except -1
