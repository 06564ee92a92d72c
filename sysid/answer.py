"""The findings of a diagnosis as the dictionary that `ranger-sim diagnose --json` writes."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ranger_sim.sysid import predicted_ties
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.machine import Recording
from ranger_sim.sysid.naming import Named
from ranger_sim.sysid.regression import Regression, kept_rows

RIVALS = 6  # that an answer lists
NEXT = {
    frozenset(
        {"sensor_offset", "direction_friction"}
    ): "a recording at standstill, which shows an offset without friction",
    frozenset({"sensor_scale", "load_friction"}): "a load cell's calibration, or stalls at several currents",
    frozenset({"stribeck", "presliding"}): "slow reversals, far below the speed at which friction has settled",
    frozenset({"resistance_temperature", "contact_drop_change"}): "the temperature of the winding, and the current",
}


def of(found: Diagnosis, findings: Sequence[dict]) -> dict[str, Any]:
    """Everything except the result of held-out data. findings: additional ones about the data."""
    extended, doubtful, impossible = found.extended, found.doubtful, _impossible(found)
    step_s = found.recordings[0].table.step_s
    together = ", ".join(each.table.name for each in found.recordings)
    return {
        "detected": bool(found.detected),
        "misfit": _channels(found),
        "subsystem": _subsystem(found) if found.detected else None,
        "causes": [cause(found, each) for each in found.named] if found.detected and not doubtful else [],
        "abstained": bool(doubtful),
        "gain": None,
        "next_experiment": _next(found.named),
        "model_file": None,
        "data_findings": [
            *findings,
            *({**dataclasses.asdict(each), "recording": together} for each in found.doubts.findings),
            *({**dataclasses.asdict(each), "recording": r.table.name} for r in found.recordings for each in r.findings),
        ],
        "evidence": {
            "p_general": found.before.p,
            "p_general_after": found.after.p,
            "explained": found.explained,
            "suspects": [each.effect.name for each in found.named] if doubtful else [],
            "parameters": {name: _value(extended, name) for name in extended.values if "@" not in name},
            "parameters_are_physical": not doubtful and not impossible,
            "impossible": impossible,
            "skew_samples": {
                each.effect.at: extended.values[each.coefficients[0]] / step_s
                for each in found.skews
                if all(each is not other for other in found.had)
            },
            "known": [_known(each, was, extended) for each, was in zip(found.had, found.known, strict=True)],
        },
    }


def cause(found: Diagnosis, each: Named) -> dict[str, Any]:
    """A named effect with its parameters, their intervals, and the evidence for it and against it."""
    machine, extended = found.machine, found.extended
    parameters = {
        name: _value(extended, full) for name, full in zip(each.effect.coefficients, each.coefficients, strict=True)
    }
    parameters |= {name: {"value": value, "ci95": [value, value]} for name, value in each.shape.items()}
    for name, (low, high) in found.intervals[each.effect.name].items():
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


def _channels(found: Diagnosis) -> list[dict[str, Any]]:
    """Misfit of each equation, in total and in each regime: rms of the residual over its noise, both in deviations."""
    plain, extended, recordings = found.plain, found.extended, found.recordings
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


def _subsystem(found: Diagnosis) -> str | None:
    if found.named:
        return found.named[0].effect.subsystem
    telling = found.before.telling.equation
    parts: dict[str, str] = {}
    for recording in found.plain.recordings:
        parts |= {name: each.subsystem for name, each in recording.equations.items()}
        parts |= {name: each.subsystem for name, each in recording.entries.items()}
    return parts[telling]


def _impossible(found: Diagnosis) -> list[str]:
    """Parameters whose whole interval is outside their limits: no machine has such values."""
    regression, out = found.extended, []
    for known in found.machine.parameters:
        if known.name in regression.values:
            value, reach = regression.values[known.name], 1.96 * _error(regression, known.name)
            if value + reach < known.low or value - reach > known.high:
                out.append(known.name)
    return out


def _known(had: Named, was: KnownEffect, extended: Regression) -> dict[str, Any]:
    """The model's known effects, and their values by these data."""
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


def _error(regression: Regression, name: str) -> float:
    number = regression.names.index(name)
    return math.sqrt(max(0.0, float(regression.covariance[number, number])))


def _letters(each: Named, recordings: Sequence[Recording]) -> str:
    made = each.effect.columns(recordings[0], each.shape, {name: 1.0 for name in _parameter_names(recordings)})
    return "".join(recordings[0].equations[name].letter for name in made if name in recordings[0].equations)


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
