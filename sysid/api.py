"""Diagnosis and identification as functions: what `ranger-sim diagnose` and `ranger-sim identify` do, for programs."""

import pathlib
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import losses, model_file, pipeline
from ranger_sim.sysid.dataset import Dataset, Table
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.fit import Parameter
from ranger_sim.sysid.identification import run
from ranger_sim.sysid.identification.motor import GEAR
from ranger_sim.sysid.machine import Machine, NoEquationError
from ranger_sim.sysid.machines import is_ours, machine_of
from ranger_sim.sysid.preparation import Prepared, parted, prepared
from ranger_sim.sysid.reading import open_recording
from ranger_sim.sysid.regression import Regression
from ranger_sim.sysid.results import DiagnosisResult, IdentificationResult
from ranger_sim.sysid.twins import evidence, judgement

File = str | pathlib.Path | Dataset


def diagnose(
    files: File | Sequence[File],
    machine: str | Machine,
    *,
    holdout: Sequence[File] = (),
    holdout_part: float | None = None,
    model: str | pathlib.Path | None = None,
    gear: float | None = None,
    repair: Collection[str] = (),
    accept_loss: float = losses.ACCEPTED,
    mapping: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    progress: pipeline.Progress = lambda what, share: None,
    emulator: evidence.Emulator | None = None,
) -> DiagnosisResult:
    """The errors of a machine's equations by measured data: whether there are any, their causes, and the gain.

    files: recordings of one experiment: text tables, logs of the robot, MDF files, folders of walks, or datasets.
    machine: an experiment's name ("motor-bench", "leg-swing", "positioning", "ankle", "walk"), or an object with the
    members of `sysid.machine.Machine`. holdout: recordings that only measure the gain; instead, holdout_part: the last
    part of each file by time, above 0 and below 1. model: a model file to start from; its effects are not findings.
    gear: of the motor bench's gearbox (14). repair: channels that drive the machine and are repaired all the same.
    accept_loss: share of a channel's samples that may be lost, 0 to 1. mapping: {column of the files: channel};
    time_unit: of a time column without one; rate_hz: of the samples of a file without a time. seed: of the
    bootstrap. progress: is called with (present step, finished share). emulator: makes walks with the likeliest causes,
    by which the comparison of a walk with its twins is confirmed: `ranger_sim.tools.twins.emulation.emulate`, as the
    command does.

    The same arguments give the same result. UserError for a mistake, and for data from which nothing can be concluded.
    """
    return diagnosis(
        files,
        machine,
        holdout,
        holdout_part,
        model,
        gear,
        repair,
        accept_loss,
        mapping,
        time_unit,
        rate_hz,
        seed,
        progress,
        emulator,
    ).result


def diagnosis(
    files: File | Sequence[File],
    machine: str | Machine,
    holdout: Sequence[File] = (),
    holdout_part: float | None = None,
    model: str | pathlib.Path | None = None,
    gear: float | None = None,
    repair: Collection[str] = (),
    accept_loss: float = losses.ACCEPTED,
    mapping: Mapping[str, str] | None = None,
    time_unit: str | None = None,
    rate_hz: float | None = None,
    seed: int = 0,
    progress: pipeline.Progress = lambda what, share: None,
    emulator: evidence.Emulator | None = None,
) -> Diagnosis:
    """The result of `diagnose` with its workings, of which the report is drawn."""
    if not 0.0 <= accept_loss <= 1.0:
        raise UserError(f"--accept-loss {accept_loss:g}: allowed are 0 to 1")
    if holdout_part is not None and holdout:
        raise UserError(f"--holdout-part {holdout_part:g}: there are files to hold out already (--holdout)")
    if holdout_part is not None and not 0.0 < holdout_part < 1.0:
        raise UserError(f"--holdout-part {holdout_part:g}: allowed is what lies between 0 and 1")
    machine = machine_of(machine, gear)
    known = model_file.read(model, machine).effects if model is not None else []
    read = [[_dataset(each, mapping, time_unit, rate_hz) for each in _several(group)] for group in (files, holdout)]
    data, held = ([prepared(each, machine, accept_loss, repair) for each in group] for group in read)
    if not data:
        raise UserError("files: none is given, a diagnosis needs at least one recording")
    ready = [*data, *held]
    if holdout_part is not None:
        data, held = parted(data, holdout_part)
        ready = data
    tables = [each.table for each in data]
    names = ", ".join(table.name for table in tables)
    without, equations = "", _first_half(progress) if _is_walk(machine) else progress
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # an overflow ends as a value that is not finite, see below
            found = pipeline.diagnose(machine, tables, _judging(machine, held), seed, ready, known, equations)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        text = f"{names}: no machine can be fitted to these numbers ({error}); nothing is concluded from such data"
        raise UserError(text) from None
    except NoEquationError as error:
        if not _is_walk(machine):
            raise
        without, found = str(error), pipeline.without_equations(machine, tables, ready)
    if _is_walk(machine):
        progress("twins", 0.5)
        twins, _ = evidence.of(read[0], read[1], holdout_part, emulator and _counted(emulator, progress))
        if without and twins.note:
            raise NoEquationError(f"{without}; and its twins cannot judge it: {twins.note}")
        found.result = evidence.combined(found.result, twins)
    if wrong := _not_finite(found.answer):
        raise UserError(f"{names}: {wrong} comes out as no number; nothing is concluded from such data")
    return found


def _first_half(progress: pipeline.Progress) -> pipeline.Progress:
    """Progress of the equations of a walk: its twins are the other half of the work."""
    return lambda what, share: progress(what, 0.5 * share)


def _counted(emulator: evidence.Emulator, progress: pipeline.Progress) -> evidence.Emulator:
    """The emulator; each use is reported, of as many as a comparison may have."""
    used = 0

    def counted(asked: evidence.Asked) -> Sequence[evidence.Emulated]:
        nonlocal used
        used += 1
        progress(f"twins with {asked.cause} walk", 0.5 + 0.5 * used / (judgement.EMULATIONS + 1))
        return emulator(asked)

    return counted


def identify(
    bench: str,
    data: File | None = None,
    *,
    known: Mapping[str, tuple[float, float]] | None = None,
    gear: float = GEAR,
    model: str | pathlib.Path | None = None,
    accept_loss: float = losses.ACCEPTED,
    mapping: Mapping[str, str] | None = None,
    seed: int = 1,
    report: Callable[[str], None] = lambda line: None,
) -> IdentificationResult:
    """Parameters of a motor, a leg or a spring from the recording of a bench, with 95 % intervals.

    bench: a name of `sysid.identification.registry.BENCHES`, or "all" for the appendix's tables 2 and 3. data: the
    recording, for "all" a folder with BENCH.csv of each; without it the virtual bench records with this `seed`, with
    the terms of `model`. known: {parameter: (value, standard deviation)} from elsewhere, for a single bench. gear: of
    the bench's gearbox, above 0. accept_loss, mapping: as for `diagnose`. report: is called with remarks about the data
    and the model, a line each.

    A fit that is refused has a reason and no parameters. UserError for a mistake.
    """
    given = [Parameter(name, "", value, uncertainty=sd) for name, (value, sd) in (known or {}).items()]
    return run.identification(bench, data, given, gear, model, accept_loss, {"mapping": mapping}, seed, report).result


def _several(files: File | Sequence[File]) -> Sequence[File]:
    return [files] if isinstance(files, str | pathlib.Path | Dataset) else files


def _dataset(file: File, mapping: Mapping[str, str] | None, time_unit: str | None, rate_hz: float | None) -> Dataset:
    return file if isinstance(file, Dataset) else open_recording(file, mapping, time_unit=time_unit, rate_hz=rate_hz)


def _judging(machine: Machine, held: Sequence[Prepared]) -> list[Table]:
    """The held-out recordings that the equations can judge: of a walk, too few steps are left to its twins."""
    if not _is_walk(machine):
        return [each.table for each in held]
    found = []
    for each in held:
        try:
            Regression([machine.prepare(each.table)])
        except UserError:
            continue
        found.append(each.table)
    return found


def _is_walk(machine: Machine) -> bool:
    return machine.name == "walk" and is_ours(machine)


def _not_finite(value: Any, place: str = "") -> str:
    """The place of the first value in plain data that is not a finite number; empty if there is none."""
    if isinstance(value, float):
        return "" if np.isfinite(value) else place
    inside = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    return next((found for key, each in inside if (found := _not_finite(each, f"{place} {key}".strip()))), "")
