"""Diagnosis in the noise that all candidates leave: for machines without their own noise estimate.

The order: the band (`bands.py`), what can be predicted at all (`predictability.py`), causes by likelihood that
held-out data do not refuse (`likelihood.py`), three errors (`three_numbers.py`), what would not have been seen.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np
from scipy import ndimage

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import (
    bands,
    gain,
    held_out,
    intervals,
    left_over,
    likelihood,
    misfit,
    naming,
    noise_floor,
    own_model,
    plausibility,
    predictability,
    rivals,
    signals,
)
from ranger_sim.sysid.dataset import Finding, Table
from ranger_sim.sysid.diagnosis import LITTLE, Diagnosis, KnownEffect, Visible
from ranger_sim.sysid.machine import LAGS, Effect, Machine, Recording, inputs_of, simulated_outputs
from ranger_sim.sysid.naming import Named, Trial
from ranger_sim.sysid.regression import Regression, kept_rows
from ranger_sim.sysid.results import DiagnosisEvidence, HeldOutError
from ranger_sim.sysid.three_numbers import Held, gained

MOST_ACTING = 8  # candidates in the simulator while it is linearised: the likeliest
# Of the likeliest one's score: what explains less hardly moves where the simulator ends. Chosen by us
SMALL = 0.2
FEW_SHAPES = 9  # of a candidate that acts at all of them while a simulator is lost: jumps have 9, lags more
# Simulations with the named effects, at most, and where only the size of a named lag still moves: it goes to and fro
# about its place
AGAIN, LAG_AGAIN = 3, 8
STEEPEST = -2.0  # of the likeliest shape by the simulated one: steeper is noise. Chosen by us
MOVED = 0.1  # standard errors that a coefficient may still move by from one of them to the next
# Times what numerics move it by: a named effect is at least so large. A lag is a stamp's, up to half a row, in one of
# the ways in which an input may go between its rows where it is below twice of the half row between these
ABOVE_NUMERICS, LAG_ABOVE_NUMERICS = 3.0, 2.0
BLOCKS = 30  # of the coefficients' errors: each longer than the memory of most residuals
MORE_PREDICTED = 1.5  # times: a narrower band in which so much more of the residual is predictable is the better one
LEVEL = 0.01  # chance of a predictable residual in any equation of a sound recording
FEWEST_STRETCHES = 20.0  # correlation times of an equation's noise: fewer say nothing
FURTHER = 5.0  # times, general features by chance: they come in addition to the predictor
RARER = 100.0  # times, a line by chance: its law is that of noise that an autoregression has made white
ROWS_PER_COEFFICIENT = 12  # of base, names and further harmonics: with fewer rows further harmonics are left out
MOST_CLIPPED = 0.2  # of the rows
LEARNED = 0.7  # of the held-out error: a black box that leaves less has learned what the equation lacks. Chosen by us
# Times: causes are at least so much surer than parameters are beyond their limits, in standard errors, for what makes
# these impossible may make those. Chosen by us: a robot joint's friction has 4.6 times, causes that it lacks 0.5 to 1.4
SURER = 2.0
DRIFTS = ("sensor_drift", "parameter_drift")
# In -2 log likelihood: what happened once explains more by it than lasting causes do. Chosen by us
SURELY_ONCE = 40.0
HALF_SAMPLE = 0.5  # samples: lags below it are stamps, not causes


def diagnose(
    machine: Machine,
    recordings: Sequence[Recording],
    holdout: Sequence[Table],
    seed: int,
    known: Sequence[KnownEffect],
    find: Callable[[KnownEffect, Sequence[Effect]], Named],
    progress: Callable[[str, float], None],
) -> Diagnosis:
    """All findings but the printed answer. find: a known effect among the machine's."""
    progress("band", 0.1)
    band, predictor = _band(machine, [unclipped(machine, each) for each in recordings], seed)
    whole = recordings
    recordings = [unclipped(machine, band.of(each)) for each in recordings]
    held = [unclipped(machine, band.of(machine.prepare(table))) for table in holdout]
    effects = machine.effects(recordings)
    had = [find(each, effects) for each in known]
    effects = [each for each in effects if all(each is not other.effect for other in had)]
    begun = _Begun(machine, whole, recordings, held, band, predictor, had, known, seed)
    lasting = [each for each in effects if not each.once]
    found = _answered(begun, lasting, progress)
    if len(lasting) == len(effects) or not _may_be_once(found, effects):
        return found
    other = _answered(begun, effects, progress)
    return other if _was_once(other, found) else found


@dataclasses.dataclass(frozen=True)
class _Begun:
    """What causes are sought in. whole: recordings as they are; recordings, held: in the band."""

    machine: Machine
    whole: Sequence[Recording]
    recordings: Sequence[Recording]
    held: Sequence[Recording]
    band: bands.Band
    predictor: predictability.Predictor
    had: list[Named]
    known: Sequence[KnownEffect]
    seed: int


def _may_be_once(found: Diagnosis, effects: Sequence[Effect]) -> bool:
    """True where lasting causes leave what happened at one time: no name, a drift, or a jump in what they leave.

    Held-out data do not judge what happened once, so that it is not sought where lasting causes explain everything.
    """
    if found.doubtful or any(each.effect.cause in DRIFTS for each in found.named):
        return True
    left = found.extended
    if not any(each.entries for each in found.recordings):  # what lasting causes leave of a jump has a long memory
        known = likelihood.noise_of(found.recordings, effects, found.skews)
        left = naming.refit(Regression(found.recordings, noise=known), [*found.skews, *found.named])
    ranked = likelihood.ranking(naming.trials([each for each in effects if each.once], left), left.size)
    ranked = likelihood.in_time(ranked, left)
    return bool(ranked) and ranked[0][0] > max(SURELY_ONCE, LITTLE * left.chi2)


def _was_once(other: Diagnosis, lasting: Diagnosis) -> bool:
    """True where causes of which one happened once explain surely more than the lasting ones, or any explain it where
    these alone do not: a simulator may be lost without what happened once among its candidates.

    A drift that held-out data refuse is among the lasting ones: they do not judge a jump that explains no more.
    """
    if other.doubtful or not other.named:
        return False
    if lasting.doubtful:
        return True
    drifts = [each for each in lasting.refused if each.effect.cause in DRIFTS]
    named = [
        *lasting.named,
        *(each for each in drifts if not any(each.effect.excludes(one.effect) for one in lasting.named)),
    ]
    explained = naming.refit(lasting.plain, named, [*lasting.skews, *named])
    once = any(each.effect.once for each in other.named)
    return (once or not lasting.named) and _size(explained) - _size(other.extended) > SURELY_ONCE


def _size(regression: Regression) -> float:
    """-2 log likelihood, up to a constant, of what each equation leaves as it is."""
    noises = likelihood.own_noise(regression).whitening
    return sum(
        2.0 * np.count_nonzero(regression.good[name]) * math.log(each.deviation) for name, each in noises.items()
    )


def _answered(begun: _Begun, effects: Sequence[Effect], progress: Callable[[str, float], None]) -> Diagnosis:
    """All findings with these candidates."""
    machine, whole, recordings, held = begun.machine, begun.whole, begun.recordings, begun.held
    band, predictor, had, known, seed = begun.band, begun.predictor, begun.had, begun.known, begun.seed
    progress("misfit", 0.2)
    if hasattr(machine, "about_all"):
        recordings, held = ([_about_all(machine, each, effects, had) for each in some] for some in (recordings, held))
    if any(each.entries for each in recordings):
        own_model.determined(machine, bands.plain(recordings))  # before anything is concluded
    skews = list(had)
    unreal: set[str] = set()  # names of causes that no machine has as they came out
    simulations = rivals.Simulations(machine, had)

    def selected(recordings: Sequence[Recording], held: Sequence[Recording], begin: float) -> likelihood.Selection:
        while True:
            found = once(recordings, held, begin)
            stamps, wrong = _stamps(found), _unreal(found)
            if not stamps and not wrong:
                return found
            skews.extend(stamps)
            unreal.update(wrong)

    def once(recordings: Sequence[Recording], held: Sequence[Recording], begin: float) -> likelihood.Selection:
        rest = [each for each in _others(effects, skews) if each.name not in unreal]
        base = naming.refit(bands.plain(recordings), skews)
        judge = Held(held, skews, base.values) if held else None
        found = likelihood.select(
            recordings, rest, skews, seed, judge, progress=lambda share: progress("causes", begin + 0.2 * share)
        )
        return simulations.decided(recordings, found, skews) if hasattr(machine, "surprise") else found

    found = selected(recordings, held, 0.25)
    before = predictability.test(found.base, predictor.columns(recordings), seed)
    floor: dict[str, tuple[float, ...]] = {}
    small: list[str] = []
    lost: list[Finding] = []
    tried: dict[str, list[tuple[float, float]]] = {}
    for number in range(LAG_AGAIN if found.named and hasattr(machine, "again") else 0):
        progress("simulated again", 0.5 + 0.2 * min(1.0, number / AGAIN))
        previous = found
        effects = _finer(effects, found, skews, tried)
        linearised = [*recordings, *held]
        recordings, held, lost = _simulated_again(simulations, recordings, held, found)
        if all(new is old for new, old in zip([*recordings, *held], linearised, strict=True)):
            break
        found = selected(recordings, held, 0.5 + 0.2 * min(1.0, number / AGAIN))
        same = [each.effect.name for each in found.named] == [each.effect.name for each in previous.named]
        if same and all(_unmoved(found, previous, name) for each in found.named for name in each.coefficients):
            break
        if number + 1 >= AGAIN and not (same and any(each.effect.cause in LAGS for each in found.named)):
            break
    while found.named and hasattr(machine, "numerical"):  # what is named instead of a small effect may be small as well
        progress("numerics", 0.7)
        recordings, held, lost = _simulated_again(simulations, recordings, held, found)  # where causes are judged
        if lost:
            break
        floor = _numerical_floor(machine, recordings, [*had, *found.named])
        below = [each for each in found.named if _below(floor, found, each.effect)]
        if not below:
            break
        small += [each.effect.name for each in below]
        effects = [each for each in effects if not any(one.effect.excludes(each) for one in below)]  # in all its forms
        lags = [each for each in below if each.effect.cause in LAGS]
        skews.extend(lags)  # of the sensor or of the input's way to the machine: it is there
        found = selected(recordings, held, 0.7)
        before = predictability.test(found.base, predictor.columns(recordings), seed) if lags else before
    progress("what is left", 0.75)
    judged = held or (recordings if hasattr(machine, "free") else [])
    if hasattr(machine, "free"):
        judged = [machine.free(each) for each in judged]
    judge = Held(judged, skews, found.base.values) if judged else None
    extended, known_to = _sure_names(machine, found, skews, floor, judge if held else None, seed)
    after = predictability.test(extended, predictor.columns(recordings), seed) if found.named else before
    progress("gain", 0.85)
    errors = None
    floors = noise_floor.by_channels(extended)
    if judge is not None and not found.named:
        floors = noise_floor.farther(floors, noise_floor.by_channels(judge.base, judge.sizes, bool(held)))
    other: list[Finding] = []
    if held and judge is not None:
        other = plausibility.of_held_out(machine, judge.base)
        lasting = predictability.predictor(machine, recordings, seed, without=("t",))  # another run has its own time
        errors = judge.errors(found.named, extended, found.base, lasting, seed)
    return Diagnosis(
        machine,
        list(recordings),
        found.base,
        extended,
        skews,
        had,
        list(known),
        found.named,
        known_to,
        _with_general(_misfit(before, machine, found.base), machine, found, whole, skews, seed),
        _misfit(after, machine, extended),
        plausibility.look(
            machine,
            extended,
            found.named,
            by_candidates=True,
            base=found.base,
            more=[*own_model.of(machine, recordings, found.base), *lost, *other],
        ),
        level=LEVEL,
        band_hz=band.edge_hz,
        refused=found.refused,
        errors=errors,
        floors=floors,
        by_candidates=True,
        left_over=_left_over(machine, found, skews, recordings, seed) if found.named else None,
        stretches={each.equation: float(each.stretches) for each in after},
        numerics=floor,
        below_numerics=small,
        visible=smallest(
            _others(effects, skews), extended, found.thresholds[-1] if found.thresholds else likelihood.LEAST
        ),
    )


def _simulated_again(
    simulations: rivals.Simulations,
    recordings: Sequence[Recording],
    held: Sequence[Recording],
    found: likelihood.Selection,
) -> tuple[Sequence[Recording], Sequence[Recording], list[Finding]]:
    """Both with the named causes in the simulator. Where it runs away with them they are as before, the causes have no
    name, and a finding says so: their sizes are those of a first order about a fit that means little."""
    try:
        again = simulations.again(recordings, found.named, found.with_named)
        return again, simulations.again(held, _there(found.named, held), found.with_named), []
    except (UserError, np.linalg.LinAlgError):
        names = " and ".join(each.effect.name for each in found.named)
        found.named, found.with_named = [], found.base
        text = f"with {names} in it, which explains these data best at first order, the simulation runs away"
        return recordings, held, [Finding("", "runs_away", 0.0, 0.0, 0.0, "", text)]


def _there(named: Sequence[Named], held: Sequence[Recording]) -> list[Named]:
    """The causes that held-out recordings have as well: what happened once is in the last part of its recording."""
    part = all(each.table.begin_s is not None for each in held)
    return [each for each in named if part or not each.effect.once]


def _sure_names(
    machine: Machine,
    found: likelihood.Selection,
    fixed: Sequence[Named],
    floor: Mapping[str, tuple[float, ...]],
    judge: Held | None,
    seed: int,
) -> tuple[Regression, dict[str, intervals.Intervals]]:
    """(regression with the causes that stay, their profiles by name); found loses the others.

    A cause has no name with 0 in its interval, where parameters are impossible nearly as surely, and where all causes
    together surely make held-out data worse; nor has what happens once, which held-out data do not judge, where much is
    left with it. The least sure one goes first.
    """
    profiles: dict[str, intervals.Intervals] = {}
    extended = found.with_named
    while found.named:
        for each in found.named:
            others = [other for other in found.named if other is not each]
            base = naming.refit(found.base, others, [*fixed, *others]) if others else found.base
            each.shape, profile = intervals.profile(each, base)
            profiles[each.effect.name] = _with_numerics(each, profile, floor)
        extended = naming.refit(found.base, found.named, [*fixed, *found.named])
        _widen(extended)
        _add_numerics(extended, found.named, floor)
        absurd = plausibility.surest_beyond(machine.parameters, extended, found.named)
        least = SURER * absurd if absurd > intervals.Z95 else 0.0
        floors = noise_floor.by_channels(extended)
        far = any(noise_floor.far(each) for each in floors.values())
        unsure = [
            each
            for each in found.named
            if each.effect.once
            and far
            or not intervals.sign_is_known(each, intervals.whole(each, extended, profiles[each.effect.name]))
            or _sure(extended, each) < least
        ]
        loses = False
        if not unsure and judge is not None:
            loses = float(gained(judge.errors(found.named, extended, found.base, None, seed).values())[2][1]) < 0.0
        if not unsure and not loses:
            break
        weakest = min(unsure or found.named, key=lambda each: _sure(extended, each))
        found.named.remove(weakest)
        found.refused += [weakest] if loses else []
        extended = found.base
    if not found.named:
        _widen(extended)
    return extended, profiles


def _left_over(
    machine: Machine, found: likelihood.Selection, fixed: Sequence[Named], recordings: Sequence[Recording], seed: int
) -> left_over.LeftOver | None:
    """What the named causes leave that goes with one signal; further harmonics of a periodic cause belong to it."""
    harmonics = []
    for each in found.named:
        for shape in each.effect.shapes if each.effect.phase_is_free else ():
            if shape != each.shape:
                place = f"{each.effect.at}, {', '.join(f'{number:g}' for number in shape.values())}"
                effect = dataclasses.replace(each.effect, at=place)
                harmonics.append(dataclasses.replace(each, effect=effect, shape=shape))
    count = found.base.count + sum(len(each.coefficients) for each in (*found.named, *harmonics))
    few = count * ROWS_PER_COEFFICIENT > found.base.size
    named = [*found.named, *([] if few else harmonics)]
    return left_over.look(machine, naming.refit(found.base, named, [*fixed, *named]), recordings, seed)


def _about_all(machine: Machine, recording: Recording, effects: Sequence[Effect], had: Sequence[Named]) -> Recording:
    """A simulator's recording, linearised with known and likely effects in it, each at the shape that suits best."""
    known = likelihood.noise_of([recording], effects, had)
    base = naming.refit(Regression([recording], noise=known), had)
    tried = naming.trials(effects, base)
    likeliest: list[Trial] = []
    best = 0.0
    while len(likeliest) < MOST_ACTING:  # each by what those before it leave: many resemble the same fault
        seen = [each for each in tried if likelihood.own_part(each) > likelihood.HIDDEN]
        ranked = likelihood.ranking(seen, len(recording.table))
        best = max(best, ranked[0][0] if ranked else 0.0)
        if not ranked or not ranked[0][0] > SMALL * best:
            break
        chosen = ranked[0][3]
        likeliest.append(chosen)
        tried = [each for each in seen if each is not chosen and not chosen.effect.excludes(each.effect)]
        naming.take(chosen, tried, base)
    acting = [(each.effect, each.shape) for each in had]
    acting += [
        (each.effect, intervals.finest(each.effect, each.shape, base) if each.effect.once else each.shape)
        for each in likeliest
    ]
    kinds = dict.fromkeys(each.subsystem for each in effects)
    few = [each for each in effects if len(each.shapes) <= FEW_SHAPES]
    families = [[(each, shape) for each in few if each.subsystem == kind for shape in each.shapes] for kind in kinds]
    return cast(Recording, machine.about_all(recording, acting, families))  # type: ignore[attr-defined]


def _finer(
    effects: Sequence[Effect],
    found: likelihood.Selection,
    fixed: Sequence[Named],
    tried: dict[str, list[tuple[float, float]]],
) -> list[Effect]:
    """The effects, those found at a shape on a scale with a finer grid about it; found gets them as well.

    tried: by lag, its simulated shapes with the likeliest shapes about them; it gets the next one.
    """
    out = list(effects)
    for each in found.named:
        scale = each.effect.scale
        if scale is None:
            continue
        others = [other for other in found.named if other is not each]
        base = naming.refit(found.base, others, [*fixed, *others]) if others else found.base
        old = each.effect
        # the grid stays: the first simulation of a large effect may be several of its shapes away from the last one
        shapes = [*old.shapes, *(shape for shape in [each.shape, *intervals.between(each)] if shape not in old.shapes)]
        each.shape, _ = intervals.profile(each, base)
        if old.cause in LAGS:
            following = _next(tried.setdefault(old.name, []), each.shape[scale])
            each.shape = {**each.shape, scale: following}
        each.effect = dataclasses.replace(old, shapes=shapes)
        # its rivals of the same kind as well: the one with the finer grid would win by it
        kind = (old.cause, old.form, old.scale)
        out = [
            each.effect
            if one is old
            else dataclasses.replace(one, shapes=shapes)
            if (one.cause, one.form, one.scale) == kind and one.shapes == old.shapes
            else one
            for one in out
        ]
    if found.named:
        found.with_named = naming.refit(found.base, found.named, [*fixed, *found.named])
    return out


def _next(tried: list[tuple[float, float]], likeliest: float) -> float:
    """The shape of a lag to simulate next, where one that was simulated has the likeliest shape about it.

    It may be beyond the right one, the more, the farther that is from the simulated one: a secant ends the going to and
    fro. tried gets the next one.
    """
    if tried:
        tried[-1] = (tried[-1][0], likeliest)
    following = likeliest
    if len(tried) > 1:
        (one, about_one), (other, about_other) = tried[-2:]
        slope = (about_other - about_one) / (other - one) if other != one else 0.0
        if STEEPEST < slope < 0.0:
            following = (likeliest - slope * other) / (1.0 - slope)
    tried.append((following, following))
    return following


def _numerical_floor(
    machine: Machine, recordings: Sequence[Recording], named: Sequence[Named]
) -> dict[str, tuple[float, ...]]:
    """By effect, the most that each coefficient moves with half the step and with inputs drawn otherwise."""
    moved = np.mean([np.max(np.abs(machine.numerical(each)), axis=0, initial=0.0) for each in recordings], axis=0)  # type: ignore[attr-defined]
    out, first = {}, 0
    for each in named:
        count = len(each.coefficients)
        out[each.effect.name] = tuple(float(size) for size in moved[first : first + count])
        first += count
    return out


def _below(floor: Mapping[str, tuple[float, ...]], found: likelihood.Selection, effect: Effect) -> bool:
    """True for a named effect that is not clearly larger than what numerics move it by."""
    for each in found.named:
        if each.effect is effect and effect.name in floor:
            size = math.hypot(*(found.with_named.values[name] for name in each.coefficients))
            times = LAG_ABOVE_NUMERICS if effect.cause in LAGS else ABOVE_NUMERICS
            return size < times * math.hypot(*floor[effect.name])
    return False


def _unmoved(found: likelihood.Selection, previous: likelihood.Selection, name: str) -> bool:
    """True when a coefficient is within a tenth of its standard error of what it was before it was simulated."""
    number = found.with_named.names.index(name)
    error = math.sqrt(max(0.0, float(found.with_named.covariance[number, number])))
    return abs(found.with_named.values[name] - previous.with_named.values.get(name, math.inf)) <= MOVED * error


def unclipped(machine: Machine, recording: Recording) -> Recording:
    """The recording without the rows in which a measured channel is cut off, and those that the band's filter reaches
    from there. UserError where it is a large part of them."""
    table = recording.table
    rows = np.zeros(len(table), dtype=bool)
    followed = inputs_of(machine) | simulated_outputs(machine)  # a simulator leaves out its outputs' rows itself
    for each in machine.quantities:
        if each.name in followed or each.name not in table:
            continue
        cut = signals.clipped(table, table[each.name], signals.counts_of(table, each.name))
        share = float(np.mean(cut))
        if share > MOST_CLIPPED:
            raise UserError(
                f"{table.name}: {each.name}: {share:.1%} of its values are cut off at its largest or smallest one, "
                f"at most {MOST_CLIPPED:.0%} may be; nothing is concluded from such data"
            )
        rows |= cut
    if not np.any(rows):
        return recording
    away = ~ndimage.binary_dilation(rows, iterations=1 + math.ceil(2.0 * recording.width))
    equations = {name: dataclasses.replace(each, valid=each.valid & away) for name, each in recording.equations.items()}
    return dataclasses.replace(recording, equations=equations)


def _band(machine: Machine, recordings: Sequence[Recording], seed: int) -> tuple[bands.Band, predictability.Predictor]:
    """The band, of three that suit, in which most of the residual can be predicted; and the predictor in it."""
    best: tuple[float, bands.Band, predictability.Predictor] | None = None
    suiting = bands.choose(recordings)
    for band in suiting:
        inside = [band.of(each) for each in recordings]
        predictor = predictability.predictor(machine, inside, seed)
        if len(suiting) == 1:
            return band, predictor
        needed = max(MORE_PREDICTED * best[0], predictability.WORTH) if best is not None else predictability.WORTH
        tests = predictability.test(bands.plain(inside), predictor.columns(inside), seed, needed)
        share = max((each.share for each in tests if each.p * len(tests) <= LEVEL), default=0.0)
        if best is None or share > needed:
            best = (share, band, predictor)
    assert best is not None
    return best[1], best[2]


def _others(effects: Sequence[Effect], skews: Sequence[Named]) -> list[Effect]:
    """The effects without those that are in the base; without other forms of an exact one, a lag, as well."""
    return [
        each
        for each in effects
        if all(each is not skew.effect and not (each.equals and each.excludes(skew.effect)) for skew in skews)
    ]


def _unreal(found: likelihood.Selection) -> list[str]:
    """Names of the causes that no machine has with the values that they have at last."""
    values = found.with_named.values
    return [
        each.effect.name
        for each in found.named
        if not each.effect.real(
            {name: values[full] for name, full in zip(each.effect.coefficients, each.coefficients, strict=True)}
        )
    ]


def _stamps(found: likelihood.Selection) -> list[Named]:
    """Lags of rows against their stamps, which are not causes; they are in the base from then on.

    Named ones of less than half a sample, and for a simulator those of less than a sample that held-out data refuse:
    an input and an output with their own clocks are so far apart, in each recording by another time.
    """
    step_s = found.base.recordings[0].table.step_s
    simulated = any(each.entries for each in found.base.recordings)
    refused = [each for each in found.refused if simulated and each.effect.cause in LAGS]
    with_refused = naming.refit(found.base, [*found.named, *refused])
    return [
        each
        for share, lags, values in ((HALF_SAMPLE, found.named, found.with_named), (1.0, refused, with_refused))
        for each in lags
        if each.effect.cause in LAGS and abs(values.values[each.coefficients[0]]) < share * step_s
    ]


def _over(machine: Machine, regression: Regression, name: str) -> str:
    """The signal over whose cells the residual of an equation varies most, as a general test is named."""
    general = [machine.generic(each).get(name, {}) for each in regression.recordings]
    if not all(general):
        return "the flexible predictor"
    good, part = regression.good[name], regression.parts[name]
    values = np.array([regression.values[each] for each in regression.names])
    left = (part.response - part.measured @ values)[good]
    shares = {}
    for signal in general[0]:
        column = np.concatenate(
            [kept_rows(each, one[signal]) for each, one in zip(regression.recordings, general, strict=True)]
        )[good]
        _, place = np.unique(misfit.cells(column, misfit.SINGLE_CELLS), return_inverse=True)
        means = np.bincount(place, left) / np.bincount(place)
        shares[signal] = float(np.sum(means[place] ** 2))
    return f"over {max(shares, key=lambda signal: shares[signal])}"


def _misfit(tests: Sequence[predictability.Predicted], machine: Machine, regression: Regression) -> misfit.Misfit:
    """The tests as those of any machine; excess: the share of the residual's square that can be predicted."""
    made = [
        misfit.Test(
            each.equation, _over(machine, regression, each.equation), each.share * each.stretches, 1, each.p, each.share
        )
        for each in tests
    ]
    chances = [each.p * len(made) for each in made]
    with_lines = _with_lines(regression)
    for line in (misfit.line(name, regression) for name in with_lines):
        chance = line.p * len(with_lines) * RARER
        if chance <= LEVEL:
            made.append(line)
            chances.append(chance)
    return misfit.Misfit(made, min([1.0, *chances]), max((each.share for each in made), default=0.0))


def _with_general(
    made: misfit.Misfit,
    machine: Machine,
    found: likelihood.Selection,
    whole: Sequence[Recording],
    fixed: Sequence[Named],
    seed: int,
) -> misfit.Misfit:
    """The tests, where they and the causes show nothing, with general features and with lines above the band."""
    if found.named or made.p < LEVEL or not all(each.firm for each in whole):
        return made
    tests, chances = list(made.tests), [made.p]
    most = left_over.look_at_all(machine, found.base, found.base.recordings, seed)
    if most is not None:
        share = most.chi2 / max(1, int(np.count_nonzero(found.base.good[most.equation])))
        tests.append(misfit.Test(most.equation, most.features, most.chi2, 1, most.p, share))
        chances.append(most.p * FURTHER)
    full = naming.refit(bands.plain(whole), fixed)
    lines = [misfit.line(name, full) for name in _with_lines(full)]
    chances += [each.p * len(lines) * RARER for each in lines]
    tests += [each for each in lines if each.p * len(lines) * RARER <= LEVEL]
    return misfit.Misfit(tests, min(1.0, *chances), max((each.share for each in tests), default=0.0))


def _with_lines(regression: Regression) -> list[str]:
    """Equations in whose residual's spectrum a line means anything."""
    made = [
        each for recording in regression.recordings if not recording.entries for each in recording.equations.items()
    ]
    return [name for name in regression.equations if any(name == other and each.lines for other, each in made)]


def _widen(regression: Regression) -> None:
    """Widen the covariance to the coefficients' scatter over blocks where a model error makes them scatter more."""
    scores = []
    for rows in regression.rows.values():
        product = regression.z[rows] * regression.residual[rows, None]
        block = np.arange(len(product)) * BLOCKS // max(1, len(product))
        scores.append(np.stack([product[block == each].sum(axis=0) for each in range(BLOCKS)]))
    together = np.sum(scores, axis=0)
    spread = regression.inverse @ (together.T @ together) @ regression.inverse.T
    kept = np.flatnonzero(np.diag(regression.covariance) > 0.0)
    model = regression.inverse @ regression.own @ regression.inverse.T
    wider = np.ones(regression.count)
    ratio = np.diag(spread) / np.maximum(np.diag(model), 1e-300)
    if len(kept) == len(ratio):
        wider[kept] = np.sqrt(np.maximum(1.0, ratio * BLOCKS / max(1, BLOCKS - len(kept))))
    regression.covariance = regression.covariance * np.outer(wider, wider)


def _sure(regression: Regression, each: Named) -> float:
    """Standard errors that the surest coefficient of a cause is away from 0."""
    numbers = [regression.names.index(name) for name in each.coefficients]
    errors = np.sqrt(np.maximum(np.diag(regression.covariance)[numbers], 1e-300))
    return float(np.max(np.abs([regression.values[name] for name in each.coefficients]) / errors))


def _add_numerics(regression: Regression, named: Sequence[Named], floor: Mapping[str, tuple[float, ...]]) -> None:
    """Widen the covariance so that a 95 % interval is longer at each end by what numerics move the coefficient by."""
    for each in named:
        for name, moved in zip(each.coefficients, floor.get(each.effect.name, ()), strict=False):
            number = regression.names.index(name)
            error = math.sqrt(max(0.0, float(regression.covariance[number, number])))
            regression.covariance[number, number] = (error + moved / intervals.Z95) ** 2


def _with_numerics(
    each: Named, profile: intervals.Intervals, floor: Mapping[str, tuple[float, ...]]
) -> intervals.Intervals:
    """The profile, in which a lag's shape has the same part of numerics as its size: both are one number."""
    name = each.effect.scale
    if each.effect.cause not in LAGS or name not in profile or each.effect.name not in floor:
        return profile
    (low, high), moved = profile[name], floor[each.effect.name][0]
    return {**profile, name: (max(0.0, low - moved), high + moved)}


def smallest(effects: Sequence[Effect], regression: Regression, threshold: float) -> list[Visible]:
    """For each effect the smallest size that these data would have named, at the shape that they show best."""
    out = []
    for effect in effects:
        sizes: list[tuple[float, dict[str, float], Mapping[str, float]]] = []
        for trial in naming.trials([effect], regression):
            inverse = np.linalg.pinv(trial.gram, rcond=1e-9, hermitian=True)
            shapes = effect.choices
            free = len(inverse) + (shapes > 1)
            needed = threshold + free * math.log(regression.size) + 2.0 * math.log(shapes)
            errors = np.sqrt(np.maximum(np.diag(inverse), 0.0) * needed * trial.inflation)
            off = likelihood.own_part(trial)
            if off > likelihood.HIDDEN:
                named = dict(zip(effect.coefficients, (float(each) for each in errors), strict=True))
                sizes.append((off, named, trial.shape))
        if sizes:
            _, named, shape = max(sizes, key=lambda one: one[0])
            out.append(Visible(effect, named, dict(shape)))
        else:
            out.append(Visible(effect, None, {}))
    return out


def held(found: Diagnosis, holdout: Sequence[str]) -> held_out.Held | None:
    """The judgement by held-out data, for the result; None without any."""
    if found.errors is None:
        return None
    named = bool(found.named) and found.detected and not found.doubtful
    names = ", ".join(holdout)
    return held_out.Held(_gain(found.errors, names) if named else None, names, found.refused, True)


def evidence(found: Diagnosis, made: DiagnosisEvidence) -> DiagnosisEvidence:
    """The evidence with errors on held-out data, the noise floor, and what would not have been seen."""
    return dataclasses.replace(
        made,
        band_hz=found.band_hz,
        held_out_errors=found.errors,
        smallest_visible={each.effect.name: each.sizes for each in found.visible if each.sizes is not None},
        cannot_be_seen=tuple(each.effect.name for each in found.visible if each.sizes is None),
        too_short_s=_needed_s(found) or None,
        learnable=_learnable(found) or None,
        below_numerics=tuple(found.below_numerics) or None,
    )


def _needed_s(found: Diagnosis) -> dict[str, float]:
    """By equation with too few independent stretches, where nothing was found, the length that would have enough."""
    if found.detected:
        return {}
    seconds = sum(len(each.table) * each.table.step_s for each in found.recordings)
    far = [name for name, each in found.floors.items() if noise_floor.far(each)]  # more of the same shows no more
    return {
        name: math.ceil(seconds * FEWEST_STRETCHES / number)
        for name, number in found.stretches.items()
        if number < FEWEST_STRETCHES and name not in (*_learnable(found), *far)
    }


def _learnable(found: Diagnosis) -> tuple[str, ...]:
    """Equations in which nothing was found, and of whose held-out error a black box explains a large part."""
    if found.detected:
        return ()
    return tuple(
        name
        for name, each in (found.errors or {}).items()
        if each.black_box is not None and each.before > noise_floor.LARGE and each.black_box < LEARNED * each.before
    )


def _gain(errors: Mapping[str, HeldOutError], holdout: str) -> gain.Gain:
    """Share of what can be explained at all that the named causes explain on held-out data, in squares of the error."""
    won, possible, ends = gained(errors.values())
    scale = max(possible, abs(won), 1e-300)  # where nothing can be gained, a loss counts as a whole one
    before = math.sqrt(sum(each.before**2 for each in errors.values()))
    after = math.sqrt(sum(each.after**2 for each in errors.values()))
    return gain.Gain(won / scale, (float(ends[0]) / scale, min(1.0, float(ends[1]) / scale)), before, after, holdout)
