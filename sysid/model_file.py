"""The extended model as a TOML file, written by a diagnosis and read by everything that simulates or diagnoses.

    [[term]]              what the simulator adds (plant/terms.py): of `walk --model` and of the virtual benches
    [diagnosis]           experiment, gear, recordings
    [diagnosis.parameters]   of the machine's equations, as fitted
    [[diagnosis.effect]]  cause and place with coefficients and shape as measured: of `diagnose --model`; `no_form`
                          says why the simulator has no term for it, `left_out = true` lets it run without

A file by hand may have terms only.
"""

import dataclasses
import json
import pathlib
from collections.abc import Sequence
from typing import Any

from ranger_sim.foundation.user_error import ModelError
from ranger_sim.plant import terms
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.machine import Machine
from ranger_sim.sysid.machines import ROBOT
from ranger_sim.sysid.model_terms import NoFormError, effects_of, parameter_terms, term_of
from ranger_sim.sysid.results import DiagnosisEvidence, KnownCause


@dataclasses.dataclass(frozen=True)
class FoundEffect:
    """A known effect, and its term in the simulator or why there is none."""

    known: KnownEffect
    term: dict[str, Any] | None
    no_form: str = ""


@dataclasses.dataclass(frozen=True)
class ModelFile:
    """A model file, read: effects as a machine's equations have them; parameters by name; terms of the simulator."""

    path: str
    experiment: str
    gear: float | None
    effects: list[KnownEffect]
    parameters: dict[str, float]
    model: terms.Model


def effects_found(found: Diagnosis, had: Sequence[KnownCause]) -> list[FoundEffect]:
    """What the model had, by these data, and what was named, each with its term."""
    values = {name: value for name, value in found.extended.values.items() if "@" not in name}
    known = [
        KnownEffect(each.name, each.at, {name: value.value for name, value in each.parameters.items()}, each.shape)
        for each in had
    ]
    for each in found.named:
        numbers = zip(each.effect.coefficients, each.coefficients, strict=True)
        coefficients = {name: float(found.extended.values[full]) for name, full in numbers}
        shape = {name: float(value) for name, value in each.shape.items()}
        known.append(KnownEffect(each.effect.cause, each.effect.at, coefficients, shape))
    made = []
    for one in known:
        try:
            term = term_of(found.machine, one.cause, one.at, {**one.coefficients, **one.shape}, values)
            made.append(FoundEffect(one, term))
        except NoFormError as reason:
            made.append(FoundEffect(one, None, str(reason)))
    return made


def model_text(found: Diagnosis, evidence: DiagnosisEvidence) -> str:
    """The file's text."""
    values = {name: each.value for name, each in evidence.parameters.items()}
    intervals = {name: each.ci95 for name, each in evidence.parameters.items()}
    effects = effects_found(found, evidence.known)
    names = [recording.table.name for recording in found.recordings]
    tables = [each.term for each in effects if each.term is not None]
    if evidence.parameters_are_physical:
        tables += parameter_terms(found.machine, values, intervals)
    lines = [f"title = {_quoted('found in ' + ', '.join(names))}"]
    for table in tables:
        lines += ["", "[[term]]", *_numbers(table)]
    lines += ["", "[diagnosis]", f"experiment = {_quoted(found.machine.name)}"]
    gear = getattr(found.machine, "gear", None)
    if gear is not None:
        lines.append(f"gear = {float(gear)!r}")
    lines += [f"recordings = [{', '.join(map(_quoted, names))}]", "", "[diagnosis.parameters]", *_numbers(values)]
    meanings = {(each.effect.cause, each.effect.at): each.effect.meaning for each in (*found.had, *found.named)}
    for each in effects:
        lines += ["", "[[diagnosis.effect]]"]
        if meaning := meanings.get((each.known.cause, each.known.at)):
            lines.append(f"# {meaning}")
        lines += [f"cause = {_quoted(each.known.cause)}", f"at = {_quoted(each.known.at)}"]
        if each.term is None and found.machine.name in ROBOT:  # other machines have their own simulators
            lines += [f"no_form = {_quoted(each.no_form)}", "left_out = false  # true: simulate without it"]
        for name, numbers in (("coefficients", each.known.coefficients), ("shape", each.known.shape)):
            lines.append(f"{name} = {{ {', '.join(_numbers(dict(numbers)))} }}" if numbers else f"{name} = {{}}")
    return "\n".join(lines) + "\n"


def _numbers(table: dict[str, Any]) -> list[str]:
    return [
        f"{name} = {_quoted(value) if isinstance(value, str) else repr(float(value))}" for name, value in table.items()
    ]


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def read(path: str | pathlib.Path, machine: Machine) -> ModelFile:
    """The model file at `path` for a machine. UserError for everything wrong in it.

    A file of another experiment gives what its terms are to this machine.
    """
    content = terms.content_of(path)
    told = content.get("diagnosis", {})
    model = terms.Model(content.get("term", []), str(path))
    if told and told.get("experiment") == machine.name:
        gear = told.get("gear")
        own = getattr(machine, "gear", None)
        if gear is not None and own is not None and abs(gear / own - 1.0) > 1e-9:
            raise ModelError(f"{path}: it was found at a gear of {gear:g}, not {own:g} (--gear)")
        effects = [_effect(str(path), number, each) for number, each in enumerate(told.get("effect", []), 1)]
        parameters = {name: float(value) for name, value in told.get("parameters", {}).items()}
        return ModelFile(str(path), machine.name, gear, effects, parameters, model)
    effects = []
    for term in model.terms:
        try:
            effects += [KnownEffect(*each) for each in effects_of(machine, term)]
        except NoFormError as reason:
            raise ModelError(f"{path}: {term.form.name} at {term.at}: {reason}") from None
    return ModelFile(str(path), str(told.get("experiment", "")), None, effects, {}, model)


def _effect(path: str, number: int, table: Any) -> KnownEffect:
    """One [[diagnosis.effect]]."""
    place = f"{path}: diagnosis.effect {number}"
    if not isinstance(table, dict):
        raise ModelError(f"{place}: an effect is a table, not {table!r}")
    texts = [table.get(name) for name in ("cause", "at")]
    numbers = [table.get(name, {}) for name in ("coefficients", "shape")]
    if not all(isinstance(text, str) for text in texts):
        raise ModelError(f"{place}: cause and at are texts")
    for each in numbers:
        if not isinstance(each, dict) or not all(map(terms.is_number, each.values())):
            raise ModelError(f"{place}: coefficients and shape are tables of numbers")
    made = [{name: float(value) for name, value in each.items()} for each in numbers]
    return KnownEffect(str(texts[0]), str(texts[1]), made[0], made[1])
