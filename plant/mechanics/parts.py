# cython: cdivision=True
# (only by the length of a spring, which is above zero)
"""Parts of the body that both legs share: the hip joint between them, and the parts of their ankles and soles."""

import cython
from cython.cimports.libc.math import cos, sin, sqrt

from ranger_sim.plant.mechanics.friction import smoothed_sign


@cython.final
@cython.cclass
class HipJoint:
    """Motor and spring between the legs (EQUATIONS 2.1, 2.2, 2.4). `parameters`: BodyParameters."""

    drive: cython.double
    coulomb: cython.double
    viscous: cython.double
    k: cython.double
    J: cython.double
    exact: cython.bint
    exact_k: cython.double
    l0: cython.double
    ab: cython.double
    aabb: cython.double

    def __init__(self, parameters) -> None:
        p = parameters
        # torque of the motor during a step: drive - coulomb tanh(rate / epsilon) - viscous rate
        self.drive = 0.0
        self.coulomb = 0.0
        self.viscous = 0.0
        self.J = p.hip_rotor_inertia_kg_m2
        self.k = p.hip_spring_Nm_per_rad
        # eq. 1 of the appendix instead of the linear spring
        self.exact = p.exact_hip_spring
        self.exact_k = p.hip_spring_rate_N_per_m if p.exact_hip_spring else 0.0
        self.l0 = p.hip_spring_rest_length_m
        self.ab = p.hip_spring_arm_a_m * p.hip_spring_arm_b_m
        self.aabb = p.hip_spring_arm_a_m * p.hip_spring_arm_a_m + p.hip_spring_arm_b_m * p.hip_spring_arm_b_m

    @cython.ccall
    @cython.exceptval(check=False)
    def spring_torque(self, angle: cython.double) -> cython.double:
        """Torque of the spring at a hip angle, N m, that it resists with (EQUATIONS 2.4)."""
        length: cython.double
        if not self.exact:
            return self.k * angle
        length = sqrt(self.aabb - 2.0 * self.ab * cos(angle))
        return 2.0 * self.exact_k * self.ab * (1.0 - self.l0 / length) * sin(angle)

    @cython.ccall
    @cython.exceptval(check=False)
    def torque(
        self, sign: cython.double, angle: cython.double, rate: cython.double, per_rad_s: cython.double
    ) -> cython.double:
        """Torque of motor and spring on a leg against the other one, N m (EQUATIONS 2.1, 2.4).

        sign: the leg's `hip_sign`; angle, rate: of that leg less the other one (rad, rad/s); per_rad_s: 1 / epsilon.
        """
        return (
            sign * self.drive
            - self.coulomb * smoothed_sign(rate * per_rad_s)
            - self.viscous * rate
            - self.spring_torque(angle)
        )

    @cython.ccall
    @cython.exceptval(check=False)
    def spring_energy(self, angle: cython.double) -> cython.double:
        """Energy in the spring at a hip angle, J."""
        length: cython.double
        if not self.exact:
            return 0.5 * self.k * angle * angle
        length = sqrt(self.aabb - 2.0 * self.ab * cos(angle))
        return self.exact_k * (length - self.l0) * (length - self.l0)


@cython.final
@cython.cclass
class Ankle:
    """Cable, rotor, springs and stops of an ankle (EQUATIONS 2.2, 2.3, 2.5, 2.7); `parameters`: BodyParameters."""

    k: cython.double
    J: cython.double
    inverse_J: cython.double
    low: cython.double
    high: cython.double
    stop_k: cython.double
    stop_c: cython.double
    return_k: cython.double
    rest: cython.double

    def __init__(self, parameters) -> None:
        p = parameters
        self.k = p.ankle_spring_Nm_per_rad
        self.J = p.ankle_rotor_inertia_kg_m2
        self.inverse_J = 1.0 / self.J
        # the return springs at the joint, and where they rest (EQUATIONS 2.7)
        self.return_k = p.ankle_return_Nm_per_rad
        self.rest = p.ankle_return_rest_rad - p.ankle_zero_rad
        self.low = p.ankle_stop_low_rad - p.ankle_zero_rad
        self.high = p.ankle_stop_high_rad - p.ankle_zero_rad
        self.stop_k = p.ankle_stop_Nm_per_rad
        self.stop_c = p.ankle_stop_Nms_per_rad

    @cython.ccall
    @cython.exceptval(check=False)
    def stop_torque(self, angle: cython.double, rate: cython.double) -> cython.double:
        """Torque on the foot of the stop that this angle is beyond: a spring and damper that only push (N m)."""
        torque: cython.double
        if angle < self.low:
            torque = self.stop_k * (self.low - angle) - self.stop_c * rate
            return torque if torque > 0.0 else 0.0
        torque = self.stop_k * (self.high - angle) - self.stop_c * rate
        return torque if torque < 0.0 else 0.0


@cython.final
@cython.cclass
class Sole:
    """Contact of a foot that brushes, or on a compliant floor (EQUATIONS 9): N/m, N s/m, s/m, mu."""

    k: cython.double
    c: cython.double
    per_m_s: cython.double
    mu: cython.double
    floor_k: cython.double
    floor_a: cython.double
    floor_per_m_s: cython.double

    def __init__(self, parameters) -> None:
        p = parameters
        self.k = p.sole_N_per_m
        self.c = p.sole_Ns_per_m
        self.per_m_s = 1.0 / p.sole_sliding_smoothing_m_s
        self.mu = p.floor_friction
        self.floor_k = p.floor_N_per_m
        self.floor_a = p.floor_dissipation_s_per_m
        self.floor_per_m_s = 1.0 / p.floor_sliding_smoothing_m_s
