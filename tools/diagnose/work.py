"""The work of `ranger-sim diagnose`: options, the screen, files. The diagnosis itself is `sysid/api.py`."""

from __future__ import annotations

import argparse
import importlib
import json
import pathlib
import shlex
import sys
from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table as RichTable

from ranger_sim.foundation.user_error import ModelError, UserError, printable, raised
from ranger_sim.sysid import answer, machines, predicted_ties
from ranger_sim.sysid.api import diagnosis
from ranger_sim.sysid.diagnosis import Diagnosis
from ranger_sim.sysid.machine import Machine
from ranger_sim.sysid.machines import missing_members
from ranger_sim.sysid.pipeline import Progress as Progressed
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from ranger_sim.tools.diagnose import twin_words, words
from ranger_sim.tools.recordings import datasets
from ranger_sim.tools.twins.emulation import emulate

EXIT_CLEAN, EXIT_FOUND, EXIT_DOUBTFUL = 0, 1, 3  # 2 is a user's mistake
MOST_GAPS = 4  # more of them are one line on a screen; report and JSON have all


def run(options: argparse.Namespace) -> int:
    """The command."""
    target = json_target(options.json)
    folder = writable_folder(options.out) if options.out else None
    screen = terminal.for_progress(options)
    lines = terminal.ProgressLines(screen, options)
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

        def progress(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)
            lines.show(f"{what}, {share:.0%}")

        found = of_options(options, progress)
        if folder is not None:
            bar.update(task, description="report")
            write(found, folder, printable(shlex.join(["ranger-sim", *sys.argv[1:]])))
    if options.json == "-":
        streams.print_result(_json(found.answer))
    else:
        if target is not None:
            replace_file(target, _json(found.answer).encode())
        _show(found, terminal.console())
    if found.result.detected:
        return EXIT_FOUND
    evidence = found.result.evidence
    doubtful = evidence.above_noise_floor or evidence.too_short_s or evidence.learnable or evidence.impossible
    return EXIT_DOUBTFUL if doubtful else EXIT_CLEAN


def write(found: Diagnosis, folder: pathlib.Path, command: str) -> None:
    """The folder of `--out`: page, answer, and the extended model where there is one."""
    from ranger_sim.tools.diagnose import page  # with plotly, which is slow to load

    files = {"diagnosis.json": "the answer for programs"}
    if found.result.extended_model:
        path = folder / "extended.toml"
        replace_file(path, found.result.extended_model.encode())
        found.result = answer.written(found, str(path))
        files["extended.toml"] = "the extended model"
    replace_file(folder / "diagnosis.json", _json(found.answer).encode())
    replace_file(folder / "report.html", page.render(found, command, files).encode())


def of_options(options: argparse.Namespace, progress: Progressed = lambda what, share: None) -> Diagnosis:
    """The diagnosis for a command line."""
    machine = machines.machine_of(machine_of(options.experiment), options.gear)  # before any file is read
    data, held = ([datasets.open_with(options, path) for path in paths] for paths in (options.data, options.holdout))
    try:
        return diagnosis(
            data,
            machine,
            holdout=held,
            holdout_part=options.holdout_part,
            model=options.model,
            repair=options.repair,
            accept_loss=options.accept_loss,
            seed=options.seed,
            progress=progress,
            emulator=emulate,
        )
    except (UserError, OSError, MemoryError):
        raise
    except Exception as error:
        file = file_of_users(machine)
        if not file or options.verbose:
            raise
        text = f"{raised(error, file)}; --verbose prints the traceback"
        raise ModelError(f"--experiment {options.experiment}: it raised {text}") from error


def file_of_users(machine: Machine) -> str:
    """The file that defines a machine of the user's own; "" for one of this package."""
    return "" if machines.is_ours(machine) else getattr(sys.modules[type(machine).__module__], "__file__", None) or ""


def machine_of(experiment: str) -> str | Machine:
    """The experiment's name, or the user's own machine for module:object; UserError when there is none."""
    module_name, colon, name = experiment.partition(":")
    if not colon:
        return experiment
    if "" not in sys.path:
        sys.path.insert(0, "")  # a user's module is in the folder where the command is started
    try:
        found = getattr(importlib.import_module(module_name), name)
        machine = found() if isinstance(found, type) else found
    except (ImportError, AttributeError) as error:
        raise UserError(f"--experiment {experiment}: {error}") from None
    except UserError:
        raise
    except Exception as error:  # whatever a user's program raises
        raise ModelError(f"--experiment {experiment}: it raised {raised(error)}") from error
    if missing := missing_members(machine):
        raise UserError(f"--experiment {experiment}: it has no {', '.join(missing)} (sysid/machine.py has its members)")
    return machine


def _json(answer: Mapping[str, Any]) -> str:
    return json.dumps(answer, indent=1, allow_nan=False)


def _show(found: Diagnosis, console: Console) -> None:
    """Print the answer."""
    told = found.answer
    console.print(words.sentence(found), highlight=False, soft_wrap=True)
    for name in told["evidence"]["impossible"]:
        value = _figure(told["evidence"]["parameters"][name]["value"])
        console.print(f"{name} comes out as {value}, which no machine has", highlight=False, soft_wrap=True)
    for name in told["evidence"].get("refused_by_holdout", ()):
        console.print(f"{name} is in these data and not in the held-out ones: refused", highlight=False, soft_wrap=True)
    findings, gaps = told["data_findings"], [each for each in told["data_findings"] if each["kind"] == "gap"]
    if len(gaps) > MOST_GAPS:
        findings = [each for each in findings if each["kind"] != "gap"]
        longest = max(gaps, key=lambda each: each["size"])
        text = (
            f"gaps in {len({each['channel'] for each in gaps})} channels; the longest is {longest['size']:.4g} s at "
            f"{longest['start_s']:.4g} s, in {longest['channel']}"
        )
        findings.append({"recording": longest["recording"], "channel": "", "text": text})
    for word, lines in (("data", findings), ("repaired", told["data_repairs"])):
        together: dict[tuple[str, str], list[str]] = {}  # identical findings of several channels are one line
        for each in lines:
            together.setdefault((each["recording"], each["text"]), []).append(each["channel"])
        for (recording, text), channels in together.items():
            place = ": ".join(each for each in (recording, ", ".join(filter(None, channels))) if each)
            console.print(f"{word}: {place}: {text}", highlight=False, soft_wrap=True)
    for each in told["evidence"]["known"]:
        values = ", ".join(
            f"{name} {_figure(value['value'])} ({_figure(value['ci95'][0])} to {_figure(value['ci95'][1])}; "
            f"in the model {_figure(value['model'])})"
            for name, value in each["parameters"].items()
        )
        console.print(f"known: {each['name']} at {each['at']}: {values}", highlight=False, soft_wrap=True)
    for line in [
        *words.held_out(told),
        *words.between_rows(told),
        *words.numerics(told),
        *words.unseen(told),
        *twin_words.lines(told),
    ]:
        console.print(line, highlight=False, soft_wrap=True)
    if not told["detected"]:
        return
    table = RichTable("equation", "regime", "misfit", "noise", "repeatable", box=None)
    for each in told["misfit"]:
        if each["regime"] == "all" or each["repeatable_fraction"] > 0.02:
            table.add_row(
                each["channel"],
                each["regime"],
                f"{each['rms']:.3g}",
                f"{each['noise']:.3g}",
                f"{each['repeatable_fraction']:.1%}",
            )
    if told["misfit"]:
        console.print(table)
    for cause in told["causes"]:
        values = ", ".join(
            f"{name} {_figure(value['value'])} ({_figure(value['ci95'][0])} to {_figure(value['ci95'][1])})"
            for name, value in words.sizes(cause).items()
        )
        tied = f"; ties with {', '.join(cause['evidence']['ties'])}" if cause["evidence"]["ties"] else ""
        form = f" ({cause['form']})" if cause.get("form") else ""
        console.print(f"{cause['name']} at {cause['at']}{form}: {values}{tied}", highlight=False, soft_wrap=True)
        for line in predicted_ties.described(cause["evidence"]["predicted"]):
            console.print(f"  {line}", highlight=False, soft_wrap=True)
    if told["gain"] is not None:
        gain = told["gain"]
        low, high = gain["ci95"]
        console.print(
            f"gain on {gain['holdout']}: {gain['fraction_of_achievable']:.0%} of what can be achieved "
            f"({low:.0%} to {high:.0%})",
            highlight=False,
            soft_wrap=True,
        )
    for each in told["evidence"].get("without_form", ()):
        console.print(
            f"{each['name']} at {each['at']} is not in the simulator's terms: {each['reason']}",
            highlight=False,
            soft_wrap=True,
        )
    for each in told["next_experiment"]:
        console.print(f"next: {each}", highlight=False, soft_wrap=True)


def _figure(value: float) -> str:
    return f"{value:.4g}"
