"""What the bench does to the motor: voltage and brake torque as a person would vary them, at the sampling rate.

Segments of random length: held levels, ramps, sines, standstill; both directions, braking and driving. The first half
second is at rest. Sources are not ideal: voltage and brake torque follow their command with a lag.
"""

import numpy as np
from scipy.signal import lfilter

STEP_S = 1e-3  # of the samples
STILL_S = 0.5  # at the start: a noise floor
SUPPLY_LAG_S = 0.008  # of a laboratory supply of a few amperes
BRAKE_LAG_S = 0.020  # of the brake motor's current source with its gearbox


def lagged(command, time_constant_s):
    """The command behind a first-order lag, exact for held samples."""
    keep = np.exp(-STEP_S / time_constant_s)
    return lfilter([1.0 - keep], [1.0, -keep], command)


def segments(rng, count, shortest_s, longest_s, level, shares, slowest_Hz=0.5, fastest_Hz=6.0):
    """Random segments, shape (count,). shares: probabilities of hold, ramp, sine, zero."""
    out = np.zeros(count)
    at = int(STILL_S / STEP_S)
    last = 0.0
    while at < count:
        size = int(rng.uniform(shortest_s, longest_s) / STEP_S)
        end = min(at + size, count)
        time_s = np.arange(end - at) * STEP_S
        kind = rng.choice(4, p=shares)
        goal = level * rng.uniform(0.15, 1.0) * rng.choice((-1.0, 1.0))
        if at == int(STILL_S / STEP_S):  # every run goes near its limits at least once
            kind, goal = 0, 0.9 * np.sign(goal) * level
        if kind == 0:
            piece = np.full(end - at, goal)
        elif kind == 1:
            piece = last + (goal - last) * time_s / (size * STEP_S)
        elif kind == 2:
            centre = rng.uniform(-0.4, 0.4) * level
            rate = 2.0 * np.pi * np.exp(rng.uniform(np.log(slowest_Hz), np.log(fastest_Hz)))
            piece = centre + 0.6 * abs(goal) * np.sin(rate * time_s)
        else:
            piece = np.zeros(end - at)
        out[at:end] = piece
        last = piece[-1]
        at = end
    return out


def rich(rng, count, supply_V, brake_Nm):
    """Voltage and brake torque, each of shape (count + 1,), for a run of `count` samples."""
    voltage_V = segments(rng, count + 1, 0.4, 1.6, supply_V, (0.4, 0.2, 0.3, 0.1))
    torque_Nm = segments(rng, count + 1, 0.5, 2.0, brake_Nm, (0.35, 0.2, 0.25, 0.2))
    return lagged(voltage_V, SUPPLY_LAG_S), lagged(torque_Nm, BRAKE_LAG_S)


def one_sided(rng, count, supply_V, brake_Nm):
    """A poor experiment: a supply that cannot be turned round, so that only the brake drives backwards."""
    voltage_V = np.abs(segments(rng, count + 1, 0.4, 1.6, supply_V - 0.5, (0.4, 0.2, 0.3, 0.1))) + 0.5
    torque_Nm = segments(rng, count + 1, 0.5, 2.0, 1.5 * brake_Nm, (0.35, 0.2, 0.25, 0.2))
    return lagged(voltage_V, SUPPLY_LAG_S), lagged(torque_Nm, BRAKE_LAG_S)


def swing(rng, count, supply_V):
    """A leg driven by the hip motor's voltage: pushes, ramps, sines near its own frequency, swinging free."""
    voltage_V = segments(rng, count + 1, 0.6, 2.5, supply_V, (0.25, 0.15, 0.4, 0.2), slowest_Hz=0.3, fastest_Hz=2.5)
    return lagged(voltage_V, SUPPLY_LAG_S), np.zeros(count + 1)
