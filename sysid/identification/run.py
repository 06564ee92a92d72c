"""Benches by name, from a recording or the virtual bench to the fits and their result."""

import dataclasses
import math
import pathlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.plant import terms
from ranger_sim.sysid import losses, repairs, sanity
from ranger_sim.sysid.benches.bench_terms import BenchTerms
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification import coverage, legs, motor
from ranger_sim.sysid.identification.registry import BENCHES, OF_TABLES, alone, bench_of, by_virtual_benches
from ranger_sim.sysid.reading import open_recording
from ranger_sim.sysid.results import FitResult, FittedParameter, IdentificationResult, LegBalance, Separability

ALL = "all"
# Residual in standard deviations of the stated instruments, above which noise is no explanation. Chosen by us: double
# noise may be another instrument's.
UNEXPLAINED = 2.0
Report = Callable[[str], None]


@dataclasses.dataclass(frozen=True)
class Identification:
    """The workings: recordings by bench and fits by title, of which the page is drawn; and the result."""

    recordings: dict[str, Dataset]
    fits: dict[str, Fit]
    result: IdentificationResult


def identification(
    bench: str,
    data: str | pathlib.Path | Dataset | None,
    known: Sequence[Parameter],
    gear: float,
    model: str | pathlib.Path | None,
    accepted: float,
    how: Mapping[str, Any],
    seed: int,
    report: Report,
    before: Report | None = None,
) -> Identification:
    """What `api.identify` returns, with its workings.

    how: of `reading.open_recording`. before: is called with the identifiability before each fit.
    """
    if gear <= 0.0 or not math.isfinite(gear):
        raise UserError(f"--gear {gear!r}: it must be above 0")
    machine = machine_with(model, bench, data is not None, gear, report)
    if data is None and how.get("mapping"):
        raise UserError("--map names columns of a file: --data is needed")
    if bench == ALL:
        if known:
            raise UserError("--known belongs to a single bench")
        recordings = _of_all(data, how, accepted, machine, seed, report)
        fits = _tables(recordings, gear, before or report)
    else:
        one = bench_of(bench)
        recordings, by_bench = {}, {}
        if data is not None:
            recordings[one.name] = recorded(one.name, data, how, report, accepted)
        elif known:
            recordings[one.name] = one.record(machine, seed)
        if recordings:
            by_bench[one.name] = alone(one, recordings[one.name], known, gear=gear, tell=before or report)
        else:
            recordings, by_bench = by_virtual_benches(one, machine, seed, gear, before or report)
        fits = {_title(name): found for name, found in by_bench.items()}
    source = data.name if isinstance(data, Dataset) else None if data is None else printable(str(data))
    result = IdentificationResult(
        bench=bench,
        data=source,
        seed=seed if data is None else None,
        gear=gear,
        fits=tuple(_fit_result(title, found) for title, found in fits.items()),
        balance=tuple(
            LegBalance(**dataclasses.asdict(row), balanced=row.balanced)
            for found in fits.values()
            if not found.refused and set(legs.TABLE_2_LEGS) <= set(found.names) and "level.arm_m" in found.names
            for row in legs.balance(found)
        ),
        truth=machine.truth() if data is None else {},
    )
    return Identification(recordings, fits, result)


def machine_with(
    path: str | pathlib.Path | None, bench: str, measured: bool, gear: float, report: Report
) -> coverage.Machine:
    """The robot that the virtual benches measure, with the terms of a model file; reports terms that a bench lacks."""
    if path is None:
        return coverage.ROBOT
    if measured:
        raise UserError("--model is what a virtual bench has; with --data use `ranger-sim diagnose --model`")
    model, told = terms.load(path), terms.content_of(path).get("diagnosis", {})
    fitted = told.get("parameters", {}) if told.get("experiment") == "motor-bench" else {}
    made = BenchTerms(model.terms, fitted, float(told.get("gear", gear)))
    for name in model.left_out:
        report(f"{path}: {name} is left out")
    benches = OF_TABLES if bench == ALL else (bench_of(bench).name,)
    for each in dict.fromkeys(each for name in benches for each in made.not_of_bench(name)):
        missing = [name for name in benches if each in made.not_of_bench(name)]
        report(f"{path}: {each} has no part in {', '.join(missing)}")
    return dataclasses.replace(coverage.ROBOT, terms=made)


def recorded(
    bench: str,
    source: str | pathlib.Path | Dataset,
    how: Mapping[str, Any],
    report: Report,
    accepted: float = losses.ACCEPTED,
) -> Dataset:
    """A user's recording of a bench; anomalies in a series of samples are reported.

    how: of `reading.open_recording`. accepted: share of a channel's samples that may be lost. UserError if more are.
    """
    data = source if isinstance(source, Dataset) else open_recording(source, **how)
    if bench in ("pendulum", "ankle-sine"):  # the others are single readings
        findings = sanity.inspect(data)
        sanity.stop_if_fatal(data.name if isinstance(source, Dataset) else str(source), findings)
        if bench == "ankle-sine":  # the legs of a pendulum may have separate stamps
            inputs = [each for each in data.channels if each.startswith(("target", "cmd"))]
            sanity.stop_if_input_is_clipped(data.name, findings, inputs)
            data = repairs.mend(data, findings, inputs)
        else:
            data = repairs.without_clipped_rows(data, findings)
        for finding in data.findings if bench == "ankle-sine" else findings:
            if finding.severity != "note":
                report(f"{data.name}: {finding.channel}: {finding.text}")
    losses.stop_if_too_many(data, data.channels, accepted)
    return data


def _of_all(
    data: str | pathlib.Path | Dataset | None,
    how: Mapping[str, Any],
    accepted: float,
    machine: coverage.Machine,
    seed: int,
    report: Report,
) -> dict[str, Dataset]:
    """Recordings of every bench of tables 2 and 3."""
    if data is None:
        return {name: BENCHES[name].record(machine, seed) for name in OF_TABLES}
    if isinstance(data, Dataset):
        raise UserError(f"--data {data.name}: for all a folder is needed, not a recording")
    folder = pathlib.Path(data)
    lacking = [name for name in OF_TABLES if not (folder / f"{name}.csv").is_file()]
    if lacking:
        raise UserError(f"--data {data}: for all a folder is needed; {lacking[0]}.csv is not in it")
    return {name: recorded(name, folder / f"{name}.csv", how, report, accepted) for name in OF_TABLES}


def _tables(recordings: Mapping[str, Dataset], gear: float, tell: Report) -> dict[str, Fit]:
    """Tables 2 and 3 in steps and jointly, by title."""
    of_motor = (recordings["stall"], recordings["cantilever"], recordings["pulley"])
    of_legs = (recordings["level"], recordings["hang"], recordings["pendulum"])
    motor_path = motor.steps(*of_motor, gear=gear, tell=tell)
    leg_path = legs.steps(*of_legs, tell=tell)
    return {
        "Step 8.3.1: stall": motor_path.stall,
        "Step 8.3.2: torque constant, with R and V_c of the stall": motor_path.power,
        "Step 8.4: friction at the pulley, with that K": motor_path.friction,
        "Step 7.2, 2-3: moment of mass": leg_path.level,
        "Step 7.2, 4-5: hanging angle": leg_path.hang,
        **{f"Step 7.2, 6-7: period of the {name} leg": found for name, found in leg_path.periods.items()},
        "Table 3, one joint fit": motor.joint(*of_motor, gear=gear, tell=tell),
        "Table 2, inertia, one joint fit": legs.joint(*of_legs, tell=tell),
        **{
            f"Table 2, {name}": alone(BENCHES[name], recordings[name], tell=tell)
            for name in ("hip-spring", "ankle-spring")
        },
    }


def _title(bench: str) -> str:
    source = BENCHES[bench].appendix
    return f"{BENCHES[bench].title} ({'appendix ' if source[0].isdigit() else ''}{source})"


def _fit_result(title: str, found: Fit) -> FitResult:
    separable = found.identifiability
    return FitResult(
        title=title,
        refused=found.refused or None,
        parameters={
            name: FittedParameter(
                found.values[name], found.standard_errors[name], found.ci95[name], found.units[name], "." in name
            )
            for name in found.values
        },
        residual_rms=found.residual_rms,
        unexplained=found.residual_rms > UNEXPLAINED,
        samples=len(found.residual),
        effective_samples=found.effective_samples,
        rho=found.rho,
        identifiability=Separability(
            singular_values=tuple(float(value) for value in separable.singular_values),
            not_separable=tuple(separable.ties),
            sensitivity=found.sensitivity,
        ),
    )
