"""Sound joints in cells of sampling, drive and noise: how often the diagnosis raises an alarm on them.

    python -m tests.sysid.sound_matrix --cases 200

Friction truly sticks; 0.5 ms steps; nothing of the diagnosis is used to make the data. An alarm is any cause or misfit.
"""

import argparse
import itertools
import sys

import numpy as np
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.pipeline import diagnose
from tests.sysid.robot_joint import Joint

FINE_S = 5e-4
SAMPLINGS, DRIVES, MEMORIES, RATES_Hz = ("point", "mean"), ("sines", "steps"), (0.0, 0.9, 0.99), (100, 250)
CELLS = tuple(itertools.product(SAMPLINGS, DRIVES, MEMORIES, RATES_Hz))


def driven(draw, kind, count):
    """The motor's current, (count,): sums of sines, or steps of half a second and more."""
    time_s = np.arange(count) * FINE_S
    if kind == "sines":
        parts = [
            draw.uniform(0.3, 0.9) * np.sin(2 * np.pi * f * time_s + draw.uniform(0, 6)) for f in (0.13, 0.37, 1.1)
        ]
        return np.sum(parts, axis=0)
    levels = draw.choice([-1.0, -0.6, 0.6, 1.0], size=int(count * FINE_S / 0.5) + 1)
    return np.repeat(levels, round(0.5 / FINE_S))[:count]


def sound(seed, sampling, drive, memory, rate_hz, seconds=24.0):
    draw = generator(seed, f"sound joint {sampling} {drive} {memory} {rate_hz}")
    inertia, viscous, coulomb, offset = (x * draw.uniform(0.9, 1.1) for x in (0.06, 0.35, 0.25, 0.02))
    count = round(seconds / FINE_S)
    current = driven(draw, drive, count)
    rates, rate = np.empty(count), 0.0
    for at, driving in enumerate((current - offset).tolist()):
        rates[at] = rate
        free = rate + FINE_S / inertia * (driving - viscous * rate)
        braking = FINE_S / inertia * coulomb
        rate = 0.0 if abs(free) <= braking else free - braking * (1.0 if free > 0.0 else -1.0)
    fine = np.column_stack([np.cumsum(rates) * FINE_S, rates, current])
    every = round(1.0 / rate_hz / FINE_S)
    whole = fine[: count // every * every].reshape(-1, every, 3)
    rows = whole[:, 0] if sampling == "point" else whole.mean(axis=1)
    shocks = draw.normal(size=len(rows) + 2000) * np.sqrt(1.0 - memory**2)
    shown = rows[:, 2] + 0.03 * lfilter([1.0], [1.0, -memory], shocks)[2000:]
    time_s = np.arange(len(rows)) / rate_hz
    columns = {"angle_rad": rows[:, 0], "rate_rad_per_s": rows[:, 1], "current_A": shown}
    return Table(time_s, columns, (slice(0, len(rows)),), f"sound joint {seed}")


def alarm(seed, cell):
    """True when two sound recordings of a cell, one held out, are called wrong."""
    result = diagnose(Joint(), [sound(2 * seed, *cell)], [sound(2 * seed + 1, *cell)]).result
    return result.detected


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cases", type=int, default=200, help="of each cell")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    for cell in CELLS:
        alarms = sum(alarm(given.seed + each, cell) for each in range(given.cases))
        sys.stdout.write(f"{' '.join(map(str, cell))}: {alarms} of {given.cases}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
