"""Puts mutants into a copy of the repository, one at a time, and runs the tests that reach them."""

import dataclasses
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterable
from typing import Any

from ranger_sim.foundation import wallclock
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import HOUSE
from ranger_sim.tools.mutate.mutants import Mutant, mutants

EQUIVALENT = pathlib.Path(__file__).with_name("equivalent.toml")
# Beside the room's own tests, and what is not a program of ours: written by other modules, or only for users' editors.
NOT_MUTATED = ("datatable/generated/",)
KILLED, SURVIVED, TIMEOUT, NOT_REACHED = "killed", "survived", "timeout", "not reached"
# A mutant may make a test slow for good; chosen by us, beside a machine that has other work.
SLOWER = 4.0
START_S = 30.0
NOTHING: dict[str, Any] = {"imported": [], "files": {}, "tests": {}, "failed": []}  # a map without tests
NO_SUCH_TEST, NO_TESTS = 4, 5  # pytest's exit codes


@dataclasses.dataclass(frozen=True)
class Verdict:
    """What became of a mutant; `by`: the test that noticed it, `tests`: how many were run at most."""

    key: str
    line: int
    outcome: str
    by: str = ""
    tests: int = 0
    seconds: float = 0.0


@dataclasses.dataclass(frozen=True)
class Known:
    """A mutant that changes nothing which could be noticed, with the reason."""

    key: str
    reason: str


def known(path: pathlib.Path = EQUIVALENT) -> list[Known]:
    """What `equivalent.toml` lists. UserError for an entry without a reason, or one that stands there twice."""
    rows = tomllib.loads(path.read_text(encoding="utf-8")).get("mutant", [])
    found: list[Known] = []
    for row in rows:
        if set(row) != {"key", "reason"} or not row["reason"].strip():
            raise UserError(f"{path.name}: an entry has key and reason, this one is {row}")
        if any(each.key == row["key"] for each in found):
            raise UserError(f"{path.name}: {row['key']} stands there twice")
        found.append(Known(row["key"], row["reason"]))
    return found


def all_mutants(room: str, house: pathlib.Path = HOUSE) -> list[Mutant]:
    """Every mutant of a room, in order of file and place."""
    found: list[Mutant] = []
    for path in sorted((house / room).rglob("*.py")):
        name = path.relative_to(house).as_posix()
        if not name.startswith(NOT_MUTATED):
            found += mutants(path.read_text(encoding="utf-8"), name)
    return found


def sample(every: list[Mutant], room: str, count: int, seed: int) -> list[Mutant]:
    """The first `count` of an order that seed and room alone decide: more of them later begin with the same ones."""
    order = generator(seed, f"mutants of {room}").permutation(len(every))
    return [every[number] for number in order[:count]]


# --- the copy ---------------------------------------------------------------------------------------------------


class Copy:
    """The repository's files in another folder, where mutants live; the folder may be one that an earlier run left."""

    def __init__(self, folder: pathlib.Path, house: pathlib.Path = HOUSE) -> None:
        self.folder = folder
        self.house = house
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=house,
            capture_output=True,
            check=False,
        )
        if listed.returncode:
            raise UserError(f"{house}: mutants need a checkout with its .git: {listed.stderr.decode().strip()}")
        names = [name for name in listed.stdout.decode().split("\0") if name and (house / name).is_file()]
        for name in names:
            there = folder / name
            there.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(house / name, there)
        for path in [path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]:
            if path.relative_to(folder).as_posix() not in set(names) and path.suffix in (".py", ".pxd", ".toml"):
                path.unlink()  # gone since an earlier run
        self.stamp = int((folder / "pyproject.toml").stat().st_mtime)

    def put(self, path: str, text: str) -> None:
        """The file's text from now on. A time stamp that it never had, so that no byte code of before is believed."""
        self.stamp += 10
        (self.folder / path).write_text(text, encoding="utf-8")
        os.utime(self.folder / path, (self.stamp, self.stamp))

    def pytest(self, arguments: Iterable[str], limit_s: float, **environment: str) -> tuple[int | None, str]:
        """Run pytest there, interpreted: (exit code, what it printed); None when it took longer than the limit."""
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        with subprocess.Popen(
            [*command, "--hypothesis-seed=1", *arguments],
            cwd=self.folder,
            env={**os.environ, "RANGER_SIM_INTERPRETED": "1", "OPENBLAS_NUM_THREADS": "1", **environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,  # so that what the tests have started ends with them
            text=True,
            errors="replace",
        ) as process:
            try:
                said, _ = process.communicate(timeout=limit_s)
                return process.returncode, said
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                return None, process.communicate()[0]


# --- which tests ------------------------------------------------------------------------------------------------


class TestsOf:
    """The tests of a room by the functions that they run, cheapest first."""

    __test__ = False  # pytest: this is none

    def __init__(self, found: dict[str, Any]) -> None:
        self.tests: dict[str, dict] = found["tests"]
        self.imported = set(found["imported"])
        self.by_function: dict[str, set[str]] = {}
        self.by_module: dict[str, set[str]] = {}
        of_file: dict[str, list[str]] = {}
        for name, test in self.tests.items():
            of_file.setdefault(name.partition("::")[0], []).append(name)
            for place in test["functions"]:
                self._note(place, [name])
        for file, functions in found["files"].items():
            for place in functions:
                self._note(place, of_file.get(file, []))

    def _note(self, place: str, names: list[str]) -> None:
        self.by_function.setdefault(place, set()).update(names)
        self.by_module.setdefault(place.partition(":")[0], set()).update(names)

    def of(self, mutant: Mutant, limit_s: float) -> list[str]:
        """Tests that can notice it, cheapest first, as many as fit into `limit_s` (at least one)."""
        place = f"{mutant.path}:{mutant.first_line}"
        at_import = not mutant.first_line or place in self.imported
        reach = self.by_module.get(mutant.path, set()) if at_import else self.by_function.get(place, set())
        chosen: list[str] = []
        total = 0.0
        for name in sorted(reach, key=lambda each: (self.tests[each]["seconds"], each)):
            total += self.tests[name]["seconds"]
            if chosen and total > limit_s:
                break
            chosen.append(name)
        return chosen

    def seconds(self, names: list[str]) -> float:
        """What they took together."""
        return sum(self.tests[name]["seconds"] for name in names)


class AllOf:
    """The same interface without a map: every mutant meets all of these tests."""

    def __init__(self, paths: list[str]) -> None:
        self.paths = paths

    def of(self, mutant: Mutant, limit_s: float) -> list[str]:
        """All of them."""
        return self.paths

    def seconds(self, names: list[str]) -> float:
        """Unknown: a quarter of an hour, as all tests of the repository take."""
        return 900.0 / SLOWER


def reach_of(copy: Copy, room: str, tests: list[str], map_limit_s: float, say: Callable[[str], None]) -> TestsOf:
    """The map of a room's tests, file by file: kept from an earlier run, or made by running them once.

    A file that takes longer than `map_limit_s` takes no part, and that is said.
    """
    folder = copy.folder.parent / f"reach-{room}"
    folder.mkdir(exist_ok=True)
    files = [file for path in tests for file in files_of_tests(copy.folder / path)]
    if not files:
        raise UserError(f"{room}: there are no tests in {', '.join(tests)}")
    merged: dict[str, Any] = {"imported": [], "files": {}, "tests": {}, "failed": []}
    for file in files:
        name = file.relative_to(copy.folder).as_posix()
        kept = folder / f"{name.replace('/', '.')}.json"
        if not kept.exists():
            partial = kept.with_suffix(".partial")
            arguments = ["-p", "ranger_sim.tools.mutate.reach", name]
            code, said = copy.pytest(arguments, limit_s=map_limit_s, RANGER_SIM_REACH=str(partial))
            if code is None:
                partial.write_text(json.dumps(NOTHING | {"failed": [f"{name} (over {map_limit_s:g} s)"]}), "utf-8")
            elif code not in (0, 1, NO_TESTS) or not partial.exists():
                raise UserError(f"{name}: does not run: {said.strip().splitlines()[-1]}")
            partial.replace(kept)
            say(f"{room}: {name} {'takes too long' if code is None else 'is mapped'}")
        found = json.loads(kept.read_text(encoding="utf-8"))
        merged["imported"] += found["imported"]
        merged["files"] |= found["files"]
        merged["tests"] |= found["tests"]
        merged["failed"] += found["failed"]
    if merged["failed"]:
        left_out = ", ".join(merged["failed"][:3])
        say(f"{room}: {len(merged['failed'])} tests fail, skip or last too long, and take no part: {left_out} ...")
    return TestsOf(merged)


def files_of_tests(path: pathlib.Path) -> list[pathlib.Path]:
    """Files of tests in a folder, or the file itself."""
    return [path] if path.is_file() else sorted(path.rglob("test_*.py"))


# --- verdicts ---------------------------------------------------------------------------------------------------


class Results:
    """Verdicts of a room in a file of JSON lines; the last one of a key counts."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.verdicts: dict[str, Verdict] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                verdict = Verdict(**json.loads(line))
                self.verdicts[verdict.key] = verdict

    def add(self, verdict: Verdict) -> None:
        """Keep it, on disk at once."""
        self.verdicts[verdict.key] = verdict
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(dataclasses.asdict(verdict)) + "\n")


def judge(copy: Copy, mutant: Mutant, tests: TestsOf | AllOf, limit_s: float) -> Verdict:
    """Put it into the copy, run the tests that reach it, and take it out again."""
    chosen = tests.of(mutant, limit_s)
    if not chosen:
        return Verdict(mutant.key, mutant.line, NOT_REACHED)
    original = (copy.house / mutant.path).read_text(encoding="utf-8")
    listed = copy.folder.parent / "chosen-tests"
    listed.write_text("".join(f"{name}\n" for name in chosen), encoding="utf-8")
    begun = wallclock.monotonic_s()
    copy.put(mutant.path, mutant.applied(original))
    try:
        limit = START_S + SLOWER * tests.seconds(chosen)
        code, said = copy.pytest(["-x", "--no-header", f"@{listed}"], limit)
        if code == NO_SUCH_TEST:  # the mutant changed what tests are made of: then all of their files
            files = dict.fromkeys(name.partition("::")[0] for name in chosen)
            code, said = copy.pytest(["-x", "--no-header", *files], limit + 300.0)
    finally:
        copy.put(mutant.path, original)
    seconds = round(wallclock.monotonic_s() - begun, 1)
    if code is None:
        return Verdict(mutant.key, mutant.line, TIMEOUT, "", len(chosen), seconds)
    if code == 0:
        return Verdict(mutant.key, mutant.line, SURVIVED, "", len(chosen), seconds)
    blamed = [line for line in said.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    by = blamed[0].split(" ", 1)[1].partition(" - ")[0] if blamed else f"pytest ends with {code}"
    return Verdict(mutant.key, mutant.line, KILLED, by, len(chosen), seconds)
