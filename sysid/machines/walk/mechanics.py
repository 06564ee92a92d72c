"""Residuals of the walking body's equations: balances of torques and closures, for numbers of body and sensors.

Letters and signs are those of plant/EQUATIONS.md: th a leg's lean, F = th + a - a_zero a foot's angle, h = th_outer -
th_inner, all positive forward. A residual is a function of all numbers (`Numbers`); the column of a wrong one is its
derivative, by differences. `s` is the stance leg, `w` the swing leg.
"""

import dataclasses

import numpy as np

from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.dataset import Array

LEGS = ("outer", "inner")


@dataclasses.dataclass(frozen=True)
class Numbers:
    """Numbers that may be wrong, at their assumed values. Sensor errors are 0 and scales 1 when all is well.

    More than 40 fields, because each is one number that a cause of the catalogue changes.
    """

    total_mass_kg: float
    mass_moment_outer_kg_m: float
    mass_moment_inner_kg_m: float
    mass_offset_outer_kg_m: float
    mass_offset_inner_kg_m: float
    hip_inertia_outer_kg_m2: float
    hip_inertia_inner_kg_m2: float
    leg_length_m: float
    foot_radius_outer_m: float
    foot_radius_inner_m: float
    ankle_offset_outer_m: float
    ankle_offset_inner_m: float
    foot_inertia_kg_m2: float
    hip_spring_Nm_per_rad: float
    cable_outer_Nm_per_rad: float
    cable_inner_Nm_per_rad: float
    ankle_return_Nm_per_rad: float
    ankle_return_rest_rad: float  # from the sweet spot, as all ankle angles here
    rolling_outer_Nms: float
    rolling_inner_Nms: float
    hip_rotor_kg_m2: float
    gravity_m_per_s2: float
    arc_heel_rad: float
    arc_toe_rad: float
    slope_rad: float = 0.0
    hip_spring_cubic_Nm_per_rad3: float = 0.0
    hip_zero_rad: float = 0.0
    hip_scale: float = 1.0
    hip_lag_s: float = 0.0
    leg_zero_rad: float = 0.0
    leg_scale: float = 1.0
    leg_lag_s: float = 0.0
    leg_lag_drift_s: float = 0.0  # increase of the lag at the recording's end, and decrease at its start
    ankle_zero_outer_rad: float = 0.0
    ankle_zero_inner_rad: float = 0.0
    motor_lag_outer_s: float = 0.0
    motor_lag_inner_s: float = 0.0
    motor_zero_outer_rad: float = 0.0
    motor_zero_inner_rad: float = 0.0

    @classmethod
    def of(cls, p: BodyParameters) -> "Numbers":
        """Those of a body of plant/bodies."""
        return cls(
            p.total_mass_kg,
            p.outer_mass_moment_kg_m,
            p.inner_mass_moment_kg_m,
            p.outer_mass_offset_kg_m,
            p.inner_mass_offset_kg_m,
            p.outer_hip_inertia_kg_m2,
            p.inner_hip_inertia_kg_m2,
            p.leg_length_m,
            p.outer_foot_radius_m,
            p.inner_foot_radius_m,
            p.outer_ankle_offset_m,
            p.inner_ankle_offset_m,
            p.foot_inertia_kg_m2,
            p.hip_spring_Nm_per_rad,
            p.ankle_spring_Nm_per_rad,
            p.ankle_spring_Nm_per_rad,
            p.ankle_return_Nm_per_rad,
            p.ankle_return_rest_rad - p.ankle_zero_rad,
            p.outer_rolling_friction_Nms,
            p.inner_rolling_friction_Nms,
            p.hip_rotor_inertia_kg_m2,
            p.gravity_m_per_s2,
            p.arc_heel_rad,
            p.arc_toe_rad,
        )


Course = tuple[Array, Array, Array, Array]  # a quantity (n,), its rate, its acceleration, and the acceleration's rate


@dataclasses.dataclass
class Motion:
    """Measured courses: hip, outer leg, each ankle joint and ankle motor (less the zero of the sweet spot); None: no
    such channel. along: the recording, from -1 at its start to 1 at its end."""

    hip: Course
    leg: Course
    ankle: tuple[Course | None, Course | None]
    motor: tuple[Course | None, Course | None]
    along: Array

    def part(self, rows: Array) -> "Motion":
        """Some rows of it."""

        def cut(course: Course | None) -> Course | None:
            return None if course is None else sure(course)

        def sure(course: Course) -> Course:
            return (course[0][rows], course[1][rows], course[2][rows], course[3][rows])

        ankle, motor = (cut(self.ankle[0]), cut(self.ankle[1])), (cut(self.motor[0]), cut(self.motor[1]))
        return Motion(sure(self.hip), sure(self.leg), ankle, motor, self.along[rows])


@dataclasses.dataclass
class _Pose:
    """Both legs' motion by the numbers: leaning angle and foot angle with rates, torque of each ankle."""

    th: list[Course]
    F: list[Course | None]
    torque: list[Array | None]  # on the foot, by cable and return spring
    hip: Course


def _corrected(course: Course, scale: float, zero: float, lag_s: Array | float) -> Course:
    """The true reading of a sensor that shows scale x quantity + zero, lag_s late."""
    x, v, a, j = course
    return ((x - zero) / scale + lag_s * v, v / scale + lag_s * a, a / scale + lag_s * j, j)


def _pose(n: Numbers, m: Motion) -> _Pose:
    hip = _corrected(m.hip, n.hip_scale, n.hip_zero_rad, n.hip_lag_s)
    outer = _corrected(m.leg, n.leg_scale, n.leg_zero_rad, n.leg_lag_s + n.leg_lag_drift_s * m.along)
    th = [outer, (outer[0] - hip[0], outer[1] - hip[1], outer[2] - hip[2], outer[3] - hip[3])]
    feet: list[Course | None] = []
    torques: list[Array | None] = []
    for leg, name in enumerate(LEGS):
        ankle, motor = m.ankle[leg], m.motor[leg]
        if ankle is None:
            feet.append(None)
            torques.append(None)
            continue
        joint, lean = ankle[0] - getattr(n, f"ankle_zero_{name}_rad"), th[leg]
        feet.append((lean[0] + joint, lean[1] + ankle[1], lean[2] + ankle[2], lean[3] + ankle[3]))
        if motor is None:
            torques.append(None)
            continue
        turned = motor[0] + getattr(n, f"motor_lag_{name}_s") * motor[1]
        stretch = turned - getattr(n, f"motor_zero_{name}_rad") - joint
        rest = n.ankle_return_rest_rad
        cable = getattr(n, f"cable_{name}_Nm_per_rad")
        torques.append(cable * stretch - n.ankle_return_Nm_per_rad * (joint - rest))
    return _Pose(th, feet, torques, hip)


def _arc(n: Numbers, F: Array) -> Array:
    """Angle of a foot beyond an end of its arc (EQUATIONS 4)."""
    return np.where(F > n.arc_toe_rad, F - n.arc_toe_rad, np.where(F < n.arc_heel_rad, F - n.arc_heel_rad, 0.0))


def _first_moments(n: Numbers, leg: int, th: Array) -> tuple[Array, Array]:
    """(A, B) of EQUATIONS 5.1."""
    mc, mw = getattr(n, f"mass_moment_{LEGS[leg]}_kg_m"), getattr(n, f"mass_offset_{LEGS[leg]}_kg_m")
    return mc * np.cos(th) + mw * np.sin(th), mc * np.sin(th) - mw * np.cos(th)


def height_difference(n: Numbers, m: Motion) -> Array:
    """Outer sole's lowest point above the inner's, 0 while both are on the floor; angles are against its normal."""
    pose = _pose(n, m)
    heights = []
    for leg, name in enumerate(LEGS):
        foot = pose.F[leg]
        assert foot is not None
        th, F = pose.th[leg][0], foot[0]
        radius, offset = getattr(n, f"foot_radius_{name}_m"), getattr(n, f"ankle_offset_{name}_m")
        sigma = _arc(n, F)
        heights.append(radius * np.cos(sigma) - offset * np.cos(F) + n.leg_length_m * np.cos(th))
    return heights[1] - heights[0]


@dataclasses.dataclass
class Left:
    """Residuals in single stance on one leg, all (n,), N m; None where channels are missing.

    floor: moments about the contact point; legs: of both legs about the stance ankle; hip_torque: required of the hip's
    motor, on h.
    """

    floor: Array | None
    legs: Array | None
    hip_torque: Array


def stance(n: Numbers, m: Motion, s: int) -> Left:
    """Balances with stance leg `s` and the other swinging (EQUATIONS 4, 5, 9.1), for all rows as if in this stance."""
    w = 1 - s
    pose = _pose(n, m)
    foot = pose.F[s]
    assert foot is not None
    name = LEGS[s]
    radius, d, length = getattr(n, f"foot_radius_{name}_m"), getattr(n, f"ankle_offset_{name}_m"), n.leg_length_m
    (th, dth, ddth, _), (F, dF, ddF, _), (tw, dtw, ddtw, _) = pose.th[s], foot, pose.th[w]
    sigma = _arc(n, F)
    e, f = radius * np.cos(sigma) - d * np.cos(F), d * np.sin(F) - radius * np.sin(sigma)
    bent = d * np.cos(F) - np.where(sigma != 0.0, radius * np.cos(sigma), 0.0)
    sine, cosine = length * np.sin(th), length * np.cos(th)
    g = n.gravity_m_per_s2
    # of the hip, less gravity, whose axes are the floor's
    ax = e * ddF + cosine * ddth + f * dF**2 - sine * dth**2 - g * np.sin(n.slope_rad)
    ay = f * ddF - sine * ddth + bent * dF**2 - cosine * dth**2 + g * np.cos(n.slope_rad)
    A, B = _first_moments(n, s, th)
    A_w, B_w = _first_moments(n, w, tw)
    Fx = n.total_mass_kg * ax - A * ddth - A_w * ddtw + B * dth**2 + B_w * dtw**2
    Fy = n.total_mass_kg * ay + B * ddth + B_w * ddtw + A * dth**2 + A_w * dtw**2
    inertia = getattr(n, f"hip_inertia_{name}_kg_m2") * ddth - A * ax + B * ay
    swinging = getattr(n, f"hip_inertia_{LEGS[w]}_kg_m2") * ddtw - A_w * ax + B_w * ay
    in_air = pose.F[w]  # only its foot's inertia acts on the leg
    reaction = n.foot_inertia_kg_m2 * in_air[2] if in_air is not None else np.zeros_like(th)
    torque = pose.torque[s]
    floor = legs = None
    if torque is not None:
        floor = torque - getattr(n, f"rolling_{name}_Nms") * dF - e * Fx - f * Fy - n.foot_inertia_kg_m2 * ddF
        legs = inertia + swinging + torque + reaction + cosine * Fx - sine * Fy
    sign = 1.0 if w == 0 else -1.0
    x = pose.hip[0]
    spring = n.hip_spring_Nm_per_rad * x + n.hip_spring_cubic_Nm_per_rad3 * x**3
    hip = sign * (swinging + reaction) + n.hip_rotor_kg_m2 * pose.hip[2] + spring
    return Left(floor, legs, hip)


def swing_foot(n: Numbers, m: Motion, leg: int) -> Array:
    """Foot in the air: its inertia against cable and return spring, N m, (n,)."""
    pose = _pose(n, m)
    foot, torque = pose.F[leg], pose.torque[leg]
    assert foot is not None and torque is not None
    return n.foot_inertia_kg_m2 * foot[2] - torque


def cable_torque(n: Numbers, m: Motion, leg: int) -> Array:
    """Pull of an ankle's cable, N m, (n,)."""
    ankle, motor = m.ankle[leg], m.motor[leg]
    assert ankle is not None and motor is not None
    return getattr(n, f"cable_{LEGS[leg]}_Nm_per_rad") * (motor[0] - ankle[0])
