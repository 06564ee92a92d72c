"""Answers to blind cases: `python -m tests.blind.answers --data DIR/data --by NAME --out ANSWERS [--processes N]`.

NAME: a comparator (tests/blind/comparators.py) or module:function, called with (files, holdout, experiment), which
returns what `ranger-sim diagnose --json` writes. A case on which it raises has no answer; ANSWERS/errors.txt says why.
"""

import argparse
import concurrent.futures
import importlib
import json
import multiprocessing
import pathlib
import traceback

from ranger_sim import diagnose
from tests.blind.comparators import COMPARATORS


def diagnosis(files, holdout, experiment):
    """What `ranger-sim diagnose --json` writes."""
    return diagnose(files, experiment, holdout=holdout).to_dict()


def method(name):
    """The function of that name."""
    if ":" not in name:
        return COMPARATORS[name]
    module, _, function = name.partition(":")
    return getattr(importlib.import_module(module), function)


def answer(name, data, case):
    """(id, answer or None, what went wrong). case: an entry of cases.json."""
    try:
        files, holdout = ([str(data / path) for path in case[role]] for role in ("files", "holdout"))
        return case["id"], json.loads(json.dumps(method(name)(files, holdout, case["experiment"]))), ""
    except Exception:
        return case["id"], None, traceback.format_exc()


def answer_all(name, data, out, processes=1, holdout=True, only=None):
    """Answers every case of a folder, or those with an id in `only`; returns {id: answer}.

    holdout: False keeps the held-out files back.
    """
    out.mkdir(parents=True, exist_ok=True)
    cases = json.loads((data / "cases.json").read_text(encoding="utf-8"))
    cases = [case for case in cases if only is None or case["id"] in only]
    if not holdout:
        cases = [case | {"holdout": []} for case in cases]
    answers, errors = {}, []
    if processes > 1:
        context = multiprocessing.get_context("spawn")
        with concurrent.futures.ProcessPoolExecutor(processes, mp_context=context) as pool:
            done = list(pool.map(answer, [name] * len(cases), [data] * len(cases), cases))
    else:
        done = [answer(name, data, case) for case in cases]
    for key, said, error in done:
        if said is None:
            errors.append(f"{key}\n{error}")
            continue
        answers[key] = said
        (out / f"{key}.json").write_text(json.dumps(said, indent=1), encoding="utf-8")
    (out / "errors.txt").write_text("\n".join(errors), encoding="utf-8")
    return answers


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m tests.blind.answers", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--by", required=True, help=f"{', '.join(COMPARATORS)} or module:function")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--no-holdout", action="store_true", help="keep the held-out files back")
    parser.add_argument("--only", nargs="+", metavar="ID", help="these cases")
    options = parser.parse_args(arguments)
    if ":" not in options.by and options.by not in COMPARATORS:
        parser.error(f"--by {options.by}: there are {', '.join(COMPARATORS)}, or module:function")
    answers = answer_all(options.by, options.data, options.out, options.processes, not options.no_holdout, options.only)
    print(f"{len(answers)} answers, errors in {options.out / 'errors.txt'}")


if __name__ == "__main__":
    main()
