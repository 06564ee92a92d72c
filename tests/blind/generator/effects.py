"""Effects that a motor bench can hide: what each does in the bench, and how it shows in the balances.

An effect has an amplitude (one number that is found by calibration) and a shape (numbers drawn for each case).

    act       lets it act: a law in the bench's loop, or a change of what the instruments see
    show      what one unit of it adds to the balances of noise-free data, along a known trajectory:
                E  V - R I - Vc sgn I - L dI/dt - G K w                                   volt
                M  G K I - J dw/dt - (C0 + mu G K |I|) sgn w - C1 w - T - leg              newton metre
                T  d theta/dt / G - w                                                      rad/s
    `tell`    the amplitude in the catalogue's parameters, where these mean the same
"""

import dataclasses
from collections.abc import Callable

import numpy as np

from tests.blind.generator.bench import DT_S, FINE
from tests.blind.generator.excitation import STEP_S, lagged


@dataclasses.dataclass(frozen=True)
class Effect:
    """name: the catalogue's identifier, or None outside it; balance: where it shows first."""

    name: str
    balance: str
    draw: Callable
    show: Callable
    law: str = ""
    measure: Callable | None = None
    tell: Callable = lambda a, shape, base: {}
    linear: bool = True  # in its amplitude
    start: float = 1.0  # where the search for the amplitude of another begins
    sign: bool = False  # may be negative
    known: bool = True  # in the catalogue
    # (trajectory) -> [(shape, balances)]: the catalogue's own form at unit size and the name of that size. What is
    # hidden has another form, so the size that a right answer finds is that of the form that comes nearest.
    like: Callable | None = None
    size: str = ""


def rate(values):
    return np.gradient(values, STEP_S)


def seen(t, V=None, I=None, w=None, T=None, theta=None):  # noqa: E741
    """Balances from deviations of what the instruments show."""
    p = t.base
    E, M, S = np.zeros((3, len(t.time_s)))
    if V is not None:
        E = E + V
    if I is not None:
        E = E - p["R"] * I - p["L"] * rate(I)
        M = M + t.ideal_Nm() * I
    if w is not None:
        E = E - p["G"] * p["K"] * w
        M = M - p["J"] * rate(w) - p["C1"] * w
        S = S - w
    if T is not None:
        M = M - T
    if theta is not None:
        S = S + rate(theta) / p["G"]
    return E, M, S


def drop(E):
    return E, np.zeros_like(E), np.zeros_like(E)


def resisting(M):
    return np.zeros_like(M), M, np.zeros_like(M)


def averaged_sine(t, times, phase):
    """Mean over each sample of sin(times theta + phase)."""
    half = 0.5 * times * t.base["G"] * t.w * STEP_S
    return np.sin(times * t.theta + phase) * np.sinc(half / np.pi)


def phases(rng, names):
    return {name: float(rng.uniform(0.0, 2.0 * np.pi)) for name in names}


# ---- torque of angle ----
def _cogging_shape(rng):
    shape = {"periods": float(rng.choice((5.0, 7.0, 9.0))), "second": 0.45, "third": 0.2, "by_V": 0.0}
    return shape | phases(rng, ("phase1", "phase2", "phase3"))


def _turn_shape(rng):
    shape = {"periods": 1.0 / 14.0, "second": float(rng.uniform(0.1, 0.4)), "third": 0.1, "by_V": 0.0}
    return shape | phases(rng, ("phase1", "phase2", "phase3"))


def _by_voltage_shape(rng):
    shape = {"periods": 3.0, "second": 0.0, "third": 0.3, "by_V": 1.0}
    return shape | phases(rng, ("phase1", "phase2", "phase3"))


def _harmonics(t, h):
    n = h["periods"]
    f = (
        averaged_sine(t, n, h["phase1"])
        + h["second"] * averaged_sine(t, 2 * n, 2 * h["phase1"] + h["phase2"])
        + h["third"] * averaged_sine(t, 3 * n, 3 * h["phase1"] + h["phase3"])
    )
    return resisting(f * (1.0 + h["by_V"] * (t.V - 1.0)))


def _commutation(t, h):
    p, n = t.base, h["periods"]
    f = averaged_sine(t, n, h["phase1"]) + h["second"] * averaged_sine(t, 2 * n, 2 * h["phase1"] + h["phase2"])
    return p["G"] * p["K"] * f * t.w, -p["G"] * p["K"] * f * t.I, np.zeros_like(f)


# ---- heat ----
def _hot_winding(t, h):
    return drop(t.base["R"] * (t.winding_C - 25.0) * t.I)


def _hot_magnet(t, h):
    f = t.base["G"] * t.base["K"] * (t.housing_C - 25.0)
    return f * t.w, -f * t.I, np.zeros_like(f)


# ---- friction ----
def _base_friction(t):
    p = t.base
    return p["C0"] + p["mu"] * p["G"] * p["K"] * np.abs(t.I)


def _bristles(t, stretch):
    """Friction of bristles less the base model's, along the trajectory; exact for a constant speed in a sample."""
    sign = np.sign(t.w)
    travel = np.maximum(np.abs(t.w) * STEP_S / stretch, 1e-9)
    keep = np.exp(-travel)
    mean = (1.0 - keep) / travel
    z, state = np.empty_like(sign), 0.0
    for k in range(len(sign)):
        apart = state - sign[k]
        z[k] = sign[k] + apart * mean[k]
        state = sign[k] + apart * keep[k]
    return _base_friction(t) * (z - sign)


def _stribeck(t, h):
    return resisting(t.sign() * np.exp(-(np.abs(t.w / h["speed_rad_s"]) ** 1.5)))


def _gaussian_stribeck(t):
    speeds = np.geomspace(0.02, 0.5, 25) * max(np.quantile(np.abs(t.w), 0.98), 1e-6)
    return [({"speed_rad_s": float(v)}, resisting(t.sign() * np.exp(-((t.w / v) ** 2)))) for v in speeds]


def _quadratic_drag(t):
    return [({}, resisting(t.w * np.abs(t.w)))]


def _presliding(t, h, a):
    return resisting(_bristles(t, a))


def _load_side(t, h):
    back = 1.0 / (1.0 + np.exp(np.clip(t.T * t.w / h["soft_W"], -40.0, 40.0)))
    return resisting(np.abs(t.T) * np.tanh(t.w / 0.05) * back)


def _tight_arc(t, h):
    arc = np.maximum(np.cos(t.theta / t.base["G"] - h["centre_rad"]) - h["dead"], 0.0)
    return resisting(arc * t.sign())


def _hysteresis(t, h):
    kept, state = np.empty_like(t.I), 0.0
    for k, current in enumerate(t.I):
        state = min(max(state, current - h["play_A"]), current + h["play_A"])
        kept[k] = state
    return resisting(t.I - kept)


def _spring_bend(t, h):
    x = t.theta / t.base["G"] / h["knee_rad"]
    return resisting(np.sign(x) * (np.exp(np.abs(x)) - 1.0 - np.abs(x)))


# ---- instruments ----
def _lag_shape(rng):
    return {"channel": str(rng.choice(("I", "w", "T")))}


def _lag(t, h):
    return seen(t, **{h["channel"]: -rate(getattr(t, h["channel"]))})


def _measure_lag(m, t, a, h):
    m[h["channel"]] = lagged_exactly(m[h["channel"]], a)


def lagged_exactly(values, time_constant_s):
    """Behind a first-order lag that may be much shorter than a sample: the values taken as straight lines between."""
    fine = np.interp(np.arange(len(values) * FINE) / FINE, np.arange(len(values)), values)
    if time_constant_s > 2.0 * DT_S:
        keep = np.exp(-DT_S / time_constant_s)
        return lagged(fine, STEP_S * time_constant_s / DT_S)[::FINE] if keep > 0 else values
    return np.interp(np.arange(len(values)) - time_constant_s / STEP_S, np.arange(len(values)), values)


def _step_at_zero(t, h):
    return seen(t, I=np.tanh(t.V / h["soft_V"]))


def _clip_value(t, h):
    over = np.maximum(np.abs(t.V) - h["limit_V"], 0.0)
    return -np.sign(t.V) * over * (1.0 - np.exp(-over / 0.2))


def _eccentric(t, h):
    return averaged_sine(t, 1.0, h["phase1"]) + 0.35 * averaged_sine(t, 2.0, h["phase2"])


def _lost(t, h):
    over = np.abs(t.w) - h["limit_rad_s"]
    return -np.cumsum(np.sign(t.w) * np.logaddexp(0.0, over / 0.5) * 0.5) * STEP_S * t.base["G"]


def _play(t, h):
    """Deviation of the output's angle: it lies against the flank that carries the torque."""
    flank = np.tanh((t.T + 0.6 * t.base["J"] * t.acceleration) / h["soft_Nm"])
    return -lagged(flank - flank[0], 0.004)


def _rattle(t, h):
    """Bursts of a lightly damped ringing whenever the load changes its side."""
    kicks = np.zeros_like(t.T)
    side = np.sign(t.T)
    at = np.flatnonzero(np.diff(side) != 0) + 1
    kicks[at] = 1.0
    far = np.flatnonzero(np.abs(np.diff(t.w)) > 0.25)
    kicks[far] += 0.5
    time_s = np.arange(int(0.25 / STEP_S)) * STEP_S
    ring = np.exp(-time_s / 0.04) * np.sin(2.0 * np.pi * h["hertz"] * time_s)
    return np.convolve(kicks, ring)[: len(kicks)]


def _mains(t, h):
    x = 2.0 * np.pi * 50.0 * t.time_s
    return np.sin(x + h["phase1"]) + 0.4 * np.sin(3.0 * x + h["phase2"])


def _cell_creep(t, h):
    """A load cell whose glue creeps: it shows part of the load late."""
    return lagged(t.T, 0.3) + 0.7 * lagged(t.T, 3.0) - 1.7 * t.T


def _measured(channel, value):
    """A measure function that adds a unit's deviation times the amplitude, and the show function that goes with it."""

    def measure(m, t, a, h):
        m[channel] = m[channel] + a * value(t, h)

    return {"measure": measure, "show": lambda t, h: seen(t, **{channel: value(t, h)})}


def _nothing(rng):
    return {}


def _pick(name, low, high):
    return lambda rng: {name: float(rng.uniform(low, high))}


def _clip_shape(rng):
    return {"limit_V": float(rng.uniform(3.4, 4.0))}


_ALL = (
    Effect(
        "contact_drop_change",
        "E",
        _pick("knee_A", 0.5, 0.9),
        lambda t, h: drop(np.sign(t.I) * (1.0 - np.exp(-np.abs(t.I) / h["knee_A"]))),
        "BrushDrop",
        tell=lambda a, h, p: {"change_V": a},
    ),
    Effect(
        "resistance_temperature",
        "E",
        _nothing,
        _hot_winding,
        "HotWinding",
        tell=lambda a, h, p: {"per_K": a},
    ),
    Effect(
        "torque_constant_temperature",
        "EM",
        _nothing,
        lambda t, h: tuple(-part for part in _hot_magnet(t, h)),  # weaker when hot
        "HotMagnet",
        tell=lambda a, h, p: {"per_K": -a},
    ),
    Effect(
        "current_step_at_zero_duty",
        "EM",
        _pick("soft_V", 0.03, 0.1),
        **_measured("I", lambda t, h: np.tanh(t.V / h["soft_V"])),
        tell=lambda a, h, p: {"step_A": 2.0 * a},
        sign=True,
    ),
    Effect(
        "sensor_scale",
        "EM",
        _nothing,
        **_measured("I", lambda t, h: t.I),
        tell=lambda a, h, p: {"factor": 1.0 + a},
        sign=True,
    ),
    Effect(
        "sensor_offset",
        "EM",
        _nothing,
        **_measured("I", lambda t, h: np.ones_like(t.I)),
        tell=lambda a, h, p: {"value": a},
        sign=True,
    ),
    Effect(
        "voltage_clip", "E", _clip_shape, **_measured("V", _clip_value), tell=lambda a, h, p: {"limit_V": h["limit_V"]}
    ),
    Effect(
        "cogging",
        "M",
        _cogging_shape,
        _harmonics,
        "Harmonics",
        tell=lambda a, h, p: {"amplitude_Nm": a, "periods_per_turn": h["periods"]},
    ),
    Effect(
        "commutation_ripple",
        "EM",
        lambda rng: {"periods": float(rng.choice((5.0, 7.0, 9.0))), "second": 0.3} | phases(rng, ("phase1", "phase2")),
        _commutation,
        "Commutation",
        tell=lambda a, h, p: {"fraction": a, "periods_per_turn": h["periods"]},
    ),
    Effect(
        "once_per_turn",
        "M",
        _turn_shape,
        _harmonics,
        "Harmonics",
        tell=lambda a, h, p: {"amplitude_Nm": a, "periods_per_turn": 1.0},
    ),
    Effect(
        "stribeck",
        "M",
        lambda rng: {"speed_rad_s": float(rng.uniform(1.0, 3.0)), "stretch_rad": 2e-4},
        _stribeck,
        "Bristles",
        like=_gaussian_stribeck,
        size="excess_Nm",
    ),
    Effect(
        "presliding",
        "M",
        _nothing,
        _presliding,
        "SoftBristles",
        linear=False,
        start=0.01,
        tell=lambda a, h, p: {"deflection_rad": a},
    ),
    Effect(
        "load_friction",
        "M",
        _pick("soft_W", 0.05, 0.3),
        _load_side,
        "LoadSide",
        tell=lambda a, h, p: {"backdrive_fraction": a},
    ),
    Effect(
        "direction_friction",
        "M",
        _pick("viscous", 0.0, 0.05),
        lambda t, h: resisting(np.tanh(np.abs(t.w) / 0.1) + h["viscous"] * np.abs(t.w)),
        "Direction",
        tell=lambda a, h, p: {"coulomb_Nm": a},
        sign=True,
    ),
    Effect(
        "friction_warm_up",
        "M",
        _nothing,
        lambda t, h: resisting(t.sign() * np.exp(-2.5 * t.grease)),
        "Warming",
        tell=lambda a, h, p: {"cold_Nm": a},
    ),
    Effect(
        "cable_backlash",
        "T",
        _pick("soft_Nm", 0.02, 0.06),
        measure=lambda m, t, a, h: m.__setitem__("w", m["w"] + a * rate(_play(t, h))),
        show=lambda t, h: seen(t, w=rate(_play(t, h))),
        tell=lambda a, h, p: {"gap_rad": 2.0 * a},
    ),
    Effect(
        "eccentricity",
        "T",
        lambda rng: phases(rng, ("phase1", "phase2")),
        **_measured("theta", _eccentric),
        tell=lambda a, h, p: {"once_rad": a, "twice_rad": 0.35 * a},
    ),
    Effect(
        "lost_counts",
        "T",
        _pick("limit_rad_s", 7.0, 10.0),
        **_measured("theta", _lost),
        tell=lambda a, h, p: {"fraction": a, "limit_rad_s": h["limit_rad_s"]},
    ),
    Effect("sensor_lag", "T", _lag_shape, _lag, measure=_measure_lag, tell=lambda a, h, p: {"time_constant_s": a}),
    Effect(
        "clock_drift",
        "t",
        _nothing,
        lambda t, h: seen(t, T=t.time_s * rate(t.T)),
        measure=lambda m, t, a, h: m.__setitem__("T", np.interp(t.time_s * (1.0 + a), t.time_s, m["T"])),
        tell=lambda a, h, p: {"drift": a},
        sign=True,
    ),
    Effect(
        "drag",
        "M",
        _pick("power", 1.85, 2.15),
        lambda t, h: resisting(t.sign() * np.abs(t.w) ** h["power"]),
        "Drag",
        like=_quadratic_drag,
        size="quadratic_Nms2",
    ),
    Effect(
        "hip_spring_bend",
        "M",
        _pick("knee_rad", 0.15, 0.3),
        _spring_bend,
        "SpringBend",
    ),
    # ---- outside the catalogue ----
    Effect(
        "tight_arc_friction",
        "M",
        lambda rng: {"centre_rad": float(rng.uniform(0, 6.28)), "dead": float(rng.uniform(0.2, 0.6))},
        _tight_arc,
        "TightArc",
        known=False,
    ),
    Effect(
        "eddy_brake_saturating",
        "M",
        _pick("peak_rad_s", 3.0, 6.0),
        lambda t, h: resisting(t.w / (1.0 + (t.w / h["peak_rad_s"]) ** 2)),
        "EddyBrake",
        known=False,
    ),
    Effect("magnetic_hysteresis", "M", _pick("play_A", 0.3, 0.8), _hysteresis, "Hysteresis", known=False),
    Effect("voltage_ripple_torque", "M", _by_voltage_shape, _harmonics, "Harmonics", known=False),
    Effect(
        "iron_saturation",
        "M",
        _pick("knee_A", 2.0, 4.0),
        lambda t, h: resisting(t.I**3 / (h["knee_A"] ** 2 + t.I**2)),
        "Saturation",
        known=False,
    ),
    Effect("mains_pickup", "EM", lambda rng: phases(rng, ("phase1", "phase2")), **_measured("I", _mains), known=False),
    Effect("rattling_coupling", "M", _pick("hertz", 60.0, 140.0), **_measured("T", _rattle), known=False),
    Effect("load_cell_creep", "M", _nothing, **_measured("T", _cell_creep), known=False),
)


def _at(channel, value):
    return lambda t, h: seen(t, **{channel: value(t, channel)})


# Causes at places where none is hidden: an answer may name them where they look alike.
OTHER_PLACES = {
    **{("sensor_offset", channel): _at(channel, lambda t, _: np.ones_like(t.I)) for channel in "VwT"},
    **{("sensor_scale", channel): _at(channel, getattr) for channel in "VwT"},
    **{("sensor_lag", channel): _at(channel, lambda t, channel: -rate(getattr(t, channel))) for channel in "VIwT"},
    ("direction_friction", "viscous"): lambda t, h: resisting(np.abs(t.w)),
}
EFFECTS = {effect.name: effect for effect in _ALL}
