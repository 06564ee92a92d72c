"""`python -m dev.mutate PACKAGE ...`: the share of small faults in a package that its tests notice.

Of all faults that `mutants.py` can put into the package's files, COUNT are drawn with a seed, put one at a time
into a copy of the repository, and the tests of the package that reach the place are run there, interpreted and cheapest
first. Where the robot is built, a mutant in a plain Python module is tried with all else compiled; with --build, one
in a compiled module that the interpreted tests let pass is built and given to the compiled ones. Verdicts are kept in
the work folder: a run that was broken off goes on where it was, and a larger count goes on from a smaller one.
Survivors are printed with their place and difference; "not within the limit": tests that reach it were left out.

A verdict holds for the tests of its time. `--again` tries mutants that were not killed once more.
"""

import argparse
import json
import pathlib
import sys
from collections import Counter
from typing import Any

from dev.mutate.mutants import Mutant
from dev.mutate.work import (
    KILLED,
    TIMEOUT,
    Built,
    Copy,
    Known,
    Results,
    TestsOf,
    Verdict,
    all_mutants,
    judge,
    judge_built,
    known,
    reach_of,
    sample,
)
from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import CHECKOUT, PACKAGE, packages
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import whole_number

COMMAND = "python -m dev.mutate"
COUNT = 30
LIMIT_S = 60.0
MAP_LIMIT_S = 900
NOTICED = (KILLED, TIMEOUT)
# Tests of a package that are elsewhere, because they use another package's interface.
ALSO = {
    "datatable": ("tests/ranger/test_requests.py", "tests/tools/robodaq/test_robodaq.py"),
    "can_bus": ("tests/dev/fuzz/test_can.py", "tests/tools/buses/test_bus.py"),
    "plant": ("tests/oracle/test_known_answers.py",),
    "harness": ("tests/ranger",),
    "sysid": ("tests/blind/test_generator.py", "tests/tools/diagnose/test_bad_data.py", "tests/tools/test_identify.py"),
}
# Walks, which finish in time only compiled; there they are among the tests tried.
WALKS = {
    "can_bus": ("tests/oracle", "tests/system/test_walking.py"),
    "plant": ("tests/oracle", "tests/system/test_walking.py"),
    "harness": ("tests/oracle", "tests/system"),
    "ranger": ("tests/oracle", "tests/system"),
}


def parser() -> argparse.ArgumentParser:
    """The options."""
    command = argparse.ArgumentParser(
        prog=COMMAND, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.add_argument("package", nargs="+", choices=packages(), metavar="PACKAGE", help=", ".join(packages()))
    command.add_argument(
        "--count", type=whole_number(1), default=COUNT, metavar="N", help=f"mutants of each package (default {COUNT})"
    )
    command.add_argument("--seed", type=int, default=1, metavar="S", help="draws them (default 1)")
    command.add_argument(
        "--tests",
        action="append",
        default=[],
        metavar="PATH",
        help="tests to run (default: tests/PACKAGE and the package's tests elsewhere)",
    )
    command.add_argument(
        "--limit",
        type=whole_number(1),
        default=int(LIMIT_S),
        metavar="S",
        help=f"of the tests that reach a mutant, run the cheapest, this many seconds in total (default {LIMIT_S:g})",
    )
    command.add_argument(
        "--build",
        type=whole_number(1),
        metavar="S",
        help="unnoticed mutants of a compiled module: build each, and run this many seconds of compiled tests",
    )
    command.add_argument(
        "--map-limit",
        type=whole_number(1),
        default=MAP_LIMIT_S,
        metavar="S",
        help=f"a file of tests that lasts longer while it is mapped takes no part (default {MAP_LIMIT_S})",
    )
    command.add_argument(
        "--work",
        type=pathlib.Path,
        default=(CHECKOUT or pathlib.Path()) / "build" / "mutate",
        metavar="DIR",
        help="copy, map of the tests and verdicts (default build/mutate)",
    )
    command.add_argument(
        "--at",
        action="append",
        default=[],
        metavar="FILE:LINE",
        help="instead of drawing: every mutant of this line",
    )
    command.add_argument("--again", action="store_true", help="try what was not noticed once more")
    command.add_argument("--json", metavar="FILE|-", help="the figures as JSON; - prints them and nothing else")
    return command


def main(arguments: list[str] | None = None) -> int:
    """Run the mutants; 0 when every one was noticed or is known to be equivalent, 1 otherwise, 2 for a user's fault."""
    options = parser().parse_args(arguments)
    try:
        return run(options)
    except UserError as mistake:
        print(f"{COMMAND}: {mistake}", file=sys.stderr)
        return 2


def run(options: argparse.Namespace) -> int:
    """The same with options that are right."""
    json_file = json_target(options.json)
    say = (lambda _text: None) if options.json == "-" else (lambda text: print(text, flush=True))
    listed = known()
    options.work.mkdir(parents=True, exist_ok=True)
    copy = Copy(options.work / "copy")
    found = {}
    for package in dict.fromkeys(options.package):
        found[package] = of_package(options, copy, package, listed, say)
    text = json.dumps({"seed": options.seed, "mutate": found}, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        print(text)
    return 1 if any(each["survivors"] for each in found.values()) else 0


def of_package(options: argparse.Namespace, copy: Copy, package: str, listed: list[Known], say: Any) -> dict:
    """Figures of one package, after all its mutants of this run have a verdict."""
    equivalent = {each.key for each in listed}
    every = all_mutants(package)
    drawn = sample(every, package, options.count, options.seed)
    if options.at:
        drawn = [mutant for mutant in every if f"{mutant.path}:{mutant.line}" in options.at]
    results = Results(options.work / f"verdicts-{package}.jsonl")
    wanted = options.tests or [f"tests/{package}", *ALSO.get(package, ())]

    def keep(mutant: Mutant, verdict: Verdict) -> None:
        results.add(verdict)
        by = f"  by {verdict.by}" if verdict.by else ""
        say(f"{verdict.outcome:11} {verdict.seconds:6.1f} s  {mutant.path}:{mutant.line} {mutant.operator}{by}")

    def is_open(mutant: Mutant) -> bool:
        old = results.verdicts.get(mutant.key)
        return mutant.key not in equivalent and (old is None or (options.again and old.outcome not in NOTICED))

    drawn_open = [mutant for mutant in drawn if is_open(mutant)]
    maps: dict[bool, TestsOf] = {}
    for compiled in (False, True):
        of_mode = [mutant for mutant in drawn_open if copy.runs_compiled(mutant) == compiled]
        build_later = compiled and options.build and len(of_mode) < len(drawn_open)
        if not of_mode and not build_later:
            continue
        paths = [*wanted, *WALKS.get(package, ())] if compiled and not options.tests else wanted
        with copy.server(paths, compiled) as ask:
            maps[compiled] = reach_of(copy, ask, package, paths, options.map_limit, say)
            for mutant in of_mode:
                keep(mutant, judge(copy, ask, mutant, maps[compiled], options.limit))
    if options.build and False in maps:
        built = Built(options.work / "built")
        for mutant in drawn_open:
            if not copy.runs_compiled(mutant) and results.verdicts[mutant.key].outcome not in NOTICED:
                keep(mutant, judge_built(built, mutant, maps[False], maps[True], options.build))
    return summarised(package, every, drawn, results, equivalent, say)


def summarised(
    package: str, every: list[Mutant], drawn: list[Mutant], results: Results, equivalent: set[str], say: Any
) -> dict:
    """Count the verdicts and print the survivors."""
    counts = Counter("equivalent" if each.key in equivalent else results.verdicts[each.key].outcome for each in drawn)
    judged = len(drawn) - counts["equivalent"]
    noticed = sum(counts[outcome] for outcome in NOTICED)
    rate = noticed / judged if judged else None
    survivors = []
    for mutant in sorted(drawn, key=lambda each: (each.path, each.line)):
        outcome = "equivalent" if mutant.key in equivalent else results.verdicts[mutant.key].outcome
        if outcome in (*NOTICED, "equivalent"):
            continue
        source = (PACKAGE / mutant.path).read_text(encoding="utf-8")
        survivors.append({"place": f"{mutant.path}:{mutant.line}", "outcome": outcome, "key": mutant.key})
        say(f"\n{mutant.path}:{mutant.line}: {outcome}; {mutant.function or 'module'}\n{mutant.difference(source)}")
    share = "none" if rate is None else f"{100.0 * rate:.0f} %"
    parts = ", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items()))
    say(f"\n{package}: {noticed} of {judged} noticed, {share} ({parts}; {len(every)} mutants in all)")
    return {"mutants": len(every), "drawn": len(drawn), "rate": rate, **counts, "survivors": survivors}


if __name__ == "__main__":
    sys.exit(main())
