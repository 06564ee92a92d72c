"""From measured data to what the simulation gets wrong: detect, localise, name, tie or abstain, extend, gain.

The answer is a dictionary that `json` writes as it is; its keys are those of `ranger-sim diagnose --json`.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import gain, intervals, misfit, naming, plausibility, predicted_ties, residual_term
from ranger_sim.sysid.dataset import Table
from ranger_sim.sysid.machine import Effect, Machine, Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression, kept_rows

# Of all general tests together. Chosen by us: their chi-squares hold for many samples only, and 0.001 gave 1 alarm in
# 30 sound recordings of the motor bench; effects worth a name are far below it.
GENERAL_LEVEL = 0.0001
NAMED_LEVEL = 0.005  # of the whole selection
HOLDS_OUT = 0.0  # chi-square that a further effect must win on held-out data
REFUSES = 2.33  # deviations, 1 % on one side, below what is expected: held-out data that refuse an effect
TELLS = 9.0  # chi-square of an effect on held-out data, three deviations: below it these say nothing of it
ROUNDS, MOST = 4, 5  # of naming; effects that are named
RIVALS = 6  # that an answer lists
AGAIN = 2  # times that what was named is simulated, and all naming done over
EXPLAINED = 0.7  # of what repeats: a name that explains less is none
SKEW = 0.5  # samples: stamps of two channels differ by so much in any log

Progress = Callable[[str, float], None]  # (what is done now, share of the work that lies behind)


@dataclasses.dataclass(frozen=True)
class KnownEffect:
    """An effect that the model has already: its shape, and the coefficients that it was found with."""

    cause: str
    at: str
    coefficients: Mapping[str, float]
    shape: Mapping[str, float]


@dataclasses.dataclass
class Diagnosis:
    """Everything that was found, for the report; `answer` is what is printed."""

    machine: Machine
    recordings: list[Recording]
    plain: Regression
    extended: Regression
    skews: list[Named]  # stamps that are off, and what the model has already: in the base of both regressions
    named: list[Named]
    before: misfit.Misfit
    after: misfit.Misfit
    answer: dict[str, Any]


def diagnose(
    machine: Machine,
    tables: Sequence[Table],
    holdout: Sequence[Table] = (),
    seed: int = 0,
    findings: Sequence[dict] = (),
    known: Sequence[KnownEffect] = (),
    progress: Progress = lambda what, share: None,
) -> Diagnosis:
    """What `machine`'s equations get wrong about these recordings. UserError when they cannot be judged at all.

    known: effects that the model has already; like the machine's parameters they are fitted anew and are no finding.
    """
    progress("equations", 0.0)
    recordings = [machine.prepare(table) for table in tables]
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
        recordings = _simulated_again(machine, recordings, named, extended)
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
    detected = before.p < GENERAL_LEVEL or bool(named) or doubts.forbid
    share = _explained(named, after)
    doubtful = detected and (not named or doubts.forbid or (share < EXPLAINED and after.p < GENERAL_LEVEL))
    impossible = _impossible(machine, extended)
    answer: dict[str, Any] = {
        "detected": bool(detected),
        "misfit": _channels(plain, extended, recordings),
        "subsystem": _subsystem(plain, before, named) if detected else None,
        "causes": [_cause(machine, each, extended, known_to) for each in named] if detected and not doubtful else [],
        "abstained": bool(doubtful),
        "gain": None,
        "next_experiment": _next(named),
        "model_file": None,
        "data_findings": [
            *findings,
            *(
                {**dataclasses.asdict(each), "recording": ", ".join(table.name for table in tables)}
                for each in doubts.findings
            ),
            *({**dataclasses.asdict(each), "recording": r.table.name} for r in recordings for each in r.findings),
        ],
        "evidence": {
            "p_general": before.p,
            "p_general_after": after.p,
            "explained": share,
            "suspects": [each.effect.name for each in named] if doubtful else [],
            "parameters": {name: _value(extended, name) for name in extended.values if "@" not in name},
            "parameters_are_physical": not doubtful and not impossible,
            "impossible": impossible,
            "skew_samples": {
                each.effect.at: extended.values[each.coefficients[0]] / recordings[0].table.step_s
                for each in skews
                if all(each is not other for other in had)
            },
            "known": [_known(each, was, extended) for each, was in zip(had, known, strict=True)],
        },
    }
    term = residual_term.learn(machine, recordings, plain, before) if doubtful and not doubts.forbid else None
    answer["evidence"]["residual_term"] = term.told() if term is not None else None
    if holdout and detected:
        progress("gain", 0.85)
        answer["gain"] = _gain(machine, plain, extended, holdout, skews, [] if doubtful else named, seed)
        refused, tells = answer["gain"].pop("refused"), answer["gain"].pop("tells")
        answer["evidence"]["refused_by_holdout"] = [each.effect.name for each in refused]
        answer["evidence"]["holdout_excites_it"] = tells
        if not tells:
            answer["gain"] = None
        if term is not None:
            answer["evidence"]["residual_term"]["holdout_rms"] = _left(machine, term, holdout)
        if refused:
            named = [each for each in named if each not in refused]
            extended = naming.refit(plain, named, [*skews, *named], fresh=True)
            answer["causes"] = [_cause(machine, each, extended, known_to) for each in named]
            answer["abstained"] = not named
    progress("done", 1.0)
    return Diagnosis(machine, recordings, plain, extended, skews, named, before, after, answer)


def _name(
    effects: Sequence[Effect],
    plain: Regression,
    skews: Sequence[Named],
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[list[Named], Regression]:
    """What of the effects is named, the most telling first, and the regression with it."""
    named: list[Named] = []
    extended, rest = plain, list(effects)
    for number in range(ROUNDS):
        progress(number / ROUNDS)
        found = naming.select(rest, extended, NAMED_LEVEL, MOST - len(named))
        if not found:
            break
        named += found
        rest = [each for each in rest if not any(other.effect.excludes(each) for other in found)]
        # what was named no longer counts as noise, and smaller effects stand out
        extended = naming.refit(plain, named, [*skews, *named], fresh=True)
    return named, extended


def _simulated_again(
    machine: Machine,
    recordings: Sequence[Recording],
    named: Sequence[Named],
    extended: Regression,
    fixed: bool = False,
) -> list[Recording]:
    """The recordings of a machine that is told by its simulator, with what was named in the simulation."""
    acting = [(each.effect, each.shape, [extended.values[name] for name in each.coefficients]) for each in named]
    return [machine.again(recording, acting, fixed) for recording in recordings]  # type: ignore[attr-defined]


def _skews(effects: Sequence[Effect], regression: Regression) -> list[Named]:
    """Lags of less than half a sample: stamps, not causes. They are taken into account without a word."""
    lags = [each for each in effects if each.cause == "sensor_lag"]
    step_s = regression.recordings[0].table.step_s
    found = naming.select(lags, regression, NAMED_LEVEL, most=2)
    if not found:
        return []
    values = naming.refit(regression, found).values
    return [each for each in found if abs(values[each.coefficients[0]]) < SKEW * step_s]


def _had(known: KnownEffect, effects: Sequence[Effect]) -> Named:
    """A known effect among those of the machine; UserError when it has none such with these channels."""
    for effect in effects:
        same = (effect.cause, effect.at, set(effect.coefficients)) == (known.cause, known.at, set(known.coefficients))
        if same and set(effect.shapes[0]) == set(known.shape):
            return Named(effect, known.shape, 0.0, 0, 1.0, 0.0, [], [])
    raise UserError(f"the model has {known.cause} at {known.at}, which these channels cannot show")


def _known(had: Named, was: KnownEffect, extended: Regression) -> dict[str, Any]:
    """What the model had, and what these data say of it."""
    return {
        "name": was.cause,
        "at": was.at,
        "parameters": {
            name: {"model": was.coefficients[name], **_value(extended, full)}
            for name, full in zip(had.effect.coefficients, had.coefficients, strict=True)
        },
        "shape": dict(was.shape),
    }


def _value(regression: Regression, name: str) -> dict[str, Any]:
    value, reach = regression.values[name], 1.96 * _error(regression, name)
    return {"value": value, "ci95": [value - reach, value + reach]}


def _explained(named: Sequence[Named], after: misfit.Misfit) -> float:
    """Share of the repeatable excess that the named effects explain."""
    gained = sum(each.chi2 - each.freedom for each in named)
    total = gained + after.excess
    return float(gained / total) if total > 0.0 else 0.0


def _impossible(machine: Machine, regression: Regression) -> list[str]:
    """Parameters that lie outside their limits with their whole interval: no machine has such."""
    found = []
    for known in machine.parameters:
        if known.name in regression.values:
            value, reach = regression.values[known.name], 1.96 * _error(regression, known.name)
            if value + reach < known.low or value - reach > known.high:
                found.append(known.name)
    return found


def _error(regression: Regression, name: str) -> float:
    number = regression.names.index(name)
    return math.sqrt(max(0.0, float(regression.covariance[number, number])))


def _subsystem(plain: Regression, before: misfit.Misfit, named: Sequence[Named]) -> str | None:
    if named:
        return named[0].effect.subsystem
    telling = before.telling.equation
    parts: dict[str, str] = {}
    for recording in plain.recordings:
        parts |= {name: each.subsystem for name, each in recording.equations.items()}
        parts |= {name: each.subsystem for name, each in recording.entries.items()}
    return parts[telling]


def _letters(each: Named, recordings: Sequence[Recording]) -> str:
    made = each.effect.columns(recordings[0], each.shape, {name: 1.0 for name in _parameter_names(recordings)})
    return "".join(recordings[0].equations[name].letter for name in made if name in recordings[0].equations)


def _parameter_names(recordings: Sequence[Recording]) -> list[str]:
    return [name for e in recordings[0].equations.values() for name in e.columns]


def _cause(
    machine: Machine, each: Named, extended: Regression, known_to: Mapping[str, intervals.Intervals]
) -> dict[str, Any]:
    parameters = {
        name: _value(extended, full) for name, full in zip(each.effect.coefficients, each.coefficients, strict=True)
    }
    parameters |= {name: {"value": value, "ci95": [value, value]} for name, value in each.shape.items()}
    for name, (low, high) in known_to[each.effect.name].items():
        near = parameters[name]["ci95"]
        parameters[name]["ci95"] = [min(low, near[0]), max(high, near[1])]
    return {
        "name": each.effect.cause,
        "at": each.effect.at,
        **({"form": each.effect.form} if each.effect.form else {}),
        "balance": _letters(each, extended.recordings),
        "parameters": parameters,
        "tied_with": list(dict.fromkeys(tie.cause for tie in each.tied if tie.cause != each.effect.cause)),
        "evidence": {
            "chi2": each.chi2,
            "p": each.p,
            "bic": each.bic,
            "ties": [tie.name for tie in each.tied],
            "behind": {effect.name: behind for effect, behind in each.rivals[:RIVALS]},
            "predicted": predicted_ties.of(machine, extended.recordings, each),
        },
    }


def _channels(plain: Regression, extended: Regression, recordings: Sequence[Recording]) -> list[dict[str, Any]]:
    """Misfit of each equation, in all and in each regime: rms of the residual over its noise, both in deviations."""
    out = []
    for equation in plain.equations:
        rows, good = plain.rows_of(equation), plain.good[equation]
        residual = plain.residual[rows]
        if not len(residual):
            continue
        scale = plain.whitening[equation].deviation
        better = extended.residual[extended.rows_of(equation)] * (extended.whitening[equation].deviation / scale)
        noise = float(np.sqrt(np.mean(better**2)))
        names = ["all", *dict.fromkeys(name for r in recordings for name in r.regimes)]
        for name in names:
            here = np.ones(len(good), dtype=bool)
            if name != "all":
                masks = [kept_rows(r, r.regimes.get(name, np.zeros(len(r.table), dtype=bool))) for r in recordings]
                here = np.concatenate(masks)
            # the extended model's noise may look further back, so that other rows count
            before, after = residual[here[good]], better[here[extended.good[equation]]]
            if min(len(before), len(after)) < 50:
                continue
            rms = float(np.sqrt(np.mean(before**2)))
            repeatable = max(0.0, 1.0 - float(np.mean(after**2)) / max(rms * rms, 1e-300))
            out.append(
                {
                    "channel": equation,
                    "regime": name,
                    "rms": rms * scale,
                    "noise": noise * scale,
                    "repeatable_fraction": repeatable,
                }
            )
    return out


def _gain(
    machine: Machine,
    plain: Regression,
    extended: Regression,
    holdout: Sequence[Table],
    skews: Sequence[Named],
    named: Sequence[Named],
    seed: int,
) -> dict[str, Any]:
    recordings = [machine.prepare(table) for table in holdout]
    if named and hasattr(machine, "again"):
        recordings = _simulated_again(machine, recordings, named, extended, fixed=True)
    general = misfit.general_features(machine, recordings)
    base = naming.refit(Regression(recordings, noise=plain), skews, values=plain.values)
    kept: list[Named] = []
    refused: list[Named] = []
    found, tells = None, False
    for each in named:
        tried = gain.measure(base, [*kept, each], extended.values, general, seed)
        won = tried.chi2_won - (found.chi2_won if found is not None else 0.0)
        # were the effect there as in training, it would win about what is expected, by twice its root either way
        expected = tried.chi2_expected
        if won > HOLDS_OUT or won > expected - REFUSES * 2.0 * math.sqrt(expected):
            kept, found = [*kept, each], tried
            tells = tells or expected >= TELLS
        else:
            refused.append(each)
    if found is not None and hasattr(machine, "free"):
        # refused or not is asked of the sharpest equations; how much nearer the simulation comes, of the simulation
        recordings = [machine.free(recording) for recording in recordings]
        general = misfit.general_features(machine, recordings)
        base = naming.refit(Regression(recordings), skews, values=plain.values)
        found = gain.measure(base, kept, extended.values, general, seed)
    return {
        "fraction_of_achievable": found.fraction if found is not None else 0.0,
        "ci95": list(found.ci95) if found is not None else [0.0, 0.0],
        "holdout": ", ".join(table.name for table in holdout),
        "worse": found is not None and found.worse,
        "refused": refused,
        "tells": found is None or tells,
    }


def _left(machine: Machine, term: residual_term.ResidualTerm, holdout: Sequence[Table]) -> list[float]:
    """What the equation leaves of held-out data without and with the learned term: rms in its unit."""
    recordings = [machine.prepare(table) for table in holdout]
    return list(term.left(machine, recordings, Regression(recordings)))


NEXT = {
    frozenset(
        {"sensor_offset", "direction_friction"}
    ): "a recording at standstill, which shows an offset without friction",
    frozenset({"sensor_scale", "load_friction"}): "a load cell's calibration, or stalls at several currents",
    frozenset({"stribeck", "presliding"}): "slow reversals, far below the speed at which friction has settled",
    frozenset({"resistance_temperature", "contact_drop_change"}): "the winding's temperature beside the current",
}


def _next(named: Sequence[Named]) -> list[str]:
    out = []
    for each in named:
        for tie in each.tied:
            pair = frozenset({each.effect.cause, tie.cause})
            if len(pair) == 2:
                out.append(NEXT.get(pair, f"an experiment in which {each.effect.name} and {tie.name} differ"))
    return list(dict.fromkeys(out))
