from boards.motor_board cimport MotorBoard
from firmware_sim.scheduler cimport Schedule
from foundation.numbers cimport divide_toward_zero

cdef long long CENTRE_COUNTS, LIMIT_COUNTS, SENSOR

cdef class SteeringBoard(MotorBoard):
    cdef public long long zero
    cdef public bint direct, closed_loop, check_limits
    cdef public long long code_left, code_right, code_stopped, id_steer_angle
    cpdef Schedule schedule(self)
    cpdef void read_sensors_once(self)
    cpdef void set_start_values(self)
    cpdef long long controlled_position(self)
    cpdef long long controlled_velocity(self)
    cpdef void update_pwm(self)
    cpdef void steering_control(self)
    cpdef void check(self)
    cpdef void send_steer_angle(self)
    cpdef void send_power(self)
