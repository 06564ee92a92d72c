"""Causes by likelihood, in the noise that the model *and all of its candidates* leave.

A residual that contains a slow fault looks like slow noise; noise estimated from it explains the fault away, and the
larger the fault, the better. What the base and all candidates together leave contains no fault of the catalogue, and
the score of a cause grows with its size. The score is then held against chance: surrogates of the base's own residual,
an autoregression without any cause, pass through the same selection.
"""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ranger_sim.sysid import causes, intervals, naming, noise
from ranger_sim.sysid.bands import fitted, least_squares, plain
from ranger_sim.sysid.dataset import Array
from ranger_sim.sysid.machine import Effect, Recording
from ranger_sim.sysid.naming import Named, Trial
from ranger_sim.sysid.regression import Noise, Part, Regression, Whitening, explained, innovations, reduced

SURROGATES = 199
LEVEL = 0.02  # chance that the best of all candidates exceeds its threshold on a sound recording
MOST = 5  # causes
LEAST = 6.0  # score that a cause must have whatever the surrogates say: that of a tie
BLOCKS = 8  # of the cross-validation within the training data
# Standard errors over the blocks by which a further effect must exceed a simpler one: 1 % on one side of Student's t,
# since the error is that of as many blocks
SURE = 3.0
PASSES = 3  # over the causes, each held against all others
WORSE = 1.05  # times the held-out square: an exchange may not make it worse
ALIKE, MOST_ALIKE = (
    0.1,
    4,
)  # of the best score, and how many: causes between which other data choose; the first is found alone
HIDDEN = 1e-4  # of a candidate's square: when the others explain all but this, an equation does not show it
# Of what the others leave: a lag that takes less of it is taken at first order for the noise, since a filter's memory
# takes a part of the noise's. Chosen by us
MOST_OF_IT = 0.5
SAME = 1e-9  # of a cosine from 1: columns that are one
FEWEST_FREE = 5  # rows per column, at least, in the fit with all candidates


class Judge(Protocol):
    """Held-out data, while causes are sought. extended: the regression with all of the causes."""

    def accepts(self, named: Sequence[Named], candidate: Named, without: Regression, extended: Regression) -> bool:
        """False where the data refuse a further candidate; without: the regression with the causes before it."""

    def square(self, named: Sequence[Named], extended: Regression) -> float:
        """Square of the errors with these causes."""


@dataclasses.dataclass
class Selection:
    """named: the causes in the order found; refused: by held-out data; base: the regression without any of them.

    with_named: in the same noise; thresholds: of each round's score; best: (effect, score) of the last round, in which
    nothing was found any more.
    """

    named: list[Named]
    refused: list[Named]
    base: Regression
    with_named: Regression
    thresholds: list[float]
    best: list[tuple[Effect, float]]


def noise_of(recordings: Sequence[Recording], effects: Sequence[Effect], fixed: Sequence[Named]) -> Noise:
    """Noise that base, `fixed` effects and all candidates leave together; each candidate at its best shape."""
    base = naming.refit(plain(recordings), fixed)
    candidates = [_columns(effect, base) for effect in _with_time(effects, base)]
    found: dict[str, Whitening] = {}
    white: dict[str, Array] = {}
    for name, part in base.parts.items():
        good = part.valid & ~part.starts
        x, y, z = part.measured, part.response, part.stand_in
        basis = np.linalg.qr(_scaled(z[good]))[0]
        left = y[good] - x[good] @ np.array([base.values[each] for each in base.names])
        left -= basis @ (basis.T @ left)
        most = np.count_nonzero(good) // FEWEST_FREE - x.shape[1]
        kept: list[Array] = []
        for exact in (False, True):  # a lag last: of a large one every other candidate is a part
            left = left - basis @ (basis.T @ left)
            added: list[tuple[float, Array]] = []
            for effect, shapes in zip(effects, candidates, strict=True):
                tried = [(_gain(each[name][good], basis, left), each[name]) for each in shapes if name in each]
                if tried and (effect.equals is not None) == exact:
                    best = max(tried, key=lambda one: one[0])
                    added.append(tried[0] if exact and best[0] < MOST_OF_IT * float(left @ left) else best)
            for _, columns in sorted(added, key=lambda one: -one[0]):
                new = _seen(columns, good, basis)
                if sum(each.shape[1] for each in kept) + new.shape[1] <= most:
                    kept.append(new)
                    basis = np.linalg.qr(np.hstack([basis, new[good]]))[0]
        wide = np.hstack([x, *kept])
        residual = y - wide @ fitted(np.hstack([z, *kept])[good], wide[good], y[good])
        memory = noise.autoregression(residual, good & _unbroken(part))
        counted = base._good(name, memory)
        shocks = innovations(memory, residual)
        free = max(1, np.count_nonzero(counted) - wide.shape[1] - len(memory))
        least = 1e-9 * float(np.max(np.abs(y), initial=0.0)) or 1.0
        deviation = max(math.sqrt(float(np.sum(shocks[counted] ** 2)) / free), least)
        found[name] = Whitening(memory, deviation)
        white[name] = np.where(counted, shocks / deviation, np.nan)
    return Noise(found, _correlations(white))


def _correlations(white: dict[str, Array]) -> dict[tuple[str, str], float]:
    """Correlations of the innovations of each pair of equations."""
    shared = {}
    names = list(white)
    for number, one in enumerate(names):
        for other in names[number + 1 :]:
            product = white[one] * white[other]
            if np.count_nonzero(np.isfinite(product)) > 40:
                shared[one, other] = float(np.clip(np.nanmean(product), -0.98, 0.98))
    return shared


def _unbroken(part: Part) -> np.ndarray:
    return np.diff(part.run, prepend=part.run[:1]) == 0


def _seen(columns: Array, good: np.ndarray, basis: Array) -> Array:
    """(n, m) directions of columns (n, k) that an orthonormal basis (rows that count, p) does not have already.

    What is left of a column that the basis has nearly is the noise of the trajectory along which it was made, which
    would explain the noise itself.
    """
    scaled = columns / np.maximum(np.linalg.norm(columns[good], axis=0), 1e-300)
    inside = scaled[good]
    _, sizes, turns = np.linalg.svd(inside - basis @ (basis.T @ inside), full_matrices=False)
    return np.asarray(scaled @ turns[sizes**2 > HIDDEN].T)


def _scaled(columns: Array) -> Array:
    lengths = np.linalg.norm(columns, axis=0)
    return columns[:, lengths > 0.0] / lengths[lengths > 0.0]


def _gain(columns: Array, basis: Array, left: Array) -> float:
    """Square that columns explain of what the base left."""
    off = columns - basis @ (basis.T @ columns)
    return float(left @ left - np.sum((left - off @ least_squares(off, left)) ** 2))


def _with_time(effects: Sequence[Effect], base: Regression) -> list[Effect]:
    """The effects of a balance, the likeliest that happens once with its own time as well.

    At the grid's times a large jump leaves a stretch of itself, which would be noise with a long memory.
    """
    once = [] if any(each.entries for each in base.recordings) else [each for each in effects if each.once]
    ranked = ranking(naming.trials(once, base), base.size)
    if not ranked:
        return list(effects)
    first = ranked[0][3]
    shape = intervals.finest(first.effect, first.shape, base)
    return [
        dataclasses.replace(each, shapes=[*each.shapes, shape]) if each is first.effect else each for each in effects
    ]


def _columns(effect: Effect, base: Regression) -> list[dict[str, Array]]:
    """Columns of an effect at each of its shapes, by equation over all recordings, in the band and not whitened."""
    out = []
    for shape in effect.shapes:
        made = [effect.columns(recording, shape, base.values) for recording in base.recordings]
        names = {name for each in made for name in each if name in base.parts}
        width = max((each[name].shape[1] for each in made for name in each), default=0)
        out.append({name: _stacked(base, made, name, width) for name in sorted(names)})
    return out


def _stacked(base: Regression, made: Sequence[dict[str, Array]], name: str, width: int) -> Array:
    parts = []
    for recording, columns in zip(base.recordings, made, strict=True):
        given = columns.get(name, np.zeros((len(recording.table), width)))
        parts.append(reduced(recording, given, name))
    return np.vstack(parts)


def own_noise(regression: Regression) -> Noise:
    """Noise of a regression's residual as it is, whatever is in it."""
    found: dict[str, Whitening] = {}
    values = np.array([regression.values[each] for each in regression.names])
    for name, part in regression.parts.items():
        residual = part.response - part.measured @ values
        memory = noise.autoregression(residual, part.valid & ~part.starts & _unbroken(part))
        counted = regression._good(name, memory)
        shocks = innovations(memory, residual)[counted]
        least = 1e-9 * float(np.max(np.abs(part.response), initial=0.0)) or 1.0
        deviation = math.sqrt(float(np.mean(shocks**2))) if len(shocks) else least
        found[name] = Whitening(memory, max(deviation, least))
    return Noise(found)


def surrogates(regression: Regression, seed: int, count: int = SURROGATES) -> Array:
    """(N, count) recordings without any cause, in the regression's rows: noise as its own residual is, and as large.

    The power of slow noise scatters; what is compared is the part of it that a candidate explains by chance.
    """
    out = np.zeros((regression.size, count))
    for name, own in own_noise(regression).whitening.items():
        raw = noise.surrogates(
            own.coefficients, own.deviation, len(regression.parts[name].response), count, seed, f"noise of {name}"
        )
        out[regression.rows[name]] = regression._scaled(name, raw)[regression.good[name]]
    left = out - regression.phi @ (regression.inverse @ (regression.z.T @ out))
    out *= np.sqrt(regression.chi2 / np.maximum(np.einsum("nm,nm->m", left, left), 1e-300))
    return out


def score(chi2: Array | float, freedom: int, shapes: int, size: int) -> Array | float:
    """Gain of the information criterion: a shape found on a grid counts as a parameter."""
    return chi2 - (freedom + (shapes > 1)) * math.log(size) - 2.0 * math.log(shapes)


def by_chance(tried: Sequence[Trial], regression: Regression, drawn: Array) -> Array:
    """(trials, count) score of each trial on each surrogate (N, count)."""
    together = regression.z.T @ drawn
    found = np.empty((len(tried), drawn.shape[1]))
    straight = [np.zeros((len(trial.gram), drawn.shape[1])) for trial in tried]
    for name, rows in regression.rows.items():  # all columns of an equation at once
        having = [number for number, trial in enumerate(tried) if name in trial.white]
        if not having:
            continue
        products = np.hstack([tried[number].white[name] for number in having]).T @ drawn[rows]
        ends = np.cumsum([len(straight[number]) for number in having])[:-1]
        for number, part in zip(having, np.split(products, ends), strict=True):
            straight[number] += part
    for number, trial in enumerate(tried):
        product = straight[number] - trial.shadow.T @ together
        inverse = np.linalg.pinv(trial.gram, rcond=1e-9, hermitian=True)
        chi2 = np.einsum("km,kl,lm->m", product, inverse, product) / trial.inflation
        found[number] = score(chi2, len(inverse), trial.effect.choices, regression.size)
    return found


def select(
    recordings: Sequence[Recording],
    effects: Sequence[Effect],
    fixed: Sequence[Named] = (),
    seed: int = 0,
    judge: Judge | None = None,
    most: int = MOST,
    progress: Callable[[float], None] = lambda share: None,
) -> Selection:
    """The causes that these data support. fixed: effects that are in the base. judge: where it refuses a candidate,
    naming goes on without it; of causes that tie here it takes the one that predicts its data best.
    """
    known = noise_of(recordings, effects, fixed)
    base = naming.refit(Regression(recordings, noise=known), fixed)
    named: list[Named] = []
    regression, rest = base, list(effects)
    left_out: list[Effect] = []
    refused: list[Named] = []
    thresholds: list[float] = []
    met: list[set[str]] = []  # names of the causes after each addition
    tried: list[Trial] = []
    scores = np.empty((0, SURROGATES))
    while True:
        if not tried:  # first, and with a cause in the base
            progress(len(named) / most)
            tried = [
                each for each in naming.trials(rest, regression) if own_part(each) > HIDDEN and _new(each, regression)
            ]
            scores = by_chance(tried, regression, surrogates(regression, seed))
        kept = np.array([any(each.effect is effect for effect in rest) for each in tried], dtype=bool)
        tried, scores = [each for each, there in zip(tried, kept, strict=True) if there], scores[kept]
        if not tried:
            return Selection(named, refused, base, regression, thresholds, [])
        chance = np.max(scores, axis=0)
        threshold = max(float(np.quantile(chance, 1.0 - LEVEL)), LEAST)
        thresholds.append(threshold)
        ranked = in_time(ranking(tried, regression.size), regression)
        chosen = next((each for each in ranked if naming.possible(each[3])), None)
        if chosen is None or chosen[0] <= threshold or len(named) == most:
            return Selection(
                named, refused, base, regression, thresholds, [(each[3].effect, each[0]) for each in ranked]
            )
        near = [each for each in ranked if abs(chosen[0] - each[0]) < naming.TIE and naming.possible(each[3])]
        within = max(naming.TIE, ALIKE * chosen[0])
        alike = _alike([each for each in ranked if chosen[0] - each[0] < within and naming.possible(each[3])])
        options = [_named(_finest(each, regression), ranked, near, chance) for each in alike]
        options.sort(key=lambda each: -each.bic)
        extensions = [naming.refit(base, [*named, each], [*fixed, *named, each]) for each in options]
        best = 0
        if len(options) > 1:
            errors = [
                judge.square([*named, one], each) if judge is not None else _error_of_blocks(each)
                for one, each in zip(options, extensions, strict=True)
            ]
            best = int(np.argmin(errors))
            if best and regression.size * math.log(errors[0] / max(errors[best], 1e-300)) < naming.TIE:
                best = 0  # no better there: the likeliest one here
        if judge is not None and len(options) > 1:  # one that is not refused, the likeliest first
            order = [best, *(number for number in range(len(options)) if number != best)]
            allowed = (each for each in order if judge.accepts(named, options[each], regression, extensions[each]))
            best = next(allowed, best)
        found, extended = options[best], extensions[best]
        in_doubt = _simpler_in_doubt(found, named, base, fixed, ranked, near, chance, threshold)
        if in_doubt is not found:
            found, extended = in_doubt, naming.refit(base, [*named, in_doubt], [*fixed, *named, in_doubt])
        lasts = not found.effect.once  # what happens once is in one of the blocks
        if (
            lasts
            and not _predicts(regression, extended)
            or not _seen_with_refused(found.effect, base, fixed, named, refused, threshold)
        ):
            left_out.append(found.effect)
        elif judge is not None and not judge.accepts(named, found, regression, extended):
            refused.append(found)
        else:
            exchanged = _exchanged([*named, found], effects, base, fixed, refused, threshold, judge)
            together = {each.effect.name for each in exchanged}
            if together in met:  # the exchange has undone it
                left_out.append(found.effect)
            else:
                met.append(together)
                named = exchanged
                regression, tried = naming.refit(base, named, [*fixed, *named]), []
        rest = [
            each
            for each in rest
            if each not in left_out
            and all(each is not other.effect for other in refused)
            and not any(other.effect.excludes(each) for other in named)
        ]


def _simpler(one: Effect, than: Effect) -> bool:
    """True for a wrong value of a number of the model (`shift`), where the other is a further effect like it."""
    simple, other = (causes.CAUSES.get(each.cause) for each in (one, than))
    if simple is None or other is None or not simple.shift or other.shift or one.at != than.at:
        return False
    return other.number in simple.confusable or simple.number in other.confusable


def _simpler_in_doubt(
    found: Named,
    others: Sequence[Named],
    base: Regression,
    fixed: Sequence[Named],
    ranked: Sequence["Scored"],
    near: Sequence["Scored"],
    chance: Array,
    threshold: float,
) -> Named:
    """The cause itself, or the best simpler one that these data support as well, with it as a tie."""
    simple = next(
        (
            each
            for each in ranked
            if each[0] > threshold and naming.possible(each[3]) and _simpler(each[3].effect, found.effect)
        ),
        None,
    )
    if simple is None:
        return found
    plainer = _named(simple, ranked, near, chance)
    with_each = [naming.refit(base, [*others, each], [*fixed, *others, each]) for each in (found, plainer)]
    if _surely_better(*with_each):
        return found
    plainer.tied = [found.effect, *(each for each in plainer.tied if each is not found.effect)]
    return plainer


def _surely_better(one: Regression, other: Regression) -> bool:
    """True when one model is better than another all over the recording, and not by a few stretches (Vuong 1989)."""
    gained = other.residual**2 - one.residual**2
    by_block = np.zeros(BLOCKS)
    for rows in one.rows.values():
        by_block += [float(np.sum(each)) for each in np.array_split(gained[rows], BLOCKS)]
    error = math.sqrt(BLOCKS / (BLOCKS - 1.0) * float(np.sum((by_block - np.mean(by_block)) ** 2)))
    return float(np.sum(by_block)) > max(naming.TIE, SURE * error)


def _seen_with_refused(
    effect: Effect,
    base: Regression,
    fixed: Sequence[Named],
    named: Sequence[Named],
    refused: Sequence[Named],
    threshold: float,
) -> bool:
    """False for an effect that is seen only where the refused ones, which these data show better, are left out."""
    if not refused:
        return True
    without = [*named, *(each for each in refused if all(not each.effect.excludes(one.effect) for one in named))]
    ranked = ranking(naming.trials([effect], naming.refit(base, without, [*fixed, *without])), base.size)
    return bool(ranked) and ranked[0][0] > threshold


def _exchanged(
    named: list[Named],
    effects: Sequence[Effect],
    base: Regression,
    fixed: Sequence[Named],
    refused: Sequence[Named],
    threshold: float,
    judge: Judge | None,
) -> list[Named]:
    """The causes, each held once more against all others with the rest in the model: the first was chosen alone."""
    out = list(named)
    for _ in range(PASSES if len(named) > 1 else 0):
        before = [each.effect for each in out]
        for old in list(out):
            others = [each for each in out if each is not old]
            if not others or len(others) == len(out):  # it is alone, or has been dropped
                continue
            regression = naming.refit(base, others, [*fixed, *others])
            rest = [
                each
                for each in effects
                if not any(one.effect.excludes(each) for one in others)
                and all(each is not one.effect for one in refused)
            ]
            tried = [each for each in naming.trials(rest, regression) if own_part(each) > HIDDEN]
            ranked = ranking(tried, base.size)
            own = next((each for each in ranked if each[3].effect is old.effect), None)
            chosen = next((each for each in ranked if naming.possible(each[3])), None)
            if own is None or chosen is None or own[0] <= threshold:  # the others explain it
                out = others
                continue
            new = dataclasses.replace(old, chi2=own[1], freedom=own[2], bic=own[0], shape=own[3].shape)
            tied = [each for each in ranked if abs(each[0] - chosen[0]) < naming.TIE and naming.possible(each[3])]
            if chosen[3].effect is not old.effect and chosen[0] > own[0] + naming.TIE:
                new = _named(chosen, ranked, tied, np.zeros(0))
            new = _simpler_in_doubt(new, others, base, fixed, ranked, tied, np.zeros(0), threshold)
            new.p = old.p
            if new.effect is not old.effect and judge is not None:
                squares = [
                    judge.square(each, naming.refit(base, each, [*fixed, *each]))
                    for each in ([*others, new], [*others, old])
                ]
                if squares[0] > WORSE * squares[1]:
                    continue
            out[out.index(old)] = new
        if [each.effect for each in out] == before:
            break
    return out


Scored = tuple[float, float, int, Trial]  # (score, chi-square, freedom, trial)


def _alike(ranked: Sequence[Scored]) -> list[Scored]:
    """The best of these, and in addition the best form of a lag, of which a curve is a part and many shapes are it."""
    exact = [each for each in ranked if each[3].effect.equals is not None][:1]
    return [*[each for each in ranked if each[3].effect.equals is None][:MOST_ALIKE], *exact]


def _named(one: Scored, ranked: Sequence[Scored], near: Sequence[Scored], chance: Array) -> Named:
    """One of the ranking as a named effect. near: those that tie; chance: best scores of surrogates."""
    score, chi2, freedom, trial = one
    return Named(
        trial.effect,
        trial.shape,
        chi2,
        freedom,
        (1.0 + float(np.count_nonzero(chance >= score))) / (1.0 + len(chance)),
        score,
        [each[3].effect for each in near if each[3].effect is not trial.effect],
        [(each[3].effect, score - each[0]) for each in ranked if each[3].effect is not trial.effect],
    )


def _finest(one: Scored, regression: Regression) -> Scored:
    """One of a ranking at its best shape, between the grid's as well: other data judge it by its shape, too."""
    effect = one[3].effect
    if effect.scale is None:
        return one
    shape = intervals.finest(effect, one[3].shape, regression)
    scored = ranking(naming.trials([effect], regression, [shape]), regression.size)
    return scored[0] if scored else one


def in_time(ranked: Sequence[Scored], regression: Regression) -> list[Scored]:
    """The ranking with the likeliest of what happens once at its own time, where a grid's may show next to nothing of
    it; each of the finer steps counts as a shape."""
    first = [each for each in ranked if each[3].effect.once][:MOST_ALIKE]
    out = [each for each in ranked if all(each is not one for one in first)]
    for each in first:
        found = _finest(each, regression)
        paid = found[0] - 2.0 * intervals.ROUNDS * math.log(intervals.BETWEEN + 1)
        out.append((paid, *found[1:]) if paid > each[0] else each)
    return sorted(out, key=lambda each: -each[0])


def _new(trial: Trial, regression: Regression) -> bool:
    """False for a column that a parameter has already; against that one's stand-in it would look like another."""
    for name, columns in trial.white.items():
        measured = regression.measured[regression.rows[name]]
        sizes = np.linalg.norm(measured, axis=0) * np.linalg.norm(columns[:, 0])
        if columns.shape[1] == 1 and np.any(
            np.abs(columns[:, 0] @ measured) > (1.0 - SAME) * np.maximum(sizes, 1e-300)
        ):
            return False
    return True


def own_part(trial: Trial) -> float:
    """Part of an effect's square that the base does not explain."""
    whole = sum(float(np.sum(columns**2)) for columns in trial.white.values())
    return float(np.trace(trial.gram)) / max(whole, 1e-300)


def ranking(tried: Sequence[Trial], size: int) -> list[Scored]:
    """Of each effect at its best shape, best first."""
    found: dict[int, list[tuple[float, int, Trial]]] = {}
    for trial in tried:
        gain, freedom = explained(trial.gram, trial.product)
        if freedom:
            found.setdefault(id(trial.effect), []).append((gain - naming.inexact(trial), freedom, trial))
    best = []
    for some in found.values():
        chi2s = naming.by_shapes([each[0] for each in some], [each[2].inflation for each in some])
        scored = [
            (float(score(chi2, freedom, trial.effect.choices, size)), chi2, freedom, trial)
            for chi2, (_, freedom, trial) in zip(chi2s, some, strict=True)
        ]
        best.append(max(scored, key=lambda each: each[0]))
    return sorted(best, key=lambda each: -each[0])


def _predicts(without: Regression, extended: Regression) -> bool:
    """True when the extended model predicts blocks of the training data better that neither model was fitted to."""
    return _error_of_blocks(extended) < _error_of_blocks(without)


def _error_of_blocks(regression: Regression) -> float:
    """Sum of squares of what a model leaves in blocks of the training data that it was not fitted to."""
    rows = {name: np.flatnonzero(regression.good[name]) for name in regression.equations}
    place = np.concatenate([each * BLOCKS // len(regression.good[name]) for name, each in rows.items()])
    z, x, y = _unwhitened(regression)
    error = 0.0
    for each in range(BLOCKS):
        fitted, held = place != each, place == each
        if not np.any(held):
            continue
        scale = np.linalg.norm(z[fitted], axis=0)
        scale = np.where(scale > 0.0, scale, 1.0)
        zs, xs = z[fitted] / scale, x[fitted] / scale
        found = np.linalg.lstsq(zs.T @ xs, zs.T @ y[fitted], rcond=1e-10)[0]
        error += float(np.sum((y[held] - (x[held] / scale) @ found) ** 2))
    return error


def _unwhitened(regression: Regression) -> tuple[Array, Array, Array]:
    """(stand-ins, columns, response) of the rows that count, each equation by its residual's size only."""
    out: list[tuple[Array, Array, Array]] = []
    for name, part in regression.parts.items():
        good = regression.good[name]
        size = regression.whitening[name].deviation
        out.append((part.stand_in[good] / size, part.measured[good] / size, part.response[good] / size))
    return tuple(np.concatenate(each) for each in zip(*out, strict=True))  # type: ignore[return-value]
