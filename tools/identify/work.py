"""The work of `ranger-sim identify`.

Without --data the virtual bench records, and results are shown next to the true values.
"""

import argparse
import dataclasses
import json
import math
import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.plant import terms
from ranger_sim.sysid import losses, repairs, sanity
from ranger_sim.sysid.benches.bench_terms import BenchTerms
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identify import coverage, legs, motor
from ranger_sim.sysid.identify.registry import BENCHES, OF_TABLES, alone, bench_of, by_virtual_benches
from ranger_sim.sysid.reading import open_recording
from ranger_sim.tools.command_line import files, streams, terminal
from ranger_sim.tools.identify import page
from ranger_sim.tools.recordings import datasets

ALL = "all"
EXIT_DONE, EXIT_REFUSED = 0, 1
# Residual in standard deviations of the stated instruments, above which noise is no explanation. Chosen by us: double
# noise may be another instrument's.
UNEXPLAINED = 2.0
UNEXPLAINED_TEXT = (
    "the residual is {:.0f} times the instruments' noise: something that is not in the model moves it, "
    "and these values may stand in for it (not physical)"
)


def run(options: argparse.Namespace) -> int:
    """Identify and report; 1 when a fit was refused."""
    target = files.json_target(options.json)
    folder = files.writable_folder(options.out) if options.out else None
    # with --json - standard output gets only the JSON
    console = terminal.console(markup=True, highlight=False, stderr=options.json == "-")
    if options.gear <= 0.0 or not math.isfinite(options.gear):
        raise UserError(f"--gear {options.gear!r}: it must be above 0")
    if options.coverage is not None:
        told = run_coverage(options, console)
        write(told, options, target)
        return EXIT_DONE
    known = [known_of(text) for text in options.known]
    machine = machine_with(options, console)
    if options.bench == ALL:
        if known:
            raise UserError("--known belongs to a single bench")
        recordings, told, fits = identify_all(options, machine, console)
    else:
        recordings, told, fits = identify_one(options, machine, known, console)
    truth = told["truth"]
    for title, found in fits.items():
        console.print(f"\n[bold]{escape(title)}[/bold]")
        print_fit(console, found, truth)
    for row in told["balance"]:
        word = "balanced within measurement" if row["balanced"] else "not balanced"
        console.print(
            f"{row['name']}: outer {row['outer']:.4g}, inner {row['inner']:.4g}, "
            f"difference {row['difference']:.3g} +/- {1.96 * row['standard_error']:.2g} {row['unit']}: {word}"
        )
    if folder is not None:
        for name, data in recordings.items():
            files.replace_file(folder / f"{name}.csv", csv_of(data).encode())
        files.replace_file(folder / "identify.json", (json.dumps(told, indent=2, allow_nan=False) + "\n").encode())
        files.replace_file(folder / "identify.html", page.render(told, recordings, fits, options.gear).encode())
        console.print(f"\n{folder / 'identify.html'}")
    write(told, options, target)
    return EXIT_REFUSED if any(found.refused for found in fits.values()) else EXIT_DONE


def write(told: dict, options: argparse.Namespace, target: pathlib.Path | None) -> None:
    """Write the JSON to the target of --json."""
    if options.json is None:
        return
    text = json.dumps(told, indent=2, allow_nan=False)
    if target is None:
        streams.print_result(text)
    else:
        files.replace_file(target, (text + "\n").encode())


def known_of(text: str) -> Parameter:
    """NAME=VALUE+-SD."""
    name, equals, rest = text.partition("=")
    value, plus_minus, spread = rest.partition("+-")
    try:
        number, sd = float(value), float(spread)
    except ValueError:
        number, sd = math.nan, math.nan
    if not equals or not plus_minus or not math.isfinite(number) or not math.isfinite(sd) or sd <= 0.0:
        raise UserError(f"--known {text!r}: NAME=VALUE+-SD is needed, as outer_cm=0.72+-0.004")
    return Parameter(name.strip(), "", number, uncertainty=sd)


def machine_with(options: argparse.Namespace, console: Console) -> coverage.Machine:
    """The robot that the virtual benches measure, with the terms of --model; reports terms that a bench lacks."""
    if options.model is None:
        return coverage.ROBOT
    if options.data is not None:
        raise UserError("--model is what a virtual bench has; with --data use `ranger-sim diagnose --model`")
    model, told = terms.load(options.model), terms.content_of(options.model).get("diagnosis", {})
    fitted = told.get("parameters", {}) if told.get("experiment") == "motor-bench" else {}
    made = BenchTerms(model.terms, fitted, float(told.get("gear", options.gear)))
    for name in model.left_out:
        console.print(escape(f"{options.model}: {name} is left out"))
    benches = OF_TABLES if options.bench == ALL else (bench_of(options.bench).name,)
    for each in dict.fromkeys(each for bench in benches for each in made.not_of_bench(bench)):
        missing = [bench for bench in benches if each in made.not_of_bench(bench)]
        console.print(escape(f"{options.model}: {each} has no part in {', '.join(missing)}"))
    return dataclasses.replace(coverage.ROBOT, terms=made)


def recorded(
    name: str, path: pathlib.Path, how: dict[str, Any], console: Console, accepted: float = losses.ACCEPTED
) -> Dataset:
    """A user's recording of a bench; anomalies in a series of samples are reported.

    how: as of `reading.open_recording`; accepted: share of a channel's samples that may be lost. UserError if more are.
    """
    data = open_recording(path, **how)
    if name in ("pendulum", "ankle-sine"):  # the others are single readings
        findings = sanity.inspect(data)
        sanity.stop_if_fatal(str(path), findings)
        if name == "ankle-sine":  # the legs of a pendulum may have separate stamps
            data = repairs.mend(data, findings, [each for each in data.channels if each.startswith(("target", "cmd"))])
        for finding in data.findings if name == "ankle-sine" else findings:
            if finding.severity != "note":
                console.print(escape(f"{path.name}: {finding.channel}: {finding.text}"))
    losses.stop_if_too_many(data, data.channels, accepted)
    return data


def identify_one(
    options: argparse.Namespace, machine: coverage.Machine, known: list[Parameter], console: Console
) -> tuple[dict[str, Dataset], dict, dict[str, Fit]]:
    """One bench: recordings, report, fits by title."""
    bench = bench_of(options.bench)
    tell = before(console)
    if options.data is not None:
        path = pathlib.Path(options.data)
        recordings = {bench.name: recorded(bench.name, path, datasets.how_of(options), console, options.accept_loss)}
        fits = {bench.name: alone(bench, recordings[bench.name], known, gear=options.gear, tell=tell)}
        truth: dict[str, float] = {}
    else:
        if options.map:
            raise UserError("--map names columns of a file: --data is needed")
        if known:
            recordings = {bench.name: bench.record(machine, options.seed)}
            fits = {bench.name: alone(bench, recordings[bench.name], known, gear=options.gear, tell=tell)}
        else:
            recordings, fits = by_virtual_benches(bench, machine, options.seed, options.gear, tell)
        truth = machine.truth()
    titled = {}
    for name, found in fits.items():
        source = BENCHES[name].appendix
        titled[f"{BENCHES[name].title} ({'appendix ' if source[0].isdigit() else ''}{source})"] = found
    return recordings, told_of(options, titled, truth), titled


def identify_all(
    options: argparse.Namespace, machine: coverage.Machine, console: Console
) -> tuple[dict[str, Dataset], dict, dict[str, Fit]]:
    """Tables 2 and 3 in steps and jointly."""
    if options.data is None:
        recordings = {name: BENCHES[name].record(machine, options.seed) for name in OF_TABLES}
        truth = machine.truth()
    else:
        folder, truth = pathlib.Path(options.data), {}
        lacking = [name for name in OF_TABLES if not (folder / f"{name}.csv").is_file()]
        if lacking:
            raise UserError(f"--data {options.data}: for all a folder is needed; {lacking[0]}.csv is not in it")
        how = datasets.how_of(options)
        recordings = {
            name: recorded(name, folder / f"{name}.csv", how, console, options.accept_loss) for name in OF_TABLES
        }
    tell = before(console)
    of_motor = (recordings["stall"], recordings["cantilever"], recordings["pulley"])
    of_legs = (recordings["level"], recordings["hang"], recordings["pendulum"])
    motor_path = motor.steps(*of_motor, gear=options.gear, tell=tell)
    leg_path = legs.steps(*of_legs, tell=tell)
    fits = {
        "Step 8.3.1: stall": motor_path.stall,
        "Step 8.3.2: torque constant, with R and V_c of the stall": motor_path.power,
        "Step 8.4: friction at the pulley, with that K": motor_path.friction,
        "Step 7.2, 2-3: moment of mass": leg_path.level,
        "Step 7.2, 4-5: hanging angle": leg_path.hang,
        **{f"Step 7.2, 6-7: period of the {name} leg": found for name, found in leg_path.periods.items()},
        "Table 3, one joint fit": motor.joint(*of_motor, gear=options.gear, tell=tell),
        "Table 2, inertia, one joint fit": legs.joint(*of_legs, tell=tell),
        **{
            f"Table 2, {name}": alone(BENCHES[name], recordings[name], tell=tell)
            for name in ("hip-spring", "ankle-spring")
        },
    }
    return recordings, told_of(options, fits, truth), fits


def before(console: Console) -> Any:
    """Printed before each fit: identifiability."""
    return lambda line: console.print(f"[dim]{escape(line)}[/dim]")


def asked(names: Iterable[str]) -> list[str]:
    """The machine's own parameters: an instrument's are named BENCH.WHAT."""
    return [name for name in names if "." not in name]


def print_fit(console: Console, found: Fit, truth: dict[str, float]) -> None:
    """A table of the machine's parameters, or the reason for its absence."""
    if found.refused:
        console.print(f"[red]refused[/red]: {escape(found.refused)}")
        for name in asked(found.names):
            if any(name in tie[:2] for tie in found.identifiability.ties):
                console.print("what is known of one of them from elsewhere separates them: --known NAME=VALUE+-SD")
                break
        return
    table = Table(box=None, pad_edge=False)
    for title in ("", "value", "95 % interval", "unit", *(("truth",) if truth else ())):
        table.add_column(title, justify="left" if title in ("", "unit") else "right")
    for name in asked(found.names):
        low, high = found.ci95[name]
        row = [name, f"{found[name]:.5g}", f"{low:.5g} ... {high:.5g}", found.units[name]]
        if truth:
            true = truth.get(name)
            row.append("" if true is None else f"{true:.5g}{'' if low <= true <= high else ' (outside)'}")
        table.add_row(*row)
    console.print(table)
    console.print(f"[dim]{escape(found.lines()[-1])}; in standard deviations of the instruments[/dim]")
    if found.residual_rms > UNEXPLAINED:
        console.print(
            f"[yellow]{UNEXPLAINED_TEXT.format(found.residual_rms)}[/yellow]",
        )


def told_of(options: argparse.Namespace, fits: dict[str, Fit], truth: dict[str, float]) -> dict:
    """Everything as plain data."""
    balance = [
        {**{key: getattr(row, key) for key in row.__dataclass_fields__}, "balanced": row.balanced}
        for found in fits.values()
        if not found.refused and set(legs.TABLE_2_LEGS) <= set(found.names) and "level.arm_m" in found.names
        for row in legs.balance(found)
    ]
    return {
        "bench": options.bench,
        "data": None if options.data is None else printable(options.data),
        "seed": options.seed if options.data is None else None,
        "gear": options.gear,
        "fits": [fit_as_data(title, found) for title, found in fits.items()],
        "balance": balance,
        "truth": truth,
    }


def fit_as_data(title: str, found: Fit) -> dict:
    """One fit as plain data."""
    singular = [float(value) for value in found.identifiability.singular_values]
    return {
        "title": title,
        "refused": found.refused or None,
        "parameters": {
            name: {
                "value": found.values[name],
                "standard_error": found.standard_errors[name],
                "ci95": list(found.ci95[name]),
                "unit": found.units[name],
                "instrument": "." in name,
            }
            for name in found.values
        },
        "residual_rms": found.residual_rms,
        "unexplained": found.residual_rms > UNEXPLAINED,
        "samples": len(found.residual),
        "effective_samples": found.effective_samples,
        "rho": found.rho,
        "identifiability": {
            "singular_values": singular,
            "not_separable": [list(tie) for tie in found.identifiability.ties],
            "sensitivity": found.sensitivity,
        },
    }


def csv_of(data: Dataset) -> str:
    """A recording as a table that `--data` reads; a cell is empty where a channel has no sample."""
    stamps = np.unique(np.concatenate([channel.time_s for channel in data.channels.values()]))
    cells = [[f"{time_s:.9g}" for time_s in stamps]]
    for channel in data.channels.values():
        column = [""] * len(stamps)
        for place, number in zip(np.searchsorted(stamps, channel.time_s), channel.value, strict=True):
            column[place] = f"{number:.9g}"
        cells.append(column)
    rows = [",".join(row) for row in zip(*cells, strict=True)]
    return "\n".join([",".join(["t_s", *data.channels]), *rows]) + "\n"


def run_coverage(options: argparse.Namespace, console: Console) -> dict:
    """N machines on the virtual benches: intervals counted, compared with the limits of a binomial."""
    if options.coverage < 1 or options.data is not None or options.model is not None or options.bench != ALL:
        raise UserError("--coverage N: N must be 1 or more, of the bench all, without --data and --model")
    bar = Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), console=console
    )
    with bar:
        task = bar.add_task("machines", total=options.coverage)
        seeds = range(options.seed, options.seed + options.coverage)
        counts = coverage.count(seeds, done=lambda number: bar.update(task, completed=number))
    fewest, most = coverage.bounds(options.coverage, len(counts))
    table = Table(box=None, pad_edge=False)
    for title in ("path and number", "held", "refused", "error / standard error, rms", "half width"):
        table.add_column(title, justify="left" if title.startswith("path") else "right")
    for label, each in counts.items():
        outside = "" if fewest <= each.held <= most else " (outside)"
        width = each.relative_width / each.asked if each.asked else math.nan
        table.add_row(
            label,
            f"{each.held} of {each.asked}{outside}",
            str(each.refused),
            f"{each.spread:.2f}",
            f"{100 * width:.2g} %",
        )
    console.print(table)
    console.print(
        f"{fewest} to {most} of {options.coverage} may hold, all {len(counts)} numbers together with 99.9 %, "
        "where each interval holds at 95 %"
    )
    return {
        "machines": options.coverage,
        "seed": options.seed,
        "rate": 0.95,
        "bounds": [fewest, most],
        "numbers": {
            label: {
                "held": each.held,
                "asked": each.asked,
                "refused": each.refused,
                "spread": each.spread if each.asked else None,
            }
            for label, each in counts.items()
        },
    }
