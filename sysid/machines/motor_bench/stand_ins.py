"""Rows of a bench that count, and stand-ins for measured columns whose noise would bias a fit."""

import math
from collections.abc import Mapping

import numpy as np

from ranger_sim.sysid.dataset import Array, Table

FLOWS = 0.15  # of the largest current: above it current flows, in any recording that excites a motor


def away(values: Array, limit: float, reach: int) -> np.ndarray:
    """True where the values stay `limit` away from 0, also `reach` samples before and after."""
    near = np.abs(values) < limit
    return np.convolve(near, np.ones(2 * reach + 1), mode="same") < 0.5


def one_sign(values: Array) -> np.ndarray:
    """False for the two samples on either side of a change of sign: within them the acceleration jumps."""
    crossed = np.zeros(len(values), dtype=bool)
    crossed[1:] = values[1:] * values[:-1] < 0.0
    crossed[:-1] |= crossed[1:]
    return np.convolve(crossed, np.ones(3), mode="same") < 0.5


def mean_sign(values: Array) -> Array:
    """(n,) mean sign over each sample, with straight lines between the values."""
    ends = np.concatenate((values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]))
    rise = np.diff(ends)
    crossing = ends[1:] * ends[:-1] < 0.0
    mean = np.divide(np.diff(np.abs(ends)), rise, out=np.zeros_like(values), where=crossing)
    return np.where(crossing, mean, np.sign(values))


def current_by_torque(T: Array, I: Array, s: Mapping[str, Array]) -> Array:  # noqa: E741
    """Current for the measured torque, by a rough fit of the mechanical balance."""
    loaded = -s["sgn_w"] * np.sign(s["I"])
    rest = np.column_stack([s["sgn_w"], s["w"], s["dw"]])
    found = np.linalg.lstsq(np.column_stack([s["I"], loaded * s["I"], rest]), T, rcond=None)[0]
    per_ampere = found[0] + found[1] * loaded
    least = 0.2 * max(abs(float(found[0])), 1e-9)
    return (T - rest @ found[2:]) / np.where(np.abs(per_ampere) > least, per_ampere, least)


def rough_electrics(V: Array, I: Array, w: Array) -> tuple[float, float, float]:  # noqa: E741
    """(R, V_c, K G) by plain least squares; good enough for a stand-in.

    Only where current surely flows: below the brushes' drop the sign of its noise would bias the drop low.
    """
    flows = np.abs(I) > FLOWS * float(np.quantile(np.abs(I), 0.98))
    found = np.linalg.lstsq(np.column_stack([I, np.sign(I), w])[flows], V[flows], rcond=None)[0]
    resistance, drop, constant = (float(each) for each in found)
    return max(resistance, 1e-6), max(drop, 0.0), constant


def current_by_voltage(V: Array, w: Array, resistance: float, drop: float, constant: float) -> Array:
    """Current by the electric equation: zero while the driving voltage stays below the brushes' drop."""
    driving = V - constant * w
    return np.sign(driving) * np.maximum(np.abs(driving) - drop, 0.0) / resistance


def spread(difference: Array, where: np.ndarray) -> float:
    """Standard deviation by the median, which ignores outliers."""
    part = difference[where] if np.any(where) else difference
    return float(np.median(np.abs(part - np.median(part)))) / 0.6745


def inner(table: Table, reach: int) -> np.ndarray:
    """False for `reach` rows at either end of each piece: Gaussians and differences are one-sided there."""
    inner = np.zeros(len(table), dtype=bool)
    for run in table.runs:
        inner[run.start + reach : run.stop - reach] = True
    return inner


def own_noise(value: Array, second: Array, third: Array, where: np.ndarray, least: float) -> float:
    """Standard deviation of a value's own noise, from two others of the same quantity whose noises are independent.

    The three-cornered hat of clocks: half of the excess of the value's two squared differences over that of the others;
    at least `least` of its difference to the second.
    """
    apart = [spread(one - other, where) ** 2 for one, other in ((value, second), (value, third), (second, third))]
    return math.sqrt(max(0.5 * (apart[0] + apart[1] - apart[2]), least**2 * apart[0]))


def no_jump(values: Array, limit: float, reach: int) -> np.ndarray:
    """True where nothing jumps, also `reach` samples before and after: a jump's time between samples is unknown.

    A jump is a step larger than `limit` times the step of a sine over all values in a fiftieth of its period.
    """
    step = np.abs(np.diff(values, prepend=values[0]))
    sized = limit * (float(np.ptp(values)) or 1.0)
    return np.convolve(step > sized, np.ones(2 * reach + 1), mode="same") < 0.5
