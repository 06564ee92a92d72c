"""Errors on held-out data: of the model, of the model with what was named, and of a black box.

The machine's own parameters are fitted again on the held-out data, with and without what is added: friction of another
day is not a fault of the extension. What is added keeps its sizes from the training data; only the phase of a periodic
effect, and what an effect declares as free, is fitted. The black box is the flexible predictor (`predictability.py`),
or the physics with a flexible rest, whichever is better there: it says how much of the error can be explained at all.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ranger_sim.foundation.random_arrays import generator
from ranger_sim.sysid import naming
from ranger_sim.sysid.bands import fitted, plain
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.predictability import Predictor, learned
from ranger_sim.sysid.regression import Regression, reduced
from ranger_sim.sysid.results import HeldOutError

DRAWS = 400
BLOCKS = 20  # of the bootstrap: each longer than the memory of most residuals
SURE = 2.33  # standard errors over the blocks by which the held-out data must show an effect: 1 % on one side
HALF = 0.5  # of an effect's size in training: with less of it the prediction is better without it
BETTER_SHOWN = 5.0  # times in training, where the held-out data do not excite an effect
SHOWS = 1e-3  # of the error's square: an effect below it on the held-out data is not judged by them


class Held:
    """Held-out recordings in the band of the training data."""

    def __init__(self, recordings: Sequence[Recording], fixed: Sequence[Named], values: Mapping[str, float]) -> None:
        """fixed: effects in the base, fitted here as the machine's own parameters are. values: of the training fit."""
        self.recordings = list(recordings)
        self.values = values
        self.base = naming.refit(plain(recordings), fixed, values=values)
        self.sizes = {name: _size(self.recordings, name, self.base) for name in self.base.equations}
        self.rows = {name: part.valid & ~part.starts for name, part in self.base.parts.items()}
        # An equation counts by what it leaves, and not by what it measures: one may have next to no noise.
        self.left = dict.fromkeys(self.sizes, 1.0)
        self.left = {name: _rms(each) or 1.0 for name, each in self.residual([], {}).items()}

    def residual(self, named: Sequence[Named], values: Mapping[str, float], extra: Mapping[str, Array] | None = None
                 ) -> dict[str, Array]:  # fmt: skip
        """By equation (rows that count,), in units of what the base left. extra: more to take off, by equation."""
        y, x, z, ends = self._stacked(extra)
        for each in named:
            columns = self._columns(each)
            if not np.any(columns):
                continue
            sizes = np.array([values[name] for name in each.coefficients])
            y = y - columns @ _adapted(each, sizes, columns, y, x, z)
        left = y - x @ fitted(z, x, y)
        return {name: left[ends[number] : ends[number + 1]] for number, name in enumerate(self.base.equations)}

    def shows(self, each: Named, values: Mapping[str, float], left: Mapping[str, Array]) -> bool:
        """True when the effect, as large as in training, moves the held-out rows enough to be judged by them.

        What happens once is not judged by them. left: errors there, of the causes before it.
        """
        if each.effect.once:
            return False
        _, _, z, _ = self._stacked(None)
        columns = self._columns(each)
        moved = columns @ np.array([values[name] for name in each.coefficients])
        moved = moved - z @ fitted(z, z, moved)
        return float(moved @ moved) > SHOWS * sum(float(one @ one) for one in left.values())

    def _stacked(self, extra: Mapping[str, Array] | None) -> tuple[Array, Array, Array, list[int]]:
        """(response, columns, their stand-ins, first row of each equation and the end), rows that count, by size."""
        ys, xs, zs = [], [], []
        for name, part in self.base.parts.items():
            good, size = self.rows[name], self.sizes[name] * self.left[name]
            response = part.response - (extra[name] if extra and name in extra else 0.0)
            ys.append(response[good] / size)
            xs.append(part.measured[good] / size)
            zs.append(part.stand_in[good] / size)
        ends = np.cumsum([0, *map(len, ys)]).tolist()
        x, z = np.vstack(xs), np.vstack(zs)
        used = np.any(x != 0.0, axis=0)
        return np.concatenate(ys), x[:, used], z[:, used], ends

    def _columns(self, each: Named) -> Array:
        made = [each.effect.columns(recording, each.shape, self.values) for recording in self.recordings]
        wide = len(each.effect.coefficients)
        out = []
        for name in self.base.equations:
            parts = [
                reduced(recording, columns.get(name, np.zeros((len(recording.table), wide))), name)
                for recording, columns in zip(self.recordings, made, strict=True)
            ]
            out.append(np.vstack(parts)[self.rows[name]] / (self.sizes[name] * self.left[name]))
        return np.vstack(out)

    def accepts(self, named: Sequence[Named], candidate: Named, without: Regression, extended: Regression) -> bool:
        """False when the data, which excite the candidate, do not surely show it, or show less than half of it."""
        before = self.residual(named, without.values)
        if not self.shows(candidate, extended.values, before):  # then it must show much better in the training data
            return candidate.chi2 > BETTER_SHOWN * SHOWS * extended.size
        after = self.residual([*named, candidate], extended.values)
        moved = {name: before[name] - after[name] for name in before}
        whole = sum(float(each @ each) for each in moved.values())
        share = sum(float(each @ before[name]) for name, each in moved.items()) / max(whole, 1e-300)
        # blocks: a residual remembers; an effect may be in few of them, and scatters no less where it is strong
        scatter: Array = np.sum(
            [_by_block(each * (before[name] - share * each)) for name, each in moved.items()], axis=0
        )
        error = math.sqrt(float(scatter @ scatter)) / max(whole, 1e-300)
        return share > max(HALF, SURE * error)

    def square(self, named: Sequence[Named], extended: Regression) -> float:
        """Square of the errors with these causes, each equation in units of what the base left."""
        return sum(float(each @ each) for each in self.residual(named, extended.values).values())

    def errors(
        self,
        named: Sequence[Named],
        extended: Regression,
        without: Regression,
        predictor: Predictor | None,
        seed: int,
    ) -> dict[str, HeldOutError]:
        """By equation. extended, without: the training regressions with the causes and without them."""
        before = self.residual([], {})
        after = self.residual(named, extended.values) if named else before
        boxes: list[dict[str, Array]] = [after]
        if predictor is not None:
            seen = predictor.columns(self.recordings)
            trained = predictor.columns(without.recordings)
            boxes.append(self.residual([], {}, _learned(without, trained, seen)))
            if named:
                boxes.append(self.residual(named, extended.values, _learned(extended, trained, seen)))
        out = {}
        for name in self.base.equations:
            if not len(before[name]):
                continue
            best = min(_rms(each[name]) for each in boxes) * self.left[name] if len(boxes) > 1 else None
            out[name] = HeldOutError(
                _rms(before[name]) * self.left[name],
                _rms(after[name]) * self.left[name],
                best,
                _ratio(before[name], after[name], seed),
            )
        return out


def gained(errors: Iterable[HeldOutError]) -> tuple[float, float, Array]:
    """(gain of all equations together, the possible one, (2,) 95 % limits), in squares of the least possible error."""
    won = possible = 0.0
    ends = np.zeros(2)
    for each in errors:
        best = min(each.after, each.black_box if each.black_box is not None else each.after)
        scale = max(best**2, 1e-12 * each.before**2, 1e-300)
        won += (each.before**2 - each.after**2) / scale
        possible += max(0.0, each.before**2 - best**2) / scale
        ends += each.before**2 * (1.0 - np.square(each.ratio95[::-1])) / scale
    return won, possible, ends


def _learned(regression: Regression, trained: Mapping[str, Array], seen: Mapping[str, Array]) -> dict[str, Array]:
    """By equation: what the flexible predictor, trained on a regression's residual, adds on other rows."""
    values = np.array([regression.values[each] for each in regression.names])
    out = {}
    for name, part in regression.parts.items():
        if name in trained and name in seen:
            good = part.valid & ~part.starts
            residual = part.response[good] - part.measured[good] @ values
            found = learned(trained[name][good], part.stand_in[good], residual)
            out[name] = seen[name] @ found
    return out


def _adapted(each: Named, sizes: Array, columns: Array, y: Array, x: Array, z: Array) -> Array:
    """Coefficients of training, with what another run does not share fitted here."""
    if each.effect.once:  # this run has it at the same time, or has it not
        there = columns @ sizes
        share = fitted(np.column_stack([z, there]), np.column_stack([x, there]), y)[-1]
        return np.asarray(sizes * np.clip(share, 0.0, 1.0))
    if not each.effect.phase_is_free and not each.effect.free:
        return sizes
    if each.effect.phase_is_free:
        here = fitted(np.hstack([z, columns]), np.hstack([x, columns]), y)[x.shape[1] :].reshape(-1, 2)
        lengths = np.linalg.norm(sizes.reshape(-1, 2), axis=1) / np.maximum(np.linalg.norm(here, axis=1), 1e-300)
        return np.asarray((here * lengths[:, None]).ravel())
    free = np.array([name in each.effect.free for name in each.effect.coefficients])
    found = np.where(free, 0.0, sizes)
    some = columns[:, free]
    found[free] = fitted(np.hstack([z, some]), np.hstack([x, some]), y - columns @ found)[x.shape[1] :]
    return found


def _size(recordings: Sequence[Recording], name: str, base: Regression) -> float:
    """What an equation's error is compared with: a simulated channel's deviation, or the response's rms."""
    channels = [each.table[name] for each in recordings if each.entries and name in each.table]
    part = base.parts[name]
    values = np.concatenate(channels) if channels else part.response[part.valid & ~part.starts]
    size = float(np.std(values)) if channels else _rms(values)
    return size or 1.0


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def _ratio(before: Array, after: Array, seed: int) -> tuple[float, float]:
    """95 % interval of the rms after over the rms before, by a bootstrap of blocks."""
    was, is_now = _by_block(before**2), _by_block(after**2)
    draws = generator(seed, "bootstrap of the error").integers(0, BLOCKS, (DRAWS, BLOCKS))
    ratios = np.sqrt(is_now[draws].sum(axis=1) / np.maximum(was[draws].sum(axis=1), 1e-300))
    low, high = np.quantile(ratios, [0.025, 0.975])
    return float(low), float(high)


def _by_block(values: Array) -> Array:
    """(BLOCKS,) sums of values (n,) over equal parts of the recording."""
    places = np.arange(len(values)) * BLOCKS // max(1, len(values))
    return np.asarray(np.bincount(places, weights=values, minlength=BLOCKS), dtype=float)
