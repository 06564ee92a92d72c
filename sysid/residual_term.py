"""A term without a cause: a balance's misfit, learned from the data as a table over one or two signals.

Where an error has no cause in the catalogue that explains it, the most significant general test gives the signals of
the term. The term is a mean for each of its cells, fitted together with the machine's own parameters by least squares.
The data are not whitened for it: a table has steps, and whitening would give these the most weight. Outside the
signals' range in training it is 0, so that the model returns to its base there.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid import misfit
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Machine, Recording
from ranger_sim.sysid.misfit import Misfit
from ranger_sim.sysid.regression import Part, Regression, kept_rows, reduced
from ranger_sim.sysid.results import LearnedTerm

SMALL = 1e-6  # of the largest: directions of the table that the base already spans


@dataclasses.dataclass(frozen=True)
class ResidualTerm:
    """value, error: (cells of the first signal, cells of the second or 1), in the equation's unit.

    error: one deviation. edges: by signal, the inner borders of its cells; low, high: its range in training.
    """

    equation: str
    unit: str
    over: tuple[str, ...]
    edges: tuple[Array, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    value: Array
    error: Array

    def column(self, machine: Machine, recording: Recording) -> Array:
        """(n, 1): the term over a recording."""
        signals = machine.generic(recording)[self.equation]
        cell, inside = _cells(signals, self)
        return np.where(inside, self.value.reshape(-1)[cell], 0.0)[:, None]

    def result(self, holdout_rms: tuple[float, float] | None = None) -> LearnedTerm:
        """The term as data: shape and domain. holdout_rms: as `left` gives it for held-out data."""
        return LearnedTerm(
            self.equation,
            self.unit,
            self.over,
            tuple(zip(self.low, self.high, strict=True)),
            tuple(tuple(edges.tolist()) for edges in self.edges),
            tuple(tuple(row) for row in self.value.tolist()),
            tuple(tuple(row) for row in self.error.tolist()),
            holdout_rms,
        )

    def left(self, machine: Machine, recordings: Sequence[Recording], regression: Regression) -> tuple[float, float]:
        """(rms without, with the term) of the equation's residual, the machine's parameters fitted again both times."""
        part = regression.parts[self.equation]
        rows = _counting(part)
        column = np.concatenate([reduced(r, self.column(machine, r), self.equation) for r in recordings])[rows, 0]
        base, response = part.measured[rows], part.response[rows]
        without, rest = (
            each - base @ np.linalg.lstsq(base, each, rcond=None)[0] for each in (response, response - column)
        )
        return float(np.sqrt(np.mean(without**2))), float(np.sqrt(np.mean(rest**2)))


def learn(
    machine: Machine, recordings: Sequence[Recording], regression: Regression, found: Misfit
) -> ResidualTerm | None:
    """The table of the most significant test over signals; None where none is significant: a line, a wave, an entry."""
    telling = [
        test
        for test in found.tests
        if test.equation in regression.equations
        and test.features.startswith("over ")
        and "t" not in _over(test.features)
    ]
    if not telling:
        return None
    test = min(telling, key=lambda each: (each.p, -each.chi2))
    if test.p * len(found.tests) > 0.01:
        return None
    over = _over(test.features)
    looked = [machine.generic(recording)[test.equation] for recording in recordings]
    together = {name: np.concatenate([each[name] for each in looked]) for name in over}
    count = misfit.SINGLE_CELLS if len(over) == 1 else misfit.PAIR_CELLS
    edges = tuple(misfit.edges(together[name], count) for name in over)
    sizes = [len(each) + 1 for each in edges]
    unit = next(r.equations[test.equation].unit for r in recordings if test.equation in r.equations)
    empty = np.zeros((sizes[0], sizes[1] if len(sizes) > 1 else 1))
    low, high = (tuple(float(f(together[name])) for name in over) for f in (np.min, np.max))
    table = ResidualTerm(test.equation, unit, over, edges, low, high, empty, empty)
    numbers = [kept_rows(recording, _cells(each, table)[0]) for recording, each in zip(recordings, looked, strict=True)]
    part = regression.parts[test.equation]
    rows = _counting(part)
    cells = np.eye(empty.size)[np.concatenate(numbers)[rows]]
    base = part.measured[rows]
    lengths = np.linalg.norm(base, axis=0)
    columns = np.hstack([base[:, lengths > 0.0] / lengths[lengths > 0.0], cells])
    values, vectors = np.linalg.eigh(columns.T @ columns)
    strong = values > SMALL * max(float(values[-1]), 1e-300)
    inverse = (vectors[:, strong] / values[strong]) @ vectors[:, strong].T
    response = part.response[rows]
    fitted = inverse @ (columns.T @ response)
    left = response - columns @ fitted
    rho = min(max(float(np.mean(left[1:] * left[:-1]) / max(float(np.mean(left**2)), 1e-300)), 0.0), 0.99)
    spread = float(np.mean(left**2)) * (1.0 + rho) / (1.0 - rho)
    value = fitted[-empty.size :].reshape(empty.shape)
    error = np.sqrt(spread * np.maximum(np.diag(inverse)[-empty.size :], 0.0)).reshape(empty.shape)
    return dataclasses.replace(table, value=value, error=error)


def _counting(part: Part) -> np.ndarray:
    """(n,) rows that count, as in the tests: none at a run's start, where a machine may be switched on."""
    return part.valid & ~part.starts


def _over(features: str) -> tuple[str, ...]:
    return tuple(features.removeprefix("over ").split(" and "))


def _cells(signals: dict[str, Array], table: ResidualTerm) -> tuple[np.ndarray, np.ndarray]:
    """(n,) number of the cell in the flattened table, and whether the row is in the domain."""
    cell: np.ndarray | None = None
    inside: np.ndarray | None = None
    for name, edges, low, high in zip(table.over, table.edges, table.low, table.high, strict=True):
        signal = signals[name]
        number = np.searchsorted(edges, signal, side="right")
        within = (signal >= low) & (signal <= high)
        cell = number if cell is None else cell * (len(edges) + 1) + number
        inside = within if inside is None else inside & within
    assert cell is not None and inside is not None
    return cell, inside
