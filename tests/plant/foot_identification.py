"""One fit of foot and ankle drive to the robot's five logs of a hanging foot that tracks a sine (August 2015).

At the joint, with the law of `MotorUnit` (EQUATIONS 2.1) and the springs of EQUATIONS 2.7:

    G K I - mu G K |I| s = J q'' + C_1 q' + C_0 s + k (q - q_0),    s = tanh(q' / epsilon)

q is the motor's angle over its gear (each 4 ms), I the motor's current (about 19 times a second, stamped with an
unknown lag tau, the same in all runs). J is rotor and foot together; the foot's weight, where it has any, is in k and
q_0. Known beforehand: G K = 0.612 N m/A and mu = 0.1. Rates and accelerations come from cubics through 15 samples
about each current. Each run counts by the scatter of its own residuals; tau is searched in steps of 1 ms, the rest is
linear. Intervals of 95 % by bootstrap: whole stretches of 2 s are drawn again, because neighbouring residuals resemble
each other.
"""

import csv
import dataclasses

import numpy as np

from ranger_sim.foundation.random_stream import RandomStream

GEAR_CONSTANT = 34.0 * 0.018  # G K, N m/A
LOAD_FRICTION = 0.1
SMOOTHING_RAD_S = 0.05
HALF_WINDOW_S = 0.030
LAGS_S = np.arange(0, 19) / 1000.0
STRETCH_S = 2.0
DRAWS = 100
NAMES = ("J", "C_1", "C_0", "k", "q_0", "tau")


@dataclasses.dataclass(frozen=True)
class Found:
    """Values and 95 % intervals by name (SI), and the share of the torque's variance explained, overall and by run."""

    values: dict
    low: dict
    high: dict
    explained: float
    explained_by_run: tuple
    samples: int


def read(path):
    """(times, motor angles, times of currents, currents) of one log."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    column = {name: np.array([float(row[name]) for row in rows]) for name in ("t_s", "motor_angle_rad")}
    measured = [(float(row["t_s"]), float(row["motor_current_A"])) for row in rows if row["motor_current_A"]]
    at, current = np.array(measured).T
    return column["t_s"], column["motor_angle_rad"], at, current


def motion(times, angles, at):
    """Angle, rate and acceleration at each time by the cubic about it; nan where samples are missing."""
    found = np.full((len(at), 3), np.nan)
    for row, instant in zip(found, at, strict=True):
        i, j = np.searchsorted(times, [instant - HALF_WINDOW_S, instant + HALF_WINDOW_S])
        if j - i >= 12:  # of 15: a gap of the radio link spoils the rest
            scaled = (times[i:j] - instant) / HALF_WINDOW_S
            c = np.polynomial.polynomial.polyfit(scaled, angles[i:j], 3)
            row[:] = c[0], c[1] / HALF_WINDOW_S, 2.0 * c[2] / HALF_WINDOW_S**2
    return found


def equations(q, current):
    """Unknowns' factors and torque of the fit, one row per current, for the motion `q` at its times."""
    angle, rate, acceleration = q.T
    sign = np.tanh(rate / SMOOTHING_RAD_S)
    factors = np.column_stack([acceleration, rate, sign, angle, np.ones_like(angle)])
    return factors, GEAR_CONSTANT * (current - LOAD_FRICTION * np.abs(current) * sign)


def best(sides, weights, rows):
    """(lag, five linear unknowns) with the least weighted squares over these rows."""
    found = None
    for lag, (factors, torque) in sides.items():
        w = weights[rows]
        x = np.linalg.lstsq(factors[rows] * w[:, None], torque[rows] * w, rcond=None)[0]
        rest = (torque[rows] - factors[rows] @ x) * w
        if found is None or rest @ rest < found[0]:
            found = (rest @ rest, lag, x)
    return found[1:]


def named(lag, x):
    return dict(zip(NAMES, (*x[:4], -x[4] / x[3], lag), strict=True))


def share(torque, rest):
    return 1.0 - float(rest @ rest / ((torque - torque.mean()) @ (torque - torque.mean())))


def identify(logs):
    """The joint fit over these logs: `Found`. The same logs give the same intervals."""
    run = np.repeat(np.arange(len(logs)), [len(current) for _, _, _, current in logs])
    at, current = (np.concatenate([log[k] for log in logs]) for k in (2, 3))
    sides = {
        lag: equations(
            np.concatenate([motion(times, angles, stamps - lag) for times, angles, stamps, _ in logs]), current
        )
        for lag in LAGS_S
    }
    whole = ~np.any([np.isnan(factors[:, 0]) for factors, _ in sides.values()], axis=0)
    sides = {lag: (factors[whole], torque[whole]) for lag, (factors, torque) in sides.items()}
    at, run = at[whole], run[whole]
    weights, rows = np.ones(len(run)), np.arange(len(run))
    for _ in range(5):  # the scatter of each run's residuals settles at once
        lag, x = best(sides, weights, rows)
        factors, torque = sides[lag]
        rest = torque - factors @ x
        weights = np.array([1.0 / rest[run == n].std() for n in range(len(logs))])[run]
    number = run * 1000 + at // STRETCH_S
    stretches = [np.flatnonzero(number == each) for each in np.unique(number)]
    stream = RandomStream(1, "foot identification")
    drawn = []
    for _ in range(DRAWS):
        picked = np.concatenate([stretches[stream.integer(len(stretches))] for _ in stretches])
        drawn.append(list(named(*best(sides, weights, picked)).values()))
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    return Found(
        named(lag, x),
        dict(zip(NAMES, low, strict=True)),
        dict(zip(NAMES, high, strict=True)),
        share(torque, rest),
        tuple(share(torque[run == n], rest[run == n]) for n in range(len(logs))),
        len(run),
    )
