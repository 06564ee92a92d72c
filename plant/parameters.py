"""Every number of the body, with its source. SI units; angles in rad.

Sources are named in brackets at each field: [A n] appendix section n, [P n], [C n] and [W n] paragraph n of
those parts of docs/robot.md, "chosen by us, because ...".
"""

import dataclasses
import math

from ranger_sim.foundation.user_error import UserError


@dataclasses.dataclass(frozen=True)
class BodyParameters:
    """The mechanical robot and the floor's friction. Legs: index 0 outer, 1 inner."""

    # The seven inertial numbers that the motion depends on [A 7.1, eq. 28]: only these can be measured.
    total_mass_kg: float = 9.91  # [A 1 table, weighed; P 3]
    outer_mass_moment_kg_m: float = 0.72  # c m [A table 2; P 3: measured]
    inner_mass_moment_kg_m: float = 0.72
    outer_mass_offset_kg_m: float = 0.0  # w m, centre of mass ahead of the leg's line [A table 2]
    inner_mass_offset_kg_m: float = 0.0
    outer_hip_inertia_kg_m2: float = 0.55  # about the hip hinge [A table 2; P 3: measured]
    inner_hip_inertia_kg_m2: float = 0.55

    leg_length_m: float = 0.96  # l, hip to ankle [A table 2; P 3]
    foot_radius_m: float = 0.2  # r [A table 2]
    ankle_offset_m: float = 0.11  # d, ankle to the centre of the arc [A table 2]
    foot_inertia_kg_m2: float = 0.002  # about the ankle [C 5.2 RangerSimulation; W 1: it helps most]; 0: massless [A 5]
    gravity_m_per_s2: float = 9.81  # [A 1.1.1]
    slope_rad: float = 0.0  # gamma, positive downhill [A 1.1.1]

    hip_spring_Nm_per_rad: float = 7.6  # k_h [A table 2]
    ankle_spring_Nm_per_rad: float = 14.0  # k_s, cable [A table 2]
    # Eq. 1 of the appendix instead of the linear spring. The appendix gives no a, b, l0: chosen by us so that the
    # small-angle stiffness is k_h exactly; arms of a spring from the box (0.15 m below the hip) to the lower leg
    # (0.85 m), pre-stretched to l0 = 0.6 of its length with parallel legs, which makes it as nearly linear as fig. 6c.
    exact_hip_spring: bool = False
    hip_spring_arm_a_m: float = 0.15
    hip_spring_arm_b_m: float = 0.85
    hip_spring_rest_length_m: float = 0.42

    motor_inertia_kg_m2: float = 1.6e-6  # J_m at the rotor [P 3: 0.002 of the appendix is the reflected value]
    hip_gear: float = 66.0  # G_H [A 1.1.2]
    ankle_gear: float = 34.0  # G_A [P 3: 43:1 gearhead times the pulleys]
    hip_rotor: bool = True  # G_H^2 J_m in the hip's row [P 1.9]

    outer_rolling_friction_Nms: float = 0.05  # C_FW [A 1.1.1; P 3 for the unit]
    inner_rolling_friction_Nms: float = 0.05

    # Ends of the arc seen from the sweet spot [P 1: -0.2 ... +0.9 works; W 1: a heel end of -0.1 adds 14 mm clearance]
    # Heel -0.1, 20 mm behind the sweet spot, because the sweet spot "is near the heel" [A 2.4]; with -0.2 the heel of
    # the flipping foot brushes the floor and half of the record machines' starts end within five steps.
    arc_heel_rad: float = -0.1
    arc_toe_rad: float = 0.9

    # Ankle stops: joint angle a = 0 and 3.2 [C 1.1], a is 1.68 with the sweet spot below an upright leg.
    ankle_zero_rad: float = 1.68
    ankle_stop_low_rad: float = 0.0
    ankle_stop_high_rad: float = 3.2
    # The stop holds a spring-loaded contact [A fig. 4]. Chosen by us, because no source gives it: 400 Nm/rad bends
    # 10 mrad under the gearhead's 4 N m, and 0.9 N m s/rad is half of critical damping for foot and motor together.
    ankle_stop_Nm_per_rad: float = 400.0
    ankle_stop_Nms_per_rad: float = 0.9

    # Where the swing foot touches the floor beside or behind the stance foot it brushes with its sole. Chosen by us:
    # 20 kN/m gives 5 mm under the robot's weight, as a rubber-faced foot cut as a spring does; damping a fifth of
    # critical for a leg's 5 kg; friction as below, smoothed at 50 mm/s.
    sole_N_per_m: float = 2.0e4
    sole_Ns_per_m: float = 130.0
    sole_sliding_smoothing_m_s: float = 0.05
    # Ahead by more than this a touch is a strike and sticks. Chosen by us: a seventh of a step.
    strike_ahead_m: float = 0.05

    # Smoothing of sgn(rate) in friction: tanh(rate / epsilon) [A eq. 43 uses 0.01; P 5: 0.05 suits steps of 0.1 ms].
    friction_smoothing_rad_s: float = 0.05

    # A foot is reported as slipping when |F_x| > mu F_y. Chosen by us: rubber on an indoor track holds about 0.9.
    floor_friction: float = 0.9

    def __post_init__(self) -> None:
        positive = (
            "total_mass_kg",
            "outer_hip_inertia_kg_m2",
            "inner_hip_inertia_kg_m2",
            "leg_length_m",
            "motor_inertia_kg_m2",
            "hip_gear",
            "ankle_gear",
            "friction_smoothing_rad_s",
            "sole_sliding_smoothing_m_s",
        )
        not_negative = (
            "foot_radius_m",
            "ankle_offset_m",
            "foot_inertia_kg_m2",
            "gravity_m_per_s2",
            "hip_spring_Nm_per_rad",
            "ankle_spring_Nm_per_rad",
            "outer_rolling_friction_Nms",
            "inner_rolling_friction_Nms",
            "ankle_stop_Nm_per_rad",
            "ankle_stop_Nms_per_rad",
            "floor_friction",
            "sole_N_per_m",
            "sole_Ns_per_m",
            "strike_ahead_m",
        )
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not math.isfinite(value):
                raise UserError(f"body: {field.name} is {value!r}, it must be a finite number")
        for name in positive:
            if getattr(self, name) <= 0.0:
                raise UserError(f"body: {name} is {getattr(self, name)!r}, it must be above 0")
        for name in not_negative:
            if getattr(self, name) < 0.0:
                raise UserError(f"body: {name} is {getattr(self, name)!r}, it must not be negative")
        if not self.arc_heel_rad < 0.0 < self.arc_toe_rad:
            raise UserError(
                f"body: the foot's arc runs from {self.arc_heel_rad!r} to {self.arc_toe_rad!r} rad, "
                "it must lie on both sides of the sweet spot (0)"
            )
        if abs(self.slope_rad) > 0.5:
            raise UserError(f"body: slope_rad is {self.slope_rad!r}, allowed are -0.5 to 0.5 rad")
        if self.exact_hip_spring and self.hip_spring_arm_a_m == self.hip_spring_arm_b_m:
            raise UserError("body: the arms a and b of the hip spring are equal, eq. 2 then has no finite stiffness")

    @property
    def hip_rotor_inertia_kg_m2(self) -> float:
        """G_H^2 J_m seen at the joint: 0.00697 kg m^2 with the defaults."""
        return self.hip_gear * self.hip_gear * self.motor_inertia_kg_m2 if self.hip_rotor else 0.0

    @property
    def ankle_rotor_inertia_kg_m2(self) -> float:
        """G_A^2 J_m seen at the gearbox output: 0.00185 kg m^2 with the defaults."""
        return self.ankle_gear * self.ankle_gear * self.motor_inertia_kg_m2

    @property
    def hip_spring_rate_N_per_m(self) -> float:
        """k of eq. 1 for which eq. 2 gives k_h."""
        a, b, l0 = self.hip_spring_arm_a_m, self.hip_spring_arm_b_m, self.hip_spring_rest_length_m
        return self.hip_spring_Nm_per_rad / (2.0 * a * b * (1.0 - l0 / abs(b - a)))


def hip_spring_torque_Nm(parameters: BodyParameters, angle_rad: float) -> float:
    """Restoring torque of the hip spring, eq. 1 (or k_h theta, eq. 2) of the appendix."""
    p = parameters
    if not p.exact_hip_spring:
        return p.hip_spring_Nm_per_rad * angle_rad
    a, b, l0 = p.hip_spring_arm_a_m, p.hip_spring_arm_b_m, p.hip_spring_rest_length_m
    length = math.sqrt(a * a + b * b - 2.0 * a * b * math.cos(angle_rad))
    return 2.0 * p.hip_spring_rate_N_per_m * a * b * (1.0 - l0 / length) * math.sin(angle_rad)
