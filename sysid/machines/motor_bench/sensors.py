"""Errors of the bench's instruments."""

from collections.abc import Callable, Mapping

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Effect, Recording, Values
from ranger_sim.sysid.machines.forms import Made, Shape, column, minus, one, ones, over


def once_and_twice(angle: Array) -> tuple[Array, ...]:
    """Cosine and sine of an angle and of its double: what an encoder's disc off its centre, or bent, shows."""
    return np.cos(angle), np.sin(angle), np.cos(2.0 * angle), np.sin(2.0 * angle)


def sensors(gear: float, top_w: float, top_V: float) -> list[Effect]:
    S = "sensor"

    def current_offset(mask: Callable[[Array], Array]) -> Made:
        def made(r: Recording, _: Shape, v: Values) -> Columns:
            where = mask(r.signals["V"])
            return {
                "electric": column(-v["resistance_ohm"] * mask(r.signals["V_by_torque"])),
                "mechanical": column(
                    -(
                        v["torque_constant_Nm_per_A"]
                        - v["load_friction_Nm_per_A"] * r.signals["sgn_w"] * r.signals["sgn_I"]
                    )
                    * where
                ),
            }

        return made

    def speed_offset(r: Recording, _: Shape, v: Values) -> Columns:
        ones = np.ones(len(r.table))
        return {
            "electric": column(-v["torque_constant_Nm_per_A"] * ones),
            "mechanical": column(v["viscous_friction_Nms"] * ones),
            "transmission": column(-ones),
        }

    def current_lag(r: Recording, _: Shape, v: Values) -> Columns:
        s = r.signals
        return {
            "electric": column(v["resistance_ohm"] * s["dI"]),
            "mechanical": column(v["torque_constant_Nm_per_A"] * s["dI"]),
        }

    def speed_lag(r: Recording, _: Shape, v: Values) -> Columns:
        s = r.signals
        return {
            "electric": column(v["torque_constant_Nm_per_A"] * s["dw"]),
            "mechanical": column(-v["viscous_friction_Nms"] * s["dw"]),
            "transmission": column(s["dw"]),
        }

    def eccentric_speed(r: Recording, _: Shape, v: Values) -> Columns:
        """The output's encoder: once and twice per turn of the output."""
        error = column(*(r.signals["w"] * wave for wave in once_and_twice(r.signals["angle"] / gear)))
        return {"electric": -v["torque_constant_Nm_per_A"] * error, "transmission": -error}

    def eccentric_angle(r: Recording, _: Shape, __: Values) -> Columns:
        """The rotor's encoder: once and twice per turn of the rotor."""
        waves = once_and_twice(r.signals["angle"])
        return {T: column(*(np.gradient(wave, r.table.step_s) / gear for wave in waves))}

    def lost_angle(r: Recording, shape: Shape, _: Values) -> Columns:
        return {T: column(-over(r.signals["w_by_voltage"], shape["speed_rad_s"]))}

    def lost_speed(r: Recording, shape: Shape, v: Values) -> Columns:
        s = r.signals
        in_voltage = v["torque_constant_Nm_per_A"] * over(s["w"], shape["speed_rad_s"])
        return {"electric": column(in_voltage), T: column(over(s["w_by_voltage"], shape["speed_rad_s"]))}

    def drifting(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
        return s["t"] * s["dT"]

    T = "transmission"
    fast = [{"speed_rad_s": share * top_w} for share in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)]
    return [
        # I measured = (1 + change) I: the torque constant counts as so much smaller, in this equation alone
        Effect(
            "sensor_scale",
            "current_A",
            S,
            ("change",),
            [{}],
            one("mechanical", lambda s, _, v: -v["torque_constant_Nm_per_A"] * s["I"]),
        ),
        Effect("sensor_offset", "voltage_V", S, ("offset_V",), [{}], one("electric", ones)),
        Effect("sensor_offset", "current_A", S, ("offset_A",), [{}], current_offset(np.ones_like)),
        Effect("sensor_offset", "torque_Nm", S, ("offset_Nm",), [{}], one("mechanical", ones)),
        Effect("sensor_offset", "speed_rad_per_s", S, ("offset_rad_s",), [{}], speed_offset),
        Effect(
            "current_step_at_zero_duty",
            "current_A",
            S,
            ("offset_A",),
            [{}],
            current_offset(lambda voltage: np.tanh(voltage / (0.02 * top_V))),
        ),
        Effect("sensor_lag", "voltage_V", S, ("time_constant_s",), [{}], one("electric", minus("dV"))),
        Effect("sensor_lag", "current_A", S, ("time_constant_s",), [{}], current_lag),
        Effect("sensor_lag", "speed_rad_per_s", S, ("time_constant_s",), [{}], speed_lag),
        Effect("sensor_lag", "torque_Nm", S, ("time_constant_s",), [{}], one("mechanical", minus("dT"))),
        Effect(
            "eccentricity",
            "speed_rad_per_s",
            S,
            ("cosine", "sine", "cosine_twice", "sine_twice"),
            [{}],
            eccentric_speed,
            phase_is_free=True,
        ),
        Effect(
            "eccentricity",
            "motor_angle_rad",
            S,
            ("cosine_rad", "sine_rad", "cosine_twice_rad", "sine_twice_rad"),
            [{}],
            eccentric_angle,
            phase_is_free=True,
        ),
        Effect("lost_counts", "speed_rad_per_s", S, ("share",), fast, lost_speed, scale="speed_rad_s"),
        Effect("lost_counts", "motor_angle_rad", S, ("share",), fast, lost_angle, scale="speed_rad_s"),
        Effect("clock_drift", "torque_Nm", S, ("share",), [{}], one("mechanical", drifting)),
    ]  # fmt: skip
