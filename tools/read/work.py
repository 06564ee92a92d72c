"""The work of `ranger-sim read`: read, print, plot, write the recipe."""

from __future__ import annotations

import argparse
import functools
import json
import pathlib

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskID, TextColumn, TimeElapsedColumn
from rich.table import Table

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.sysid import sanity
from ranger_sim.sysid.reading import Measurement, inspected
from ranger_sim.sysid.recipe import Recipe
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.read.findings import called, lines_of
from ranger_sim.tools.recordings import datasets

EXIT_REFUSED = 2
MOST_CHANNELS = 40  # more are counted; --json has all
PLOTS = (".html", ".png")


def run(options: argparse.Namespace) -> int:
    """The command: the worst of the files' exit codes."""
    target = json_target(options.json)
    if options.plot and pathlib.Path(options.plot).suffix.lower() not in PLOTS:
        raise UserError(f"--plot {options.plot}: the name must end in .html or .png")
    screen = terminal.console(stderr=True)
    bar = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=screen,
        transient=True,
        disable=not screen.is_terminal,
    )
    found: list[Measurement] = []
    with bar:
        for path in options.files:
            task = bar.add_task(printable(path), total=1.0)
            dataset = datasets.open_with(options, path, functools.partial(_shown, bar, task))
            found.append(inspected(dataset))
            bar.update(task, completed=1.0)
    if options.plot:
        plot(found, pathlib.Path(options.plot))
    if options.write_recipe:
        recipe = Recipe.of(found[0].dataset, options.time_unit)
        replace_file(pathlib.Path(options.write_recipe), recipe.text().encode())
    answer = [each.to_dict() for each in found]
    text = json.dumps(answer[0] if len(answer) == 1 else answer, indent=1, allow_nan=False)
    if target is not None:
        replace_file(target, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        console = terminal.console()
        for each in found:
            show(each, console)
    fatal = any(finding.severity == sanity.FATAL for each in found for finding in each.findings)
    return EXIT_REFUSED if fatal else max(each.exit_code for each in found)


def _shown(bar: Progress, task: TaskID, what: str, share: float) -> None:
    bar.update(task, description=what, completed=share)


def show(measurement: Measurement, console: Console) -> None:
    """Channels, ledger, findings and proposals of one recording."""
    dataset = measurement.dataset
    layout = dict(dataset.layout)
    kind = layout.pop("format", "")
    how = ", ".join(f"{key} {value}" for key, value in layout.items() if isinstance(value, str))
    console.print(printable(f"{dataset.name}: {kind}" + (f" ({how})" if how else "")), soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    for heading in ("channel", "unit", "in the file", "samples", "from", "to", "every", "least", "most"):
        table.add_column(heading, justify="left" if heading in ("channel", "unit", "in the file") else "right")
    answer = measurement.to_dict()
    for name, each in list(answer["channels"].items())[:MOST_CHANNELS]:
        numbers = [each[key] for key in ("start_s", "end_s", "step_s", "least", "most")]
        start, end, step, least, most = ("" if number is None else f"{number:.6g}" for number in numbers)
        source = each["source"] if each["source"] != name else ""
        table.add_row(
            printable(name), each["unit"], printable(source), str(each["samples"]), f"{start} s", f"{end} s",
            f"{step} s" if step else "", least, most,
        )  # fmt: skip
    terminal.print_table(console, table, ("in the file", "from", "every"))
    if len(answer["channels"]) > MOST_CHANNELS:
        console.print(f"and {len(answer['channels']) - MOST_CHANNELS} more channels (--json has all)")
    _show_ledger(measurement, console)
    for mark, text in lines_of(measurement):
        console.print(printable(f"{mark}: {text}"), soft_wrap=True)


def _show_ledger(measurement: Measurement, console: Console) -> None:
    ledger = measurement.ledger()
    if ledger["lines"]:
        parts = ", ".join(f"{count} {kind}" for kind, count in ledger["lines"].items() if count)
        console.print(printable(f"lines: {sum(ledger['lines'].values())} = {parts}"), soft_wrap=True)
    if ledger["stamps"]:
        console.print(printable(f"stamps: {ledger['stamps']}"), soft_wrap=True)
    alike: dict[str, list[str]] = {}
    for name, account in ledger["channels"].items():
        if account["left_out"]:
            reasons = "; ".join(
                f"{each['count']} {each['reason'].replace('_', ' ')}" + (f" ({each['where']})" if each["where"] else "")
                for each in account["left_out"]
            )
            alike.setdefault(f"{account['read']} read, {account['kept']} kept, left out: {reasons}", []).append(name)
    for text, names in alike.items():
        console.print(printable(f"samples of {called(names) or 'no channel'}: {text}"), soft_wrap=True)


def plot(found: list[Measurement], path: pathlib.Path) -> None:
    """Write the page or the picture."""
    from ranger_sim.tools.read import picture

    if path.suffix.lower() == ".html":
        replace_file(path, picture.page(found).encode())
    else:
        replace_file(path, picture.png(found))
