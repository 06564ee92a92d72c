"""Each experiment as linearised equations about a reference motion: unknowns, sensors, parameters, where causes enter.

An equation sets a sum of terms to zero. Each term is an unknown signal, or its derivative, times a coefficient
over time. A measured channel adds an equation: the sensor's reading equals the signal. Parameters that a fit
adjusts, and causes, enter an equation by their contributions to it: their regressors. A cause is at its most usual
place; `places` names it where there is a choice.

The numbers are those of the robot's hip motor (plant/electrics/motor_parameters.py) and of the bench of the blind tests
(tests/blind/README.md). Only their order matters here: it decides how alike two signatures look.
"""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.sysid.dataset import Array

SAMPLES = 120  # of the reference motion, from which signatures are compared
FINE = 20  # steps of the signals with memory between two samples
MODEL_SIGMA = 1e-2  # error of an equation, as a part of the rms of its first parameter's regressor

Regressors = Mapping[str, Array]
Signal = NDArray[Any]  # over the fine grid
Values = Mapping[str, Signal | float]


@dataclasses.dataclass(frozen=True)
class Equation:
    """sum of coefficient x unknown (or its derivative) = 0. sigma: its error, in the equation's unit; channel: of a
    sensor's equation, which exists when the channel is measured. Arrays have shape (SAMPLES,).
    """

    name: str
    balance: str
    terms: tuple[tuple[str, Array, int], ...]  # unknown, coefficient, order of the derivative: 0 or 1
    parameters: Regressors
    causes: Regressors
    sigma: float
    channel: str = ""


@dataclasses.dataclass(frozen=True)
class Model:
    """An experiment. time_s: shape (SAMPLES,); excitation: the reference motion in words; places: {cause: where}."""

    name: str
    time_s: Array
    equations: tuple[Equation, ...]
    excitation: str
    places: Mapping[str, str]

    @property
    def channels(self) -> tuple[str, ...]:
        """Every channel that a sensor could show."""
        return tuple(equation.channel for equation in self.equations if equation.channel)

    @property
    def causes(self) -> tuple[str, ...]:
        """Every cause that enters anywhere, in the order of the equations."""
        return tuple(dict.fromkeys(cause for equation in self.equations for cause in equation.causes))


class Builder:
    """Collects equations on the fine grid; `model` samples them."""

    def __init__(self, duration_s: float) -> None:
        self.t = np.linspace(0.0, duration_s, SAMPLES * FINE)
        self.step_s = float(self.t[1])
        self.equations: list[Equation] = []
        self.places: dict[str, str] = {}

    def waves(self, *parts: tuple[float, float, float]) -> Signal:
        """A sum of sines: (amplitude, Hz, phase) each."""
        return sum((a * np.sin(2.0 * np.pi * f * self.t + p) for a, f, p in parts), np.zeros_like(self.t))

    def rate(self, value: Signal) -> Signal:
        """The derivative."""
        return np.gradient(value, self.step_s)

    def integral(self, value: Signal) -> Signal:
        """The integral from 0."""
        return np.cumsum(value) * self.step_s

    def low_pass(self, value: Signal, constant_s: float) -> Signal:
        """Behind a first-order filter that begins at 0."""
        return self._walk(value, lambda y, x: y + (x - y) * self.step_s / constant_s)

    def bristle(self, speed: Signal, way: float) -> Signal:
        """Deficit of a bristle of this length against full sliding friction, of 1: Dahl's law."""
        moved = speed * self.step_s / way
        z = np.zeros_like(speed)
        for k in range(1, len(z)):
            # exact over the step, so that steps longer than the way stay in -1 ... 1
            full = np.sign(moved[k])
            z[k] = full + (z[k - 1] - full) * np.exp(-abs(moved[k]))
        return z - np.sign(speed)

    def _walk(self, value: Signal, law: Callable[[float, float], float]) -> Signal:
        found = np.zeros_like(value)
        for k in range(1, len(value)):
            found[k] = law(found[k - 1], value[k])
        return found

    def half_derivative(self, value: Signal) -> Signal:
        """A derivative of order 0.65: the voltage at an inductance that falls with the frequency's power 0.35."""
        spectrum = np.fft.rfft(value)
        return np.fft.irfft(spectrum * (2j * np.pi * np.fft.rfftfreq(len(value), self.step_s)) ** 0.65, len(value))

    def equation(
        self,
        name: str,
        balance: str,
        terms: list[tuple],
        parameters: Values | None = None,
        causes: Values | None = None,
        sigma: float = 0.0,
        channel: str = "",
    ) -> None:
        """Add one. A term: (unknown, coefficient) or (unknown, coefficient, order). sigma 0: from its regressors."""
        ones = np.ones(SAMPLES)

        def sampled(value: Signal | float) -> Array:
            return ones * (value[::FINE] if isinstance(value, np.ndarray) else value)

        regressors = {key: sampled(value) for key, value in (parameters or {}).items()}
        sizes = [float(np.sqrt(np.mean(each**2))) for each in regressors.values()]
        self.equations.append(
            Equation(
                name,
                balance,
                tuple((term[0], sampled(term[1]), term[2] if len(term) > 2 else 0) for term in terms),
                regressors,
                {key: sampled(value) for key, value in (causes or {}).items()},
                sigma or MODEL_SIGMA * (sizes[0] if sizes else 1.0),
                channel,
            )
        )

    def sensor(
        self,
        channel: str,
        unknown: str,
        sigma: float,
        balance: str = "S",
        causes: Values | None = None,
    ) -> None:
        """A channel that shows an unknown."""
        self.equation(f"sensor of {channel}", balance, [(unknown, -1.0)], None, causes, sigma, channel)

    def model(self, name: str, excitation: str) -> Model:
        """The collected model."""
        return Model(name, self.t[::FINE], tuple(self.equations), excitation, dict(self.places))


def _friction(b: Builder, w: Signal, torque: Signal, way: float, slow: float) -> dict[str, Signal | float]:
    """Contributions of the catalogue's frictions to a balance of torques or forces: `way`, `slow` are their scales."""
    sign = np.tanh(w / (0.1 * slow))
    return {
        "coulomb_friction": sign,
        "viscous_friction": w,
        "stribeck": sign * np.exp(-((w / slow) ** 2)),
        "presliding": b.bristle(w, way),
        # in addition to the base model: more of it while the load drives
        "load_friction": sign * np.abs(torque) * (torque * w < 0.0),
        "direction_friction": np.abs(sign) + 0.2 * np.abs(w) / slow,
        "friction_warm_up": sign * np.exp(-4.0 * b.t / b.t[-1]),
        "drag": w * np.abs(w),
    }


def _current_sensor(b: Builder, channel: str, unknown: str, current: Signal, duty: Signal) -> None:
    """A current's sensor with its causes."""
    causes: dict[str, Signal | float] = {
        "sensor_scale@current": current,
        "sensor_offset@current": 1.0,
        "current_step_at_zero_duty": np.tanh(duty / 0.02),
    }
    b.sensor(channel, unknown, 0.02, "E", causes)


def _winding(b: Builder, prefix: str, current: Signal, speed: Signal, p: MotorParameters, extra: dict) -> None:
    """Voltage against resistance, drops, speed. Unknowns: voltage, current, speed, named with `prefix`."""
    gear_K = p.gear * p.torque_constant_Nm_per_A
    sign = np.tanh(current / 0.05)
    heat = b.low_pass(current**2, 4.0)
    b.equation(
        f"{prefix}winding",
        "E",
        [(f"{prefix}V", 1.0), (f"{prefix}I", -p.resistance_ohm), (f"{prefix}w", -gear_K)],
        {"R": current, "V_c": sign, "K": gear_K * speed, "L": b.rate(current)},
        {
            "contact_drop_change": sign,
            "resistance_temperature": current * heat,
            "inductance_frequency": b.half_derivative(current),
            **extra,
        },
    )


def motor_bench() -> Model:
    """A motor with a gearbox of 14:1 against a brake motor that also drives; 20 s."""
    p = MotorParameters(gear=14.0)
    gear_K, R, J = 14.0 * p.torque_constant_Nm_per_A, p.resistance_ohm, 0.01
    b = Builder(20.0)
    envelope = np.clip(1.6 * np.sin(2.0 * np.pi * 0.06 * b.t) ** 2 - 0.15, 0.0, 1.0)  # at rest now and then
    w = envelope * b.waves((9.0, 0.21, 0.0), (5.0, 0.53, 1.0), (2.0, 1.31, 2.0))
    load = b.waves((0.25, 0.09, 0.4), (0.15, 0.47, 1.7), (0.05, 1.7, 0.3))
    sign = np.tanh(w / 0.1)
    current = (J * b.rate(w) + load + 0.05 * sign + 0.004 * w) / gear_K
    q = 14.0 * b.integral(w)
    volts = R * current + 0.7 * np.tanh(current / 0.05) + gear_K * w
    duty = volts / 12.0
    housing = b.low_pass(current**2, 60.0)
    weak = {"torque_constant_temperature": gear_K * w * housing, "dead_time": 12.0 * np.tanh(current / 0.05)}
    _winding(b, "", current, w, p, weak)
    motor_torque = gear_K * current
    b.equation(
        "mechanics",
        "M",
        [("w", -J, 1), ("I", gear_K), ("w", -0.004), ("load", -1.0)],
        {"K": motor_torque, "C_0": sign, "C_1": w, "mu": sign * np.abs(motor_torque), "J": b.rate(w)},
        {
            **_friction(b, w, motor_torque, 0.02, 1.0),
            "torque_constant_temperature": motor_torque * housing,
            "cogging": np.sin(4.0 * q),
            "commutation_ripple": motor_torque * np.sin(14.0 * q + 0.5),
            "once_per_turn": np.sin(q / 14.0 + 0.3),
            "inertia": b.rate(w),
        },
    )
    b.equation(
        "housing",
        "E",
        [("T", -65.0, 1), ("T", -0.1), ("I", 2.0 * R * current)],
        {"R": current**2, "conductance": b.low_pass(current**2, 60.0), "air": 1.0},
        {"pwm_ripple": np.abs(duty) * (1.0 - np.clip(np.abs(duty), 0.0, 1.0))},
    )
    transmission = {
        "lost_counts": 20.0 * (np.abs(w) > 10.0),
        "cable_backlash": b.rate(np.tanh(load / 0.02)),
        "cable_stiffening": b.rate(load**3),
        "pulley_slip": np.where(np.abs(load) > 0.25, w, 0.0),
    }
    b.equation("turning", "T", [("q", 1.0, 1), ("w", -14.0)], {"compliance": b.rate(load)}, transmission, 0.2)
    supply = {
        "voltage_clip": np.sign(volts) * np.maximum(np.abs(volts) - 0.8 * np.abs(volts).max(), 0.0),
        "battery_sag": volts * np.abs(current),
        "charge_drift": volts * b.integral(np.abs(current)),
    }
    b.sensor("voltage_V", "V", 0.008, "E", supply)
    _current_sensor(b, "current_A", "I", current, duty)
    b.sensor("speed_rad_per_s", "w", 0.04, "S", {"sensor_lag": b.rate(w), "clock_drift": b.rate(w) * b.t})
    b.sensor("torque_Nm", "load", 0.008, "M")
    b.sensor("temperature_C", "T", 0.1, "E")
    b.sensor("motor_angle_rad", "q", 0.003, "S", {"eccentricity": np.sin(q) + 0.5 * np.sin(2.0 * q)})
    b.places = {"sensor_lag": "speed_rad_per_s", "clock_drift": "speed_rad_per_s", "eccentricity": "motor_angle_rad"}
    return b.model("motor-bench", "20 s of speed up to 14 rad/s with standstill, load up to 0.4 Nm both ways")


def leg_swing() -> Model:
    """A leg swings about the held hip; inertial numbers of plant/mechanics/parameters.py."""
    p = MotorParameters()
    gear_K, R, J, gravity, spring = p.gear * p.torque_constant_Nm_per_A, p.resistance_ohm, 0.55, 7.06, 7.6
    b = Builder(24.0)
    q = np.exp(-b.t / 25.0) * b.waves((0.35, 0.62, 0.0), (0.12, 1.15, 0.7)) + 0.1 * np.sin(2.0 * np.pi * 0.11 * b.t)
    w = b.rate(q)
    sign = np.tanh(w / 0.03)
    current = (J * b.rate(w) + gravity * np.sin(q) + spring * q + 0.1 * sign + 0.01 * w) / gear_K
    duty = (R * current + 0.7 * np.tanh(current / 0.05) + gear_K * w) / 24.0
    _winding(b, "", current, w, p, {"dead_time": 24.0 * np.tanh(current / 0.05)})
    torque = gear_K * current
    b.equation(
        "swing",
        "M",
        [("w", -J, 1), ("q", -gravity * np.cos(q) - spring), ("w", -0.01), ("I", gear_K)],
        {"K": torque, "J": b.rate(w), "m g c": np.sin(q), "k_h": q, "C_0": sign, "C_1": w},
        {
            **_friction(b, w, torque, 0.01, 0.3),
            "cogging": np.sin(4.0 * 66.0 * q),
            "commutation_ripple": torque * np.sin(7.0 * 66.0 * q + 0.5),
            "once_per_turn": np.sin(3.0 * q + 0.3),
            "hip_spring_bend": q**3,
            "inertia": b.rate(w) + 5.0 * np.sin(q),
            "spring_value": q,
        },
    )
    b.equation("turning", "S", [("q", 1.0, 1), ("w", -1.0)], {}, {}, 1e-3)
    angle: dict[str, Signal | float] = {
        "sensor_offset@angle": 1.0,
        "eccentricity": np.sin(2.0 * q + 0.4),
        "sensor_lag": w,
    }
    b.sensor("hip_angle_rad", "q", 2e-4, "S", angle | {"bit_flip": _flips(b)})
    _current_sensor(b, "current_A", "I", current, duty)
    b.sensor("voltage_V", "V", 0.02, "E", {"clock_drift": b.rate(duty) * 24.0 * b.t})
    b.places = {"sensor_lag": "hip_angle_rad", "eccentricity": "hip_angle_rad", "clock_drift": "voltage_V"}
    return b.model("leg-swing", "24 s of swings up to 0.4 rad that die away, over a slow sine")


def _flips(b: Builder) -> Signal:
    """A few single samples."""
    flips = np.zeros_like(b.t)
    for place, size in ((17, 1.0), (43, -1.0), (88, 1.0)):
        flips[place * FINE] = size
    return flips


def _cable(b: Builder, prefix: str, torque: Signal, stiffness: float) -> None:
    """Motor angle less joint angle is the cable's twist. Unknowns: motor m, joint q, torque tau."""
    twist = torque / stiffness
    b.equation(
        f"{prefix}cable",
        "T",
        [(f"{prefix}m", 1.0), (f"{prefix}q", -1.0), (f"{prefix}tau", -1.0 / stiffness)],
        {"k_s": twist, "zero": 1.0},
        {
            "cable_backlash": np.tanh(torque / 0.05),
            "cable_stiffening": twist**3,
            "cable_creep": b.low_pass(twist, 5.0),
            "pulley_slip": np.where(b.t > 0.45 * b.t[-1], 1.0, 0.0),
        },
        2e-4,
    )


def ankle() -> Model:
    """The robot hangs, an ankle follows a sine under the law I = I_0 - K m - D m'; docs/robot.md C6.3."""
    p = MotorParameters(gear=34.0)
    gear_K, R, k_s, k_r = 0.612, p.resistance_ohm, 14.0, 0.134
    J_motor, J_foot = 34.0**2 * p.rotor_inertia_kg_m2, 0.002
    K, D = 16.1209, 1.63399
    b = Builder(20.0)
    q = 1.3 + b.waves((0.9, 0.3, 0.0), (0.15, 1.1, 0.5), (0.05, 2.3, 0.2))
    w = b.rate(q)
    tau = J_foot * b.rate(w) + k_r * (q - 1.66)
    m = q + tau / k_s
    wm = b.rate(m)
    sign = np.tanh(wm / 0.03)
    current = (J_motor * b.rate(wm) + tau + 0.05 * sign + 0.01 * wm) / gear_K
    duty = (R * current + 0.7 * np.tanh(current / 0.05) + gear_K * wm) / 24.0
    torque = gear_K * current
    b.equation(
        "motor",
        "M",
        [("wm", -J_motor, 1), ("I", gear_K), ("wm", -0.01), ("tau", -1.0)],
        {"K": torque, "J_m": b.rate(wm), "C_0": sign, "C_1": wm},
        {
            **_friction(b, wm, torque, 0.01, 0.3),
            "cogging": np.sin(4.0 * 34.0 * m),
            "commutation_ripple": torque * np.sin(7.0 * 34.0 * m + 0.5),
            "once_per_turn": np.sin(3.0 * m + 0.3),
        },
    )
    b.equation(
        "foot",
        "M",
        [("w", -J_foot, 1), ("tau", 1.0), ("q", -k_r)],
        {"k": q, "rest": 1.0, "J": b.rate(w)},
        {"return_spring": q**2, "spring_value": q - 1.66, "inertia": b.rate(w) + np.sin(q)},
    )
    _cable(b, "", tau, k_s)
    b.equation("joint turning", "S", [("q", 1.0, 1), ("w", -1.0)], {}, {}, 1e-3)
    b.equation("motor turning", "S", [("m", 1.0, 1), ("wm", -1.0)], {}, {"lost_counts": 1.0 * (np.abs(wm) > 2.0)}, 1e-3)
    b.equation(
        "law",
        "C",
        [("I", 1.0), ("I0", -1.0), ("m", K), ("wm", D)],
        {},
        {"firmware_parameter": m, "voltage_clip": np.where(np.abs(duty) > 0.8 * np.abs(duty).max(), duty, 0.0)},
        0.05,
    )
    b.equation("target", "C", [("I0", 1.0), ("goal", -K), ("goal_rate", -D)], {}, {}, 0.01)
    angle: dict[str, Signal | float] = {
        "sensor_offset@angle": 1.0,
        "eccentricity": np.sin(q + 0.4),
        "bit_flip": _flips(b),
    }
    b.sensor("joint_angle_rad", "q", 2e-4, "S", angle)
    b.sensor("joint_rate_rad_per_s", "w", 0.02, "S", {"sensor_lag": b.rate(w)})
    b.sensor("motor_angle_rad", "m", 2e-4, "S")
    _current_sensor(b, "current_A", "I", current, duty)
    b.equations[-1] = dataclasses.replace(
        b.equations[-1], causes={**b.equations[-1].causes, "clock_drift": (b.rate(current) * b.t)[::FINE]}
    )
    b.sensor("command_current_A", "I0", 0.001, "C")
    b.sensor("target_angle_rad", "goal", 1e-4, "C")
    b.sensor("target_rate_rad_per_s", "goal_rate", 1e-3, "C")
    b.places = {"sensor_lag": "joint_rate_rad_per_s", "eccentricity": "joint_angle_rad", "clock_drift": "current_A"}
    return b.model("ankle", "20 s of a sine of 0.9 rad at 0.3 Hz with faster parts, robot hanging")


def positioning() -> Model:
    """A mass on a line under a position controller; numbers of the published system (facts of the data's README)."""
    mass, viscous, coulomb, gain, kp, kv = 95.1, 203.5, 20.4, 35.15, 160.18, 243.45
    b = Builder(24.8)
    v = 0.12 * np.tanh(3.0 * np.sin(2.0 * np.pi * b.t / 6.24)) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 0.43 * b.t))
    x = b.integral(v)
    force = mass * b.rate(v) + viscous * v + coulomb * np.tanh(v / 0.002)
    sign = np.tanh(v / 0.002)
    b.equation(
        "motion",
        "M",
        [("v", -mass, 1), ("u", gain), ("v", -viscous)],  # force pulses pass through the drive too (data's README)
        {"M": b.rate(v), "F_v": v, "F_c": sign, "offset": 1.0},
        {
            **_friction(b, v, force, 5e-4, 0.02),
            "once_per_turn": np.sin(2.0 * np.pi * x / 0.0025),
            "cogging": np.sin(2.0 * np.pi * x / 0.0025 * 4.0),
            "commutation_ripple": force * np.sin(2.0 * np.pi * x / 0.0025 * 7.0),
            "inertia": b.rate(v),
        },
    )
    b.equation("moving", "S", [("x", 1.0, 1), ("v", -1.0)], {}, {"lost_counts": 1.0 * (np.abs(v) > 0.13)}, 1e-5)
    b.equation(
        "controller",
        "C",
        [("u", -1.0), ("goal", kp * kv), ("x", -kp * kv), ("v", -kv)],
        {"offset of the law": 1.0},
        {"firmware_parameter": kv * v, "sensor_lag": kp * kv * v + kv * b.rate(v)},
        0.05,
    )
    b.sensor(
        "position_m", "x", 1e-6, "S", {"sensor_offset@angle": 1.0, "eccentricity": np.sin(2.0 * np.pi * x / 0.0025)}
    )
    clip = np.where(np.abs(force) > 0.85 * np.abs(force).max(), force, 0.0) / gain
    b.sensor("voltage_V", "u", 0.005, "E", {"voltage_clip": clip, "clock_drift": b.rate(force) / gain * b.t})
    b.sensor("reference_m", "goal", 1e-6, "C")
    b.places = {"sensor_lag": "the controller's loop", "sensor_offset@angle": "position_m", "clock_drift": "voltage_V"}
    return b.model("positioning", "four periods of 6.24 s to and fro at 0.12 m/s")


def walk() -> Model:
    """The robot walks: hip, two ankles, the outer leg by gyro, the battery; steps of 0.6 s."""
    p = MotorParameters()
    b = Builder(12.0)
    f = 1.0 / 1.2  # strides per second
    stance = 0.5 * (1.0 + np.tanh(8.0 * np.sin(2.0 * np.pi * f * b.t)))  # 1: on the outer feet
    double = np.exp(-((np.sin(2.0 * np.pi * f * b.t) / 0.12) ** 2))
    strikes = double * np.cos(2.0 * np.pi * f * b.t)
    hip = b.waves((0.35, f, 0.3), (0.06, 3.0 * f, 1.0), (0.01, 0.31, 0.0))
    leg = b.waves((0.22, f, 0.9), (0.04, 2.0 * f, 0.4), (0.01, 0.23, 0.5))
    wh, wl = b.rate(hip), b.rate(leg)
    hip_torque = 0.55 * b.rate(wh) + 7.6 * hip + 3.0 * np.sin(leg)
    gear_K = p.gear * p.torque_constant_Nm_per_A
    hip_current = (hip_torque + 0.1 * np.tanh(wh / 0.05)) / gear_K
    supply = 24.0 - 0.2 * np.abs(hip_current)
    _winding(b, "hip ", hip_current, wh, p, {
        "torque_constant_temperature": gear_K * wh * b.low_pass(hip_current**2, 60.0),
        "dead_time": supply * np.tanh(hip_current / 0.05),
    })  # fmt: skip
    sign = np.tanh(wh / 0.03)
    b.equation(
        "hip",
        "M",
        [("hip w", -0.55, 1), ("hip", -7.6), ("leg", -3.0), ("hip I", gear_K)],
        {"J": b.rate(wh), "m g c": np.sin(leg), "k_h": hip, "C_0": sign, "C_1": wh, "K": gear_K * hip_current},
        {
            **_friction(b, wh, hip_torque, 0.01, 0.3),
            "torque_constant_temperature": gear_K * hip_current * b.low_pass(hip_current**2, 60.0),
            "cogging": np.sin(4.0 * 66.0 * hip),
            "commutation_ripple": hip_torque * np.sin(7.0 * 66.0 * hip),
            "once_per_turn": np.sin(3.0 * hip + 0.3),
            "hip_spring_bend": hip**3,
            "spring_value": hip,
            "leg_asymmetry": (2.0 * stance - 1.0) * np.cos(leg),
        },
    )
    b.equation("hip turning", "S", [("hip", 1.0, 1), ("hip w", -1.0)], {}, {}, 1e-3)
    b.equation("leg turning", "S", [("leg", 1.0, 1), ("leg w", -1.0)], {}, {}, 1e-3)
    b.equation(
        "stance",
        "M",
        [("leg w", -10.0, 1), ("leg", 60.0 * stance), ("hip", 20.0 * (1.0 - stance)), ("outer tau", 1.0 * stance),
         ("inner tau", 1.0 - stance)],
        {"m": b.rate(wl)},
        {
            "inertia": np.sin(leg) + 0.2 * b.rate(wl),
            "floor": 1.0,
            "contact_loss": strikes + 0.3 * np.sign(wl) * stance,
            "leg_asymmetry": (2.0 * stance - 1.0),
            "geometry": np.sin(leg) * np.abs(np.sin(leg)),
        },
        0.5,
    )  # fmt: skip
    b.equation(
        "closure",
        "S",
        [("leg", double), ("hip", -0.5 * double)],
        {},
        {"geometry": double * np.sign(hip), "floor": double * 0.5},
        2e-3,
    )
    for leg_name, phase in (("outer", 0.2), ("inner", 0.2 + np.pi)):
        ankle_angle = 1.2 + b.waves((0.5, f, phase), (0.2, 2.0 * f, phase))
        on = stance if leg_name == "outer" else 1.0 - stance
        tau = 3.0 * on * (1.0 + b.waves((0.5, f, phase + 1.0))) + 0.134 * (ankle_angle - 1.66)
        wa = b.rate(ankle_angle)
        drive = (tau + 0.1 * np.tanh(wa / 0.05)) / 0.612
        n = f"{leg_name} "
        outer = leg_name == "outer"
        b.equation(
            f"{n}motor",
            "M",
            [(f"{n}wm", -0.00185, 1), (f"{n}I", 0.612), (f"{n}wm", -0.01), (f"{n}tau", -1.0)],
            {"K": 0.612 * drive, "C_0": np.tanh(wa / 0.05), "C_1": wa},
            {"return_spring": ankle_angle**2} if outer else {},
        )
        if outer:
            _cable(b, n, tau, 14.0)
        else:
            b.equation(f"{n}cable", "T", [(f"{n}m", 1.0), (f"{n}q", -1.0), (f"{n}tau", -1.0 / 14.0)], {}, {}, 2e-4)
        b.equation(f"{n}motor turning", "S", [(f"{n}m", 1.0, 1), (f"{n}wm", -1.0)], {},
                   {"lost_counts": 1.0 * (np.abs(wa) > 2.0)} if outer else {}, 1e-3)  # fmt: skip
        b.equation(f"{n}joint turning", "S", [(f"{n}q", 1.0, 1), (f"{n}w", -1.0)], {}, {}, 1e-3)
        b.sensor(f"{n[:-1]}_ankle_angle_rad", f"{n}q", 2e-4, "S", {"bit_flip": _flips(b)} if outer else {})
        b.sensor(f"{n[:-1]}_ankle_rate_rad_per_s", f"{n}w", 0.02)
        b.sensor(f"{n[:-1]}_motor_angle_rad", f"{n}m", 2e-4)
        b.sensor(f"{n[:-1]}_ankle_current_A", f"{n}I", 0.02, "E")
    power = hip_current * wh * gear_K + 12.0
    total = power / supply
    b.equation(
        "power",
        "P",
        [("battery V", total), ("battery I", supply), ("hip I", -2.0 * p.resistance_ohm * hip_current - gear_K * wh),
         ("hip w", -gear_K * hip_current)],
        {"fixed": 1.0},
        {"pwm_ripple": np.abs(hip_current) * 0.1 + 0.05},
        0.2,
    )  # fmt: skip
    b.equation(
        "battery",
        "P",
        [("battery V", 1.0), ("battery I", 0.1)],
        {"empty voltage": 1.0},
        {"battery_sag": total, "charge_drift": b.integral(total)},
        0.02,
    )
    b.sensor("hip_angle_rad", "hip", 2e-4, "S", {"sensor_offset@angle": 1.0, "eccentricity": np.sin(2.0 * hip + 0.4)})
    b.sensor("hip_rate_rad_per_s", "hip w", 0.02, "S", {"sensor_lag": b.rate(wh)})
    gyro: dict[str, Signal | float] = {
        "sensor_scale@gyro": wl,
        "sensor_offset@gyro": 1.0,
        "gyro_misalignment": b.waves((0.2, f, 2.0), (0.1, 2.0 * f, 0.1)),
        "clock_drift": b.rate(wl) * b.t,
    }
    b.sensor("outer_leg_rate_rad_per_s", "leg w", 0.01, "S", gyro)
    b.sensor("outer_leg_angle_rad", "leg", 5e-3)
    duty = (p.resistance_ohm * hip_current + gear_K * wh) / supply
    _current_sensor(b, "hip_current_A", "hip I", hip_current, duty)
    b.sensor("hip_voltage_V", "hip V", 0.05, "E", {"voltage_clip": np.where(np.abs(duty) > 0.3, duty, 0.0)})
    b.sensor("battery_voltage_V", "battery V", 0.02, "P")
    b.sensor("battery_current_A", "battery I", 0.02, "P")
    b.equation("hip law", "C", [("hip I", 1.0), ("hip", 5.0), ("hip w", 0.5)], {"target": np.sign(hip)},
               {"firmware_parameter": hip}, 0.05)  # fmt: skip
    b.places = {
        "sensor_lag": "hip_rate_rad_per_s", "eccentricity": "hip_angle_rad", "clock_drift": "outer_leg_rate_rad_per_s",
        "sensor_offset@angle": "hip_angle_rad", "sensor_scale@current": "hip_current_A",
        "sensor_offset@current": "hip_current_A", "cable_backlash": "outer ankle", "bit_flip": "outer ankle",
    }  # fmt: skip
    return b.model("walk", "12 s of walking with steps of 0.6 s")


MODELS: Mapping[str, Callable[[], Model]] = {
    "motor-bench": motor_bench,
    "leg-swing": leg_swing,
    "ankle": ankle,
    "walk": walk,
    "positioning": positioning,
}
