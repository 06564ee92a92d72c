"""What a twin may have: one cause of the catalogue each, as changes of body, model terms, faults, floor or firmware.

Sizes are changes in the unit of the parameter's name. They are far above what shows and below the fall; chosen by us.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

Values = Mapping[str, float]
# What a sound robot's boards do to their motor angles: 20 % (outer) and 5 % (inner) of the cable's stretch is taken for
# an error of the motor's encoder when the task meets the foot's turning point near its upper stop, where the ankle has
# no rate for a moment while the motor already pulls. Seen: -11.9 and -5.4 mrad outside, -4.9 inside; reserves chosen by
# us.
OUTER_JUMP_RAD, INNER_JUMP_RAD = -0.015, -0.006


@dataclasses.dataclass(frozen=True)
class Change:
    """What differs from the sound scenario. body, controller: parameters by name; terms: of a model file; faults:
    (place, mode, parameters), from the first step on; scenario: fields of `Scenario`."""

    body: Mapping[str, float] = dataclasses.field(default_factory=dict)
    controller: Mapping[str, float] = dataclasses.field(default_factory=dict)
    terms: tuple[Mapping[str, Any], ...] = ()
    faults: tuple[tuple[str, str, Mapping[str, float]], ...] = ()
    scenario: Mapping[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Twin:
    """One cause. change: makes it of a size, given the sound body's and controller's values; one_sided: sizes above 0
    alone; tolerance: standard deviation among sound robots, in the same unit, 0 where it is small against what
    shows; sound: the farthest size that a sound robot reaches by itself now and then."""

    cause: str
    at: str
    parameter: str
    sizes: tuple[float, ...]
    change: Callable[[float, Values], Change]
    tolerance: float = 0.0
    form: str = ""
    seeds: float = 0.0  # of its walks, a multiple of the usual number; 0: as its sizes ask for
    sound: float = 0.0

    @property
    def key(self) -> str:
        """A name without blanks."""
        return f"{self.cause}@{self.at}@{self.parameter}"


def both(small: float, large: float) -> tuple[float, ...]:
    """Sizes of either sign."""
    return -large, -small, small, large


def of_body(*names: str, weights: tuple[float, ...] = ()) -> Callable[[float, Values], Change]:
    """Adds the size to numbers of the body."""
    factors = weights or (1.0,) * len(names)

    def change(size: float, values: Values) -> Change:
        return Change(body={name: values[name] + factor * size for name, factor in zip(names, factors, strict=True)})

    return change


def of_friction(leg: str) -> Callable[[float, Values], Change]:
    """Constant friction of an ankle changes by the size, viscous friction in proportion."""
    constant, viscous = f"{leg}_ankle_constant_friction_Nm", f"{leg}_ankle_viscous_friction_Nms"

    def change(size: float, values: Values) -> Change:
        share = 1.0 + size / values[constant]
        return Change(body={constant: values[constant] * share, viscous: values[viscous] * share})

    return change


def of_term(form: str, at: str, parameter: str, one: float = 0.0) -> Callable[[float, Values], Change]:
    """A term of a model file with the size, added to `one`."""
    return lambda size, _: Change(terms=({"form": form, "at": at, parameter: one + size},))


def of_faults(mode: str, parameter: str, factor: float, *places: str) -> Callable[[float, Values], Change]:
    """Faults from the first step on; factor: of the size in the fault's unit."""
    return lambda size, _: Change(faults=tuple((place, mode, {parameter: factor * size}) for place in places))


def of_gains(*names: str) -> Callable[[float, Values], Change]:
    """Multiplies parameters of the controller by one plus the size."""
    return lambda size, values: Change(controller={name: values[name] * (1.0 + size) for name in names})


def of_targets(*names: str) -> Callable[[float, Values], Change]:
    """Adds the size to parameters of the controller."""
    return lambda size, values: Change(controller={name: values[name] + size for name in names})


def of_slope(size: float, _: Values) -> Change:
    """A floor that slopes."""
    return Change(scenario={"slope_rad": size})


def _legs() -> list[Twin]:
    found = []
    for leg, board, jump_rad in (("outer", "MCFO", OUTER_JUMP_RAD), ("inner", "MCFI", INNER_JUMP_RAD)):
        found += [
            Twin("geometry", f"{leg}_feet", "foot_height_m", both(0.0015, 0.003), of_body(f"{leg}_ankle_offset_m"),
                 0.0005),
            Twin("inertia", f"{leg}_leg", "moment_kg_m", both(0.02, 0.04), of_body(f"{leg}_mass_moment_kg_m"), 0.002),
            Twin("inertia", f"{leg}_leg", "offset_kg_m", both(0.012, 0.024), of_body(f"{leg}_mass_offset_kg_m"), 0.001),
            Twin("inertia", f"{leg}_leg", "inertia_kg_m2", both(0.015, 0.03), of_body(f"{leg}_hip_inertia_kg_m2"),
                 0.003),
            Twin("coulomb_friction", f"{leg}_ankle", "change_Nm", (-0.03, 0.05, 0.1), of_friction(leg), 0.004),
            Twin("sensor_offset", f"{leg}_ankle_angle_rad", "offset_rad", both(0.008, 0.016),
                 of_term("sensor_offset", f"{leg}_ankle_absolute", "value"), 0.001),
            Twin("sensor_lag", f"{leg}_contact", "delay_s", (0.006, 0.012),
                 of_faults("delay", "delay_ms", 1e3, f"{board}.left_foot", f"{board}.right_foot")),
            Twin("pulley_slip", f"{leg}_cable", "slip_rad", both(0.025, 0.05),
                 of_faults("cable_slip", "angle", 1.0, f"{board}.cable"), sound=jump_rad),
            Twin("cable_backlash", f"{leg}_cable", "gap_rad", (0.012, 0.024),
                 of_term("cable_backlash", f"{leg}_cable", "gap_rad"), form="cable_backlash"),
            Twin("torque_constant_temperature", f"{leg}_motor", "relative", both(0.05, 0.1),
                 of_term("torque_constant_change", f"{leg}_motor", "factor", 1.0), 0.005, "torque_constant_change"),
            Twin("sensor_scale", f"{leg}_ankle_current_A", "change", both(0.05, 0.1),
                 of_term("sensor_scale", f"{leg}_ankle_motor_current", "factor", 1.0), 0.005),
            Twin("firmware_parameter", f"P_F{leg[0].upper()}_PP_THEIGHT", "change_m", both(0.002, 0.004),
                 of_targets(f"P_F{leg[0].upper()}_PP_THEIGHT")),
        ]  # fmt: skip
    return found


TWINS: tuple[Twin, ...] = (
    *_legs(),
    Twin("geometry", "feet", "foot_height_m", both(0.003, 0.006), of_body("outer_ankle_offset_m",
         "inner_ankle_offset_m")),
    Twin("geometry", "soles", "radius_m", both(0.005, 0.01), of_body("outer_foot_radius_m", "inner_foot_radius_m"),
         0.0005),
    Twin("geometry", "legs", "length_m", both(0.006, 0.012), of_body("leg_length_m"), 0.001),
    Twin("inertia", "body", "mass_kg", both(0.2, 0.4), of_body("total_mass_kg"), 0.02),
    Twin("spring_value", "hip_spring", "stiffness_Nm_per_rad", both(0.5, 1.1), of_body("hip_spring_Nm_per_rad"), 0.076),
    Twin("spring_value", "cables", "stiffness_Nm_per_rad", both(0.8, 1.8), of_body("ankle_spring_Nm_per_rad"), 0.14),
    Twin("spring_value", "ankle_return", "stiffness_Nm_per_rad", both(0.03, 0.06),
         of_body("ankle_return_Nm_per_rad"), 0.0026),
    Twin("hip_spring_bend", "hip_spring", "cubic_Nm_per_rad3", both(3.0, 6.0),
         of_term("spring", "hip_joint", "cubic_Nm_per_rad3"), form="spring"),
    Twin("coulomb_friction", "hip_motor", "change_Nm", (-0.08, 0.1, 0.2), of_body("hip_constant_friction_Nm"), 0.01),
    Twin("contact_loss", "feet", "rolling_Nms", (-0.04, 0.05, 0.1),
         of_body("outer_rolling_friction_Nms", "inner_rolling_friction_Nms"), 0.004),
    Twin("floor", "floor", "slope_rad", both(0.004, 0.008), of_slope, 0.0002),
    Twin("sensor_offset", "hip_angle_rad", "offset_rad", both(0.008, 0.016),
         of_term("sensor_offset", "hip_absolute", "value"), 0.001),
    Twin("sensor_scale", "hip_angle_rad", "change", both(0.01, 0.02),
         of_term("sensor_scale", "hip_absolute", "factor", 1.0)),
    Twin("sensor_scale", "gyro", "change", both(0.02, 0.04), of_term("sensor_scale", "gyro", "factor", 1.0), 0.001),
    Twin("sensor_offset", "gyro", "offset_rad_s", both(0.0015, 0.003), of_term("sensor_offset", "gyro", "value"),
         0.0005),
    Twin("sensor_lag", "gyro", "time_constant_s", (0.005, 0.01), of_term("sensor_lag", "gyro", "time_constant_s")),
    Twin("torque_constant_temperature", "hip_motor", "relative", both(0.05, 0.1),
         of_term("torque_constant_change", "hip_motor", "factor", 1.0), 0.005, "torque_constant_change"),
    Twin("resistance_temperature", "hip_motor", "change_ohm", (-0.3, 0.3, 0.6),
         of_term("resistance_change", "hip_motor", "change_ohm"), 0.02, "resistance_change"),
    Twin("sensor_scale", "hip_current_A", "change", both(0.05, 0.1),
         of_term("sensor_scale", "hip_motor_current", "factor", 1.0), 0.005),
    Twin("sensor_offset", "hip_current_A", "offset_A", both(0.1, 0.2),
         of_term("sensor_offset", "hip_motor_current", "value"), 0.01),
    Twin("sensor_scale", "hip_battery_current", "change", both(0.05, 0.1),
         of_term("sensor_scale", "hip_battery_current", "factor", 1.0), 0.005),
    Twin("firmware_parameter", "C_F_ST_F_ANG", "relative", both(0.12, 0.24), of_gains("C_F_ST_F_ANG")),
    Twin("firmware_parameter", "C_H_PM_H_RATE", "relative", both(0.1, 0.2), of_gains("C_H_PM_H_RATE")),
    Twin("firmware_parameter", "C_F_PP_F_ANG", "relative", both(0.1, 0.2), of_gains("C_F_PP_F_ANG")),
    Twin("firmware_parameter", "P_H_PM_H_TRATE", "change_rad_s", both(0.06, 0.12), of_targets("P_H_PM_H_TRATE")),
    Twin("firmware_parameter", "C_F_FU_F_ANG", "relative", both(0.15, 0.3), of_gains("C_F_FU_F_ANG", "C_F_FD_F_ANG")),
    *(
        Twin("clock_drift", f"{bus}_delay", "delay_s", (0.003, 0.006), of_faults("delay", "late_us", 1e6, f"CSR.{bus}"),
             seeds=0.6)
        for bus in ("can1", "can2", "can3", "can4")
    ),
    *(
        Twin("pwm_ripple", f"{motor.partition('_')[0]}_motor", "power_W", (-0.06, 0.06, 0.12),
             of_body(f"{motor}_gate_power_W"), 0.005)
        for motor in ("hip", "outer_ankle", "inner_ankle")
    ),
)  # fmt: skip
BY_KEY = {twin.key: twin for twin in TWINS}
