"""What differs from one sound robot to the next, and is fitted: by name, with the model's value and hard limits.

Limits are chosen by us: ten times the appendix's motor constants either way, and what no encoder or link can have.
"""

from ranger_sim.sysid.machine import Known

HIP_K_Nm_per_A = 66.0 * 0.018  # gear times torque constant: appendix 1.1.2, table 3
_ANKLE_K = 34.0 * 0.018

PARAMETERS = (
    Known("leg_zero_rad", "rad", 0.0, -0.3, 0.3, "constant of the outer leg's lean as the gyro adds it up"),
    Known("gyro_bias_rad_s", "rad/s", 0.0, -0.02, 0.02, "at rest, beyond the -0.004 rad/s that the firmware takes off"),
    Known("leg_lag_s", "s", 0.0, -0.03, 0.03, "of the outer leg's sensor behind the joints'"),
    Known("leg_lag_drift_s", "s", 0.0, -0.01, 0.01, "change of that lag over half of a recording: crystals differ"),
    Known("motor_zero_outer_rad", "rad", 0.0, -0.1, 0.1, "of the outer ankle motor's encoder against the joint's"),
    Known("motor_zero_inner_rad", "rad", 0.0, -0.1, 0.1, "of the inner ankle motor's encoder against the joint's"),
    *(
        Known(f"motor_lag_{leg}_s", "s", 0.0, -0.02, 0.02, f"of the {leg} ankle's motor encoder behind its joint's")
        for leg in ("outer", "inner")
    ),
    Known("hip_current_offset_Nm", "N m", 0.0, -1.0, 1.0, "torque that an offset of the hip's current seems to be"),
    Known(
        "hip_torque_constant_Nm_per_A",
        "N m/A",
        HIP_K_Nm_per_A,
        0.1 * HIP_K_Nm_per_A,
        10.0 * HIP_K_Nm_per_A,
        "at the joint",
    ),
    Known("hip_current_lag_s", "s", 0.0, -0.05, 0.05, "of the hip's current behind its angle"),
    Known("hip_constant_friction_Nm", "N m", 0.1, -1.0, 3.0, "of the hip's motor and gearhead"),
    Known("hip_viscous_friction_Nms", "N m s/rad", 0.01, -0.3, 1.0, "of the hip's motor and gearhead"),
    *(
        Known(name, unit, value, low, high, meaning)
        for motor, k in (("hip", HIP_K_Nm_per_A), ("outer_ankle", _ANKLE_K), ("inner_ankle", _ANKLE_K))
        for name, unit, value, low, high, meaning in (
            (f"{motor}_resistance_ohm", "ohm", 1.36, 0.0, 13.6, "winding, leads and bridge"),
            (f"{motor}_contact_drop_V", "V", 0.7, -2.0, 7.0, "at the brushes"),
            (
                f"{motor}_generator_constant_Vs_per_rad",
                "V s/rad",
                k,
                0.1 * k,
                10.0 * k,
                "voltage of its turning, at the joint",
            ),
            (f"{motor}_power_lag_s", "s", 0.0, -0.05, 0.05, "of the current behind the power"),
            (f"{motor}_voltage_lag_s", "s", 0.0, -0.02, 0.02, "of the current behind the voltage"),
            (f"{motor}_gates_W", "W", 0.3, -1.0, 3.0, "of the bridge's gates"),
            (f"{motor}_rate_scale", "1", 1.0, 0.1, 10.0, "of the rate as its board computes it"),
            (f"{motor}_rate_lag_s", "s", 0.0075, -0.02, 0.05, "of the rate's filter: 7.5 ms by robot.md N4.1"),
            (f"{motor}_rate_filter_s2", "s^2", 6e-5, -0.01, 0.01, "second moment of that filter"),
        )
    ),
)
# What sound robots differ in, as good as measured: (value, standard deviation); fields of `Numbers` are changes.
PRIORS = {
    # a motor's constant within a tenth of its data sheet; a current behind its angle by a slot of 5 ms
    "hip_torque_constant_Nm_per_A": (HIP_K_Nm_per_A, 0.1 * HIP_K_Nm_per_A),
    "hip_current_lag_s": (0.0, 0.005),
    # one board reads both encoders of an ankle
    "motor_lag_outer_s": (0.0, 0.001),
    "motor_lag_inner_s": (0.0, 0.001),
    # what the appendix does not give, or as a guess: a fifth
    "ankle_return_Nm_per_rad": (0.0, 0.2 * 0.066),
    "foot_inertia_kg_m2": (0.0, 0.2 * 0.0012),
    "rolling_outer_Nms": (0.0, 0.2 * 0.05),
    "rolling_inner_Nms": (0.0, 0.2 * 0.05),
    # tape, scale and bench, chosen by us: a quarter of a millimetre at a foot, one of a leg, 0.25 % of weights and
    # moments, 1 % of inertias, 2 % of the hip's spring, a tenth of the cables', 0.1 % of sensors, a quarter of a count
    # of an absolute encoder. Larger ones hide small faults; a sound robot that is off by more is named.
    "ankle_offset_outer_m": (0.0, 0.00025),
    "ankle_offset_inner_m": (0.0, 0.00025),
    "foot_radius_outer_m": (0.0, 0.0005),
    "foot_radius_inner_m": (0.0, 0.0005),
    "leg_length_m": (0.0, 0.001),
    "total_mass_kg": (0.0, 0.025),
    "mass_moment_outer_kg_m": (0.0, 0.0025),
    "mass_moment_inner_kg_m": (0.0, 0.0025),
    "mass_offset_outer_kg_m": (0.0, 0.001),
    "mass_offset_inner_kg_m": (0.0, 0.001),
    "hip_inertia_outer_kg_m2": (0.0, 0.0055),
    "hip_inertia_inner_kg_m2": (0.0, 0.0055),
    "hip_spring_Nm_per_rad": (0.0, 0.15),
    "cable_outer_Nm_per_rad": (0.0, 1.4),
    "cable_inner_Nm_per_rad": (0.0, 1.4),
    "hip_scale": (0.0, 0.001),
    "leg_scale": (0.0, 0.001),
    "hip_zero_rad": (0.0, 0.0002),
    "ankle_zero_outer_rad": (0.0, 0.0002),
    "ankle_zero_inner_rad": (0.0, 0.0002),
    "slope_rad": (0.0, 0.0002),
}
# fields of `Numbers` among them
TOLERATED = tuple(name for name in PRIORS if "lag" not in name and name != "hip_torque_constant_Nm_per_A")
