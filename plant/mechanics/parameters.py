"""Every number of the body, with unit, limits and source. SI units; angles in rad.

The fields of `BodyParameters` are the one table of them: from it come the limits that are checked, what a file of
plant/bodies may change (plant/body_files.py), and what `ranger-sim body show` prints. Sources are named in brackets:
[A n] appendix section n, [P n], [C n] and [W n] paragraph n of those parts of docs/robot.md, "chosen by us, because
...". Limits are wide and only exclude meaningless values: a mistyped unit or sign. They are chosen by us.
"""

import dataclasses
import math
from typing import Any

from ranger_sim.foundation.user_error import ModelError

# How a foot meets the floor (EQUATIONS 8, 9). "sticking": the strike of the appendix, which holds both feet, by a pull
# if need be; "unilateral": a trailing foot that the strike would pull lets go; "coulomb": no foot ever pulls nor holds
# beyond friction, in a strike and between strikes; "compliant": springs and dampers that only push, and friction that
# grows with the speed, in place of strikes and of sticking.
CONTACTS = ("sticking", "unilateral", "coulomb", "compliant")


def number(default: float, unit: str, low: float, high: float, source: str) -> Any:
    """A field of the table: default value, unit, limits (inclusive), description and source."""
    return dataclasses.field(default=default, metadata={"unit": unit, "limits": (low, high), "source": source})


def choice(default: Any, allowed: tuple, source: str) -> Any:
    """A field of the table that takes one of the `allowed` values."""
    return dataclasses.field(default=default, metadata={"unit": "", "allowed": allowed, "source": source})


@dataclasses.dataclass(frozen=True)
class BodyParameters:
    """The mechanical robot and the floor's friction: the robot as the appendix prints it, in the main.

    UserError of one line that names every value outside its limits.
    """

    # The seven inertial numbers that the motion depends on [A 7.1, eq. 28]: only these can be measured.
    total_mass_kg: float = number(9.91, "kg", 0.1, 1000.0, "weighed [A 1 table; P 3]")
    outer_mass_moment_kg_m: float = number(0.72, "kg m", 0.0, 100.0, "c m, measured [A table 2; P 3]")
    inner_mass_moment_kg_m: float = number(0.72, "kg m", 0.0, 100.0, "as the outer legs'")
    outer_mass_offset_kg_m: float = number(0.0, "kg m", -1.0, 1.0, "w m, centre of mass ahead of the leg [A table 2]")
    inner_mass_offset_kg_m: float = number(0.0, "kg m", -1.0, 1.0, "as the outer legs'")
    outer_hip_inertia_kg_m2: float = number(0.55, "kg m^2", 0.001, 100.0, "about the hip, measured [A table 2; P 3]")
    inner_hip_inertia_kg_m2: float = number(0.55, "kg m^2", 0.001, 100.0, "as the outer legs'")

    leg_length_m: float = number(0.96, "m", 0.05, 10.0, "l, hip to ankle [A table 2; P 3]")
    outer_foot_radius_m: float = number(0.2, "m", 0.0, 5.0, "r, of the sole's arc [A table 2]")
    inner_foot_radius_m: float = number(0.2, "m", 0.0, 5.0, "as the outer feet's [A table 2]")
    outer_ankle_offset_m: float = number(0.11, "m", 0.0, 5.0, "d, ankle to the arc's centre [A table 2; P 1.13]")
    inner_ankle_offset_m: float = number(0.11, "m", 0.0, 5.0, "as the outer feet's [A table 2; P 1.13]")
    foot_inertia_kg_m2: float = number(0.002, "kg m^2", 0.0, 1.0, "about the ankle [C 5.2]; 0: massless feet [A 5]")
    gravity_m_per_s2: float = number(9.81, "m/s^2", 0.0, 100.0, "[A 1.1.1]")
    slope_rad: float = number(0.0, "rad", -0.5, 0.5, "gamma, positive downhill [A 1.1.1]; a scenario has its own")

    hip_spring_Nm_per_rad: float = number(7.6, "N m/rad", 0.0, 1000.0, "k_h [A table 2]")
    ankle_spring_Nm_per_rad: float = number(14.0, "N m/rad", 0.0, 1000.0, "k_s, of the cable [A table 2]")
    # Eq. 1 of the appendix instead of the linear spring. The appendix gives no a, b, l0: chosen by us so that the
    # small-angle stiffness is k_h exactly; arms of a spring from the box (0.15 m below the hip) to the lower leg
    # (0.85 m), pre-stretched to l0 = 0.6 of its length with parallel legs, which makes it as nearly linear as fig. 6c.
    exact_hip_spring: bool = choice(False, (False, True), "eq. 1 of the appendix in place of the linear spring [A 1]")
    hip_spring_arm_a_m: float = number(0.15, "m", 0.001, 10.0, "chosen by us, because the appendix gives none")
    hip_spring_arm_b_m: float = number(0.85, "m", 0.001, 10.0, "chosen by us, because the appendix gives none")
    hip_spring_rest_length_m: float = number(0.42, "m", 0.0, 10.0, "chosen by us, because the appendix gives none")
    # The springs that keep the cable tight, at the foot and at the motor [A 2.2], as one at the joint (EQUATIONS 2.7).
    ankle_return_Nm_per_rad: float = number(0.0, "N m/rad", 0.0, 100.0, "0: left out, as in the appendix's equations")
    ankle_return_rest_rad: float = number(1.68, "rad", -10.0, 10.0, "joint angle where they rest: sweet spot [C 1.1]")

    motor_inertia_kg_m2: float = number(1.6e-6, "kg m^2", 1e-9, 0.1, "J_m at the rotor [P 3: 0.002 is reflected]")
    hip_gear: float = number(66.0, "1", 0.01, 1e4, "G_H [A 1.1.2]")
    ankle_gear: float = number(34.0, "1", 0.01, 1e4, "G_A [P 3: 43:1 gearhead times the pulleys]")
    hip_rotor: bool = choice(True, (False, True), "G_H^2 J_m in the hip's row [P 1.9]")

    outer_rolling_friction_Nms: float = number(0.05, "N m s/rad", 0.0, 10.0, "C_FW [A 1.1.1; P 3 for the unit]")
    inner_rolling_friction_Nms: float = number(0.05, "N m s/rad", 0.0, 10.0, "as the outer feet's")

    # Ends of the arc seen from the sweet spot [P 1: -0.2 ... +0.9 works; W 1: a heel end of -0.1 adds 14 mm clearance]
    # Heel -0.1, 20 mm behind the sweet spot, because the sweet spot "is near the heel" [A 2.4]; with -0.2 the heel of
    # the flipping foot brushes the floor and half of the record machines' starts end within five steps.
    arc_heel_rad: float = number(-0.1, "rad", -3.1, -0.001, "heel end seen from the sweet spot, near it [A 2.4; W 1]")
    arc_toe_rad: float = number(0.9, "rad", 0.001, 3.1, "toe end seen from the sweet spot [P 1]")

    ankle_zero_rad: float = number(1.68, "rad", -10.0, 10.0, "joint angle, sweet spot below an upright leg [C 1.1]")
    ankle_stop_low_rad: float = number(0.0, "rad", -10.0, 10.0, "joint angle of the foot flipped up [C 1.1]")
    ankle_stop_high_rad: float = number(3.2, "rad", -10.0, 10.0, "joint angle of the foot pushed down [C 1.1]")
    # The stop holds a spring-loaded contact [A fig. 4]. Chosen by us, because no source gives it: 400 Nm/rad bends
    # 10 mrad under the gearhead's 4 N m, and 0.9 N m s/rad is half of critical damping for foot and motor together.
    ankle_stop_Nm_per_rad: float = number(400.0, "N m/rad", 0.0, 1e5, "chosen by us: 10 mrad under 4 N m")
    ankle_stop_Nms_per_rad: float = number(0.9, "N m s/rad", 0.0, 1e3, "chosen by us: half of critical damping")

    # How a foot meets the floor; the part shared by both feet.
    contact: str = choice("sticking", CONTACTS, "the appendix's strike holds both feet [A 5; P 1]")
    # Where the swing foot touches the floor next to or behind the stance foot it brushes with its sole. Chosen by us:
    # 20 kN/m gives 5 mm under the robot's weight, as a rubber-faced foot cut as a spring does; damping a fifth of
    # critical for a leg's 5 kg; friction as below, smoothed at 50 mm/s.
    sole_N_per_m: float = number(2.0e4, "N/m", 0.0, 1e7, "of a brushing sole; chosen by us: 5 mm under the weight")
    sole_Ns_per_m: float = number(130.0, "N s/m", 0.0, 1e5, "chosen by us: a fifth of critical damping of a leg")
    sole_sliding_smoothing_m_s: float = number(0.05, "m/s", 1e-6, 10.0, "of a brushing sole's friction; chosen by us")
    # Contact "compliant" (Hunt and Crossley 1975). Chosen by us: 1 mm under the weight; dissipation that leaves a
    # strike of 0.2 m/s hardly a rebound; friction that reaches a foot's demand at a creep of some mm/s.
    floor_N_per_m: float = number(1e5, "N/m", 1e3, 1e6, "of a compliant floor and sole; chosen by us: 1 mm deep")
    floor_dissipation_s_per_m: float = number(6.0, "s/m", 0.0, 100.0, "chosen by us: no rebound")
    floor_sliding_smoothing_m_s: float = number(0.01, "m/s", 1e-3, 1.0, "of its friction; chosen by us")
    # Ahead by more than this a touch is a strike and sticks. Chosen by us: a seventh of a step.
    strike_ahead_m: float = number(0.05, "m", 0.0, 1.0, "a touch so far ahead is a strike; chosen by us: 1/7 of a step")

    # Smoothing of sgn(rate) in friction: tanh(rate / epsilon) [A eq. 43 uses 0.01; P 5: 0.05 suits steps of 0.1 ms].
    friction_smoothing_rad_s: float = number(0.05, "rad/s", 1e-6, 10.0, "epsilon of eq. 43 [P 5; the appendix: 0.01]")
    floor_friction: float = number(0.9, "1", 0.0, 10.0, "mu of the sole; chosen by us: rubber on an indoor track")

    def __post_init__(self) -> None:
        wrong = list(faults(self))
        if wrong:
            raise ModelError("body: " + "; ".join(wrong))

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


def fault_of(field: Any, value: Any) -> str | None:
    """Fault of `value` in this field of the table: name, value, limit; None when it is valid."""
    allowed = field.metadata.get("allowed")
    if allowed is not None:
        if value not in allowed or isinstance(value, bool) != isinstance(allowed[0], bool):
            return f"{field.name} is {value!r}, allowed are {' and '.join(map(repr, allowed))}"
        return None
    low, high = field.metadata["limits"]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return f"{field.name} is {value!r}, it must be a finite number"
    if not low <= value <= high:
        unit = field.metadata["unit"]
        return f"{field.name} is {value!r}, allowed are {low:g} to {high:g}{' ' + unit if unit != '1' else ''}"
    return None


def faults(p: BodyParameters) -> Any:
    """All faults of these parameters, one text each."""
    single = [fault for field in dataclasses.fields(p) if (fault := fault_of(field, getattr(p, field.name)))]
    yield from single
    if single:
        return
    if p.exact_hip_spring and p.hip_spring_arm_a_m == p.hip_spring_arm_b_m:
        yield "the arms a and b of the hip spring are equal, eq. 2 then has no finite stiffness"
    if p.ankle_stop_low_rad >= p.ankle_stop_high_rad:
        yield f"ankle_stop_low_rad {p.ankle_stop_low_rad!r} is not below ankle_stop_high_rad {p.ankle_stop_high_rad!r}"


def hip_spring_torque_Nm(parameters: BodyParameters, angle_rad: float) -> float:
    """Restoring torque of the hip spring, eq. 1 (or k_h theta, eq. 2) of the appendix."""
    p = parameters
    if not p.exact_hip_spring:
        return p.hip_spring_Nm_per_rad * angle_rad
    a, b, l0 = p.hip_spring_arm_a_m, p.hip_spring_arm_b_m, p.hip_spring_rest_length_m
    length = math.sqrt(a * a + b * b - 2.0 * a * b * math.cos(angle_rad))
    return 2.0 * p.hip_spring_rate_N_per_m * a * b * (1.0 - l0 / length) * math.sin(angle_rad)
