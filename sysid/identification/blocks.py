"""Pieces of a residual, one for each recording: stacked for a joint fit, alone for a step of the paper's path.

Every row is divided by its own standard deviation, so pieces of different benches weigh as they should. An instrument's
offset and gain are parameters of their own, known beforehand as well as the instrument says.
"""

import dataclasses
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter, fit
from ranger_sim.sysid.instruments import Instrument

Array = NDArray[np.float64]
Values = dict[str, float]


@dataclasses.dataclass(frozen=True)
class Block:
    """Rows of one recording. parameters: what is asked of them; nuisances: of its instruments; residual: in standard
    deviations, shape (n,); series: neighbours in it are neighbours in time."""

    name: str
    parameters: tuple[Parameter, ...]
    nuisances: tuple[Parameter, ...]
    residual: Callable[[Values], Array]
    count: int
    series: bool = False


@dataclasses.dataclass(frozen=True)
class Correction:
    """What an instrument showed, put right with its two errors."""

    shown: Array
    offset: str
    gain: str

    def __call__(self, values: Values) -> Array:
        return (self.shown - values.get(self.offset, 0.0)) / (1.0 + values.get(self.gain, 0.0))


def corrected(bench: str, shown: Array, instrument: Instrument) -> tuple[Correction, tuple[Parameter, ...]]:
    """A column as a function of the instrument's errors, and these as parameters; an error that it has not is none."""
    stem = f"{bench}.{instrument.name.replace(' ', '_').replace(chr(39), '')}"
    offset, gain = f"{stem}_offset", f"{stem}_gain"
    found = []
    if instrument.offset > 0.0:
        found.append(Parameter(offset, instrument.unit, 0.0, source=instrument.source, uncertainty=instrument.offset))
    if instrument.gain > 0.0:
        found.append(Parameter(gain, "1", 0.0, source=instrument.source, uncertainty=instrument.gain))
    return Correction(shown, offset, gain), tuple(found)


def length(name: str, value: float, uncertainty: float, source: str) -> Parameter:
    """A length that was measured by hand."""
    return Parameter(name, "m", value, 0.1 * value, 10.0 * value, source, uncertainty)


def column(dataset: Dataset, name: str, bench: str, default: float | None = None) -> Array:
    """Finite numbers of a channel; without it `default` for every row. UserError: it is needed and not there."""
    if name not in dataset and default is not None:
        return np.full(len(next(iter(dataset.channels.values())).value), default)
    if name not in dataset:
        there = ", ".join(dataset.channels) or "none"
        raise UserError(f"{dataset.name}: {bench} needs the channel {name}; there are {there}")
    value = dataset[name].value
    if not np.all(np.isfinite(value)):
        raise UserError(
            f"{dataset.name}: {name} has {np.count_nonzero(~np.isfinite(value))} values that are no numbers"
        )
    return value


def same_rows(dataset: Dataset, bench: str, *columns: Array) -> None:
    """UserError unless all columns have as many rows."""
    if len({len(each) for each in columns}) > 1:
        raise UserError(
            f"{dataset.name}: the channels of {bench} must have the same rows, they have {[len(c) for c in columns]}"
        )


def solve(
    blocks: Sequence[Block],
    parameters: Iterable[Parameter] = (),
    earlier: Iterable[Fit] = (),
    tell: Callable[[str], None] | None = None,
) -> Fit:
    """Fit all blocks at once. parameters: put in the place of the blocks' own of the same name (a better start).

    What a physical constant cannot be is refused: below zero by more than two standard errors.
    """
    unknown: dict[str, Parameter] = {}
    for block in blocks:
        for parameter in (*block.parameters, *block.nuisances):
            unknown.setdefault(parameter.name, parameter)
    unknown.update({parameter.name: parameter for parameter in parameters if parameter.name in unknown})
    starts = np.cumsum([0, *(block.count for block in blocks)])
    if tell is not None:
        tell(f"{' + '.join(block.name for block in blocks)}: {starts[-1]} rows, {len(unknown)} unknowns")
    runs = [slice(int(starts[k]), int(starts[k + 1])) for k, block in enumerate(blocks) if block.series]
    found = fit(
        lambda values: np.concatenate([block.residual(values) for block in blocks]),
        list(unknown.values()),
        None if runs else float(starts[-1]),
        runs=runs,
        earlier=earlier,
        tell=tell,
    )
    return refused_if_negative(found)


NEVER_NEGATIVE = (  # how such names begin
    *("R", "V_c", "K", "C_0", "C_1", "mu", "ankle_C_0"),
    *("outer_cm", "inner_cm", "outer_J", "inner_J", "J_foot", "k_"),
)


def refused_if_negative(found: Fit) -> Fit:
    """The same fit, refused where a constant that cannot be negative is, by more than two standard errors."""
    wrong = [
        f"{name} is {value:.3g} {found.units[name]}, it cannot be negative"
        for name, value in found.values.items()
        if name.startswith(NEVER_NEGATIVE) and value < -2.0 * found.standard_errors[name]
    ]
    if not wrong:
        return found
    return dataclasses.replace(found, values={}, standard_errors={}, ci95={}, refused="; ".join(wrong))


def start_at(fitted: Fit, parameters: Iterable[Parameter]) -> list[Parameter]:
    """The parameters, started where an earlier fit of the same data ended (nothing is counted twice)."""
    return [
        dataclasses.replace(each, value=fitted.ended_at[each.name], scale=each.step)
        if each.name in fitted.ended_at and each.low < fitted.ended_at[each.name] < each.high and not each.uncertainty
        else each
        for each in parameters
    ]
