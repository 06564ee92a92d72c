"""What may be hidden in a walk: changes of scenario files, and the names under which it counts as found."""

import dataclasses
from collections.abc import Mapping

Addition = Mapping[str, float]  # {key of a file: what a size of 1 adds}


@dataclasses.dataclass(frozen=True)
class Kind:
    """One kind. right: "cause at place" that counts as right; parameter: the diagnosis's, of which the size is; body,
    controller: what a size of 1 adds; relative: it multiplies by 1 + size instead; term: (form, place, key, value at
    size 0); fault: (places, mode, key, factor); one_sided: sizes above 0 only."""

    name: str
    right: str
    parameter: str
    body: Addition = dataclasses.field(default_factory=dict)
    controller: Addition = dataclasses.field(default_factory=dict)
    relative: bool = False
    term: tuple[str, str, str, float] | None = None
    fault: tuple[tuple[str, ...], str, str, float] | None = None
    scenario: str = ""
    one_sided: bool = False


def _legs() -> list[Kind]:
    found = []
    for leg, board in (("outer", "MCFO"), ("inner", "MCFI")):
        found += [
            Kind(f"{leg} feet higher", f"geometry at {leg}_feet", "foot_height_m", {f"{leg}_ankle_offset_m": 1.0}),
            Kind(f"{leg} leg's moment", f"inertia at {leg}_leg", "moment_kg_m", {f"{leg}_mass_moment_kg_m": 1.0}),
            Kind(f"{leg} leg's centre ahead", f"inertia at {leg}_leg", "offset_kg_m", {f"{leg}_mass_offset_kg_m": 1.0}),
            Kind(f"{leg} leg's inertia", f"inertia at {leg}_leg", "inertia_kg_m2", {f"{leg}_hip_inertia_kg_m2": 1.0}),
            Kind(f"{leg} ankle's friction", f"coulomb_friction at {leg}_ankle", "change_Nm",
                 {f"{leg}_ankle_constant_friction_Nm": 1.0, f"{leg}_ankle_viscous_friction_Nms": 0.08}, one_sided=True),
            Kind(f"{leg} ankle's zero", f"sensor_offset at {leg}_ankle_angle_rad", "offset_rad",
                 term=("sensor_offset", f"{leg}_ankle_absolute", "value", 0.0)),
            Kind(f"{leg} contact late", f"sensor_lag at {leg}_contact", "delay_s",
                 fault=((f"{board}.left_foot", f"{board}.right_foot"), "delay", "delay_ms", 1e3), one_sided=True),
            Kind(f"{leg} cable slips", f"pulley_slip at {leg}_cable", "slip_rad",
                 fault=((f"{board}.cable",), "cable_slip", "angle", 1.0)),
            Kind(f"{leg} cable's backlash", f"cable_backlash at {leg}_cable", "gap_rad",
                 term=("cable_backlash", f"{leg}_cable", "gap_rad", 0.0), one_sided=True),
            Kind(f"{leg} motor's constant", f"torque_constant_temperature at {leg}_motor", "relative",
                 {f"{leg}_ankle_torque_constant_Nm_per_A": 1.0}, relative=True),
            Kind(f"{leg} current's scale", f"sensor_scale at {leg}_ankle_current_A", "change",
                 term=("sensor_scale", f"{leg}_ankle_motor_current", "factor", 1.0)),
        ]  # fmt: skip
    return found


KINDS = (
    *_legs(),
    Kind("soles' radius", "geometry at soles", "radius_m", {"outer_foot_radius_m": 1.0, "inner_foot_radius_m": 1.0}),
    Kind("legs' length", "geometry at legs", "length_m", {"leg_length_m": 1.0}),
    Kind("mass", "inertia at body", "mass_kg", {"total_mass_kg": 1.0}),
    Kind("hip spring", "spring_value at hip_spring", "stiffness_Nm_per_rad", {"hip_spring_Nm_per_rad": 1.0}),
    Kind("cables' stiffness", "spring_value at cables", "stiffness_Nm_per_rad", {"ankle_spring_Nm_per_rad": 1.0}),
    Kind("hip friction", "coulomb_friction at hip_motor", "change_Nm", {"hip_constant_friction_Nm": 1.0},
         one_sided=True),
    Kind("rolling resistance", "contact_loss at feet", "rolling_Nms",
         {"outer_rolling_friction_Nms": 1.0, "inner_rolling_friction_Nms": 1.0}, one_sided=True),
    Kind("slope", "floor at floor", "slope_rad", scenario="slope_rad"),
    Kind("hip angle's zero", "sensor_offset at hip_angle_rad", "offset_rad",
         term=("sensor_offset", "hip_absolute", "value", 0.0)),
    Kind("gyro's scale", "sensor_scale at gyro", "change", term=("sensor_scale", "gyro", "factor", 1.0)),
    Kind("gyro's bias", "sensor_offset at gyro", "offset_rad_s", term=("sensor_offset", "gyro", "value", 0.0)),
    Kind("gyro late", "sensor_lag at gyro", "time_constant_s", term=("sensor_lag", "gyro", "time_constant_s", 0.0),
         one_sided=True),
    Kind("hip motor's constant", "torque_constant_temperature at hip_motor", "relative",
         {"hip_torque_constant_Nm_per_A": 1.0}, relative=True),
    Kind("hip motor's resistance", "resistance_temperature at hip_motor", "change_ohm", {"hip_resistance_ohm": 1.0},
         one_sided=True),
    Kind("hip current's scale", "sensor_scale at hip_current_A", "change",
         term=("sensor_scale", "hip_motor_current", "factor", 1.0)),
    Kind("stance gain", "firmware_parameter at C_F_ST_F_ANG", "relative", controller={"C_F_ST_F_ANG": 1.0},
         relative=True),
    Kind("push-off gain", "firmware_parameter at C_F_PP_F_ANG", "relative", controller={"C_F_PP_F_ANG": 1.0},
         relative=True),
    Kind("CAN 1 late", "clock_drift at can1_delay", "delay_s", fault=(("CSR.can1",), "delay", "late_us", 1e6),
         one_sided=True),
    Kind("CAN 3 late", "clock_drift at can3_delay", "delay_s", fault=(("CSR.can3",), "delay", "late_us", 1e6),
         one_sided=True),
)  # fmt: skip
# Not among the causes with twins: nothing may be named with confidence for them.
FOREIGN = ("compliant floor",)
# What differs between sound robots: standard deviation of a normal draw, by key of a body file.
TOLERANCES = {
    "total_mass_kg": 0.02,
    "outer_mass_moment_kg_m": 0.002,
    "inner_mass_moment_kg_m": 0.002,
    "outer_mass_offset_kg_m": 0.001,
    "inner_mass_offset_kg_m": 0.001,
    "outer_ankle_offset_m": 0.0005,
    "inner_ankle_offset_m": 0.0005,
    "hip_spring_Nm_per_rad": 0.076,
    "ankle_spring_Nm_per_rad": 0.14,
    "outer_ankle_constant_friction_Nm": 0.004,
    "inner_ankle_constant_friction_Nm": 0.004,
    "hip_constant_friction_Nm": 0.007,
}
