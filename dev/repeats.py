"""python -m dev.repeats --times 20: the system tests again and again, next to busy processes, with random hash seeds.

What a run computes must not depend on who else works on the machine, nor on the order in which a set is walked
through. Each time a fixed scenario is run, whose digest must be the same every time, and the system tests that wait for
no wall clock, whose outcomes must be (the Makefile names those that do). Ends with 1 when a digest differs, a test
fails, or its outcome changes. `--keep FILE` makes a long series resumable; the hash seeds come from `--seed`.
"""

import argparse
import contextlib
import dataclasses
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from ranger_sim.foundation.random_arrays import generator
from tests.system.digest_of import Case

ROOT = pathlib.Path(__file__).resolve().parents[1]
CASE = Case(seconds=3.5, seed=3)  # let go at 1.5 s; then two seconds of walking
BUSY = 2
HASH_SEEDS = 1 << 32  # PYTHONHASHSEED is below that


def with_a_clock(makefile: str) -> list[str]:
    """The tests that wait for the wall clock, as the Makefile lists them."""
    listed = re.search(r"^WITH_A_CLOCK = ((?:.*\\\n)*.*)$", makefile, re.MULTILINE)
    assert listed is not None, "the Makefile has no WITH_A_CLOCK"
    return listed[1].replace("\\\n", " ").split()


def system_tests() -> list[str]:
    """Those without."""
    others = with_a_clock((ROOT / "Makefile").read_text(encoding="utf-8"))
    found = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "tests/system").glob("test_*.py"))
    return [name for name in found if name not in others]


def outcomes(report: str) -> dict[str, str]:
    """{test: passed, failed, error or skipped} of a report in JUnit's form."""
    found = {}
    for case in ElementTree.fromstring(report).iter("testcase"):
        worse = [each.tag for each in case if each.tag in ("failure", "error", "skipped")]
        name = f"{case.get('classname')}::{case.get('name')}"
        found[name] = {"failure": "failed"}.get(worse[0], worse[0]) if worse else "passed"
    return found


@contextlib.contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """While it lasts so many processes compute without end."""
    running = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for each in running:
            each.kill()
            each.wait()


def once(hash_seed: int, tests: list[str]) -> dict:
    """One time: the digest, and the outcome of every test."""
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed)}
    case = json.dumps([dataclasses.asdict(CASE)])
    with tempfile.TemporaryDirectory() as folder, busy_processes(BUSY):
        report = pathlib.Path(folder) / "report.xml"
        call = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *tests]
        done = subprocess.run(
            [sys.executable, "-m", "tests.system.digest_of", case],
            cwd=ROOT, env=environment, capture_output=True, text=True, check=True,
        )  # fmt: skip
        if tests:
            subprocess.run(call, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, check=False)
        found = outcomes(report.read_text(encoding="utf-8")) if tests else {}
    return {"hash_seed": hash_seed, "digest": done.stdout.strip(), "outcomes": found}


def differences(rows: list[dict]) -> list[str]:
    """A line for everything that was not the same every time, or not as it should be."""
    lines = []
    digests = sorted({row["digest"] for row in rows})
    if len(digests) > 1:
        lines.append(f"{len(digests)} digests: {'; '.join(digests)}")
    for name in sorted({name for row in rows for name in row["outcomes"]}):
        counts: dict[str, int] = {}
        for row in rows:
            outcome = row["outcomes"].get(name, "missing")
            counts[outcome] = counts.get(outcome, 0) + 1
        if len(counts) > 1 or not counts.keys() <= {"passed", "skipped"}:
            lines.append(f"{name}: " + ", ".join(f"{outcome} {count} times" for outcome, count in counts.items()))
    return lines


def main(arguments: list[str] | None = None) -> int:
    """0 when every time was like the first, and no test failed."""
    parser = argparse.ArgumentParser(prog="python -m dev.repeats", description=__doc__.partition("\n\n")[2])
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1, help="of the hash seeds (default 1)")
    parser.add_argument("--keep", type=pathlib.Path, help="what was run already, a line each; new ones are added")
    parser.add_argument("--digest-only", action="store_true", help="the fixed scenario alone")
    given = parser.parse_args(arguments)
    tests = [] if given.digest_only else system_tests()
    seeds = [int(each) for each in generator(given.seed, "hash seeds").integers(HASH_SEEDS, size=given.times)]
    rows = []
    if given.keep is not None and given.keep.exists():
        rows = [json.loads(line) for line in given.keep.read_text(encoding="utf-8").splitlines()]
    rows = [row for row in rows if row["hash_seed"] in seeds]
    done = {row["hash_seed"] for row in rows}
    for seed in (seed for seed in seeds if seed not in done):
        rows.append(once(seed, tests))
        if given.keep is not None:
            with given.keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
        passed = sum(outcome == "passed" for outcome in rows[-1]["outcomes"].values())
        print(
            f"{len(rows)} of {given.times}: hash seed {seed}, {passed} tests passed, {rows[-1]['digest']}", flush=True
        )
    found = differences(rows)
    print("\n".join(found) or f"{len(rows)} times the same: {rows[0]['digest'] if rows else 'nothing'}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
