"""The robot's pose from its joint angles alone, when front and rear feet both stand on a level floor.

Notation of robot.md C3.1: the front leg's foot is "t", the rear one "w"; R the radius of a
foot's arc, d the distance from the ankle to the arc's centre; ankle angles counted from the sweet spot.
ROBOT PARITY: the firmware took sines from tables and arcsines from a quartic fit; here they are exact.
"""

import cython
from cython.cimports.libc.math import asin, atan, cos, sin, sqrt


@cython.cclass
class FloorGeometry:
    """Pose at heel strike. Lengths in m, angles in rad, leg angles positive leaning forward."""

    leg_m: cython.double
    inner_radius_m: cython.double
    inner_ankle_m: cython.double
    outer_radius_m: cython.double
    outer_ankle_m: cython.double
    front_foot: cython.double
    rear_foot: cython.double
    front_leg: cython.double
    rear_leg: cython.double
    ankle_distance_m: cython.double

    def __init__(self) -> None:
        self.leg_m = 0.960
        self.inner_radius_m = 0.23
        self.inner_ankle_m = 0.176
        self.outer_radius_m = 0.168
        self.outer_ankle_m = 0.114
        self.front_foot = 0.0
        self.rear_foot = 0.0
        self.front_leg = 0.0
        self.rear_leg = 0.0
        self.ankle_distance_m = 0.0

    @cython.ccall
    def solve(self, hip: cython.double, outer: cython.double, inner: cython.double) -> cython.bint:
        """Pose for hip angle h and the two ankle angles less 1.68 rad; False when no pose fits.

        Below 0.05 rad of hip angle the feet are too close for the formula (chosen by us).
        """
        spread: cython.double = hip if hip >= 0.0 else -hip
        half: cython.double = 0.5 * spread
        dt: cython.double
        dw: cython.double
        at: cython.double
        aw: cython.double
        radius_difference: cython.double
        daa: cython.double
        d1: cython.double
        beta: cython.double
        sigma: cython.double
        dcc: cython.double
        across: cython.double
        along: cython.double
        if spread < 0.05:
            return False
        if hip >= 0.0:
            dt = self.inner_ankle_m
            dw = self.outer_ankle_m
            at = inner
            aw = outer
            radius_difference = self.inner_radius_m - self.outer_radius_m
        else:
            dt = self.outer_ankle_m
            dw = self.inner_ankle_m
            at = outer
            aw = inner
            radius_difference = self.outer_radius_m - self.inner_radius_m
        daa = 2.0 * self.leg_m * sin(half)
        along = daa - dw * sin(half + aw)
        if along <= 0.0:
            return False
        d1 = sqrt(dw * dw + daa * daa - 2.0 * dw * daa * sin(half + aw))
        beta = atan(dw * cos(half + aw) / along)
        sigma = half - at + beta
        dcc = sqrt(dt * dt + d1 * d1 - 2.0 * dt * d1 * sin(sigma))
        across = d1 * cos(sigma)
        if across <= 0.0 or radius_difference >= dcc or radius_difference <= -dcc:
            return False
        self.ankle_distance_m = daa
        self.front_foot = atan((dt - d1 * sin(sigma)) / across) - asin(radius_difference / dcc)
        self.front_leg = self.front_foot - at
        self.rear_leg = self.front_leg + spread
        self.rear_foot = self.rear_leg + aw
        return True
