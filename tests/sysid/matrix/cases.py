"""Recordings of a cell, sound or with a hidden effect of a known strength, and what the diagnosis says about them."""

import functools

import numpy as np
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from tests.sysid.matrix.bodies import BODIES, HIDDEN, none
from tests.sysid.matrix.drives import H_S

STRENGTHS = (1.0, 2.0, 4.0, 8.0, 25.0, 100.0)
UNIT = 4.85  # standard errors: one of 28 candidates is then detected nine times in ten
MEMORY = 0.9  # of coloured noise, from row to row
MUCH = 0.1  # of a row, between two channels of a multiplexer
SETTLED = 2  # fine steps after a held voltage has changed: the bench's current has settled, its motion has not begun
# Standard deviations; what has none is a command, and exact. Positioning: its encoder counts 0.1 um, as that of EMPS
NOISE = {
    "bench": {"voltage_V": 0.008, "current_A": 0.02, "speed_rad_per_s": 0.04, "torque_Nm": 0.008},
    "leg": {"hip_angle_rad": 3e-4, "current_A": 0.02, "voltage_V": 0.008},
    "ankle": {"joint_angle_rad": 5e-4},
    "positioning": {"position_m": 1e-7, "voltage_V": 1e-3},
    "axis": {"voltage_V": 0.01, "current_A": 0.03, "position_m": 2e-5},
}
COUNT_RAD = 2.0 * np.pi / 2048.0  # of the bench's encoder


def seconds(cell):
    return 20.0 if cell.rate_hz < 500 else 12.0


def shown(cell, draw, channels):
    """Rows of a recording: sampled, with noise. {column: (rows,)}, with t_s."""
    per = round(1.0 / cell.rate_hz / H_S)
    rows = len(next(iter(channels.values()))) // per - 1
    found = {"t_s": np.arange(rows) / cell.rate_hz}
    for number, (name, fine) in enumerate(channels.items()):
        if cell.sampling == "mean" and name in NOISE[cell.machine]:
            values = fine[: rows * per].reshape(rows, per).mean(axis=1)
        else:
            late = round(MUCH * per) * number if cell.sampling == "multiplexed" and name in NOISE[cell.machine] else 0
            late += SETTLED if cell.sampling == "held" and cell.machine == "bench" else 0
            values = fine[late : late + rows * per : per].copy()
        deviation = NOISE[cell.machine].get(name, 0.0)
        if name == "motor_angle_rad":
            values = np.floor(values / COUNT_RAD) * COUNT_RAD
        elif name == "temperature_C":
            values = np.round(values + 0.05 * draw.normal(size=rows), 1)
        elif cell.noise == "white":
            values = values + deviation * draw.normal(size=rows)
        elif cell.noise == "coloured":
            shocks = draw.normal(size=rows + 200) * np.sqrt(1.0 - MEMORY**2)
            values = values + deviation * lfilter([1.0], [1.0, -MEMORY], shocks)[200:]
        elif (
            deviation > 0.0
        ):  # counts with as much power as the noise of the other cells, and a little that is not counts
            count = np.sqrt(12.0) * deviation
            values = np.round((values + 0.2 * deviation * draw.normal(size=rows)) / count) * count
        found[name] = values
    return found


def made(cell, seed, law, tag):
    """One run of a machine: parameters by the seed alone, motion and noise by the tag as well."""
    return BODIES[cell.machine](
        generator(seed, f"matrix {cell.name} parameters"),
        generator(seed, f"matrix {cell.name} motion {tag}"),
        cell.drive,
        round(1.0 / cell.rate_hz / H_S) if cell.sampling == "held" else 0,
        1.0 if cell.standstill == "smooth" else 0.0,
        law,
        round(seconds(cell) / H_S),
    )


def size_of(cell, seed, hidden, numbers):
    """The size at which the effect has strength 1 about the sound motion, from the truth alone.

    Its part in the balance that the base parameters cannot take up, over the noise of that balance by frequency, has
    then the length UNIT.
    """
    run = made(cell, seed, none(0.0, {}), "a")
    per = round(1.0 / cell.rate_hz / H_S)
    fine_law, rates, places = hidden.law(1.0, numbers), *_motion(cell.machine, run)
    effect = np.array([fine_law(rate, place, 0.0) for rate, place in zip(rates[::per], places[::per], strict=True)])
    rows = len(effect)
    hertz = np.fft.rfftfreq(rows, 1.0 / cell.rate_hz)
    power = {
        name: deviation**2 * _spectrum(cell.noise, hertz, cell.rate_hz)
        for name, deviation in NOISE[cell.machine].items()
    }
    deviation = np.sqrt(np.maximum(run.deviation(hertz, power), 1e-300))

    def white(values):
        return np.fft.irfft(np.fft.rfft(values) / deviation, n=rows)

    moving = np.abs(rates[::per]) > 0.01 * np.max(np.abs(rates))
    basis = np.linalg.qr(np.column_stack([white(each[::per] * moving) for each in run.base]))[0]
    vector = white(effect * moving)
    return UNIT / float(np.linalg.norm(vector - basis @ (basis.T @ vector)))


def _spectrum(noise, hertz, rate_hz):
    """Power by frequency of noise of variance 1, whose mean over the frequencies is 1."""
    if noise != "coloured":
        return np.ones_like(hertz)
    return (1.0 - MEMORY**2) / np.abs(1.0 - MEMORY * np.exp(-2j * np.pi * hertz / rate_hz)) ** 2


def _motion(machine, run):
    """Rate and place as the laws see them."""
    place = {"bench": "motor_angle_rad", "leg": "hip_angle_rad", "ankle": "joint_angle_rad"}.get(machine, "position_m")
    there = run.channels[place] / (14.0 if machine == "bench" else 1.0)
    return np.gradient(there, H_S), there


@functools.cache
def one(cell, seed, name):
    """(size of strength 1, numbers) of an effect of HIDDEN in a case."""
    hidden = HIDDEN[cell.machine][name]
    numbers = hidden.numbers(generator(seed, f"matrix {cell.name} {name}"))
    return size_of(cell, seed, hidden, numbers), numbers


def recordings(cell, seed, name="", strength=0.0):
    """(columns to train with, columns held out, size, numbers) of a case; name: of HIDDEN, "" for a sound one."""
    law, size, numbers = none(0.0, {}), 0.0, {}
    if name:
        unit, numbers = one(cell, seed, name)
        size = strength * unit
        law = HIDDEN[cell.machine][name].law(size, numbers)
    found = [
        shown(cell, generator(seed, f"matrix {cell.name} noise {tag}"), made(cell, seed, law, tag).channels)
        for tag in "ab"
    ]
    return *found, size, numbers
