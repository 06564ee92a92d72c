cimport cython

from libc.math cimport cos, sin, sqrt

@cython.final
cdef class Body:
    # what every step looks at stands first, beside each other
    cdef public long long mode, stance, step_start_ns, changes, event, last_strike_leg
    cdef public double foot_outer, leg_outer, leg_inner, foot_inner, motor_outer, motor_inner
    cdef public double foot_outer_rate, leg_outer_rate, leg_inner_rate, foot_inner_rate, motor_outer_rate, motor_inner_rate
    cdef public double hip_x, hip_y, hip_vx, hip_vy
    cdef public double known_foot_outer, sin_foot_outer, cos_foot_outer, known_leg_outer, sin_leg_outer, cos_leg_outer
    cdef public double known_leg_inner, sin_leg_inner, cos_leg_inner, known_foot_inner, sin_foot_inner, cos_foot_inner
    cdef public double hip_drive, hip_coulomb, hip_viscous
    cdef public double outer_drive, outer_coulomb, outer_viscous, inner_drive, inner_coulomb, inner_viscous
    cdef public double outer_Fx, outer_Fy, inner_Fx, inner_Fy
    cdef public double foot_outer_acc, leg_outer_acc, leg_inner_acc, foot_inner_acc, motor_outer_acc, motor_inner_acc
    cdef public double anchor_outer, anchor_inner, height_outer, height_inner, gap_outer, gap_inner
    cdef public bint brush, brushing, exact_spring, standing, outer_armed, inner_armed, foothold_due, lock_hip
    cdef public object terms
    cdef public double M, el, r, d, gx, gy, kh, ks, Jf, JH, inverse_JA, inverse_Jf, heel, toe, stop_low, stop_high, inverse_smoothing
    cdef public double mc_outer, mc_inner, mw_outer, mw_inner, C_outer, C_inner
    cdef public double m22_outer, m22_inner, mt_outer, mt_inner, i33_outer, i33_inner
    cdef public double elapsed, time_s, released_s, stall_s, strike_ahead, passing_gap
    cdef public double friction_ratio_max, mu, normal_force_min, fall_height, fall_lean, fall_split
    cdef public double[16] saved
    # the rest serves double stance, the sole, events and additional terms
    cdef public double J_outer, J_inner, JA, closing_rate, sole_k, sole_c, sole_v, stop_k, stop_c, hip_ay
    cdef public double scuff_time_s, slip_s, brush_s, pull_s
    cdef public double spring_ab, spring_aabb, spring_l0, spring_k
    cdef public double extra_hip, extra_outer, extra_inner, extra_outer_motor, extra_inner_motor
    cdef public double P_stance_x, P_stance_y, P_swing_x, P_swing_y
    cdef public bint unilateral, lift_leading
    cdef public double[110] matrix
    cdef public double[10] solution
    cdef public object parameters, floor, record
    cdef public str cause
    cpdef void set_slope(self, double slope_rad) noexcept
    cpdef double excess(self, double foot) noexcept
    cpdef double chain_x(self, double foot, double leg) noexcept
    cpdef double chain_y(self, double foot, double leg) noexcept
    cpdef double behind(self, long long leg) noexcept
    cpdef double ahead(self) noexcept
    cpdef void anchor(self, long long leg) noexcept
    cpdef double contact_x(self, long long leg) noexcept
    cpdef double ankle_x(self, long long leg) noexcept
    cpdef double hip_angle(self) noexcept
    cpdef double hip_rate(self) noexcept
    cpdef bint stands(self, long long leg) noexcept
    cdef void know_angles(self) noexcept
    cpdef void update_pose(self) noexcept
    cpdef void update_hip_rates(self) noexcept
    cpdef void lift(self) noexcept
    cpdef void limp_foot(self, long long leg) noexcept
    cpdef dict snapshot(self)
    cdef double stop_torque(self, double angle, double rate) noexcept
    cdef double spring_torque(self, double angle) noexcept
    cdef int ask_terms(
        self, bint outer_stance, double hip, double a_s, double a_w, double p, double n, double hip_rate,
        double ra_s, double ra_w, double up, double un,
    ) except -1
    cpdef double energy_J(self)
    cpdef long long event_time_ns(self) noexcept
    cdef void save(self) noexcept
    cdef void restore(self) noexcept
