"""The work of `ranger-sim diagnose`: errors of the simulation against measured data, and the gain from fixing them."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import json
import pathlib
import shlex
import sys
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.sysid import losses, model_file, predicted_ties, repairs, sanity
from ranger_sim.sysid.channels import named_for
from ranger_sim.sysid.dataset import Dataset, Finding, Repair, Table
from ranger_sim.sysid.diagnose import Progress as Progressed
from ranger_sim.sysid.diagnose import diagnose
from ranger_sim.sysid.diagnosis import Diagnosis, KnownEffect
from ranger_sim.sysid.machine import Machine
from ranger_sim.sysid.machines import MACHINES, ROBOT, made
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from ranger_sim.tools.diagnose import words
from ranger_sim.tools.recordings import datasets

EXIT_CLEAN, EXIT_FOUND = 0, 1
MOST_GAPS = 4  # more of them are one line on a screen; report and JSON have all
LEAST_ROWS = 50  # below, filters are longer than the data; useful data have some hundreds


def run(options: argparse.Namespace) -> int:
    """The command."""
    target = json_target(options.json)
    folder = writable_folder(options.out) if options.out else None
    screen = terminal.console(stderr=True)
    bar = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(),
        TimeElapsedColumn(),
        console=screen,
        transient=True,
        disable=not screen.is_terminal,  # a file or a pipe gets only the answer
    )
    with bar:
        task = bar.add_task("recordings", total=1.0)
        found = of_options(options, lambda what, share: bar.update(task, description=what, completed=share))
        if folder is not None:
            bar.update(task, description="report")
            write(found, folder, printable(shlex.join(["ranger-sim", *sys.argv[1:]])))
    if options.json == "-":
        streams.print_result(_json(found.answer))
    else:
        if target is not None:
            replace_file(target, _json(found.answer).encode())
        _show(found, terminal.console())
    return EXIT_FOUND if found.answer["detected"] else EXIT_CLEAN


def write(found: Diagnosis, folder: pathlib.Path, command: str) -> None:
    """The folder of `--out`: page, answer, and the extended model where there is one."""
    from ranger_sim.tools.diagnose import page  # with plotly, which is slow to load

    files = {"diagnosis.json": "the answer for programs"}
    if (found.named or found.answer["evidence"]["known"]) and not found.answer["abstained"]:
        path = folder / "extended.toml"
        replace_file(path, model_file.model_text(found).encode())
        found.answer["model_file"] = str(path)
        for each in model_file.effects_found(found):
            if each.term is None and found.machine.name in ROBOT:  # other machines have their own simulators
                found.answer["evidence"].setdefault("without_form", []).append(
                    {"name": each.known.cause, "at": each.known.at, "reason": each.no_form}
                )
        files["extended.toml"] = "the extended model"
    replace_file(folder / "diagnosis.json", _json(found.answer).encode())
    replace_file(folder / "report.html", page.render(found, command, files).encode())


def of_options(options: argparse.Namespace, progress: Progressed = lambda what, share: None) -> Diagnosis:
    """The diagnosis for a command line."""
    machine = machine_of(options.experiment, options.gear)
    known = model_file.read(options.model, machine).effects if options.model else []
    experiment, accepted = options.experiment, options.accept_loss
    data, held = (
        [prepared(datasets.open_with(options, path), machine, experiment, accepted, options.repair) for path in paths]
        for paths in (options.data, options.holdout)
    )
    if options.holdout_part is not None:
        if held:
            raise UserError(f"--holdout-part {options.holdout_part:g}: there are files to hold out already (--holdout)")
        data, held = _parted(data, options.holdout_part)
    return _diagnosed(machine, data, held, options.seed, known, progress)


@dataclasses.dataclass(frozen=True)
class Prepared:
    """A prepared recording: its table, its anomalies, its repairs, and the fate of its samples."""

    table: Table
    findings: list[Finding]
    repairs: list[Repair]
    ledger: Mapping[str, Any]


def _parted(data: Sequence[Prepared], part: float) -> tuple[list[Prepared], list[Prepared]]:
    """The first and the last part of each recording by time; reports on its data are on the first."""
    if not 0.0 < part < 1.0:
        raise UserError(f"--holdout-part {part:g}: allowed is what lies between 0 and 1")
    first: list[Prepared] = []
    last: list[Prepared] = []
    for each in data:
        table = each.table
        begin, end = float(table.time_s[0]), float(table.time_s[-1])
        row = int(np.searchsorted(table.time_s, end - part * (end - begin)))
        first.append(dataclasses.replace(each, table=table.part(slice(0, row))))
        rest = table.part(slice(row, None))
        rest.name = f"{table.name} from {table.time_s[row]:.1f} s on"
        last.append(Prepared(rest, [], [], {}))
    return first, last


def answer(
    files: Sequence[str], holdout: Sequence[str], experiment: str, holdout_part: float | None = None
) -> dict[str, Any]:
    """The output of `--json`, for programs: files and held-out files, or a part of each, of one experiment."""
    machine = machine_of(experiment)
    data, held = (
        [prepared(datasets.open_recording(path), machine, experiment) for path in each] for each in (files, holdout)
    )
    if holdout_part is not None:
        data, held = _parted(data, holdout_part)
    return _diagnosed(machine, data, held, 0).answer


def machine_of(experiment: str, gear: float | None = None) -> Machine:
    """A machine of ours by its experiment's name, or a user's as module:object; UserError when there is none."""
    if experiment in MACHINES:
        if gear is not None:
            if experiment != "motor-bench":
                raise UserError(f"--gear {gear:g}: only the motor bench has a gearbox to be given, not {experiment}")
            if not 0.01 <= gear <= 1e4:
                raise UserError(f"--gear {gear:g}: allowed are 0.01 to 10000")
            return made(experiment)(gear)
        return made(experiment)()
    module_name, colon, name = experiment.partition(":")
    if not colon:
        raise UserError(
            f"--experiment {experiment}: there are {', '.join(MACHINES)}; a machine of yours is module:object"
        )
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module stands where the command is started
    try:
        found = getattr(importlib.import_module(module_name), name)
    except (ImportError, AttributeError) as error:
        raise UserError(f"--experiment {experiment}: {error}") from None
    machine = found() if isinstance(found, type) else found
    missing = [
        each
        for each in ("name", "quantities", "parameters", "prepare", "effects", "generic")
        if not hasattr(machine, each)
    ]
    if missing:
        raise UserError(
            f"--experiment {experiment}: it has no {', '.join(missing)} (sysid/machine.py describes what a machine has)"
        )
    return machine


def prepared(
    dataset: Dataset,
    machine: Machine,
    experiment: str,
    accepted: float = losses.ACCEPTED,
    asked: Collection[str] = (),
) -> Prepared:
    """A recording mended, its channels on one time base.

    accepted: share of a channel's samples that may be lost. asked: inputs of the machine that are repaired all the
    same. UserError for data that are not what they say, or of which too much is lost.
    """
    if experiment in MACHINES:
        dataset = named_for(dataset, experiment)
    missing = [each.name for each in machine.quantities if each.needed and each.name not in dataset]
    names = [each.name for each in machine.quantities if each.name in dataset]
    if missing or not names:
        wanted = ", ".join(missing) or "one of its channels"
        there = ", ".join(dataset.channels) or "none"
        raise UserError(
            f"{dataset.name}: {machine.name} needs {wanted}; there are {there} (--map NAME=CHANNEL names it)"
        )
    for name in asked:
        if name not in names:
            raise UserError(f"--repair {name}: unknown channel of {dataset.name} (available: {', '.join(names)})")
    dataset.channels = {name: dataset.channels[name] for name in names}
    dataset.findings = [each for each in dataset.findings if each.channel in ("", *names)]
    dataset.repairs = [each for each in dataset.repairs if each.channel in ("", *names)]
    findings = sanity.inspect(dataset)
    sanity.stop_if_fatal(dataset.name, findings)
    inputs = {each.name for each in machine.quantities if each.is_input} - set(asked)
    mended = repairs.mend(dataset, findings, inputs)
    losses.stop_if_too_many(mended, names, accepted)
    needed = [each.name for each in machine.quantities if each.needed]
    for doubt in sanity.doubts(findings):
        if doubt.kind == "noise" and doubt.channel not in needed:
            continue  # a channel at rest; what it is needed for says more
        if doubt.kind == "slow_samples" and experiment not in MACHINES:
            continue  # a user's own machine may be a tank
        place = f"{doubt.channel}: " if doubt.channel else ""
        raise UserError(f"{dataset.name}: {place}{doubt.text}; nothing is concluded from such data")
    if experiment in MACHINES:  # a user's own machine may have a setting for a channel
        for each in machine.quantities:
            if each.needed and np.ptp(mended[each.name].value) == 0.0:
                raise UserError(f"{dataset.name}: {each.name}: one value all the time; nothing is concluded from that")
    own = getattr(machine, "table", None)  # of a machine whose channels come at rates of their own
    table = own(mended, names) if own is not None else mended.table(names)
    if len(table) < LEAST_ROWS:
        raise UserError(f"{dataset.name}: {len(table)} rows with all channels, at least {LEAST_ROWS} are needed")
    return Prepared(table, mended.findings, mended.repairs, mended.ledger())


def _diagnosed(
    machine: Machine,
    data: Sequence[Prepared],
    held: Sequence[Prepared],
    seed: int,
    known: Sequence[KnownEffect] = (),
    progress: Progressed = lambda what, share: None,
) -> Diagnosis:
    findings = [
        {**dataclasses.asdict(finding), "recording": each.table.name}
        for each in (*data, *held)
        for finding in each.findings
    ]
    tables = [each.table for each in data]
    names = ", ".join(table.name for table in tables)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what overflows ends as no number, which is told below
            found = diagnose(machine, tables, [each.table for each in held], seed, findings, known, progress)
    except (np.linalg.LinAlgError, FloatingPointError) as error:
        text = f"{names}: no machine can be fitted to these numbers ({error}); nothing is concluded from such data"
        raise UserError(text) from None
    found.answer["data_repairs"] = [
        {**dataclasses.asdict(repair), "recording": each.table.name}
        for each in (*data, *held)
        for repair in each.repairs
        if repair.kind in repairs.KINDS
    ]
    found.answer["data_ledger"] = {each.table.name: each.ledger for each in (*data, *held) if each.ledger}
    wrong = _no_number(found.answer)
    if wrong:
        raise UserError(f"{names}: {wrong} comes out as no number; nothing is concluded from such data")
    return found


def _no_number(value: Any, place: str = "") -> str:
    """The place of the first value in an answer that is not a finite number; empty if there is none."""
    if isinstance(value, float):
        return "" if np.isfinite(value) else place
    inside = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list) else ()
    return next((found for key, each in inside if (found := _no_number(each, f"{place} {key}".strip()))), "")


def _json(answer: Mapping[str, Any]) -> str:
    return json.dumps(answer, indent=1, allow_nan=False)


def _show(found: Diagnosis, console: Console) -> None:
    """Print the answer."""
    answer = found.answer
    console.print(words.sentence(found), highlight=False, soft_wrap=True)
    for name in answer["evidence"]["impossible"]:
        value = _figure(answer["evidence"]["parameters"][name]["value"])
        console.print(f"{name} comes out as {value}, which no machine has", highlight=False, soft_wrap=True)
    for name in answer["evidence"].get("refused_by_holdout", ()):
        console.print(f"{name} is in these data and not in the held-out ones: refused", highlight=False, soft_wrap=True)
    findings, gaps = answer["data_findings"], [each for each in answer["data_findings"] if each["kind"] == "gap"]
    if len(gaps) > MOST_GAPS:
        findings = [each for each in findings if each["kind"] != "gap"]
        longest = max(gaps, key=lambda each: each["size"])
        text = (
            f"gaps in {len({each['channel'] for each in gaps})} channels; the longest is {longest['size']:.4g} s at "
            f"{longest['start_s']:.4g} s, in {longest['channel']}"
        )
        findings.append({"recording": longest["recording"], "channel": "", "text": text})
    for word, lines in (("data", findings), ("repaired", answer["data_repairs"])):
        together: dict[tuple[str, str], list[str]] = {}  # identical findings of several channels are one line
        for each in lines:
            together.setdefault((each["recording"], each["text"]), []).append(each["channel"])
        for (recording, text), channels in together.items():
            place = ": ".join(each for each in (recording, ", ".join(filter(None, channels))) if each)
            console.print(f"{word}: {place}: {text}", highlight=False, soft_wrap=True)
    for each in answer["evidence"]["known"]:
        values = ", ".join(
            f"{name} {_figure(value['value'])} ({_figure(value['ci95'][0])} to {_figure(value['ci95'][1])}; "
            f"in the model {_figure(value['model'])})"
            for name, value in each["parameters"].items()
        )
        console.print(f"known: {each['name']} at {each['at']}: {values}", highlight=False, soft_wrap=True)
    if not answer["detected"]:
        return
    table = RichTable("equation", "regime", "misfit", "noise", "repeatable", box=None)
    for each in answer["misfit"]:
        if each["regime"] == "all" or each["repeatable_fraction"] > 0.02:
            table.add_row(
                each["channel"],
                each["regime"],
                f"{each['rms']:.3g}",
                f"{each['noise']:.3g}",
                f"{each['repeatable_fraction']:.1%}",
            )
    console.print(table)
    for cause in answer["causes"]:
        values = ", ".join(
            f"{name} {_figure(value['value'])} ({_figure(value['ci95'][0])} to {_figure(value['ci95'][1])})"
            for name, value in cause["parameters"].items()
        )
        tied = f"; ties with {', '.join(cause['evidence']['ties'])}" if cause["evidence"]["ties"] else ""
        console.print(f"{cause['name']} at {cause['at']}: {values}{tied}", highlight=False, soft_wrap=True)
        for line in predicted_ties.told(cause["evidence"]["predicted"]):
            console.print(f"  {line}", highlight=False, soft_wrap=True)
    if answer["gain"] is not None:
        gain = answer["gain"]
        low, high = gain["ci95"]
        console.print(
            f"gain on {gain['holdout']}: {gain['fraction_of_achievable']:.0%} of what can be achieved "
            f"({low:.0%} to {high:.0%})",
            highlight=False,
            soft_wrap=True,
        )
    for each in answer["evidence"].get("without_form", ()):
        console.print(
            f"{each['name']} at {each['at']} is not in the simulator's terms: {each['reason']}",
            highlight=False,
            soft_wrap=True,
        )
    for each in answer["next_experiment"]:
        console.print(f"next: {each}", highlight=False, soft_wrap=True)


def _figure(value: float) -> str:
    return f"{value:.4g}"
