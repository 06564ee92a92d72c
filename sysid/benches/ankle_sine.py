"""An ankle that tracks a sine while the robot hangs, as in the robot's own foot-inertia logs.

Motor and foot are two inertias with the cable between them; the board's law acts on the motor's angle p:

    I = K (target - p) + D (target' - p')
    J_A p'' = T(I, p') - k_s (p - a)              T of EQUATIONS 2.1
    J_f a'' = k_s (p - a) - k_r (a - a_0)         EQUATIONS 2.3, 2.7

Columns are those of the logs: motor_angle_rad, joint_angle_rad, joint_rate_rad_per_s, target_angle_rad,
target_rate_rad_per_s, motor_current_A (about 19 Hz, with separate stamps).
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ranger_sim.plant.electrics.motor_parameters import ANKLE_MOTOR, MotorParameters
from ranger_sim.plant.mechanics.parameters import BodyParameters
from ranger_sim.sysid.benches.bench_terms import NOTHING, BenchTerms
from ranger_sim.sysid.dataset import Channel, Dataset
from ranger_sim.sysid.instruments import BOARD_CURRENT, JOINT_ENCODER, Instrument

Array = NDArray[np.float64]

STIFFNESS_A_per_rad = 11.219  # of the logs' runs
DAMPING_As_per_rad = 1.634
AMPLITUDE_rad = 0.85
CENTRE_rad = 1.05  # the logs' sines run from 0.2 to 1.9 rad
LOG_S = 0.004  # from one row to the next
CURRENT_S = 0.052
STEP_S = 0.0005
# Foot 0.0013 kg m^2, return spring 0.33 N m/rad, friction 0.08 N m: what the robot's own logs say (robot.md P3).
HANGING = dataclasses.replace(BodyParameters(), foot_inertia_kg_m2=0.0013, ankle_return_Nm_per_rad=0.33)
MOTOR = dataclasses.replace(ANKLE_MOTOR, constant_friction_Nm=0.06)
# As logged: both encoders are zeroed at the same stop, so their offsets are the log's own zero.
ENCODER = dataclasses.replace(JOINT_ENCODER, offset=0.0)
RATE = Instrument(
    "joint rate", "rad/s", 0.02, 0.005, 0.0, 0.0, "chosen by us in the size of the scatter in the robot's own logs"
)


def sine(times: Array, frequency_hz: float) -> tuple[Array, Array]:
    """Target angle and rate."""
    w = 2.0 * math.pi * frequency_hz
    return CENTRE_rad + AMPLITUDE_rad * np.sin(w * times), AMPLITUDE_rad * w * np.cos(w * times)


def tracked(
    body: BodyParameters, motor: MotorParameters, frequency_hz: float, seconds: float, terms: BenchTerms = NOTHING
) -> Array:
    """Rows of (time, motor angle, joint angle, joint rate, target, its rate, current) every STEP_S, settled at first.

    One period goes before, so that nothing of the start is left.
    """
    unit = terms.unit("inner_motor", motor, "ankle")
    J_A, J_f = motor.reflected_inertia_kg_m2, body.foot_inertia_kg_m2
    k_s, k_r, a_0 = body.ankle_spring_Nm_per_rad, body.ankle_return_Nm_per_rad, body.ankle_return_rest_rad
    before = 1.0 / frequency_hz
    w = 2.0 * math.pi * frequency_hz

    def slope(t: float, p: float, a: float, u: float, v: float) -> tuple[float, float, float]:
        current = STIFFNESS_A_per_rad * (CENTRE_rad + AMPLITUDE_rad * math.sin(w * t) - p)
        current += DAMPING_As_per_rad * (AMPLITUDE_rad * w * math.cos(w * t) - u)
        cable = k_s * (p - a)
        unit.turn(p, 0.0, 0.0)
        on_motor, on_foot = unit.torque_Nm(current, u) - cable, cable - k_r * (a - a_0)
        if terms.places:
            stretch = terms.torque_Nm("inner_cable", p - a, u - v)
            on_motor += terms.torque_Nm("inner_motor", p, u) - stretch
            on_foot += terms.torque_Nm("inner_ankle", a, v) + stretch
        return on_motor / J_A, on_foot / J_f, current

    h = STEP_S
    p, a, u, v = CENTRE_rad, CENTRE_rad, AMPLITUDE_rad * w, AMPLITUDE_rad * w
    count = round((before + seconds) / h)
    rows = []
    for number in range(count):
        t = number * h - before
        u1, v1, current = slope(t, p, a, u, v)
        if t >= -0.5 * h:
            target = CENTRE_rad + AMPLITUDE_rad * math.sin(w * t)
            rows.append((t, p, a, v, target, AMPLITUDE_rad * w * math.cos(w * t), current))
        u2, v2, _ = slope(t + 0.5 * h, p + 0.5 * h * u, a + 0.5 * h * v, u + 0.5 * h * u1, v + 0.5 * h * v1)
        pm, am = p + 0.5 * h * u + 0.25 * h * h * u1, a + 0.5 * h * v + 0.25 * h * h * v1
        u3, v3, _ = slope(t + 0.5 * h, pm, am, u + 0.5 * h * u2, v + 0.5 * h * v2)
        pe, ae = p + h * u + 0.5 * h * h * u2, a + h * v + 0.5 * h * h * v2
        u4, v4, _ = slope(t + h, pe, ae, u + h * u3, v + h * v3)
        p += h * u + h * h / 6.0 * (u1 + u2 + u3)
        a += h * v + h * h / 6.0 * (v1 + v2 + v3)
        u += h / 6.0 * (u1 + 2.0 * u2 + 2.0 * u3 + u4)
        v += h / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4)
    return np.array(rows)


def ankle_sine(
    body: BodyParameters = HANGING,
    motor: MotorParameters = MOTOR,
    seed: int = 1,
    frequency_hz: float = 1.0,
    seconds: float = 4.0,
    terms: BenchTerms = NOTHING,
) -> Dataset:
    """One run at one frequency, as the robot would log it."""
    name = f"ankle-sine {frequency_hz:g} Hz"
    terms = terms.of_bench("ankle-sine")
    rows = tracked(body, terms.motor("inner_motor", motor), frequency_hz, seconds, terms)
    kept = rows[:: round(LOG_S / STEP_S)]
    sparse = rows[:: round(CURRENT_S / STEP_S)]
    time_s = kept[:, 0]
    instruments = (ENCODER, dataclasses.replace(ENCODER, name="ankle encoder"), RATE)
    channels = {}
    for column, (channel, one) in enumerate(
        zip(("motor_angle_rad", "joint_angle_rad", "joint_rate_rad_per_s"), instruments, strict=True), start=1
    ):
        shown = one.read(kept[:, column], seed, name)
        channels[channel] = Channel(channel, one.unit, time_s, shown, one.resolution, f"{one.name}: {one.source}")
    for column, (channel, unit) in enumerate((("target_angle_rad", "rad"), ("target_rate_rad_per_s", "rad/s")), 4):
        channels[channel] = Channel(channel, unit, time_s, kept[:, column], source="set")
    current = BOARD_CURRENT.read(sparse[:, 6], seed, name)
    channels["motor_current_A"] = Channel("motor_current_A", "A", sparse[:, 0], current, BOARD_CURRENT.resolution)
    return Dataset(name, channels)
