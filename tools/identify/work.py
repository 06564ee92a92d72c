"""The work of `ranger-sim identify`: options, tables on the screen, files. `sysid/identification` does the rest.

Without --data the virtual bench records, and results are shown next to the true values.
"""

import argparse
import json
import math
import pathlib
from collections.abc import Iterable

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid.dataset import Dataset
from ranger_sim.sysid.fit import Fit, Parameter
from ranger_sim.sysid.identification import coverage
from ranger_sim.sysid.identification.run import ALL, UNEXPLAINED, identification
from ranger_sim.tools.command_line import files, streams, terminal
from ranger_sim.tools.identify import page
from ranger_sim.tools.recordings import datasets

EXIT_DONE, EXIT_REFUSED = 0, 1
UNEXPLAINED_TEXT = (
    "the residual is {:.0f} times the instruments' noise: something that is not in the model moves it, "
    "and these values may compensate for it (not physical)"
)


def run(options: argparse.Namespace) -> int:
    """Identify and report; 1 when a fit was refused."""
    target = files.json_target(options.json)
    folder = files.writable_folder(options.out) if options.out else None
    # with --json - standard output gets only the JSON
    console = terminal.console(markup=True, highlight=False, stderr=options.json == "-")
    if options.coverage is not None:
        told = run_coverage(options, console)
        write(told, options, target)
        return EXIT_DONE
    done = identification(
        options.bench,
        options.data,
        [known_of(text) for text in options.known],
        options.gear,
        options.model,
        options.accept_loss,
        datasets.how_of(options),
        options.seed,
        report=lambda line: console.print(escape(line)),
        before=lambda line: console.print(f"[dim]{escape(line)}[/dim]"),
    )
    recordings, fits, told = done.recordings, done.fits, done.result.to_dict()
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
