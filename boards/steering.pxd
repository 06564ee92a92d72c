from ranger_sim.boards.motor_board cimport MotorBoard

cpdef long long whole(long long value) noexcept

cdef long long CENTRE_COUNTS, LIMIT_COUNTS, SENSOR

cdef class SteeringBoard(MotorBoard):
    cdef public long long zero
    cdef public bint direct, closed_loop, check_limits
    cpdef int read_sensors_once(self) except -1
    cpdef int set_start_values(self) except -1
    cpdef long long controlled_position(self) noexcept
    cpdef long long controlled_velocity(self) noexcept
    cpdef int check(self) except -1
    cpdef long long steer_angle_counts(self) noexcept
