"""Three machines solved by scipy's `solve_ivp`, as their sensors show them, with one hidden effect each.

A thrust stand, a battery and a robot's elastic joint, written for the diagnosis of machines in `machines_of_a_user` and
sharing nothing with it: another scheme (LSODA, its own steps), sensors with noise and counts, each sampled by its own
clock and put into the nearest row of the log, as a merge of several files does it.
"""

import dataclasses
import functools
import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

from ranger_sim.foundation.random_arrays import generator

UNIT = 4.85  # standard errors: an effect of strength 1 is so long, once the base has taken what it can
PPM = 50.0  # of a sensor's clock against the log's
HARMONICS = 50  # of the recording's length, of the input's noise; the machines hardly follow faster ones
NUDGE = 1e-4  # of a base parameter: step of its sensitivity
EXACT = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-11}


@dataclasses.dataclass(frozen=True)
class Sensor:
    """A column of the log. shown(states (s, n), inputs (n,), base, effect, size, t) -> (n,)."""

    column: str
    noise: float
    count: float
    shown: Callable

    @property
    def deviation(self):
        return math.hypot(self.noise, self.count / math.sqrt(12.0))


@dataclasses.dataclass(frozen=True)
class Solved:
    """drive(draw, seconds) -> the input as a function of time, and its corners; rates(t, x, u, base, effect, size);
    base: parameters of the truth, of which a draw changes each by some percent; effects: a size that is about visible,
    from which the smallest visible one is found."""

    name: str
    seconds: float
    rate_hz: float
    base: dict[str, float]
    start: Callable
    drive: Callable
    rates: Callable
    sensors: tuple[Sensor, ...]
    effects: dict[str, float]

    def drawn(self, seed):
        """(base parameters, the input, its corners) of a seed and whether it is held out."""
        machine, run = seed
        draw = generator(machine, f"{self.name} made")
        base = {name: value * draw.uniform(0.94, 1.06) for name, value in self.base.items()}
        return (base, *self.drive(generator(machine, f"{self.name} driven {run}"), self.seconds))

    def solved(self, base, given, corners, effect="", size=0.0, nudged=None):
        """States as a function of time. nudged: (number of a state, by how much its start differs)."""
        start = np.array(self.start(base, effect, size), dtype=float)
        if nudged is not None:
            start[nudged[0]] += nudged[1]
        pieces = []
        for begin, end in zip(corners[:-1], corners[1:], strict=True):
            piece = solve_ivp(self.rates, (begin, end), start, args=(given, base, effect, size), dense_output=True,
                              max_step=(end - begin) / 2.0, **EXACT)  # fmt: skip
            pieces.append(piece.sol)
            start = piece.y[:, -1]

        def at(t):
            number = np.clip(np.searchsorted(corners, t, side="right") - 1, 0, len(pieces) - 1)
            out = np.empty((len(start), len(t)))
            for each in np.unique(number):
                out[:, number == each] = pieces[each](t[number == each])
            return out

        return at

    def log(self, seed, run="a", effect="", size=0.0):
        """Columns (n,) by name, "t [s]" first, as the log has them."""
        base, given, corners = self.drawn((seed, run))
        states = self.solved(base, given, corners, effect, size)
        draw = generator(seed, f"{self.name} sensors {run}")
        rows = np.arange(round((self.seconds - 1.0 / self.rate_hz) * self.rate_hz)) / self.rate_hz
        out = {"t [s]": rows}
        for each in self.sensors:
            step_s = (1.0 + draw.uniform(-PPM, PPM) * 1e-6) / self.rate_hz
            ticks = (np.arange(len(rows) + 2) + draw.uniform(-0.5, 0.5)) * step_s
            ticks = np.clip(ticks, 0.0, self.seconds)
            seen = each.shown(states(ticks), given(ticks), base, effect, size, ticks)
            seen = np.round((seen + each.noise * draw.normal(size=len(ticks))) / each.count) * each.count
            later = np.clip(np.searchsorted(ticks, rows), 1, len(ticks) - 1)
            nearest = np.where(rows - ticks[later - 1] <= ticks[later] - rows, later - 1, later)
            out[each.column] = seen[nearest]
        return out

    def visible(self, effect):
        """The size at which the effect has strength 1, by the truth's own sensitivities."""
        return _visible(self, effect)

    def write(self, path, seed, run="a", effect="", size=0.0):
        """The log as a file with a comma between the columns; returns the path."""
        columns = self.log(seed, run, effect, size)
        table = np.column_stack(list(columns.values()))
        np.savetxt(path, table, "%.9g", ",", header=",".join(columns), comments="")
        return path

    def __hash__(self):
        return hash(self.name)


@functools.cache
def _visible(machine, effect):
    base, given, corners = machine.drawn((1, "a"))
    rows = np.arange(1, round(machine.seconds * machine.rate_hz)) / machine.rate_hz
    sensor, *outputs = machine.sensors  # the first shows the input

    def shown(base, name="", size=0.0, nudged=None, given=given):
        states, u = machine.solved(base, given, corners, name, size, nudged)(rows), given(rows)
        return np.concatenate([each.shown(states, u, base, name, size, rows) / each.deviation for each in outputs])

    sound = shown(base)
    first = np.array(machine.start(base, "", 0.0), dtype=float)
    columns = [shown(base | {name: value * (1.0 + NUDGE)}) - sound for name, value in base.items()]
    columns += [shown(base, nudged=(number, NUDGE * max(1.0, abs(each)))) - sound for number, each in enumerate(first)]
    basis = [each / np.linalg.norm(each) for each in columns if np.linalg.norm(each) > 1e-6]
    known = []  # slow parts of the noise of the measured input, each with a deviation of 1
    for harmonic in range(1, HARMONICS + 1):
        for phase in (0.0, 0.25):
            part = functools.partial(_with_noise, given, sensor.deviation * math.sqrt(2.0 / len(rows)),
                                     harmonic / machine.seconds, phase)  # fmt: skip
            known.append(shown(base, given=part) - sound)
    size = machine.effects[effect]
    vector = (shown(base, effect, size) - sound) / size
    whole = np.vstack((np.column_stack([*basis, *known]), np.zeros((len(known), len(basis) + len(known)))))
    whole[len(vector) :, len(basis) :] = np.eye(len(known))
    wanted = np.concatenate((vector, np.zeros(len(known))))
    left = wanted - whole @ np.linalg.lstsq(whole, wanted, rcond=1e-9)[0]
    return UNIT / float(np.linalg.norm(left))


def _with_noise(given, size, hertz, phase, t):
    return given(t) + size * np.cos(2.0 * np.pi * (hertz * t + phase))


def _levels(draw, seconds, low, high, every_s):
    """A throttle that goes smoothly from level to level."""
    knots = np.arange(0.0, seconds + 2.0 * every_s, every_s)
    return PchipInterpolator(knots, draw.uniform(low, high, len(knots)))


# --- a drone's motor on a thrust stand ----------------------------------------------------------------------------


def _stand_current(x, v, p, effect, size):
    heat = size * x[1] if effect == "heating" else 0.0
    return (v - p["k"] * x[0]) / (p["R"] * (1.0 + heat))


def _stand_rates(t, x, given, p, effect, size):
    i = _stand_current(x, float(given(t)), p, effect, size)
    torque = p["k"] * i - p["b"] * x[0] - p["c"] * x[0] * x[0]
    if effect == "dry bearing":
        torque -= size * math.tanh(x[0] / 0.5)
    return torque / 4.2e-5, (i * i / 100.0 - x[1]) / 8.0


def _stand_drive(draw, seconds):
    return _levels(draw, seconds, 5.0, 14.0, 0.6), np.array([0.0, seconds])


STAND = Solved(
    "thrust stand", 20.0, 200.0,
    {"k": 0.0113, "R": 0.145, "b": 2.1e-5, "c": 1.15e-7, "ct": 7.9e-6},
    lambda p, effect, size: (400.0, 0.0), _stand_drive, _stand_rates,
    (
        Sensor("voltage [V]", 0.004, 0.005, lambda x, u, p, e, s, t: u),
        Sensor("thrust [N]", 0.02, 0.01, lambda x, u, p, e, s, t: p["ct"] * x[0] ** 2),
        Sensor("speed [rad/s]", 0.5, 0.25, lambda x, u, p, e, s, t: x[0]),
        Sensor("current [A]", 0.05, 0.02, lambda x, u, p, e, s, t: _stand_current(x, u, p, e, s)),
    ),
    {"heating": 0.01, "dry bearing": 1e-4},
)  # fmt: skip


# --- a battery under a load that changes in steps -----------------------------------------------------------------


def _battery_rates(t, x, given, p, effect, size):
    i = float(given(t))
    leak = size if effect == "leak" else 0.0
    return -p["slope"] * (i + leak), (p["R1"] * i - x[1]) / p["tau"]


def _battery_drive(draw, seconds):
    corners = np.concatenate(([0.0], np.cumsum(draw.uniform(8.0, 45.0, 400))))
    corners = np.append(corners[corners < seconds], seconds)
    levels = draw.uniform(-6.0, 12.0, len(corners))
    return lambda t: levels[np.clip(np.searchsorted(corners, t, side="right") - 1, 0, len(corners) - 2)], corners


def _battery_volts(x, i, p, effect, size, t):
    ageing = size * t if effect == "resistance grows" else 0.0
    return x[0] - (p["R0"] + ageing) * i - x[1]


BATTERY = Solved(
    "battery", 1200.0, 2.0,
    {"R0": 0.031, "R1": 0.019, "tau": 28.0, "slope": 4.4e-5},
    lambda p, effect, size: (3.85, 0.0), _battery_drive, _battery_rates,
    (
        Sensor("current [A]", 0.004, 0.005, lambda x, u, p, e, s, t: u),
        Sensor("voltage [V]", 0.001, 0.001, _battery_volts),
    ),
    {"leak": 0.05, "resistance grows": 1e-7},
)  # fmt: skip


# --- a motor that turns a link through a compliant gear -----------------------------------------------------------


def _joint_rates(t, x, given, p, effect, size):
    motor, link, motor_rate, link_rate = x
    twist = motor - link
    through = p["K"] * twist + p["D"] * (motor_rate - link_rate)
    if effect == "gear stiffens":  # a hyperbolic sine, whose cube is size * twist^3
        through += size * 6.0 * 0.05**3 * (math.sinh(twist / 0.05) - twist / 0.05)
    load = p["bl"] * link_rate + (size * math.sin(link) if effect == "gravity" else 0.0)
    return motor_rate, link_rate, (float(given(t)) - through - p["bm"] * motor_rate) / 0.02, (through - load) / p["Jl"]


def _joint_drive(draw, seconds):
    parts = [(draw.uniform(0.6, 2.0), f, draw.uniform(0.0, 6.28)) for f in (0.25, 0.6, 1.1, 1.9, 3.1, 5.3)]
    return (lambda t: sum(a * np.sin(2.0 * np.pi * f * t + phase) for a, f, phase in parts)), np.array([0.0, seconds])


JOINT = Solved(
    "elastic joint", 10.0, 250.0,
    {"Jl": 0.11, "K": 180.0, "D": 0.15, "bm": 0.12, "bl": 0.06},
    lambda p, effect, size: (0.0, 0.0, 0.0, 0.0), _joint_drive, _joint_rates,
    (
        Sensor("torque [N m]", 0.005, 0.01, lambda x, u, p, e, s, t: u),
        Sensor("motor [rad]", 2e-4, 2.0 * np.pi / 16384, lambda x, u, p, e, s, t: x[0]),
        Sensor("link [rad]", 2e-4, 2.0 * np.pi / 16384, lambda x, u, p, e, s, t: x[1]),
    ),
    {"gravity": 0.01, "gear stiffens": 300.0},
)  # fmt: skip

ALL = (STAND, BATTERY, JOINT)
