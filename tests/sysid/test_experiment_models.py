"""The linearised experiments compared with a second book: each number and form of each equation written once more, from
the catalogue's words, the robot's parameters and the data's README, with filters and sums of SciPy and NumPy."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from ranger_sim.plant.electrics.motor_parameters import MotorParameters
from ranger_sim.sysid import experiment_models
from ranger_sim.sysid.experiment_models import FINE, SAMPLES, Builder

HIP = MotorParameters()
K, R = HIP.torque_constant_Nm_per_A, HIP.resistance_ohm
TURN = 2.0 * math.pi
SIGN_WIDTH_A = 0.05  # a sign of the current is smooth over so much


class Book:
    """A fine grid of time with the operations that the equations need."""

    def __init__(self, duration_s):
        self.t = np.linspace(0.0, duration_s, 2400)
        self.h = duration_s / 2399.0

    def sine(self, *parts):
        return sum(a * np.sin(TURN * f * self.t + p) for a, f, p in parts)

    def rate(self, x):
        return np.gradient(x, self.h)

    def total(self, x):
        return np.cumsum(x) * self.h

    def lag(self, x, constant_s):
        share = self.h / constant_s
        return lfilter([share], [1.0, share - 1.0], np.concatenate([[0.0], x[1:]]))

    def friction(self, w, torque, way, slow):
        sign = np.tanh(10.0 * w / slow)
        return {
            "coulomb_friction": sign,
            "viscous_friction": w,
            "stribeck": sign * np.exp(-(w * w) / (slow * slow)),
            "presliding": Builder(self.t[-1]).bristle(w, way),  # held by a test of its own
            "load_friction": np.where(torque * w < 0.0, sign * abs(torque), 0.0),
            "direction_friction": abs(sign) + abs(w) / (5.0 * slow),
            "friction_warm_up": sign * np.exp(-self.t / (0.25 * self.t[-1])),
            "drag": np.sign(w) * w**2,
        }

    def winding(self, prefix, current, w, gear_K, volts, **extra):
        sign = np.tanh(current / SIGN_WIDTH_A)
        spectrum = np.fft.rfft(current)
        omega = TURN * np.fft.rfftfreq(2400, self.h)
        turned = spectrum * omega**0.65 * np.exp(0.65j * math.pi / 2.0)
        turned[-1] = turned[-1].real  # an even number of samples: the last line has no phase
        return {
            f"{prefix}winding": (
                [(f"{prefix}V", 1.0, 0), (f"{prefix}I", -R, 0), (f"{prefix}w", -gear_K, 0)],
                {"R": current, "V_c": sign, "K": gear_K * w, "L": self.rate(current)},
                {
                    "contact_drop_change": sign,
                    "resistance_temperature": current * self.lag(current * current, 4.0),
                    "inductance_frequency": np.fft.irfft(turned, 2400),
                    "dead_time": volts * sign,
                    **extra,
                },
                None,
            )
        }

    def flips(self):
        sizes = np.zeros(2400)
        sizes[[340, 860, 1760]] = 1.0, -1.0, 1.0
        return sizes

    def current_sensor(self, channel, unknown, current, duty):
        causes = {
            "sensor_scale@current": current,
            "sensor_offset@current": 1.0,
            "current_step_at_zero_duty": np.tanh(50.0 * duty),
        }
        return self.sensor(channel, unknown, 0.02, **causes)

    def sensor(self, channel, unknown, sigma, **causes):
        return {f"sensor of {channel}": ([(unknown, -1.0, 0)], {}, causes, sigma)}

    def turning(self, name, angle, rate, ratio=1.0, sigma=1e-3, **causes):
        return {name: ([(angle, 1.0, 1), (rate, -ratio, 0)], {}, causes, sigma)}

    def cable(self, prefix, torque, stiffness):
        twist = torque / stiffness
        return {
            f"{prefix}cable": (
                [(f"{prefix}m", 1.0, 0), (f"{prefix}q", -1.0, 0), (f"{prefix}tau", -1.0 / stiffness, 0)],
                {"k_s": twist, "zero": 1.0},
                {
                    "cable_backlash": np.tanh(20.0 * torque),
                    "cable_stiffening": twist * twist * twist,
                    "cable_creep": self.lag(twist, 5.0),
                    "pulley_slip": 1.0 * (self.t > 0.45 * self.t[-1]),
                },
                2e-4,
            )
        }


def motor_bench():
    b, J = Book(20.0), 0.01
    gear_K = 14.0 * K
    hull = np.clip(0.65 - 0.8 * np.cos(TURN * 0.12 * b.t), 0.0, 1.0)  # 1.6 sin^2 - 0.15
    w = hull * b.sine((9.0, 0.21, 0.0), (5.0, 0.53, 1.0), (2.0, 1.31, 2.0))
    load = b.sine((0.25, 0.09, 0.4), (0.15, 0.47, 1.7), (0.05, 1.7, 0.3))
    sign = np.tanh(10.0 * w)
    torque = J * b.rate(w) + load + 0.05 * sign + 0.004 * w
    current = torque / gear_K
    q = 14.0 * b.total(w)
    volts = R * current + 0.7 * np.tanh(current / SIGN_WIDTH_A) + gear_K * w
    duty, warm = volts / 12.0, b.lag(current**2, 60.0)
    most = abs(volts).max()
    return b, {
        **b.winding("", current, w, gear_K, 12.0, torque_constant_temperature=gear_K * w * warm),
        "mechanics": (
            [("w", -J, 1), ("I", gear_K, 0), ("w", -0.004, 0), ("load", -1.0, 0)],
            {"K": torque, "C_0": sign, "C_1": w, "mu": sign * abs(torque), "J": b.rate(w)},
            {
                **b.friction(w, torque, 0.02, 1.0),
                "torque_constant_temperature": torque * warm,
                "cogging": np.sin(4.0 * q),
                "commutation_ripple": torque * np.sin(14.0 * q + 0.5),
                "once_per_turn": np.sin(q / 14.0 + 0.3),
                "inertia": b.rate(w),
            },
            None,
        ),
        "housing": (
            [("T", -65.0, 1), ("T", -0.1, 0), ("I", 2.0 * R * current, 0)],
            {"R": current**2, "conductance": warm, "air": 1.0},
            {"pwm_ripple": abs(duty) * np.maximum(1.0 - abs(duty), 0.0)},
            None,
        ),
        "turning": (
            [("q", 1.0, 1), ("w", -14.0, 0)],
            {"compliance": b.rate(load)},
            {
                "lost_counts": np.where(abs(w) > 10.0, 20.0, 0.0),
                "cable_backlash": b.rate(np.tanh(50.0 * load)),
                "cable_stiffening": b.rate(load * load * load),
                "pulley_slip": w * (abs(load) > 0.25),
            },
            0.2,
        ),
        **b.sensor(
            "voltage_V",
            "V",
            0.008,
            voltage_clip=np.where(abs(volts) > 0.8 * most, volts - np.sign(volts) * 0.8 * most, 0.0),
            battery_sag=volts * abs(current),
            charge_drift=volts * b.total(abs(current)),
        ),
        **b.current_sensor("current_A", "I", current, duty),
        **b.sensor("speed_rad_per_s", "w", 0.04, sensor_lag=b.rate(w), clock_drift=b.rate(w) * b.t),
        **b.sensor("torque_Nm", "load", 0.008),
        **b.sensor("temperature_C", "T", 0.1),
        **b.sensor("motor_angle_rad", "q", 0.003, eccentricity=np.sin(q) + np.sin(q) * np.cos(q)),
    }


def leg_swing():
    b = Book(24.0)
    gear_K = 66.0 * K
    q = np.exp(-0.04 * b.t) * b.sine((0.35, 0.62, 0.0), (0.12, 1.15, 0.7)) + b.sine((0.1, 0.11, 0.0))
    w = b.rate(q)
    a = b.rate(w)
    current = (0.55 * a + 7.06 * np.sin(q) + 7.6 * q + 0.1 * np.tanh(w / 0.03) + 0.01 * w) / gear_K
    torque = gear_K * current
    duty = (R * current + 0.7 * np.tanh(current / SIGN_WIDTH_A) + gear_K * w) / 24.0
    return b, {
        **b.winding("", current, w, gear_K, 24.0),
        "swing": (
            [("w", -0.55, 1), ("q", -7.06 * np.cos(q) - 7.6, 0), ("w", -0.01, 0), ("I", gear_K, 0)],
            {"K": torque, "J": a, "m g c": np.sin(q), "k_h": q, "C_0": np.tanh(w / 0.03), "C_1": w},
            {
                **b.friction(w, torque, 0.01, 0.3),
                "cogging": np.sin(264.0 * q),
                "commutation_ripple": torque * np.sin(462.0 * q + 0.5),
                "once_per_turn": np.sin(3.0 * q + 0.3),
                "hip_spring_bend": q * q * q,
                "inertia": a + 5.0 * np.sin(q),
                "spring_value": q,
            },
            None,
        ),
        **b.turning("turning", "q", "w"),
        **b.sensor(
            "hip_angle_rad",
            "q",
            2e-4,
            **{
                "sensor_offset@angle": 1.0,
                "eccentricity": np.sin(2.0 * q + 0.4),
                "sensor_lag": w,
                "bit_flip": b.flips(),
            },
        ),
        **b.current_sensor("current_A", "I", current, duty),
        **b.sensor("voltage_V", "V", 0.02, clock_drift=24.0 * b.rate(duty) * b.t),
    }


def ankle():
    b = Book(20.0)
    gear_K, law_K, law_D = 0.612, 16.1209, 1.63399  # docs/robot.md C6.3
    J = 34.0 * 34.0 * HIP.rotor_inertia_kg_m2
    q = 1.3 + b.sine((0.9, 0.3, 0.0), (0.15, 1.1, 0.5), (0.05, 2.3, 0.2))
    w = b.rate(q)
    a = b.rate(w)
    tau = 0.002 * a + 0.134 * (q - 1.66)
    m = q + tau / 14.0
    wm = b.rate(m)
    torque = J * b.rate(wm) + tau + 0.05 * np.tanh(wm / 0.03) + 0.01 * wm
    current = torque / gear_K
    duty = (R * current + 0.7 * np.tanh(current / SIGN_WIDTH_A) + gear_K * wm) / 24.0
    sensor = b.current_sensor("current_A", "I", current, duty)
    sensor["sensor of current_A"][2]["clock_drift"] = b.rate(current) * b.t
    return b, {
        "motor": (
            [("wm", -J, 1), ("I", gear_K, 0), ("wm", -0.01, 0), ("tau", -1.0, 0)],
            {"K": torque, "J_m": b.rate(wm), "C_0": np.tanh(wm / 0.03), "C_1": wm},
            {
                **b.friction(wm, torque, 0.01, 0.3),
                "cogging": np.sin(136.0 * m),
                "commutation_ripple": torque * np.sin(238.0 * m + 0.5),
                "once_per_turn": np.sin(3.0 * m + 0.3),
            },
            None,
        ),
        "foot": (
            [("w", -0.002, 1), ("tau", 1.0, 0), ("q", -0.134, 0)],
            {"k": q, "rest": 1.0, "J": a},
            {"return_spring": q * q, "spring_value": q - 1.66, "inertia": a + np.sin(q)},
            None,
        ),
        **b.cable("", tau, 14.0),
        **b.turning("joint turning", "q", "w"),
        **b.turning("motor turning", "m", "wm", lost_counts=1.0 * (abs(wm) > 2.0)),
        "law": (
            [("I", 1.0, 0), ("I0", -1.0, 0), ("m", law_K, 0), ("wm", law_D, 0)],
            {},
            {"firmware_parameter": m, "voltage_clip": duty * (abs(duty) > 0.8 * abs(duty).max())},
            0.05,
        ),
        "target": ([("I0", 1.0, 0), ("goal", -law_K, 0), ("goal_rate", -law_D, 0)], {}, {}, 0.01),
        **b.sensor(
            "joint_angle_rad",
            "q",
            2e-4,
            **{"sensor_offset@angle": 1.0, "eccentricity": np.sin(q + 0.4), "bit_flip": b.flips()},
        ),
        **b.sensor("joint_rate_rad_per_s", "w", 0.02, sensor_lag=a),
        **b.sensor("motor_angle_rad", "m", 2e-4),
        **sensor,
        **b.sensor("command_current_A", "I0", 0.001),
        **b.sensor("target_angle_rad", "goal", 1e-4),
        **b.sensor("target_rate_rad_per_s", "goal_rate", 1e-3),
    }


def positioning():
    b = Book(24.8)
    v = 0.12 * np.tanh(3.0 * b.sine((1.0, 1.0 / 6.24, 0.0))) * (1.0 + b.sine((0.3, 0.43, 0.0)))
    a, x = b.rate(v), b.total(v)
    sign = np.tanh(500.0 * v)
    force = 95.1 * a + 203.5 * v + 20.4 * sign
    turn = TURN * 400.0 * x  # 2.5 mm of the line a turn
    kp, kv = 160.18, 243.45
    return b, {
        "motion": (
            [("v", -95.1, 1), ("u", 35.15, 0), ("v", -203.5, 0)],
            {"M": a, "F_v": v, "F_c": sign, "offset": 1.0},
            {
                **b.friction(v, force, 5e-4, 0.02),
                "once_per_turn": np.sin(turn),
                "cogging": np.sin(4.0 * turn),
                "commutation_ripple": force * np.sin(7.0 * turn),
                "inertia": a,
            },
            None,
        ),
        **b.turning("moving", "x", "v", sigma=1e-5, lost_counts=1.0 * (abs(v) > 0.13)),
        "controller": (
            [("u", -1.0, 0), ("goal", kp * kv, 0), ("x", -kp * kv, 0), ("v", -kv, 0)],
            {"offset of the law": 1.0},
            {"firmware_parameter": kv * v, "sensor_lag": kv * (kp * v + a)},
            0.05,
        ),
        **b.sensor("position_m", "x", 1e-6, **{"sensor_offset@angle": 1.0, "eccentricity": np.sin(turn)}),
        **b.sensor(
            "voltage_V",
            "u",
            0.005,
            voltage_clip=force / 35.15 * (abs(force) > 0.85 * abs(force).max()),
            clock_drift=b.rate(force) * b.t / 35.15,
        ),
        **b.sensor("reference_m", "goal", 1e-6),
    }


def walk():
    b = Book(12.0)
    hip_K, ankle_K, f = 66.0 * K, 0.612, 1.0 / 1.2  # a stride is two steps of 0.6 s
    swing = b.sine((1.0, f, 0.0))
    stance, other = 1.0 / (1.0 + np.exp(-16.0 * swing)), 1.0 / (1.0 + np.exp(16.0 * swing))
    double = np.exp(-(swing**2) / 0.0144)
    hip = b.sine((0.35, f, 0.3), (0.06, 3.0 * f, 1.0), (0.01, 0.31, 0.0))
    leg = b.sine((0.22, f, 0.9), (0.04, 2.0 * f, 0.4), (0.01, 0.23, 0.5))
    wh, wl = b.rate(hip), b.rate(leg)
    torque = 0.55 * b.rate(wh) + 7.6 * hip + 3.0 * np.sin(leg)
    current = (torque + 0.1 * np.tanh(20.0 * wh)) / hip_K
    supply = 24.0 - 0.2 * abs(current)
    duty = (R * current + hip_K * wh) / supply
    total = (hip_K * current * wh + 12.0) / supply
    warm = b.lag(current**2, 60.0)
    ankles = {}
    for name, phase, on, sound in (("outer", 0.2, stance, False), ("inner", 0.2 + math.pi, other, True)):
        angle = 1.2 + b.sine((0.5, f, phase), (0.2, 2.0 * f, phase))
        w = b.rate(angle)
        tau = 3.0 * on * (1.0 + b.sine((0.5, f, phase + 1.0))) + 0.134 * (angle - 1.66)
        fault = {} if sound else {"lost_counts": 1.0 * (abs(w) > 2.0)}
        cable = b.cable(f"{name} ", tau, 14.0)
        if sound:
            cable = {f"{name} cable": (cable[f"{name} cable"][0], {}, {}, 2e-4)}
        ankles |= {
            f"{name} motor": (
                [(f"{name} wm", -0.00185, 1), (f"{name} I", ankle_K, 0), (f"{name} wm", -0.01, 0),
                 (f"{name} tau", -1.0, 0)],
                {"K": tau + 0.1 * np.tanh(20.0 * w), "C_0": np.tanh(20.0 * w), "C_1": w},
                {} if sound else {"return_spring": angle * angle},
                None,
            ),
            **cable,
            **b.turning(f"{name} motor turning", f"{name} m", f"{name} wm", **fault),
            **b.turning(f"{name} joint turning", f"{name} q", f"{name} w"),
            **b.sensor(f"{name}_ankle_angle_rad", f"{name} q", 2e-4, **({} if sound else {"bit_flip": b.flips()})),
            **b.sensor(f"{name}_ankle_rate_rad_per_s", f"{name} w", 0.02),
            **b.sensor(f"{name}_motor_angle_rad", f"{name} m", 2e-4),
            **b.sensor(f"{name}_ankle_current_A", f"{name} I", 0.02),
        }  # fmt: skip
    return b, {
        **b.winding("hip ", current, wh, hip_K, supply, torque_constant_temperature=hip_K * wh * warm),
        "hip": (
            [("hip w", -0.55, 1), ("hip", -7.6, 0), ("leg", -3.0, 0), ("hip I", hip_K, 0)],
            {"J": b.rate(wh), "m g c": np.sin(leg), "k_h": hip, "C_0": np.tanh(wh / 0.03), "C_1": wh,
             "K": hip_K * current},
            {
                **b.friction(wh, torque, 0.01, 0.3),
                "torque_constant_temperature": hip_K * current * warm,
                "cogging": np.sin(264.0 * hip),
                "commutation_ripple": torque * np.sin(462.0 * hip),
                "once_per_turn": np.sin(3.0 * hip + 0.3),
                "hip_spring_bend": hip * hip * hip,
                "spring_value": hip,
                "leg_asymmetry": (stance - other) * np.cos(leg),
            },
            None,
        ),
        **b.turning("hip turning", "hip", "hip w"),
        **b.turning("leg turning", "leg", "leg w"),
        "stance": (
            [("leg w", -10.0, 1), ("leg", 60.0 * stance, 0), ("hip", 20.0 * other, 0), ("outer tau", stance, 0),
             ("inner tau", other, 0)],
            {"m": b.rate(wl)},
            {
                "inertia": np.sin(leg) + b.rate(wl) / 5.0,
                "floor": 1.0,
                "contact_loss": double * b.sine((1.0, f, math.pi / 2.0)) + 0.3 * np.sign(wl) * stance,
                "leg_asymmetry": stance - other,
                "geometry": np.sign(leg) * np.sin(leg) ** 2,
            },
            0.5,
        ),
        "closure": (
            [("leg", double, 0), ("hip", -double / 2.0, 0)],
            {},
            {"geometry": double * np.sign(hip), "floor": double / 2.0},
            2e-3,
        ),
        **ankles,
        "power": (
            [("battery V", total, 0), ("battery I", supply, 0), ("hip I", -2.0 * R * current - hip_K * wh, 0),
             ("hip w", -hip_K * current, 0)],
            {"fixed": 1.0},
            {"pwm_ripple": (2.0 * abs(current) + 1.0) / 20.0},
            0.2,
        ),
        "battery": (
            [("battery V", 1.0, 0), ("battery I", 0.1, 0)],
            {"empty voltage": 1.0},
            {"battery_sag": total, "charge_drift": b.total(total)},
            0.02,
        ),
        **b.sensor(
            "hip_angle_rad", "hip", 2e-4, **{"sensor_offset@angle": 1.0, "eccentricity": np.sin(2.0 * hip + 0.4)}
        ),
        **b.sensor("hip_rate_rad_per_s", "hip w", 0.02, sensor_lag=b.rate(wh)),
        **b.sensor(
            "outer_leg_rate_rad_per_s",
            "leg w",
            0.01,
            **{
                "sensor_scale@gyro": wl,
                "sensor_offset@gyro": 1.0,
                "gyro_misalignment": b.sine((0.2, f, 2.0), (0.1, 2.0 * f, 0.1)),
                "clock_drift": b.rate(wl) * b.t,
            },
        ),
        **b.sensor("outer_leg_angle_rad", "leg", 5e-3),
        **b.current_sensor("hip_current_A", "hip I", current, duty),
        **b.sensor("hip_voltage_V", "hip V", 0.05, voltage_clip=duty * (abs(duty) > 0.3)),
        **b.sensor("battery_voltage_V", "battery V", 0.02),
        **b.sensor("battery_current_A", "battery I", 0.02),
        "hip law": (
            [("hip I", 1.0, 0), ("hip", 5.0, 0), ("hip w", 0.5, 0)],
            {"target": np.sign(hip)},
            {"firmware_parameter": hip},
            0.05,
        ),
    }  # fmt: skip


SECOND_BOOK = {
    "motor-bench": motor_bench,
    "leg-swing": leg_swing,
    "ankle": ankle,
    "positioning": positioning,
    "walk": walk,
}


def close(found, expected, what):
    sampled = np.ones(SAMPLES) * (expected[::FINE] if isinstance(expected, np.ndarray) else expected)
    size = max(float(abs(sampled).max()), 1e-30)
    assert found.shape == (SAMPLES,), what
    assert abs(found - sampled).max() <= 1e-6 * size, what


@pytest.mark.parametrize("name", SECOND_BOOK)
def test_each_term_parameter_and_cause_of_an_experiment_is_that_of_the_second_book(name):
    model = experiment_models.MODELS[name]()
    book, equations = SECOND_BOOK[name]()
    assert model.name == name
    close(model.time_s, book.t, "time")
    assert [each.name for each in model.equations] == list(equations)
    for found in model.equations:
        terms, parameters, causes, sigma = equations[found.name]
        assert [(term[0], term[2]) for term in found.terms] == [(term[0], term[2]) for term in terms]
        for term, expected in zip(found.terms, terms, strict=True):
            close(term[1], expected[1], f"{found.name}: {term[0]}")
        for kind, shown, booked in (("parameter", found.parameters, parameters), ("cause", found.causes, causes)):
            assert set(shown) == set(booked), found.name
            for key, expected in booked.items():
                close(shown[key], expected, f"{found.name}: {kind} {key}")
        if sigma is None:  # an equation is exact to 1 % of its first parameter's part
            first = next(iter(parameters.values())) * np.ones(2400)
            sigma = 0.01 * math.sqrt(np.mean(first[::FINE] ** 2))
        assert found.sigma == pytest.approx(sigma, rel=1e-9), found.name
        assert found.channel == found.name.removeprefix("sensor of ") or not found.name.startswith("sensor of ")


def test_a_place_is_reported_for_causes_that_could_be_at_several():
    for name in SECOND_BOOK:
        model = experiment_models.MODELS[name]()
        assert set(model.places) <= set(model.causes)
        for cause, place in model.places.items():
            if place in model.channels:
                assert any(cause in each.causes for each in model.equations if each.channel == place)


PLACES = {
    "motor-bench": {
        "sensor_lag": "speed_rad_per_s",
        "clock_drift": "speed_rad_per_s",
        "eccentricity": "motor_angle_rad",
    },
    "leg-swing": {"sensor_lag": "hip_angle_rad", "eccentricity": "hip_angle_rad", "clock_drift": "voltage_V"},
    "ankle": {"sensor_lag": "joint_rate_rad_per_s", "eccentricity": "joint_angle_rad", "clock_drift": "current_A"},
    "positioning": {
        "sensor_lag": "the controller's loop",
        "sensor_offset@angle": "position_m",
        "clock_drift": "voltage_V",
    },
    "walk": {
        "sensor_lag": "hip_rate_rad_per_s",
        "eccentricity": "hip_angle_rad",
        "clock_drift": "outer_leg_rate_rad_per_s",
        "sensor_offset@angle": "hip_angle_rad",
        "sensor_scale@current": "hip_current_A",
        "sensor_offset@current": "hip_current_A",
        "cable_backlash": "outer ankle",
        "bit_flip": "outer ankle",
    },
}


def test_causes_are_at_their_most_usual_places():
    assert {name: dict(make().places) for name, make in experiment_models.MODELS.items()} == PLACES


def test_the_builder_s_grid_has_twenty_steps_between_samples_and_ends_with_the_duration():
    b = Builder(10.0)
    assert len(b.t) == 2400 and b.t[-1] == 10.0 and b.step_s == pytest.approx(10.0 / 2399.0)
    assert b.waves().tolist() == [0.0] * 2400


def test_rates_sums_and_filters_have_their_textbook_answers():
    b = Builder(10.0)
    assert np.allclose(b.rate(3.0 * b.t), 3.0)
    assert b.integral(np.full(2400, 2.0))[-1] == pytest.approx(20.0, rel=1e-3)
    step = b.low_pass(np.ones(2400), 2.0)
    assert step[0] == 0.0 and np.allclose(step, 1.0 - np.exp(-b.t / 2.0), atol=2e-3)
    assert b.low_pass(-np.ones(2400), 2.0)[-1] == pytest.approx(-(1.0 - math.exp(-5.0)), abs=1e-3)
    w = b.waves((2.0, 0.25, 0.5))
    assert w[0] == pytest.approx(2.0 * math.sin(0.5)) and w.max() == pytest.approx(2.0, rel=1e-5)


def test_a_derivative_of_order_0_65_scales_a_sine_and_turns_it_by_58_5_degrees():
    b = Builder(2399.0)  # steps of 1 s: a period of 100 samples stands 24 times in the grid
    omega = TURN / 100.0
    found = b.half_derivative(np.sin(omega * b.t))
    assert np.allclose(found, omega**0.65 * np.sin(omega * b.t + math.radians(58.5)), atol=1e-9)


def test_a_bristle_bends_over_its_way_in_both_directions_and_again_after_a_reversal():
    b = Builder(2399.0)  # steps of 1 s
    speed = np.concatenate([np.full(1200, 0.1), np.full(1200, -0.1)])
    lacking = b.bristle(speed, 5.0)
    way = 0.1 * np.arange(1200)
    assert np.allclose(lacking[1:1200], -np.exp(-way[1:] / 5.0), atol=1e-12)  # full friction but for the bend
    assert np.allclose(lacking[1200:], 2.0 * np.exp(-(way + 0.1) / 5.0), atol=1e-9)  # from + 1 to - 1
    assert b.bristle(np.full(2400, -50.0), 5.0)[1:].tolist() == pytest.approx(
        [math.exp(-10.0)] + [0.0] * 2398, abs=1e-4
    )
    assert not b.bristle(np.zeros(2400), 5.0).any()


def test_an_equation_without_parameters_is_as_exact_as_one_per_cent_of_one():
    b = Builder(1.0)
    b.equation("plain", "M", [("x", 2.0)])
    b.equation("told", "M", [("x", 2.0, 1)], {"k": 3.0}, sigma=0.5)
    b.equation("from its regressor", "M", [("x", 2.0, 1)], {"k": -3.0, "l": 70.0})
    assert [each.sigma for each in b.equations] == pytest.approx([0.01, 0.5, 0.03])
    assert [each.terms[0][2] for each in b.equations] == [0, 1, 1]
