"""What differs from one sound robot to the next, and is fitted: by name, with the model's value and hard limits.

Limits are chosen by us: ten times the appendix's motor constants either way, and what no encoder or link can have.
"""

from ranger_sim.sysid.machine import Known

_HIP_K = 66.0 * 0.018  # gear times torque constant: appendix 1.1.2, table 3
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
    Known("hip_current_lag_s", "s", 0.0, -0.05, 0.05, "of the hip's current behind its angle"),
    Known("hip_constant_friction_Nm", "N m", 0.1, -1.0, 3.0, "of the hip's motor and gearhead"),
    Known("hip_viscous_friction_Nms", "N m s/rad", 0.01, -0.3, 1.0, "of the hip's motor and gearhead"),
    *(
        Known(name, unit, value, low, high, meaning)
        for motor, k in (("hip", _HIP_K), ("outer_ankle", _ANKLE_K), ("inner_ankle", _ANKLE_K))
        for name, unit, value, low, high, meaning in (
            (f"{motor}_resistance_ohm", "ohm", 1.36, 0.0, 13.6, "winding, leads and bridge"),
            (f"{motor}_contact_drop_V", "V", 0.7, -2.0, 7.0, "at the brushes"),
            (
                f"{motor}_torque_constant_Nm_per_A",
                "N m/A",
                k,
                0.1 * k,
                10.0 * k,
                "at the joint: of torque and of voltage",
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
