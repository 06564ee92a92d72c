"""From measured data to the simulation's errors: detect, localise, name, tie or abstain, extend, gain.

`api.py` has the same for files. The workings are a `Diagnosis`, of which `answer.py` makes the result; held-out data
judge it in `held_out.py`.
"""

import dataclasses
from collections.abc import Callable, Sequence

from threadpoolctl import threadpool_limits

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import (
    answer,
    bands,
    by_candidates,
    held_out,
    intervals,
    misfit,
    naming,
    noise_floor,
    plausibility,
    residual_term,
)
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.held_out import Held, simulated_again
from ranger_sim.sysid.machine import Effect, Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.preparation import Prepared
from ranger_sim.sysid.regression import NoEquations, Regression
from ranger_sim.sysid.results import LearnedTerm, NoiseFloor

NAMED_LEVEL = 0.005  # of the whole selection
ROUNDS, MOST = 4, 5  # of naming; effects that are named
AGAIN = 2  # times that the named effects are simulated and the whole naming is repeated
SKEW = 0.5  # samples: usual difference between two channels' stamps in any log

Progress = Callable[[str, float], None]  # (present step, finished share of the work)


def without_equations(machine: Machine, tables: Sequence[Table], prepared: Sequence[Prepared]) -> Diagnosis:
    """The frame of a diagnosis whose recordings give no equation: a walk that its twins alone judge."""
    silent, sound = misfit.Misfit([], 1.0, 0.0), plausibility.Doubts([], False)
    recordings = [Recording(table, {}, {}) for table in tables]
    nothing = NoEquations()
    found = Diagnosis(machine, recordings, nothing, nothing, [], [], [], [], {}, silent, silent, sound)
    found.result = answer.without_equations(found, prepared)
    return found


def diagnose(
    machine: Machine,
    tables: Sequence[Table],
    holdout: Sequence[Table] = (),
    seed: int = 0,
    prepared: Sequence[Prepared] = (),
    known: Sequence[KnownEffect] = (),
    progress: Progress = lambda what, share: None,
) -> Diagnosis:
    """Errors of `machine`'s equations about these recordings. UserError when they cannot be judged at all.

    prepared: of all these recordings, for the result's findings, repairs and ledger. known: effects that the model has
    already; like the machine's parameters they are fitted again and are not findings.
    """
    progress("equations", 0.0)
    with threadpool_limits(1):  # threads of the linear algebra cost more than they save, and change last digits
        recordings = [machine.prepare(table) for table in tables]
    if all(each.noise_by_candidates for each in recordings):
        with threadpool_limits(1):
            found = by_candidates.diagnose(machine, recordings, holdout, seed, known, _had, progress)
        judged = by_candidates.held(found, [table.name for table in holdout])
        found.result = answer.of(found, found, judged, _learned(found, holdout), prepared)
        progress("done", 1.0)
        return found
    progress("general tests", 0.1)
    general = misfit.general_features(machine, recordings)
    whole = Regression(recordings)
    effects = machine.effects(recordings)
    had = [_had(each, effects) for each in known]
    effects = [each for each in effects if all(each is not other.effect for other in had)]
    whole = naming.refit(whole, had, fresh=True)
    skews = _skews(effects, whole) + had
    progress("misfit", 0.2)
    plain = naming.refit(whole, skews)
    before = misfit.look(plain, general)
    rest, first = [each for each in effects if all(each is not skew.effect for skew in skews)], recordings
    named, extended = _name(rest, plain, skews, lambda share: progress("causes", 0.25 + 0.25 * share))
    for number in range(AGAIN if named and hasattr(machine, "again") else 0):
        progress("simulated again", 0.5 + 0.25 * number / AGAIN)
        recordings = simulated_again(machine, recordings, named, extended)
        plain = naming.refit(Regression(recordings), skews, fresh=True)
        was, (named, extended) = named, _name(rest, plain, skews)
        if [each.effect for each in named] == [each.effect for each in was]:
            break
    if recordings is not first:
        general = misfit.general_features(machine, recordings)
    progress("what is left", 0.75)
    known_to: dict[str, intervals.Intervals] = {}
    for each in named:
        others = [*skews, *(other for other in named if other is not each)]
        base = naming.refit(extended, others) if others else Regression(recordings, noise=extended)
        each.shape, known_to[each.effect.name] = intervals.profile(each, base)
    if named:
        extended = naming.refit(plain, named, [*skews, *named], fresh=True)
    after = misfit.look(extended, general)
    doubts = plausibility.look(machine, extended, named)
    found = Diagnosis(
        machine, recordings, plain, extended, skews, had, list(known), named, known_to, before, after, doubts
    )
    final, held = found, None
    if holdout and found.detected:
        progress("gain", 0.85)
        final, held = _hold_out(found, holdout, seed)
    elif not found.detected:
        progress("noise floor", 0.85)
        found.floors = _floors(found, holdout)
    final.result = answer.of(found, final, held, _learned(found, holdout), prepared)
    progress("done", 1.0)
    return final


def _hold_out(found: Diagnosis, holdout: Sequence[Table], seed: int) -> tuple[Diagnosis, Held]:
    """The diagnosis without the effects that held-out data refuse, and their judgement."""
    named = [] if found.doubtful else found.named
    held = held_out.judged(found.machine, found.plain, found.extended, holdout, found.skews, named, seed)
    if not held.refused:
        return found, held
    kept = [each for each in named if each not in held.refused]
    extended = naming.refit(found.plain, kept, [*found.skews, *kept], fresh=True)
    return dataclasses.replace(found, named=kept, extended=extended), held


def _floors(found: Diagnosis, holdout: Sequence[Table]) -> dict[str, NoiseFloor]:
    """What the equations leave next to their noise, also of held-out data."""
    floors = noise_floor.by_band_or_repeats(found.extended)
    if not holdout:
        return floors
    recordings = [found.machine.prepare(table) for table in holdout]
    base = naming.refit(Regression(recordings, noise=found.plain), found.skews, values=found.plain.values)
    return noise_floor.farther(floors, noise_floor.by_band_or_repeats(base, held_out=True))


def _name(
    effects: Sequence[Effect],
    plain: Regression,
    skews: Sequence[Named],
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[list[Named], Regression]:
    """The named effects, the most significant first, and the regression with them."""
    named: list[Named] = []
    extended, rest = plain, list(effects)
    for number in range(ROUNDS):
        progress(number / ROUNDS)
        found = naming.select(rest, extended, NAMED_LEVEL, MOST - len(named))
        if not found:
            break
        named += found
        rest = [each for each in rest if not any(other.effect.excludes(each) for other in found)]
        # named effects no longer count as noise, and smaller effects become visible
        extended = naming.refit(plain, named, [*skews, *named], fresh=True)
    return named, extended


def _skews(effects: Sequence[Effect], regression: Regression) -> list[Named]:
    """Lags of less than half a sample: stamps, not causes. They are included without a finding."""
    lags = [each for each in effects if each.cause == "sensor_lag"]
    step_s = regression.recordings[0].table.step_s
    found = naming.select(lags, regression, NAMED_LEVEL, most=2)
    if not found:
        return []
    values = naming.refit(regression, found).values
    return [each for each in found if abs(values[each.coefficients[0]]) < SKEW * step_s]


def _had(known: KnownEffect, effects: Sequence[Effect]) -> Named:
    """A known effect among those of the machine; UserError when the machine has no such effect with these channels."""
    for effect in effects:
        same = (effect.cause, effect.at, set(effect.coefficients)) == (known.cause, known.at, set(known.coefficients))
        if same and set(effect.shapes[0]) == set(known.shape):
            return Named(effect, known.shape, 0.0, 0, 1.0, 0.0, [], [])
    raise UserError(f"the model has {known.cause} at {known.at}, which these channels cannot show")


def _learned(found: Diagnosis, holdout: Sequence[Table]) -> LearnedTerm | None:
    """A table of what is wrong and has no name, and what it leaves of held-out data."""
    if not found.doubtful or found.doubts.forbid:
        return None
    term = residual_term.learn(found.machine, found.recordings, found.plain, found.before)
    if term is None or not holdout:
        return term.result() if term is not None else None
    recordings = [bands.Band(found.band_hz).of(found.machine.prepare(table)) for table in holdout]
    return term.result(term.left(found.machine, recordings, bands.plain(recordings)))
