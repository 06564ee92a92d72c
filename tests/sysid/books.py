"""A second book of what a machine can have: each cause written down once more, and a recording of noise to hold it on.

A row of a book is `Row(cause, at, subsystem, coefficients, columns, ...)`: `columns(shape)` gives by equation or port
what one of each coefficient adds, `grid` every shape that is tried, `yes` and `no` what is admitted and what is not.
"""

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import lfilter

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid.dataset import Table

STEP_S, COUNT = 0.01, 300
RUNS = (slice(0, 180), slice(180, COUNT))
TIME_S = 3.0 + STEP_S * np.arange(COUNT) + 2.0 * (np.arange(COUNT) >= 180)


def noise(seed, names, size=1.0):
    """{name: (COUNT,)} of independent samples, a twentieth of them 0: what is decided at 0 is seen."""
    made = {}
    for name in names:
        rng = generator(seed, f"book: {name}")
        made[name] = size * rng.normal(size=COUNT)
        made[name][rng.choice(COUNT, COUNT // 20, replace=False)] = 0.0
    return made


def table(columns=None, name="book"):
    return Table(TIME_S, dict(columns or {}), RUNS, name)


def behind(values, time_constant_s):
    """A first-order lag from 0, run by run, exact for a value that stays over its step."""
    keep = np.exp(-STEP_S / time_constant_s)
    return np.concatenate([lfilter([1.0 - keep], [1.0, -keep], values[run]) for run in RUNS])


def summed(values):
    return cumulative_trapezoid(values, TIME_S, initial=0.0)


def waves(angle):
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def bend(rate, way):
    """Dahl's state by its own formula over each sample, beginning at 0 with a run."""
    out = np.zeros(COUNT)
    for run in RUNS:
        state = 0.0
        for k in range(run.start, run.stop):
            x = rate[k] * STEP_S / way
            if x > 0.0:
                state = 1.0 - (1.0 - state) * np.exp(-x)
            elif x < 0.0:
                state = -1.0 + (1.0 + state) * np.exp(x)
            out[k] = state
    return out


@dataclasses.dataclass
class Row:
    cause: str
    at: str
    subsystem: str
    coefficients: tuple[str, ...]
    columns: Callable[[dict], dict]
    grid: Sequence[dict] = ({},)
    yes: Sequence[dict] = ({"any": 1.0}, {"any": -1.0})
    no: Sequence[dict] = ()
    form: str = ""
    scale: str | None = None
    free: tuple[str, ...] = ()
    phase_is_free: bool = False


def positive(name, **shape):
    """What is admitted above 0 alone."""
    return {"yes": [{name: 1e-9, **shape}, {name: 0.5, **shape}], "no": [{name: 0.0, **shape}, {name: -1.0, **shape}]}


def hold(found, book, made):
    """Every cause of `found` with its row, in order; made(effect, shape) -> what the program has of it."""
    assert [(each.cause, each.at, each.coefficients) for each in found] == [
        (row.cause, row.at, row.coefficients) for row in book
    ]
    for effect, row in zip(found, book, strict=True):
        what = f"{row.cause} at {row.at} {row.coefficients}"
        assert effect.subsystem == row.subsystem, what
        assert effect.phase_is_free is row.phase_is_free, what
        for name in ("form", "scale", "free"):
            assert getattr(effect, name, getattr(row, name)) == getattr(row, name), what
        assert len(effect.shapes) == len(row.grid), what
        for shape, wanted in zip(effect.shapes, row.grid, strict=True):
            assert set(shape) == set(wanted), what
            assert all(abs(shape[name] - value) <= 1e-9 * abs(value) for name, value in wanted.items()), (what, shape)
        assert all(effect.admissible(each) for each in row.yes), what
        assert not any(effect.admissible(each) for each in row.no), what
        for shape in (row.grid[0], row.grid[len(row.grid) // 2], row.grid[-1]):
            columns, wanted = made(effect, shape), row.columns(shape)
            assert set(columns) == set(wanted), what
            for place, column in wanted.items():
                column = column[:, None] if column.ndim == 1 else column
                shown = columns[place][:, None] if columns[place].ndim == 1 else columns[place]
                assert shown.shape == column.shape == (COUNT, len(row.coefficients)), what
                assert np.max(np.abs(shown - column)) <= 1e-9 * np.max(np.abs(column)), (what, place, shape)
