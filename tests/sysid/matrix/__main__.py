"""The matrix: sound recordings and hidden effects in cells of how a recording was made.

    python -m tests.sysid.matrix --out matrix.json --sound 2 --effects 1 --jobs 2
    python -m tests.sysid.matrix --out matrix.json --cells "axis held" --sound 20
    python -m tests.sysid.matrix --out matrix.json

Answers are kept in the file one by one: the same command goes on where a run was interrupted, and a larger number
adds to what is there. Without --sound and --effects it prints the tables of the file. A cell is chosen when its name
has every word of one --cells. The seed is drawn by the system for a new file, printed, and kept in it; a case's seed is
that and its number.
"""

import argparse
import concurrent.futures
import dataclasses
import json
import multiprocessing
import os
import pathlib
import sys

from tests.sysid.matrix import tables
from tests.sysid.matrix.bodies import HIDDEN
from tests.sysid.matrix.cases import STRENGTHS
from tests.sysid.matrix.cells import CELLS
from tests.sysid.matrix.judged import answer


def chosen(patterns):
    """Cells that have all words of a pattern; all cells without one."""
    return [
        each for each in CELLS if not patterns or any(set(one.split()) <= set(each.name.split()) for one in patterns)
    ]


def wanted(cells, seed, sound, effects, strengths, only):
    """{key: arguments of `answer`}, sound ones first, all cells' first case before any second."""
    found = {}
    for number in range(sound):
        for cell in cells:
            found[f"{cell.name} | sound | {number}"] = (dataclasses.astuple(cell), seed + number)
    for number in range(effects):
        for cell in cells:
            for name in HIDDEN[cell.machine]:
                for strength in strengths if name in (only or name) else ():
                    key = f"{cell.name} | {name} {strength:g} | {number}"
                    found[key] = (dataclasses.astuple(cell), seed + number, name, strength)
    return found


def run(path, kept, cases, jobs):
    """Answers what the file does not have; each answer is written at once."""
    missing = {key: each for key, each in cases.items() if key not in kept["answers"]}
    for number, (key, found) in enumerate(answered(missing, jobs), start=1):
        kept["answers"][key] = found
        save(path, kept)
        sys.stdout.write(f"{number} of {len(missing)}: {key}: {tables.short(found)}\n")
        sys.stdout.flush()


def answered(cases, jobs):
    """(key, answer) of each case as it is ready, from so many processes."""
    if jobs == 1:
        yield from ((key, answer(*each)) for key, each in cases.items())
        return
    with concurrent.futures.ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        asked = {pool.submit(answer, *each): key for key, each in cases.items()}
        for done in concurrent.futures.as_completed(asked):
            yield asked[done], done.result()


def save(path, kept):
    """The whole file anew, so that an interruption leaves the old one or the new one."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(kept, indent=0), encoding="utf-8")
    os.replace(new, path)


def main(arguments=None):
    options = argparse.ArgumentParser(
        prog="python -m tests.sysid.matrix", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--out", type=pathlib.Path, required=True, help="file of the answers")
    options.add_argument("--cells", action="append", default=[], help="words of a cell's name; may be repeated")
    options.add_argument("--sound", type=int, default=0, help="sound cases of each cell")
    options.add_argument("--effects", type=int, default=0, help="cases of each cell, effect and strength")
    options.add_argument("--strengths", type=float, nargs="+", default=STRENGTHS)
    options.add_argument("--only", default="", help="effects of this name only")
    options.add_argument("--jobs", type=int, default=1, help="processes")
    options.add_argument("--seed", type=int, help="of a new file; drawn when left out")
    given = options.parse_args(arguments)
    cells = chosen(given.cells)
    if not cells:
        options.error(f"--cells {given.cells}: no cell has these words, such as {CELLS[0].name!r}")
    if given.out.exists():
        kept = json.loads(given.out.read_text(encoding="utf-8"))
        if given.seed not in (None, kept["seed"]):
            options.error(f"--seed {given.seed}: {given.out} has answers of seed {kept['seed']}")
    else:
        kept = {"seed": int.from_bytes(os.urandom(3), "big") if given.seed is None else given.seed, "answers": {}}
    sys.stdout.write(f"matrix: seed {kept['seed']}, {len(cells)} of {len(CELLS)} cells\n")
    cases = wanted(cells, kept["seed"], given.sound, given.effects, given.strengths, given.only)
    if cases:
        run(given.out, kept, cases, given.jobs)
    sys.stdout.write(tables.markdown(list(kept["answers"].values())))


if __name__ == "__main__":
    main()
