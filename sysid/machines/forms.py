"""Forms that causes of several machines share, and the grids over which their shapes are sought."""

from collections.abc import Callable, Mapping

import numpy as np

from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Columns, Recording, Values

HEAT_TIMES_S = (3.0, 10.0, 30.0, 100.0, 300.0)
SPEED_SHARES = (0.01, 0.02, 0.04, 0.08, 0.16, 0.3, 0.5)  # of the largest speed
CURRENT_SHARES = (0.1, 0.3, 1.0)  # of the largest current
MOST_PERIODS = 60  # per turn of the rotor

Shape = Mapping[str, float]
Made = Callable[[Recording, Shape, Values], Columns]


def column(*parts: Array) -> Array:
    """(n, k) from k columns (n,)."""
    return np.column_stack(parts)


def one(equation: str, make: Callable[[Mapping[str, Array], Shape, Values], Array]) -> Made:
    """An effect's `columns` for one equation and one coefficient."""
    return lambda r, shape, values: {equation: column(make(r.signals, shape, values))}


def ones(s: Mapping[str, Array], _: Shape, __: Values) -> Array:
    """An offset's column."""
    return np.ones_like(s["V"])


def minus(name: str) -> Callable[[Mapping[str, Array], Shape, Values], Array]:
    """A signal with its sign turned round."""
    return lambda s, _, __: -s[name]


def over(values: Array, limit: float) -> Array:
    """What of the values lies beyond the limit, either way."""
    return np.sign(values) * np.maximum(np.abs(values) - limit, 0.0)


def bristles(r: Recording, rate: Array, slide: float) -> Array:
    """Dahl's state over its limit: goes to the sign of the rate over a way of `slide`, run by run."""
    way = rate * r.table.step_s / slide
    keep = np.exp(-np.abs(way)).tolist()
    sign = np.sign(way).tolist()
    out, state = [], 0.0
    starts = {run.start for run in r.table.runs}
    for number, (share, direction) in enumerate(zip(keep, sign, strict=True)):
        if number in starts:
            state = 0.0
        state = direction + (state - direction) * share if direction else state
        out.append(state)
    return np.asarray(out)
