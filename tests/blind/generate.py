"""Makes blind cases: `python -m tests.blind.generate --experiment motor-bench --count 60 --seed N --out DIR`.

    DIR/data/cases.json       [{"id", "experiment", "files", "holdout"}], nothing else
    DIR/data/ID/a.csv, b.csv  measured; b is held out
    DIR/truth/ID.json         what is hidden there, for the scorer alone (another folder by --truth)

Without --seed one is drawn and printed; the same seed gives the same files. --slice makes a part of the cases, by their
numbers in the truth: 17, or 80:160.
"""

import argparse
import json
import os
import pathlib
import sys

from tests.blind.generator.ankle import ANKLE
from tests.blind.generator.experiment import STRENGTHS
from tests.blind.generator.leg_swing import LEG_SWING
from tests.blind.generator.motor_bench import MOTOR_BENCH
from tests.blind.generator.walk import WALK

SHORTEST_S, LONGEST_S = 1.0, 60.0  # the first half second stands still; longer ones want more memory than a batch may
EXPERIMENTS = {experiment.NAME: experiment for experiment in (MOTOR_BENCH, LEG_SWING, ANKLE, WALK)}


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m tests.blind.generate", description=__doc__.splitlines()[0])
    parser.add_argument("--experiment", choices=EXPERIMENTS, default="motor-bench")
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, help="drawn from the system when left out")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--truth", type=pathlib.Path, help="folder of the truth (default OUT/truth)")
    parser.add_argument("--check", action="store_true", help="the cases of continuous integration, whatever --count")
    parser.add_argument("--seconds", type=float, help="length of a run (default 20)")
    parser.add_argument("--kinds", help="only these, by comma: single,null,pair,outside,confusable")
    parser.add_argument("--causes", help="only these causes as single effects and in pairs, by comma")
    parser.add_argument("--strength", type=float, choices=STRENGTHS, help="of every single effect")
    parser.add_argument("--slice", help="only the cases with these numbers: NUMBER, or FIRST:END")
    options = parser.parse_args(arguments)
    experiment = EXPERIMENTS[options.experiment]
    if options.seconds is not None:
        if not SHORTEST_S <= options.seconds <= LONGEST_S:
            parser.error(f"--seconds {options.seconds:g}: allowed are {SHORTEST_S:g} to {LONGEST_S:g}")
        try:
            experiment = experiment.lasting(options.seconds)
        except ValueError as error:
            parser.error(f"--seconds: {error}")
    kinds = options.kinds.split(",") if options.kinds else [kind for kind, _ in experiment.MIX]
    causes = options.causes.split(",") if options.causes else list(experiment.CAUSES)
    for wanted, known in ((kinds, dict(experiment.MIX)), (causes, experiment.CAUSES)):
        for name in wanted:
            if name not in known:
                parser.error(f"{name!r} is not one of {', '.join(known)}")
    seed = int.from_bytes(os.urandom(4), "big") if options.seed is None else options.seed
    cases = experiment.check_plan(seed) if options.check else experiment.plan(seed, options.count, kinds, causes)
    if options.strength:
        for case in cases:
            if case.kind == "single":
                case.effects = [(name, options.strength) for name, _ in case.effects]
    if options.slice:
        first, colon, end = options.slice.partition(":")
        if not first.isdigit() or not (end.isdigit() if colon else True):
            parser.error(f"--slice {options.slice}: NUMBER or FIRST:END")
        chosen = range(int(first), int(end) if colon else int(first) + 1)
        cases = [case for case in cases if case.number in chosen]
    print(f"blind cases: experiment {options.experiment}, count {len(cases)}, seed {seed}", flush=True)
    data, truth = options.out / "data", options.truth or options.out / "truth"
    if data.exists():
        parser.error(f"{data} is there already")
    data.mkdir(parents=True)
    truth.mkdir(parents=True, exist_ok=True)
    public = []
    said = (lambda text: print(text, file=sys.stderr, flush=True)) if sys.stderr.isatty() else (lambda text: None)
    for key, files, holdout, hidden in experiment.generate(seed, cases, data, said):
        (truth / f"{key}.json").write_text(json.dumps(hidden, indent=1), encoding="utf-8")
        public.append({"id": key, "experiment": options.experiment, "files": files, "holdout": holdout})
    (data / "cases.json").write_text(json.dumps(public, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
