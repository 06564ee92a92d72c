# cython: cdivision=True
# (only by inertias, which are above zero)
"""The fourth motor: twist of the inner feet, turn of the robot, path in the plane (EQUATIONS 14).

The inner legs twist about their own axes and turn both inner feet; while these carry the robot they do not slide,
so the robot turns the other way (appendix 2.7). The steering has little effect on the walk seen from the side (same
place), so it is computed separately: nothing flows back into the body.

    J dw/dt = T - k twist - c w (and a stop), yaw rate = -w while only the inner feet stand, 0 otherwise

Positive is to the left, seen from above. With all feet on the floor the twist is blocked.
"""

import cython
from cython.cimports.libc.math import cos, sin

from ranger_sim.plant.mechanics.friction import smoothed_sign


@cython.final
@cython.cclass
class Steering:
    """Twist (rad), heading `yaw` (rad) and the hip's path `path_x`, `path_y` (m) in the plane of the floor.

    No fact gives the mechanism's constants; all are chosen by us:
    stops at +/-0.0436 rad, because one full travel then turns the robot by the 5 degrees per inner step of appendix
    2.7; 1.5 N m/rad of the bending leg tubes, which the 1 W motor can hold at the stop; 0.01 kg m^2 for two feet and
    leg tubes about the vertical axis between them, 0.2 kg m^2 for the robot about the same axis (10 kg at 0.14 m);
    damping 0.1 N m s/rad.
    """

    twist: cython.double
    rate: cython.double
    yaw: cython.double
    path_x: cython.double
    path_y: cython.double
    hip_x: cython.double
    known_yaw: cython.double
    sin_yaw: cython.double
    cos_yaw: cython.double
    rotor_inertia: cython.double
    swing_inertia: cython.double
    stance_inertia: cython.double
    stiffness: cython.double
    damping: cython.double
    stop: cython.double

    def __init__(self, rotor_inertia_kg_m2=84.0 * 84.0 * 1e-7) -> None:
        self.twist = 0.0
        self.rate = 0.0
        self.yaw = 0.0
        self.path_x = 0.0
        self.path_y = 0.0
        self.hip_x = 0.0
        # the yaw whose sine and cosine these are
        self.known_yaw = 0.0
        self.sin_yaw = 0.0
        self.cos_yaw = 1.0
        self.rotor_inertia = rotor_inertia_kg_m2
        self.swing_inertia = 0.01
        self.stance_inertia = 0.2
        self.stiffness = 1.5
        self.damping = 0.1
        self.stop = 0.0436

    @cython.ccall
    def begin(self, hip_x: cython.double) -> cython.void:
        """Start path and heading where the robot is put down."""
        self.yaw = 0.0
        self.path_x = 0.0
        self.path_y = 0.0
        self.hip_x = hip_x

    @cython.ccall
    def advance(
        self,
        h: cython.double,
        drive: cython.double,
        coulomb: cython.double,
        viscous: cython.double,
        inverse_smoothing: cython.double,
        outer_stands: cython.bint,
        inner_stands: cython.bint,
        hip_x: cython.double,
    ) -> cython.void:
        """`h` seconds with the motor's torque law and these feet on the floor; the hip is at `hip_x` afterwards.

        Semi-implicit Euler: at 250 us its error is h^2 k / J = 9e-6 per step, against constants known to a factor.
        """
        before: cython.double = self.twist
        rate: cython.double = self.rate
        twist: cython.double
        went: cython.double
        if outer_stands and inner_stands:
            self.rate = 0.0
        elif drive != 0.0 or rate != 0.0 or before != 0.0:
            rate += (
                h
                * (
                    drive
                    - coulomb * smoothed_sign(rate * inverse_smoothing)
                    - (viscous + self.damping) * rate
                    - self.stiffness * before
                )
                / (self.rotor_inertia + (self.stance_inertia if inner_stands else self.swing_inertia))
            )
            twist = before + h * rate
            if twist > self.stop:
                twist = self.stop
                rate = 0.0
            elif twist < -self.stop:
                twist = -self.stop
                rate = 0.0
            self.rate = rate
            self.twist = twist
            if inner_stands:
                self.yaw -= twist - before
        went = hip_x - self.hip_x
        self.hip_x = hip_x
        if went != 0.0:
            if self.yaw != self.known_yaw:
                self.known_yaw = self.yaw
                self.sin_yaw = sin(self.yaw)
                self.cos_yaw = cos(self.yaw)
            self.path_x += went * self.cos_yaw
            self.path_y += went * self.sin_yaw
