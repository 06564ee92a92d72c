"""How often the 95 % interval of a rightly named cause holds its true value, cause by cause.

    python -m tests.sysid.coverage --out coverage.json --seeds 20
    python -m tests.sysid.coverage --out coverage.json --seeds 20 --only cable_backlash --jobs 2

Sources: the hidden effects of three users' machines (`hidden_effects`) and blind cases of one effect at a strength of 4
(`tests.blind`) on the motor bench, the leg and the ankle. Answers are kept in the file one by one, and the same command
goes on where a run was interrupted; the first seed is drawn for a new file, and printed. Without --seeds it prints the
table. A rate is meant to be 90 to 98 %; its own interval (Clopper and Pearson) says what so many cases can show.
"""

import argparse
import collections
import concurrent.futures
import dataclasses
import json
import multiprocessing
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

from tests.blind.answers import answer
from tests.blind.generate import EXPERIMENTS
from tests.blind.score import Answer, share_interval
from tests.sysid.hidden_effects import CASES
from tests.sysid.matrix.__main__ import save

BLIND = ("motor-bench", "leg-swing", "ankle")
LOW, HIGH = 0.90, 0.98  # of the target
ENOUGH = 50  # intervals: fewer keep no target, and may miss one


def of_machine(title, seed):
    """A record of a hidden effect."""
    case = next(each for each in CASES if each.title == title)
    result = case.found(seed).result
    first = case.named(result)
    found = first.parameters.get(case.coefficient) if first is not None else None
    return _record(title, result.detected, first is not None, found and (found.value, found.ci95), case.true)


def of_blind(experiment, cause, seed):
    """A record of one blind case."""
    with tempfile.TemporaryDirectory(prefix="blind-") as folder:
        made = [sys.executable, "-m", "tests.blind.generate", "--experiment", experiment, "--kinds", "single"]
        made += ["--causes", cause, "--strength", "4", "--count", "1", "--seed", str(seed), "--out", folder]
        subprocess.run(made, check=True, stdout=subprocess.DEVNULL)
        (case,) = json.loads((pathlib.Path(folder) / "data" / "cases.json").read_text(encoding="utf-8"))
        (truth,) = [json.loads(each.read_text(encoding="utf-8")) for each in (pathlib.Path(folder) / "truth").iterdir()]
        _, said, error = answer("tests.blind.answers:diagnosis", pathlib.Path(folder) / "data", case)
    if said is None:
        return {"what": f"{experiment} {cause}", "failed": error}
    given, hidden = Answer(said), truth["causes"][0]
    parameter, true = next(iter(hidden["parameters"].items()), ("", 0.0))
    right = given.names()[:1] == [cause]
    return _record(
        f"{experiment} {cause}", given.detected, right, given.parameter(cause, parameter) if right else None, true
    )


def _record(what, detected, right, found, true):
    record = {"what": what, "detected": detected, "right": right}
    if found and found[1] is not None:
        record |= {"value": found[0], "ci95": list(found[1]), "true": true}
    return record


def wanted(first, seeds, only):
    """{key: (function, its arguments)}, the first seed of everything before any second."""
    found = {}
    for seed in range(first, first + seeds):
        for case in CASES:
            if case.names and only in case.title:
                found[f"{case.title} {seed}"] = (of_machine, case.title, seed)
        for experiment in BLIND:
            for cause in EXPERIMENTS[experiment].CAUSES:
                if only in f"{experiment} {cause}":
                    found[f"{experiment} {cause} {seed}"] = (of_blind, experiment, cause, seed)
    return found


@dataclasses.dataclass
class Row:
    """Counts of one cause."""

    cases: int = 0
    detected: int = 0
    right: int = 0
    intervals: int = 0
    held: int = 0
    errors: list = dataclasses.field(default_factory=list)

    def add(self, record):
        self.cases += 1
        self.detected += record["detected"]
        self.right += record["right"]
        if "ci95" in record:
            low, high = record["ci95"]
            self.intervals += 1
            self.held += low <= record["true"] <= high
            self.errors.append(abs(record["value"] / record["true"] - 1.0) if record["true"] else 0.0)

    def cells(self):
        shown = [
            f"{self.detected} of {self.cases}",
            f"{self.right} of {self.cases}",
            f"{self.held} of {self.intervals}",
        ]
        if not self.intervals:
            return [*shown[:2], "", "", "", ""]
        low, high = share_interval(self.held, self.intervals)
        verdict = "kept" if self.held / self.intervals >= LOW and self.intervals >= ENOUGH else "open"
        verdict = "**missed**" if high < LOW or low > HIGH else verdict
        return [*shown, f"{low:.0%} to {high:.0%}", verdict, f"{statistics.median(self.errors):.1%}"]


def markdown(records):
    rows = collections.defaultdict(Row)
    for each in records:
        if "failed" not in each:
            rows[each["what"]].add(each)
            rows["all"].add(each)
    lines = ["| cause | detected | named first | interval holds | of all cases, 95 % | 90 to 98 % | error, median |"]
    lines.append("|---" * 7 + "|")
    lines += [f"| {what} | {' | '.join(row.cells())} |" for what, row in rows.items() if what != "all"]
    if rows:
        lines.append(f"| all | {' | '.join(rows['all'].cells())} |")
    failed = collections.Counter(each["what"] for each in records if "failed" in each)
    lines += [f"{what}: {count} without an answer" for what, count in failed.items()]
    return "\n".join(lines) + "\n"


def main(arguments=None):
    options = argparse.ArgumentParser(
        prog="python -m tests.sysid.coverage", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=pathlib.Path, required=True, help="file of the answers")
    options.add_argument("--seeds", type=int, default=0, help="of each cause")
    options.add_argument("--only", default="", help="causes with this in their name")
    options.add_argument("--jobs", type=int, default=1, help="processes")
    given = options.parse_args(arguments)
    if given.out.exists():
        kept = json.loads(given.out.read_text(encoding="utf-8"))
    else:
        kept = {"seed": int.from_bytes(os.urandom(3), "big"), "answers": {}}
    sys.stdout.write(f"coverage: first seed {kept['seed']}\n")
    cases = wanted(kept["seed"], given.seeds, given.only)
    missing = {key: each for key, each in cases.items() if key not in kept["answers"]}
    if missing:
        with concurrent.futures.ProcessPoolExecutor(
            given.jobs, mp_context=multiprocessing.get_context("spawn")
        ) as pool:
            asked = {pool.submit(*each): key for key, each in missing.items()}
            for done in concurrent.futures.as_completed(asked):
                kept["answers"][asked[done]] = done.result()
                save(given.out, kept)
    sys.stdout.write(markdown(list(kept["answers"].values())))


if __name__ == "__main__":
    main()
