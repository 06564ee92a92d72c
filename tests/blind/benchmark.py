"""The benchmark: `python -m tests.blind.benchmark --experiment motor-bench --cases 1000 --seed N --jobs 2 --out DIR`.

    DIR/run.json              experiment, cases, seed: the same command goes on where a run was interrupted
    DIR/truth/ID.json         what was hidden
    DIR/answers/METHOD/ID.json, ID.txt    an answer, or why there is none
    DIR/table.txt, table.md   figures, methods side by side, and which causes are missed or misnamed
    DIR/score.json            the figures by method, for a program

The generator and each diagnosis run in processes of their own. Measured data lie in a folder of their own elsewhere and
are gone when they are answered; `tests.blind.generate` with the same seed and --count makes them again.

Fixed, as a benchmark of system identification fixes it: a.csv of a case is the training run, b.csv the test run, with
another trajectory, supply, room and state of warming (experiment.py `prepare`). Both begin at rest: the first 0.5 s
(excitation.py STILL_S) are the window in which initial states may be estimated; no other sample of b.csv may serve for
anything but the gain.
"""

import argparse
import concurrent.futures
import dataclasses
import importlib.util
import json
import multiprocessing
import os
import pathlib
import subprocess
import sys
import tempfile

from tests.blind import confusion
from tests.blind.answers import answer
from tests.blind.comparators import COMPARATORS, NEEDS
from tests.blind.generate import EXPERIMENTS
from tests.blind.generator.experiment import BATCH
from tests.blind.score import read_folder, score, table

DIAGNOSIS = "tests.blind.answers:diagnosis"
ANCHOR = (
    "Published for another task (the competition of DX 2025 on the LiU-ICE engine, 25 cycles at 20 Hz): the winner "
    "detected 87 % at no false alarm, with 73.8 % mean probability on the right fault; on an unseen cycle 100 % and "
    "66.2 %."
)


@dataclasses.dataclass(frozen=True)
class Method:
    """A name for tables, and what `tests.blind.answers` calls it."""

    name: str
    call: str


def methods_of(names):
    """([Method], [sentences on those that cannot run here])."""
    chosen, left_out = [], []
    for name in names:
        call = DIAGNOSIS if name == "diagnosis" else name
        library, package = NEEDS.get(call, ("", ""))
        if library and importlib.util.find_spec(library) is None:
            left_out.append(f"{name}: not run, {package} is not installed (pip install --group comparators)")
        else:
            chosen.append(Method(name.replace(":", "."), call))
    return chosen, left_out


class Benchmark:
    """One run in its folder. seconds: length of the recordings, None for the experiment's own."""

    def __init__(self, folder, experiment, cases, seed, methods, seconds=None):
        self.folder, self.experiment, self.cases, self.seed, self.methods = folder, experiment, cases, seed, methods
        self.seconds = seconds
        self.truth, self.answers = folder / "truth", folder / "answers"

    def open(self):
        """Makes the folder, or checks that it is of this run. ValueError when it is of another."""
        said = {"experiment": self.experiment, "cases": self.cases, "seed": self.seed, "seconds": self.seconds}
        path = self.folder / "run.json"
        if path.exists():
            was = json.loads(path.read_text(encoding="utf-8"))
            if was != said:
                raise ValueError(f"{self.folder} holds another run: {was}")
        for each in (self.truth, *(self.answers / method.name for method in self.methods)):
            each.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(said), encoding="utf-8")

    def parts(self):
        """(first, end) of the parts that are made at once."""
        return [(first, min(first + BATCH, self.cases)) for first in range(0, self.cases, BATCH)]

    def is_done(self, part):
        """Whether every method has said something on each case of a part."""
        known = {truth["number"]: key for key, truth in read_folder(self.truth).items()}
        keys = [known.get(number) for number in range(*part)]
        return all(key and self.has(method, key) for key in keys for method in self.methods)

    def has(self, method, key):
        folder = self.answers / method.name
        return (folder / f"{key}.json").exists() or (folder / f"{key}.txt").exists()

    def generation(self, part, folder):
        """The command that makes a part's data; the truth goes where no diagnosis is told of."""
        command = [sys.executable, "-m", "tests.blind.generate", "--experiment", self.experiment]
        command += ["--count", str(self.cases), "--seed", str(self.seed), "--slice", f"{part[0]}:{part[1]}"]
        command += ["--seconds", str(self.seconds)] if self.seconds else []
        return [*command, "--out", str(folder), "--truth", str(self.truth)]

    def generate(self, part, folder):
        """Folder with the data of a part, made by another process."""
        subprocess.run(self.generation(part, folder), check=True, stdout=subprocess.DEVNULL)
        return folder / "data"

    def run(self, jobs, tell):
        """Every part that is not done yet, `jobs` diagnoses at once."""
        missing = [part for part in self.parts() if not self.is_done(part)]
        if missing:
            self.in_processes(missing, jobs, tell)

    def in_processes(self, missing, jobs, tell):
        """Has `missing` parts answered by a pool of processes."""
        context = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(jobs, mp_context=context) as pool:
            self.answer(missing, pool, tell)

    def answer(self, missing, pool, tell):
        """Parts one after the other, so that only the data of one are there at a time."""
        for part in missing:
            with tempfile.TemporaryDirectory(prefix="blind-") as folder:
                data = self.generate(part, pathlib.Path(folder))
                cases = json.loads((data / "cases.json").read_text(encoding="utf-8"))
                asked = {
                    pool.submit(answer, method.call, data, case): method
                    for method in self.methods
                    for case in cases
                    if not self.has(method, case["id"])
                }
                for done in concurrent.futures.as_completed(asked):
                    self.keep(asked[done], *done.result())
            tell(f"{part[1]} of {self.cases} cases")

    def keep(self, method, key, said, error):
        """Stores an answer at once, or why there is none."""
        path = self.answers / method.name / f"{key}.{'txt' if said is None else 'json'}"
        path.write_text(error if said is None else json.dumps(said, indent=1), encoding="utf-8")

    def results(self):
        """{method's name: (figures, answers)} and the truths."""
        truths = read_folder(self.truth)
        answers = {method.name: read_folder(self.answers / method.name) for method in self.methods}
        return {name: (score(truths, each), each) for name, each in answers.items()}, truths

    def write(self, left_out):
        """The tables; returns the text."""
        results, truths = self.results()
        head = f"{self.experiment}, {len(truths)} cases, seed {self.seed}"
        first = next(iter(results))
        text = [head, "", f"== {first}", table(results[first][0]), "", confusion.text(truths, results[first][1])]
        text += ["", "== side by side", side_by_side({name: figures for name, (figures, _) in results.items()})]
        text += ["", *left_out, ANCHOR]
        pages = [side_by_side({name: figures for name, (figures, _) in results.items()})]
        pages += ["", confusion.markdown(truths, results[first][1]), "", *left_out, ANCHOR]
        (self.folder / "table.txt").write_text("\n".join(text) + "\n", encoding="utf-8")
        (self.folder / "table.md").write_text("\n".join([head, "", *pages]) + "\n", encoding="utf-8")
        figures = {name: [dataclasses.asdict(figure) for figure in each] for name, (each, _) in results.items()}
        (self.folder / "score.json").write_text(json.dumps(figures, indent=1), encoding="utf-8")
        return "\n".join(text)


def side_by_side(figures):
    """Markdown: a row for each figure, the first method with its interval, the others beside it."""
    first, *others = figures
    lines = [f"| figure | cases | target | {' | '.join((first, '95 % interval', *others))} |"]
    lines.append("|---|---|---|" + "---|" * (2 + len(others)))
    rivals = [{figure.name: figure for figure in figures[name]} for name in others]
    for figure in figures[first]:
        target = ""
        if figure.target is not None:
            target = f"{'>=' if figure.at_least else '<='} {figure.target:g}"
        interval = "" if figure.value is None else f"{figure.low:.3f} to {figure.high:.3f}"
        value = _value(figure) + (" **missed**" if figure.meets is False else "")
        cells = (figure.name, str(figure.cases), target, value, interval, *(_value(r[figure.name]) for r in rivals))
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _value(figure):
    return "" if figure.value is None else f"{figure.value:.3f}"


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m tests.blind.benchmark", description=__doc__.splitlines()[0])
    parser.add_argument("--experiment", choices=EXPERIMENTS, default="motor-bench")
    parser.add_argument("--cases", type=int, default=1000)
    parser.add_argument("--seconds", type=float, help="length of a recording (default: the experiment's own)")
    parser.add_argument("--seed", type=int, help="drawn from the system when left out; of an interrupted run its own")
    parser.add_argument("--jobs", type=int, default=1, help="diagnoses at once")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    every = ["diagnosis", *COMPARATORS]
    parser.add_argument(
        "--methods", default=",".join(every), help=f"of {', '.join(every)}, or module:function, by comma"
    )
    options = parser.parse_args(arguments)
    if options.cases < 1 or options.jobs < 1:
        parser.error("--cases and --jobs: 1 or more")
    for name in options.methods.split(","):
        if ":" not in name and name not in every:
            parser.error(f"--methods {name}: there are {', '.join(every)}, or module:function")
    methods, left_out = methods_of(options.methods.split(","))
    if not methods:
        parser.error("; ".join(left_out))
    seed, was = options.seed, options.out / "run.json"
    if seed is None:
        seed = json.loads(was.read_text())["seed"] if was.exists() else int.from_bytes(os.urandom(4), "big")
    benchmark = Benchmark(options.out, options.experiment, options.cases, seed, methods, options.seconds)
    try:
        benchmark.open()
    except ValueError as error:
        parser.error(str(error))
    print(f"blind benchmark: experiment {options.experiment}, cases {options.cases}, seed {seed}", flush=True)
    said = (lambda text: print(text, file=sys.stderr, flush=True)) if sys.stderr.isatty() else (lambda text: None)
    benchmark.run(options.jobs, said)
    print(benchmark.write(left_out))


if __name__ == "__main__":
    main()
