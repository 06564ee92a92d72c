"""The work of `python -m studies.figures`: walk, weigh, report."""

import argparse
import dataclasses
import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from ranger_sim import loading
from ranger_sim.foundation.user_error import UserError
from ranger_sim.plant import body_files
from ranger_sim.ranger.walks import written
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from studies.figures import file
from studies.figures.diagnose import ROUNDS, Diagnosis, diagnose, values_of
from studies.figures.question import Candidate, Figure, Question
from studies.figures.walks import FIGURES, Setup, Walks

EXIT_CLEAN, EXIT_FOUND = 0, 1
OURS = pathlib.Path(__file__).parent
FEW = 3  # suspects that a sentence names
HIDDEN_SEEDS = range(1001, 1005)  # of the walks whose figures a blind check takes as measured: not those of the search


def run(options: argparse.Namespace) -> int:
    """The command."""
    target = json_target(options.json)
    folder = writable_folder(options.out) if options.out else None
    setup, question = asked(options)
    console = terminal.for_progress(options)
    lines = terminal.ProgressLines(console, options)
    if not loading.RUNS_COMPILED:
        console.print(f"running interpreted, slowly: {loading.RUNS_INTERPRETED_BECAUSE}", soft_wrap=True)
    walks = Walks(setup, question.candidates, options.jobs, folder)
    rounds = ROUNDS if options.rounds is None else options.rounds
    if options.hide:
        answer: dict[str, Any] = {"blind": [blind(walks, question, each, rounds, lines) for each in options.hide]}
        detected = any(each["answer"]["detected"] for each in answer["blind"])
    else:
        found = with_progress(walks, question, rounds, lines, question.title)
        answer, detected = found.answer, found.answer["detected"]
        if folder is not None and answer["causes"]:
            answer["model_file"] = corrected(folder, walks, values_of(answer))
    text = json.dumps(answer, indent=1, allow_nan=False)
    if folder is not None:
        replace_file(folder / "diagnosis.json", text.encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        if target is not None:
            replace_file(target, text.encode())
        show(answer, terminal.console())
    return EXIT_FOUND if detected else EXIT_CLEAN


def asked(options: argparse.Namespace) -> tuple[Setup, Question]:
    """The question of a command line. UserError for a fault of it or of the file."""
    name = options.file
    there = sorted(path.stem for path in OURS.glob("*.toml"))
    path = pathlib.Path(name) if name.endswith(".toml") else OURS / f"{name}.toml"
    if not name.endswith(".toml") and name not in there:
        raise UserError(f"{name}: there is {', '.join(there)}; a file of yours ends in .toml")
    data = file.load(path)
    changes = {key: getattr(options, key) for key in ("body", "controller", "steps", "seeds")}
    setup = Setup.of(path, {**data.get("run", {}), **{key: value for key, value in changes.items() if value}})
    question = file.question(path, data, setup.number)
    question = dataclasses.replace(question, figures=(*question.figures, *map(typed_figure, options.also)))
    for each in [*(figure.name for figure in question.gait), *(wanted.name for wanted in question.measurements)]:
        if each not in FIGURES:
            raise UserError(f"{path}: unknown figure {each} (available: {', '.join(FIGURES)})")
    limits_met(path, setup, question.candidates)
    return setup, question


def typed_figure(text: str) -> Figure:
    """NAME=VALUE+-SD."""
    name, equals, rest = text.partition("=")
    value, sign, sd = rest.partition("+-")
    try:
        if not (name and equals and sign):
            raise ValueError
        return Figure(name, float(value), float(sd), source="given on the command line")
    except ValueError:
        raise UserError(f"--also {text}: NAME=VALUE+-SD is expected, as sole_to_hip_m=1.0+-0.005") from None


def limits_met(path: pathlib.Path, setup: Setup, candidates: Sequence[Candidate]) -> None:
    """UserError for a candidate whose limits a body or a controller does not take."""
    walks = Walks(setup, candidates)
    for each in candidates:
        for value in (each.low, each.high):
            moved = walks.moved({each.name: value})
            for key, number in moved.items():
                group, _, name = key.partition(".")
                if group == "body" and not _within(body_files.keys()[name], number):
                    raise UserError(
                        f"{path}: candidate {each.name}: at {value:g} {key} would be {number:g}, allowed are "
                        f"{body_files.keys()[name].limits}"
                    )


def _within(key: body_files.Key, number: float) -> bool:
    low, high = key.metadata["limits"]
    return bool(low <= number <= high)


def with_progress(
    walks: Walks, question: Question, rounds: int, lines: terminal.ProgressLines, title: str
) -> Diagnosis:
    """The diagnosis, with a bar on the screen or lines."""
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("walks"),
        TimeElapsedColumn(),
        console=lines.console,
        disable=not lines.console.is_terminal,
    ) as progress:
        task = progress.add_task(title, total=None)

        def report(done: int, foreseen: int, what: str) -> None:
            progress.update(task, completed=done, total=foreseen, description=f"{title}: {what}")
            lines.show(f"{title}: {what}, {done} of {foreseen} walks")

        seeds = range(1, walks.setup.seeds + 1)
        return note_starts(diagnose(question, walks, seeds, report, rounds))


def note_starts(found: Diagnosis) -> Diagnosis:
    """The same, with a finding where walks failed at their start."""
    runs = [run for at in found.simulated.outcomes for run in at]
    lost = sum(run.survived == 0.0 and not run.failed for run in runs)
    if lost:
        found.answer["data_findings"].append(
            {"channel": "", "kind": "start", "text": f"{lost} of {len(runs)} walks fell while they started: they say "
             "nothing of the gait"}
        )  # fmt: skip
    return found


def blind(walks: Walks, question: Question, text: str, rounds: int, lines: terminal.ProgressLines) -> dict[str, Any]:
    """Blind check: a wrong number hidden in the body that walks, and the diagnosis from the figures of that walk.

    The figures keep the errors of their measurement. The simulator errs nowhere else here, so model_sd is left out; the
    scatter of the hidden walks' own means takes its place.
    """
    moved, name, value = hidden(walks, question, text)
    outcomes = list(walks.walked([(moved, seed) for seed in HIDDEN_SEEDS]))
    figures = []
    for each in question.figures:
        if each.endurance:
            steps = sum(outcome.survived for outcome in outcomes)
            figures.append(dataclasses.replace(each, value=steps, at_least=not any(run.failed for run in outcomes)))
            continue
        values = [outcome.figures[each.name] for outcome in outcomes if each.name in outcome.figures]
        if len(values) < 2:
            raise UserError(
                f"--hide {text}: the robot does not walk {walks.setup.steps} steps with it, there is no {each.name}"
            )
        scatter = float(np.std(values, ddof=1)) / len(values) ** 0.5
        figures.append(
            dataclasses.replace(each, value=float(np.mean(values)), model_sd=scatter, source=f"of a robot with {text}")
        )
    found = with_progress(walks, dataclasses.replace(question, figures=tuple(figures)), rounds, lines, text)
    return {"hidden": text, "candidate": name, "truth": value, "answer": found.answer}


def hidden(walks: Walks, question: Question, text: str) -> tuple[dict[str, float], str | None, float]:
    """(changed numbers, their candidate, its true value) of KEY=CHANGE."""
    key, equals, change = text.partition("=")
    share = change.endswith("%")
    try:
        if not equals:
            raise ValueError
        amount = float(change.removesuffix("%"))
    except ValueError:
        raise UserError(
            f"--hide {text}: KEY=CHANGE is expected, as leg_length_m=+0.03 or hip_spring_Nm_per_rad=-30%"
        ) from None
    by_name = {each.name: each for each in question.candidates}
    if key in by_name:
        candidate = by_name[key]
        value = candidate.value * (1.0 + amount / 100.0) if share else candidate.value + amount
        return walks.moved({key: value}), key, value
    number = walks.setup.number(key)
    value = number * (1.0 + amount / 100.0) if share else number + amount
    owner = next((each.name for each in question.candidates if list(each.moves) == [key]), None)
    return {key: value}, owner, value


def corrected(folder: pathlib.Path, walks: Walks, values: Mapping[str, float]) -> str | None:
    """The body with the named values, as a file that `walk --body` takes."""
    moved = walks.moved(values)
    body = {key.partition(".")[2]: number for key, number in moved.items() if key.startswith("body.")}
    if not body:
        return None
    return written(folder / "corrected.toml", walks.setup.body, body, "sources")


def show(answer: Mapping[str, Any], console: Console) -> None:
    """The answer for a person."""
    if "blind" in answer:
        table = Table("hidden", "found", "value", "95 %", "truth", box=None)
        for each in answer["blind"]:
            table.add_row(*blind_row(each))
        console.print(table)
        return
    console.print(sentence(answer), highlight=False, soft_wrap=True)
    table = Table("figure", "measured", "unchanged", "at the best", "error allowed", box=None)
    for before, after in zip(answer["misfit"], answer["figures"], strict=True):
        table.add_row(
            before["channel"], *(f"{value:.4g}" for value in (before["measured"], before["simulated"],
                                                             after["simulated"], before["noise"]))
        )  # fmt: skip
    console.print(table)
    table = Table("wrong would be", "values, 95 %", "criterion", "p", "walked", box=None)
    for each in answer["hypotheses"]:
        values = "; ".join(value_text(name, value) for name, value in each["values"].items())
        table.add_row(
            " and ".join(each["wrong"]) or "nothing", values, f"{each['bic']:+.1f}", f"{each['p']:.2g}",
            "yes" if each["simulated"] else "no",
        )  # fmt: skip
    console.print(table)
    for first, second, cosine in answer["evidence"]["ties"]:
        console.print(f"{first} and {second} do alike to these figures (|cos| {cosine:.2f})", highlight=False)
    for finding in answer["data_findings"]:
        console.print(f"data: {finding['text']}", highlight=False, soft_wrap=True)
    for each in answer["next_experiment"][:3]:
        shrinks = ", ".join(f"{name} {share:.0%}" for name, share in each["shrinks"].items() if share >= 0.05)
        brings = f"intervals shorter by {shrinks or 'little'}"
        console.print(
            f"next: {each['measurement']} to {each['sd']:g} ({each['how']}): {brings}",
            highlight=False,
            soft_wrap=True,
        )
    if answer["model_file"]:
        console.print(f"corrected body: {answer['model_file']}", highlight=False, soft_wrap=True)


def value_text(name: str, value: Mapping[str, Any]) -> str:
    """A value with its interval; an end set by the limits is marked."""
    low, high = (f"{end:.3g}{' (limit)' if is_open else ''}" for end, is_open in
                 zip(value["ci95"], value["open_ends"], strict=True))  # fmt: skip
    return f"{name} {value['value']:.4g} ({low} to {high}; was {value['was']:g})"


def sentence(answer: Mapping[str, Any]) -> str:
    """The diagnosis in a sentence or two."""
    moved = "; ".join(value_text(name, answer["estimates"][name]) for name in answer["sharper"])
    sharper = f" Within what was known, they say more of {moved}." if moved else ""
    if not answer["detected"]:
        p = answer["evidence"]["p_nothing"]
        return f"These figures refuse nothing of the unchanged body within its known accuracy (p {p:.2g}).{sharper}"
    if answer["abstained"]:
        return (
            "Something is wrong, and no one or two of the candidates explain the figures "
            f"(p {answer['evidence']['p_best']:.2g}): their values are not physical until it is resolved."
        )
    named = [name for cause in answer["causes"] for name in cause["parameters"]]
    if not named:
        return f"Something is wrong; these figures cannot decide which: {', '.join(answer['suspects'])}."
    values = " and ".join(
        value_text(name, value) for cause in answer["causes"] for name, value in cause["parameters"].items()
    )
    also = ""
    if answer["suspects"]:
        few = len(answer["suspects"]) <= FEW
        also = f" Perhaps also {', '.join(answer['suspects'])}." if few else " What else may be wrong, they do not say."
    return f"Wrong is {values}.{also}{sharper}"


def blind_row(each: Mapping[str, Any]) -> tuple[str, str, str, str, str]:
    """A line of the table of blind checks."""
    answer = each["answer"]
    named = {name: value for cause in answer["causes"] for name, value in cause["parameters"].items()}
    value = named.get(each["candidate"])
    if not answer["detected"]:
        found = "nothing"
    elif answer["abstained"]:
        found = "something, none of these"
    else:
        found = ", ".join(named) or f"one of {', '.join(answer['suspects'])}"
    return (
        each["hidden"],
        found,
        f"{value['value']:.4g}" if value else "",
        f"{value['ci95'][0]:.4g} to {value['ci95'][1]:.4g}" if value else "",
        f"{each['truth']:.4g}",
    )
