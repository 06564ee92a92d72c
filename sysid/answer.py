"""The one place that makes the result of a diagnosis: values, intervals and findings as `results.DiagnosisResult`."""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np

from ranger_sim.sysid import by_candidates, intervals, model_file, noise_floor, plausibility, predicted_ties, repairs
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.free_simulation import entrance
from ranger_sim.sysid.free_simulation.linearised import LinearisedRecording
from ranger_sim.sysid.held_out import Held
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.machines import ROBOT
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.preparation import Prepared
from ranger_sim.sysid.regression import Regression, kept_rows
from ranger_sim.sysid.results import (
    Cause,
    CauseEvidence,
    ChannelMisfit,
    DiagnosisEvidence,
    DiagnosisResult,
    KnownCause,
    KnownValue,
    LearnedTerm,
    RecordingFinding,
    RecordingRepair,
    Value,
    WithoutForm,
)

RIVALS = 6  # that an answer lists
NEXT = {
    frozenset(
        {"sensor_offset", "direction_friction"}
    ): "a recording at standstill, which shows an offset without friction",
    frozenset({"sensor_scale", "load_friction"}): "a load cell's calibration, or stalls at several currents",
    frozenset({"stribeck", "presliding"}): "slow reversals, far below the speed at which friction has settled",
    frozenset({"resistance_temperature", "contact_drop_change"}): "the temperature of the winding, and the current",
}


def of(
    found: Diagnosis, final: Diagnosis, held: Held | None, term: LearnedTerm | None, prepared: Sequence[Prepared]
) -> DiagnosisResult:
    """The result. final: `found` without the effects that held-out data refuse; prepared: every recording."""
    doubtful, refused = found.doubtful, len(final.named) < len(found.named)
    abstained = not final.named if refused else doubtful
    evidence = _evidence(found, held, term)
    if found.by_candidates:
        evidence = by_candidates.evidence(found, evidence)
    return DiagnosisResult(
        detected=bool(found.detected),
        misfit=tuple(_channels(found)),
        subsystem=_subsystem(found) if found.detected else None,
        causes=tuple(_cause(final, each) for each in final.named) if found.detected and not doubtful else (),
        abstained=bool(abstained),
        gain=held.result if held is not None else None,
        next_experiment=tuple(_next(found.named)),
        model_file=None,
        data_findings=tuple(_findings(found, prepared)),
        evidence=evidence,
        data_repairs=_repairs(prepared),
        data_ledger={each.table.name: each.ledger for each in prepared if each.ledger},
        extended_model=model_file.model_text(final, evidence)
        if (final.named or evidence.known) and not abstained
        else "",
    )


def without_equations(found: Diagnosis, prepared: Sequence[Prepared]) -> DiagnosisResult:
    """The result about recordings of which no equation can be made, before another judgement is added."""
    return DiagnosisResult(
        detected=False,
        misfit=(),
        subsystem=None,
        causes=(),
        abstained=False,
        gain=None,
        next_experiment=(),
        model_file=None,
        data_findings=tuple(_findings(found, prepared)),
        evidence=DiagnosisEvidence(1.0, 1.0, 0.0, (), {}, True, (), {}, (), None),
        data_repairs=_repairs(prepared),
        data_ledger={each.table.name: each.ledger for each in prepared if each.ledger},
    )


def _repairs(prepared: Sequence[Prepared]) -> tuple[RecordingRepair, ...]:
    return tuple(
        RecordingRepair(**dataclasses.asdict(repair), recording=each.table.name)
        for each in prepared
        for repair in each.repairs
        if repair.kind in repairs.KINDS
    )


def written(found: Diagnosis, path: str) -> DiagnosisResult:
    """The result with the path of its model file, and with the causes for which that file has no term."""
    without = tuple(
        WithoutForm(each.known.cause, each.known.at, each.no_form)
        for each in model_file.effects_found(found, found.result.evidence.known)
        if each.term is None and found.machine.name in ROBOT  # other machines have their own simulators
    )
    evidence = dataclasses.replace(found.result.evidence, without_form=without or None)
    return dataclasses.replace(found.result, model_file=path, evidence=evidence)


def _evidence(found: Diagnosis, held: Held | None, term: LearnedTerm | None) -> DiagnosisEvidence:
    extended, impossible = found.extended, _impossible(found)
    step_s = found.recordings[0].table.step_s
    return DiagnosisEvidence(
        p_general=found.before.p,
        p_general_after=found.after.p,
        explained=found.explained,
        suspects=tuple(each.effect.name for each in found.named) if found.doubtful else (),
        parameters={name: _value(extended, name) for name in extended.values if "@" not in name},
        parameters_are_physical=not found.doubtful and not impossible,
        impossible=tuple(impossible),
        skew_samples={
            each.effect.at: extended.values[each.coefficients[0]] / step_s
            for each in found.skews
            if all(each is not other for other in found.had)
        },
        known=tuple(_known(each, was, extended) for each, was in zip(found.had, found.known, strict=True)),
        residual_term=term,
        refused_by_holdout=tuple(each.effect.name for each in held.refused) if held is not None else None,
        holdout_excites_it=held.tells if held is not None else None,
        noise_floor=found.floors or None,
        between_rows={each.table.name: each.between_rows for each in found.recordings if each.between_rows} or None,
        above_noise_floor=tuple(name for name, each in found.floors.items() if noise_floor.far(each)),
    )


def _findings(found: Diagnosis, prepared: Sequence[Prepared]) -> list[RecordingFinding]:
    """Findings about the data, about all recordings together, and of the machine about each of them."""
    together = ", ".join(each.table.name for each in found.recordings)
    pairs = [
        *((each.table.name, finding) for each in prepared for finding in each.findings),
        *((together, finding) for finding in found.doubts.findings),
        *((each.table.name, finding) for each in found.recordings for finding in each.findings),
    ]
    return [RecordingFinding(**dataclasses.asdict(finding), recording=name) for name, finding in pairs]


def _cause(found: Diagnosis, each: Named) -> Cause:
    """A named effect with its parameters, their intervals, and the evidence for it and against it."""
    extended = found.extended
    values = {
        name: extended.values[full] for name, full in zip(each.effect.coefficients, each.coefficients, strict=True)
    }
    known_to = intervals.whole(each, extended, found.intervals[each.effect.name])
    parameters = {name: Value(value, known_to[name]) for name, value in (values | dict(each.shape)).items()}
    return Cause(
        name=each.effect.cause,
        at=each.effect.at,
        form=each.effect.form or None,
        balance=_letters(each, extended.recordings),
        parameters=parameters,
        tied_with=tuple(dict.fromkeys(tie.cause for tie in each.tied if tie.cause != each.effect.cause)),
        waves=waves(extended, each) or None,
        evidence=CauseEvidence(
            chi2=each.chi2,
            p=each.p,
            bic=each.bic,
            ties=tuple(tie.name for tie in each.tied),
            behind={effect.name: behind for effect, behind in each.rivals[:RIVALS]},
            predicted=predicted_ties.of(found.machine, extended.recordings, each),
            moved_by_numerics=dict(zip(each.effect.coefficients, moved, strict=True))
            if (moved := found.numerics.get(each.effect.name)) is not None
            else None,
        ),
    )


def waves(extended: Regression, each: Named) -> dict[str, Value]:
    """Amplitude and phase of each pair of cosine and sine among an effect's coefficients, with their intervals."""
    out: dict[str, Value] = {}
    full = dict(zip(each.effect.coefficients, each.coefficients, strict=True))
    for cosine, rest in ((name, name.removeprefix("cosine")) for name in full if name.startswith("cosine")):
        if f"sine{rest}" not in full:
            continue
        pair = [full[cosine], full[f"sine{rest}"]]
        values = np.array([extended.values[name] for name in pair])
        places = [extended.names.index(name) for name in pair]
        spread = extended.covariance[np.ix_(places, places)]
        size = float(np.hypot(*values))
        if size == 0.0:
            continue
        along, across = values / size, np.array([-values[1], values[0]]) / size
        reach = intervals.Z95 * math.sqrt(max(0.0, float(along @ spread @ along)))
        turn = min(math.pi, intervals.Z95 * math.sqrt(max(0.0, float(across @ spread @ across))) / size)
        phase = math.atan2(values[1], values[0])  # size cos(x - phase)
        out[f"amplitude{rest}"] = Value(size, (max(0.0, size - reach), size + reach))
        out["phase_twice_rad" if rest.startswith("_twice") else "phase_rad"] = Value(
            phase, (phase - turn, phase + turn)
        )
    return out


def _channels(found: Diagnosis) -> list[ChannelMisfit]:
    """Misfit of each equation, in total and in each regime: rms of the residual over its noise, both in deviations.

    The noise is what the named causes leave; without any, by candidates, what a flexible predictor cannot predict.
    """
    plain, extended, recordings = found.plain, found.extended, found.recordings
    unnamed = found.by_candidates and not found.named
    tests = [each for each in found.before.tests if unnamed and each.p < found.level and "a line" not in each.features]
    out = []
    for equation in plain.equations:
        rows, good = plain.rows_of(equation), plain.good[equation]
        residual = plain.residual[rows]
        if not len(residual):
            continue
        scale = plain.whitening[equation].deviation
        better = extended.residual[extended.rows_of(equation)] * (extended.whitening[equation].deviation / scale)
        predicted = max((each.share for each in tests if each.equation == equation), default=0.0)
        better *= math.sqrt(max(0.0, 1.0 - predicted))
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
            out.append(ChannelMisfit(equation, name, rms * scale, noise * scale, repeatable))
    return out


def _subsystem(found: Diagnosis) -> str | None:
    if found.named and not found.doubtful:
        return found.named[0].effect.subsystem
    simulated = [each for each in found.plain.recordings if isinstance(each, LinearisedRecording)]
    if simulated:
        return entrance.subsystem(simulated)
    telling = found.before.telling.equation
    parts: dict[str, str] = {}
    for recording in found.plain.recordings:
        parts |= {name: each.subsystem for name, each in recording.equations.items()}
        parts |= {name: each.subsystem for name, each in recording.entries.items()}
    return parts[telling]


def _impossible(found: Diagnosis) -> list[str]:
    """Parameters whose whole interval is outside their limits, with and without what the named causes add to them: no
    machine has such values."""
    regression, out = found.extended, []
    shared = plausibility.with_causes(regression, found.machine.parameters, found.named)
    for known in found.machine.parameters:
        if known.name in regression.values:
            value, reach = regression.values[known.name], intervals.Z95 * _error(regression, known.name)
            both = (value, value + shared.get(known.name, 0.0))
            reach += plausibility.LITTLE * abs(known.value)
            if all(plausibility.outside(known, each, reach) for each in both):
                out.append(known.name)
    return out


def _known(had: Named, was: KnownEffect, extended: Regression) -> KnownCause:
    """The model's known effects, and their values by these data."""
    parameters = {}
    for name, full in zip(had.effect.coefficients, had.coefficients, strict=True):
        found = _value(extended, full)
        parameters[name] = KnownValue(was.coefficients[name], found.value, found.ci95)
    return KnownCause(was.cause, was.at, parameters, dict(was.shape))


def _value(regression: Regression, name: str) -> Value:
    value, reach = regression.values[name], intervals.Z95 * _error(regression, name)
    return Value(value, (value - reach, value + reach))


def _error(regression: Regression, name: str) -> float:
    number = regression.names.index(name)
    return math.sqrt(max(0.0, float(regression.covariance[number, number])))


def _letters(each: Named, recordings: Sequence[Recording]) -> str:
    made = each.effect.columns(recordings[0], each.shape, {name: 1.0 for name in _parameter_names(recordings)})
    letters = (recordings[0].equations[name].letter for name in made if name in recordings[0].equations)
    return "".join(dict.fromkeys(letters))


def _parameter_names(recordings: Sequence[Recording]) -> list[str]:
    return [name for e in recordings[0].equations.values() for name in e.columns]


def _next(named: Sequence[Named]) -> list[str]:
    out = []
    for each in named:
        for tie in each.tied:
            pair = frozenset({each.effect.cause, tie.cause})
            if len(pair) == 2:
                out.append(NEXT.get(pair, f"an experiment in which {each.effect.name} and {tie.name} differ"))
    return list(dict.fromkeys(out))
