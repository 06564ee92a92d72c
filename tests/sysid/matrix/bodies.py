"""Five machines in plain numbers: a motor bench, a swinging leg, an ankle under its board's law, a positioning axis,
a belt axis. Steps of 0.1 ms, semi-implicit; friction truly sticks, or has a smooth sign.

Each returns its true channels on the fine grid, and for the strength of an effect the balance in which it acts: what
it adds, what the base parameters can take up, and the noise of that balance by frequency. Nothing of the diagnosis is
used.
"""

import dataclasses
import math

import numpy as np

from tests.sysid.matrix import drives
from tests.sysid.matrix.drives import H_S

GRAVITY = 9.81


@dataclasses.dataclass
class Made:
    """channels: by column, (fine steps,), without noise; effect, base: (fine steps,) each, of the balance; deviation:
    (frequencies) -> noise of the balance by the channels' own power spectra, see `strength.py`."""

    channels: dict
    effect: np.ndarray
    base: list
    deviation: object


def shifted(draw, values):
    """Each 5 to 15 % off, up or down: the parameters that are fitted."""
    return {name: value * (1.0 + draw.choice((-1.0, 1.0)) * draw.uniform(0.05, 0.15)) for name, value in values.items()}


def rubbed(rate, push, limit, inertia, smooth):
    """The rate after a step, with friction of this limit. smooth: rate about which its sign turns, 0: it sticks."""
    free, most = rate + push * H_S / inertia, limit * H_S / inertia
    if smooth > 0.0:
        return free / (1.0 + most / (rate**4 + smooth**4) ** 0.25)  # a thousandth from its limit at four times it
    return 0.0 if abs(free) <= most else free - math.copysign(most, free)


def bench(draw, drawn, kind, held_rows, smooth, law, count):
    """J w' = G K I - T - C1 w - (C0 + mu G K |I|) sgn w - law;  I behind L / R of (V - Vc sgn I - G K w) / R."""
    p = shifted(draw, {"R": 1.34, "Vc": 0.7, "GK": 0.252, "C0": 0.01, "C1": 0.0033, "mu": 0.1, "J": 9.4e-4, "L": 67e-6})
    volts = drives.of("multisine" if kind == "feedback" else kind, drawn, count, 6.0)
    if kind == "feedback":
        volts *= 12.0 / 6.0  # a target of the speed, rad/s
    if held_rows and kind != "feedback":
        volts = drives.held(volts, held_rows)
    load = drives.multisine(drawn, count, 0.35, 0.11, 1.7, 5)
    out = np.empty((count, 4))
    torque = np.empty(count)
    R, Vc, GK, J = p["R"], p["Vc"], p["GK"], p["J"]
    keep, w, current, angle, put, summed = math.exp(-H_S * R / p["L"]), 0.0, 0.0, 0.0, 0.0, 0.0
    for at, (given, outside) in enumerate(zip(volts.tolist(), load.tolist(), strict=True)):
        if kind != "feedback":
            put = given
        elif not held_rows or at % held_rows == 0:
            summed += 2.0 * (given - w) * H_S * (held_rows or 1)
            put = max(-12.0, min(12.0, 0.25 * given + 0.3 * (given - w) + summed))
        out[at] = put, current, w, angle
        left = put - GK * w
        settled = 0.0 if abs(left) < Vc else (left - math.copysign(Vc, left)) / R
        current = settled + (current - settled) * keep
        extra = torque[at] = law(w, angle, at * H_S)
        push = GK * current - outside - p["C1"] * w - extra
        w = rubbed(w, push, p["C0"] + p["mu"] * GK * abs(current), J, 0.05 * smooth)
        angle += w * H_S
    V, I, w, angle = out.T  # noqa: E741  (the paper's letter)
    acceleration = np.gradient(w, H_S)
    channels = {
        "voltage_V": V,
        "current_A": I,
        "speed_rad_per_s": w,
        "torque_Nm": load,
        "temperature_C": np.full(count, 22.0),
        "motor_angle_rad": 14.0 * angle,
    }
    base = [acceleration, w, np.sign(w), np.abs(I) * np.sign(w), I]

    def deviation(hertz, power):
        turn = (2.0 * np.pi * hertz) ** 2
        return power["torque_Nm"] + GK**2 * power["current_A"] + (p["C1"] ** 2 + J**2 * turn) * power["speed_rad_per_s"]

    return Made(channels, torque, base, deviation)


def leg(draw, drawn, kind, held_rows, smooth, law, count):
    """J q'' = K I - k q - m g (c sin q - w cos q) - C1 q' - (C0 + mu K |I|) sgn q' - law."""
    p = shifted(
        draw, {"R": 1.34, "Vc": 0.7, "K": 1.19, "C0": 0.1, "C1": 0.01, "mu": 0.1, "J": 0.557, "k": 7.6, "a": 0.39}
    )
    level = 0.35 if kind == "feedback" else 7.0
    volts = drives.of("multisine" if kind == "feedback" else kind, drawn, count, level)
    if held_rows and kind != "feedback":
        volts = drives.held(volts, held_rows)
    out, torque = np.empty((count, 4)), np.empty(count)
    R, Vc, K, J = p["R"], p["Vc"], p["K"], p["J"]
    q, rate, put = 0.0, 0.0, 0.0
    for at, given in enumerate(volts.tolist()):
        if kind != "feedback":
            put = given
        elif not held_rows or at % held_rows == 0:
            put = max(-12.0, min(12.0, 40.0 * (given - q) - 2.0 * rate))
        left = put - K * rate
        current = 0.0 if abs(left) < Vc else (left - math.copysign(Vc, left)) / R
        out[at] = put, current, q, rate
        extra = torque[at] = law(rate, q, at * H_S)
        push = K * current - p["k"] * q - GRAVITY * 0.72 * math.sin(q) + p["a"] * math.cos(q) - p["C1"] * rate - extra
        rate = rubbed(rate, push, p["C0"] + p["mu"] * K * abs(current), J, 0.005 * smooth)
        q += rate * H_S
    V, I, q, rate = out.T  # noqa: E741
    base = [np.gradient(rate, H_S), rate, np.sign(rate), np.abs(I) * np.sign(rate), I, q, np.cos(q)]

    def deviation(hertz, power):
        turn = (2.0 * np.pi * hertz) ** 2
        return K**2 * power["current_A"] + ((p["k"] - J * turn) ** 2 + K**4 / R**2 * turn) * power["hip_angle_rad"]

    return Made({"hip_angle_rad": q, "current_A": I, "voltage_V": V}, torque, base, deviation)


def ankle(draw, drawn, kind, held_rows, smooth, law, count):
    """Rotor and foot with a cable between them, under I = K (target - p) + D (target' - p'), from the board each 0.5 ms
    with counts of its encoder and targets each 2 ms, 2 ms old. A feedback drive is the sine of the robot's logs. The
    current has no limit here, for the diagnosis's ankle has none."""
    usual = {"J_f": 0.0012, "k_r": 0.066, "q_0": 1.66, "k_s": 14.0, "C0": 0.05, "C1": 0.004, "mu": 0.1, "GK": 0.612}
    p = shifted(draw, usual | {"zero": 0.025})
    J_m, damping, k_s, GK = 34.0**2 * 1.6e-6, 0.003, p["k_s"], p["GK"]
    K, D = float(drawn.uniform(15.0, 25.0)), float(drawn.uniform(1.5, 1.8))
    time_s = np.arange(count) * H_S
    if kind == "feedback":
        hertz, phase = float(np.exp(drawn.uniform(np.log(0.12), np.log(1.5)))), drawn.uniform(0.0, 6.28)
        target = 1.3 + 0.9 * np.sin(2.0 * np.pi * hertz * time_s + phase)
    elif kind == "chirp":
        target = 1.3 + drives.chirp(drawn, count, 0.7, 0.15, 1.5)
    else:
        target = 1.3 + drives.of(kind, drawn, count, 0.25 if kind == "steps" else 0.5)
    rate = np.zeros(count) if kind == "steps" else np.gradient(target, H_S)
    asked, asked_rate = (np.repeat(each[::20], 20)[:count] for each in (target, rate))
    late, late_rate = (np.concatenate((np.full(20, each[0]), each[:-20])) for each in (asked, asked_rate))
    out, torque = np.empty((count, 3)), np.empty(count)
    u = v = current = wanted = 0.0
    motor, foot = target[0], target[0] + p["zero"]
    keep, counted = math.exp(-H_S / 5e-4), 2.0 * math.pi / (2048.0 * 34.0)
    for at, (to, to_rate) in enumerate(zip(late.tolist(), late_rate.tolist(), strict=True)):
        if at % 5 == 0:
            seen = math.floor(motor / counted) * counted
            wanted = K * (to - seen) + D * (to_rate - u)
        current = wanted + (current - wanted) * keep
        out[at] = motor, foot, u
        pull = k_s * (motor - foot + p["zero"]) + damping * (u - v)
        extra = torque[at] = law(u, foot, at * H_S)
        on_motor, on_foot = extra if isinstance(extra, tuple) else (0.0, extra)
        torque[at] = on_motor + on_foot
        push = GK * current - pull - p["C1"] * u - on_motor
        u = rubbed(u, push, p["C0"] + p["mu"] * GK * abs(current), J_m, 0.02 * smooth)
        v += H_S / p["J_f"] * (pull - p["k_r"] * (foot - p["q_0"]) - on_foot)
        motor, foot = motor + u * H_S, foot + v * H_S
    motor, foot, u = out.T
    effort = GK * (K * (late - motor) + D * (late_rate - u))
    base = [np.gradient(u, H_S), u, np.sign(u), np.abs(effort) * np.sign(u), effort, foot, np.ones(count)]
    channels = {
        "joint_angle_rad": foot,
        "target_angle_rad": asked,
        "target_rate_rad_per_s": asked_rate,
        "command_stiffness_A_per_rad": np.full(count, K),
        "command_dampness_A_s_per_rad": np.full(count, D),
    }

    def deviation(hertz, power):
        turn = 2.0 * np.pi * hertz
        return ((GK * K - (J_m + p["J_f"]) * turn**2) ** 2 + (GK * D * turn) ** 2) * power["joint_angle_rad"]

    return Made(channels, torque, base, deviation)


def positioning(draw, drawn, kind, held_rows, smooth, law, count):
    """M v' = g V - F_v v - F_c sgn v - F_0 - law, g published; feedback with the published gains, on a sum of sines."""
    p = shifted(draw, {"M": 95.1, "F_v": 203.5, "F_c": 20.4, "F_0": 3.0})
    gain = 35.15065188
    volts = drives.of("multisine" if kind == "feedback" else kind, drawn, count, 0.1 if kind == "feedback" else 3.0)
    if held_rows and kind != "feedback":
        volts = drives.held(volts, held_rows)
    out, force = np.empty((count, 3)), np.empty(count)
    x, v, put = 0.0, 0.0, 0.0
    for at, given in enumerate(volts.tolist()):
        if kind != "feedback":
            put = given
        elif not held_rows or at % held_rows == 0:
            put = max(-10.0, min(10.0, 60.0 * (30.0 * (given - x) - v)))
        out[at] = put, x, v
        extra = force[at] = law(v, x, at * H_S)
        v = rubbed(v, gain * put - p["F_v"] * v - p["F_0"] - extra, p["F_c"], p["M"], 0.001 * smooth)
        x += v * H_S
    V, x, v = out.T
    base = [np.gradient(v, H_S), v, np.sign(v), np.ones(count)]

    def deviation(hertz, power):
        turn = (2.0 * np.pi * hertz) ** 2
        return gain**2 * power["voltage_V"] + (p["F_v"] ** 2 * turn + p["M"] ** 2 * turn**2) * power["position_m"]

    return Made({"position_m": x, "voltage_V": V}, force, base, deviation)


def axis(draw, drawn, kind, held_rows, smooth, law, count):
    """6 kg v' = f I - b v - F_c sgn v - law;  I = (V - f v) / R."""
    p = shifted(draw, {"f": 20.0, "R": 1.5, "b": 12.0, "F_c": 8.0})
    volts = drives.of("multisine" if kind == "feedback" else kind, drawn, count, 0.12 if kind == "feedback" else 8.0)
    if held_rows and kind != "feedback":
        volts = drives.held(volts, held_rows)
    out, force = np.empty((count, 4)), np.empty(count)
    x, v, put = 0.0, 0.0, 0.0
    for at, given in enumerate(volts.tolist()):
        if kind != "feedback":
            put = given
        elif not held_rows or at % held_rows == 0:
            put = max(-24.0, min(24.0, 250.0 * (given - x)))
        current = (put - p["f"] * v) / p["R"]
        out[at] = put, current, x, v
        extra = force[at] = law(v, x, at * H_S)
        v = rubbed(v, p["f"] * current - p["b"] * v - extra, p["F_c"], 6.0, 0.002 * smooth)
        x += v * H_S
    V, I, x, v = out.T  # noqa: E741
    base = [np.gradient(v, H_S), v, np.sign(v), I]

    def deviation(hertz, power):
        turn = (2.0 * np.pi * hertz) ** 2
        return p["f"] ** 2 * power["current_A"] + (p["b"] ** 2 * turn + 36.0 * turn**2) * power["position_m"]

    return Made({"voltage_V": V, "current_A": I, "position_m": x}, force, base, deviation)


BODIES = {each.__name__: each for each in (bench, leg, ankle, positioning, axis)}


# ---- hidden effects: what a law adds against the motion. size, and numbers drawn once for a case ----


def drag(size, numbers):
    return lambda rate, place, t: size * math.copysign(abs(rate) ** numbers["power"], rate)


def bend(size, numbers):
    """A spring that hardens: the hyperbolic sine less its slope."""
    return lambda rate, place, t: size * (math.sinh(place / 0.45) - place / 0.45)


def hardening(size, numbers):
    """A return spring that hardens beyond 0.7 rad, exponentially."""

    def law(rate, place, t):
        over = max(place - 0.7, 0.0) / 0.45
        return size * (math.expm1(over) - over)

    return law


def wave(size, numbers):
    """Three harmonics over the place."""

    def law(rate, place, t):
        x = numbers["per"] * place + numbers["phase"]
        return size * (math.sin(x) + 0.3 * math.sin(2.0 * x + 1.0) + 0.1 * math.sin(3.0 * x + 2.0))

    return law


def lopsided(size, numbers):
    """Viscous friction that is larger in one direction."""
    return lambda rate, place, t: size * abs(rate)


def none(size, numbers):
    return lambda rate, place, t: 0.0


@dataclasses.dataclass(frozen=True)
class Hidden:
    """names: causes that are right; coefficient: the one whose interval is judged, "" where the cause has another form;
    factor: numbers -> its true value per unit of the size."""

    law: object
    names: tuple
    numbers: object = lambda draw: {}
    coefficient: str = ""
    factor: object = lambda numbers: 1.0


def _power(draw):
    return {"power": float(draw.uniform(1.9, 2.1))}


def _turn(per):
    return lambda draw: {"per": per, "phase": float(draw.uniform(0.0, 6.28))}


TAU = 2.0 * math.pi
HIDDEN = {
    "bench": {
        "drag": Hidden(drag, ("drag",), _power),
        "cogging": Hidden(wave, ("cogging", "once_per_turn", "commutation_ripple"), _turn(14.0)),
    },
    "leg": {"drag": Hidden(drag, ("drag",), _power), "spring": Hidden(bend, ("hip_spring_bend",))},
    "ankle": {"spring": Hidden(hardening, ("return_spring",))},
    "positioning": {
        "direction": Hidden(lopsided, ("direction_friction",), coefficient="viscous_Ns_per_m"),
        "ripple": Hidden(
            wave, ("once_per_turn",), _turn(TAU / 0.02), "sine_N", lambda numbers: math.cos(numbers["phase"])
        ),
    },
    "axis": {
        "drag": Hidden(drag, ("drag",), _power),
        "ripple": Hidden(wave, ("once_per_turn",), _turn(TAU / 0.08)),
    },
}
