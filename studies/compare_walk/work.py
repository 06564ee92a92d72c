"""The work of `python -m studies.compare_walk`: read, walk, compare, name, write."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import pathlib
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.stats import f as f_distribution
from scipy.stats import t as t_distribution

from ranger_sim.boards.main_brain import controllers
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError, printable
from ranger_sim.plant import body_files
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.sysid import channels, inspection, losses, repairs, sanity
from ranger_sim.sysid.dataset import Array, Finding
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from ranger_sim.tools.recordings import datasets
from studies.compare_walk import emulate, figure, gait, hip_law, naming
from studies.compare_walk.candidates import BY_NAME

FALSE_ALARM = 0.01  # of a false difference
RESAMPLES = 2000
FEWEST = 2  # steady strides; a third and further ones make the intervals shorter
EXTENDED = ("extended-body.toml", "extended-model.toml", "extended-controller.toml")


def run(options: argparse.Namespace) -> int:
    """Compare; 0 alike, 1 different."""
    folder = writable_folder(options.out) if options.out else None
    json_file = json_target(options.json)
    console = terminal.for_progress(options)
    scenario = Scenario(
        controller=options.controller,
        body=options.body,
        model_file=options.model,
        slope_rad=options.slope,
        seed=options.seed,
    )
    measured, findings = read(options)
    emulator = emulate.Emulator(scenario, options.steps)
    with shown(terminal.ProgressLines(console, options)) as progress:
        answer = compare(options.log, measured, emulator, options.causes, progress)
    answer["data_findings"] = [sanity.as_json(each) for each in findings]
    if folder is not None:
        answer["files"] = write(answer, scenario, folder)
    text = json.dumps(answer, indent=1)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        show(answer, console)
    return 1 if answer["detected"] else 0


def read(options: argparse.Namespace) -> tuple[gait.Walk, list[Finding]]:
    """The measured walk, and remarks on its channels."""
    dataset = channels.named_for(datasets.open_with(options, options.log), "walk")
    for name in gait.CHANNELS:
        dataset[name]
    dataset.channels = {name: dataset.channels[name] for name in gait.CHANNELS}
    dataset.findings = [each for each in dataset.findings if each.channel in ("", *gait.CHANNELS)]
    findings = sanity.inspect(dataset)
    sanity.stop_if_fatal(options.log, findings)
    mended = repairs.mend(dataset, findings)
    losses.stop_if_too_many(mended, gait.CHANNELS, options.accept_loss)
    return gait.of_dataset(mended), findings


@contextlib.contextmanager
def shown(lines: terminal.ProgressLines) -> Iterator[Any]:
    """Shows which walk is walked: in one place of a screen, or in lines."""
    if not lines.console.is_terminal:
        yield lambda text: lines.show(f"walking: {text}")
        return
    with lines.console.status("walking ...") as status:
        yield lambda text: status.update(f"walking: {text}")


def compare(log: str, measured: gait.Walk, emulator: emulate.Emulator, causes: bool, progress: Any) -> dict[str, Any]:
    """The whole answer as it goes into JSON. UserError when either of the two does not walk enough."""
    every = measured.strides()
    chosen = gait.steady(every)
    if len(chosen) < FEWEST:
        raise UserError(
            f"{log}: {len(every)} whole strides, {len(chosen)} of one gait in a row; at least {FEWEST} are needed"
        )
    scatter, degrees = gait.scatter(chosen)
    progress("unchanged")
    walk = emulator.walk()
    walked = walk.strides()
    if walk.ended or len(walked) < emulator.settled + 2:
        raise UserError(
            f"the emulated robot has {len(walked)} whole strides and {walk.ended or 'stands'}: nothing to compare with"
        )
    walked = walked[-emulator.settled :]
    features = np.mean([each.features for each in walked], axis=0)
    answer: dict[str, Any] = {
        "log": printable(pathlib.Path(log).name),
        "controller": emulator.scenario.controller,
        "body": emulator.scenario.body,
        "model": emulator.scenario.model_file,
        "strides_s": [round(each.duration_s, 4) for each in every],
        "steady": [each.number for each in chosen],
        **misfit(chosen, features, scatter, degrees),
        "hip_makes_up_for": {
            "measured": hip_law_of(measured, emulator),
            "emulated": hip_law_of(walk, emulator),
            "parameter": controllers.load(emulator.scenario.controller).values["HD_H_SPRING"],
        },
        "causes": [],
        "trajectories": {
            "measured": [trajectory(each) for each in chosen],
            "emulated": [trajectory(each) for each in walked[-1:]],
        },
    }
    if causes:
        answer |= named(chosen, scatter, degrees, emulator, progress, answer["trajectories"])
    return answer


def hip_law_of(walk: gait.Walk, emulator: emulate.Emulator) -> dict[str, Any] | None:
    """The spring that the hip's motor compensates in a walk, with body and gains of the emulated one."""
    body = body_files.load(emulator.scenario.body).parameters
    law = hip_law.of_walk(walk, body, controllers.load(emulator.scenario.controller).values)
    return None if law is None else {**dataclasses.asdict(law), "ci95": list(law.ci95)}


def misfit(chosen: Sequence[gait.Stride], features: Array, scatter: Array, degrees: int) -> dict[str, Any]:
    """The differences, feature by feature and as a whole."""
    mean = np.mean([each.features for each in chosen], axis=0)
    error = scatter / math.sqrt(len(chosen))
    reach = float(t_distribution.ppf(0.975, degrees)) * error
    ratio = float(np.mean(((mean - features) / error) ** 2))
    rows = [
        {
            "channel": feature.name,
            "meaning": feature.meaning,
            "unit": feature.unit,
            "measured": float(mean[i]),
            "ci95": [float(mean[i] - reach[i]), float(mean[i] + reach[i])],
            "emulated": float(features[i]),
            "deviations": float((mean[i] - features[i]) / error[i]),
        }
        for i, feature in enumerate(gait.FEATURES)
    ]
    p = float(f_distribution.sf(ratio, len(features), degrees))
    return {"detected": p < FALSE_ALARM, "p": p, "misfit": rows}


def named(
    chosen: Sequence[gait.Stride],
    scatter: Array,
    degrees: int,
    emulator: emulate.Emulator,
    progress: Any,
    trajectories: dict,
) -> dict[str, Any]:
    """Causes fitted on every other steady stride, beginning with the first, and checked on the rest."""
    fitted = naming.Target.of(chosen[::2], scatter)
    held_out = naming.Target.of(chosen[1::2], scatter)
    found = naming.Search(emulator, fitted, held_out, progress=progress, degrees=degrees).run()
    progress("with all causes")
    strides = emulator.settled_strides(found.extended.values)
    trajectories["extended"] = [trajectory(each) for each in strides[-1:]]
    held = [each for each in chosen if each.number in held_out.strides]
    base = emulator.settled_strides({})
    return {
        "fitted_on": list(fitted.strides),
        "held_out": list(held_out.strides),
        "causes": [
            {
                "name": cause.candidate.cause,
                "at": cause.candidate.at,
                "meaning": cause.candidate.meaning,
                "parameters": {
                    cause.candidate.kind: {
                        "value": cause.value,
                        "ci95": list(cause.ci95),
                        "unit": cause.candidate.unit,
                    }
                },
                "tied_with": list(cause.tied_with),
                "look_at": inspection.look_at(cause.candidate.cause, cause.candidate.at),
            }
            for cause in found.causes
        ],
        "physical": found.physical,
        "abstained": not found.causes,
        "rounds": found.rounds,
        "stopped": found.stopped,
        "next_experiment": next_experiment(found, len(chosen)),
        "extended_features": [float(each) for each in found.extended.features],
        "gain": gain(found.base.features, found.extended.features, held_out, scatter, len(fitted.strides)),
        "trajectory_rms_rad": {
            "emulated": rms(base, held),
            "extended": rms(strides, held),
            "between_strides": rms(chosen[:1], chosen[1:]),
        },
    }


def next_experiment(found: naming.Answer, strides: int) -> list[str]:
    """The next measurements: promising candidates that are not named, then more of the same."""
    wanted = []
    for each in found.rounds:
        if not each["accepted"]:
            candidate = BY_NAME[each["best"]]
            hint = inspection.look_at(candidate.cause, candidate.at)
            value = f"{each['values'][candidate.name]:+.3g} {candidate.unit}"
            wanted.append(f"{candidate.name}, not named ({value}): {hint}")
    wanted.append(f"More strides of one gait: {4 * strides} in place of {strides} halve every interval.")
    return wanted


def gain(before: Array, after: Array, held_out: naming.Target, scatter: Array, fitted: int) -> dict[str, Any]:
    """The share of the avoidable squared misses at the held-out strides that the causes remove.

    The unavoidable part is that of a perfect model fitted to strides with this scatter. The interval is a bootstrap
    over the features: it shows how evenly the gain is spread over them, not the result for other strides.
    """
    first, second = held_out.misses(before) ** 2, held_out.misses(after) ** 2
    floor = np.full(len(first), 1.0 + len(held_out.strides) / fitted)
    random = generator(0, "compare-walk gain")
    shares = []
    for _ in range(RESAMPLES):
        rows = random.integers(0, len(first), len(first))
        able = float(np.sum(first[rows] - floor[rows]))
        if able > 0.0:
            shares.append(float(np.sum(first[rows] - second[rows])) / able)
    able = float(np.sum(first - floor))
    return {
        "fraction_of_achievable": float(np.sum(first - second)) / able if able > 0.0 else 0.0,
        "ci95": [float(each) for each in np.percentile(shares, [2.5, 97.5])] if shares else None,
        "holdout": f"strides {', '.join(map(str, held_out.strides))}",
        "misfit_before": float(first.sum()),
        "misfit_after": float(second.sum()),
    }


def rms(strides: Sequence[gait.Stride], others: Sequence[gait.Stride]) -> dict[str, float]:
    """Root mean square of the difference of the mean trajectories, state by state stretched to one length."""
    found = {}
    for name in ("hip_rad", "lean_rad"):
        first, second = (np.mean([getattr(each, name) for each in group], axis=0) for group in (strides, others))
        found[name.removesuffix("_rad")] = float(np.sqrt(np.mean((first - second) ** 2)))
    return found


def trajectory(stride: gait.Stride, most: int = 220) -> dict[str, Any]:
    """A stride for the plot: rounded, with a limited number of points."""
    every = max(1, -(-len(stride.time_s) // most))
    return {
        "stride": stride.number,
        "changes_s": [round(each - stride.changes_s[0], 4) for each in stride.changes_s],
        "time_s": [round(float(each), 4) for each in stride.time_s[::every]],
        "hip_rad": [round(float(each), 4) for each in stride.raw_hip_rad[::every]],
        "lean_rad": [round(float(each), 4) for each in stride.raw_lean_rad[::every]],
    }


def write(answer: dict[str, Any], scenario: Scenario, folder: pathlib.Path) -> list[str]:
    """The plot and the extended files; returns the names of all that is written, the answer's own file last."""
    replace_file(folder / "compare-walk.svg", figure.draw(answer).encode())
    written = ["compare-walk.svg"]
    changes = {f"{each['name']} at {each['at']}": next(iter(each["parameters"].values()))["value"]
               for each in answer["causes"]}  # fmt: skip
    for name in EXTENDED:
        (folder / name).unlink(missing_ok=True)  # of an earlier run
    with tempfile.TemporaryDirectory() as made:
        emulate.with_changes(scenario, changes, pathlib.Path(made))
        for name in EXTENDED:
            if (pathlib.Path(made) / name).exists():
                shutil.copy(pathlib.Path(made) / name, folder / name)
                written.append(name)
    answer["files"] = [*written, "answer.json"]
    replace_file(folder / "answer.json", (json.dumps(answer, indent=1) + "\n").encode())
    return answer["files"]


def show(answer: dict[str, Any], console: Console) -> None:
    """Print the answer."""
    extended = answer.get("extended_features") if answer["causes"] else None
    table = Table(
        title=f"{answer['log']}, strides {', '.join(map(str, answer['steady']))}, compared with {answer['controller']}"
    )
    heads = ("", "measured", "95 %", "emulated", *(("extended",) if extended else ()), "unit")
    for head in heads:
        table.add_column(head, justify="left" if head in ("", "unit") else "right")
    for i, row in enumerate(answer["misfit"]):
        low, high = row["ci95"]
        cells = [row["meaning"], f"{row['measured']:.3f}", f"{low:.3f} to {high:.3f}", f"{row['emulated']:.3f}"]
        table.add_row(*cells, *((f"{extended[i]:.3f}",) if extended else ()), row["unit"])
    console.print(table)
    many = len(answer["steady"])
    console.print(
        f"The walks {'differ' if answer['detected'] else 'do not differ'} by more than the scatter of {many} strides "
        f"(p {answer['p']:.2g}); {many} are few: intervals rest on their scatter, pooled over features of a unit.",
        highlight=False,
    )
    laws = [f"{name} {law['made_up_for_Nm_per_rad']:.1f} ({law['ci95'][0]:.1f} to {law['ci95'][1]:.1f})"
            for name in ("measured", "emulated") if (law := answer["hip_makes_up_for"][name])]  # fmt: skip
    if laws:
        console.print(
            f"In its pushes the hip's motor makes up for a spring of, N m/rad: {', '.join(laws)}; the emulated "
            f"controller's number is {answer['hip_makes_up_for']['parameter']:g}.",
            highlight=False,
        )
    if "stopped" not in answer:
        return
    for cause in answer["causes"]:
        value = next(iter(cause["parameters"].values()))
        tie = f"; not distinguished from {', '.join(cause['tied_with'])}" if cause["tied_with"] else ""
        console.print(
            f"{cause['name']} at {cause['at']}: {value['value']:+.3g} {value['unit']} "
            f"({value['ci95'][0]:+.3g} to {value['ci95'][1]:+.3g}), {cause['meaning']}{tie}",
            highlight=False,
        )
    if not answer["causes"]:
        console.print("No cause is named.", highlight=False)
    console.print(f"Then: {answer['stopped']}.", highlight=False)
    won = answer["gain"]
    console.print(
        f"On {won['holdout']}, held out, the squared misses fall from {won['misfit_before']:.0f} to "
        f"{won['misfit_after']:.0f}: {100.0 * won['fraction_of_achievable']:.0f} % of what can be achieved.",
        highlight=False,
    )
    if answer["causes"] and not answer["physical"]:
        console.print("The rest is more than scatter: the values are not physical yet.", highlight=False)
