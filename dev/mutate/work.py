"""Puts mutants into a copy of the repository, one at a time, and runs the tests that reach them."""

import ast
import contextlib
import dataclasses
import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TextIO

from dev.mutate.mutants import Mutant, mutants
from dev.mutate.serve import ASKED_BY
from ranger_sim.foundation import toml_file, wallclock
from ranger_sim.foundation.random_arrays import generator
from ranger_sim.foundation.user_error import UserError
from ranger_sim.loading import (
    CHECKOUT,
    COMPILED,
    IS_COMPILED,
    PACKAGE,
    RECORD,
    RUNS_COMPILED,
    RUNS_INTERPRETED_BECAUSE,
    packages,
)

EQUIVALENT = pathlib.Path(__file__).with_name("equivalent.toml")
# Excluded: the package's own tests, and files that are not our programs, written by other modules or for users'
# editors.
NOT_MUTATED = ("datatable/generated/",)
KILLED, SURVIVED, TIMEOUT, NOT_REACHED, TOO_SLOW = "killed", "survived", "timeout", "not reached", "too slow"
NOT_WITHIN = "not within the limit"  # more tests reach it than there was time for
# A mutant may make a test slow for ever; chosen by us, for a machine that has other work.
SLOWER = 4.0
START_S = 60.0
LOOP_S = 5.0  # a test that takes so much more processor time than it did is in a loop
BUILD_S = 600.0  # nor one module to be built, on a machine that has other work
NOTHING: dict[str, Any] = {"imported": [], "shared": [], "tests": {}, "late": {}, "failed": []}  # a map without tests
# They hold tables of modules that run only at import: the map of functions cannot show that.
TABLES = ("tests/sysid/test_causes_are_documented.py",)
NO_SUCH_TEST = 4  # pytest's exit code
LIMIT_TEST_S = 20.0  # of processor time: a test that takes longer takes no part; chosen by us


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Verdict on a mutant; `by`: the test that detected it, `tests`: the most that were run, `left`: the number that
    reach it and were not run, for lack of time.
    """

    key: str
    line: int
    outcome: str
    by: str = ""
    tests: int = 0
    seconds: float = 0.0
    left: int = 0


@dataclasses.dataclass(frozen=True)
class Known:
    """A mutant without a detectable effect, with the reason."""

    key: str
    reason: str


def known(path: pathlib.Path = EQUIVALENT) -> list[Known]:
    """The entries of `equivalent.toml`. UserError for an entry without a reason, or a duplicate."""
    rows = toml_file.load(path).get("mutant", [])
    found: list[Known] = []
    for row in rows:
        if set(row) != {"key", "reason"} or not row["reason"].strip():
            raise UserError(f"{path.name}: an entry has key and reason, this one is {row}")
        if any(each.key == row["key"] for each in found):
            raise UserError(f"{path.name}: {row['key']} is listed twice")
        found.append(Known(row["key"], row["reason"]))
    return found


def all_mutants(package: str, source: pathlib.Path = PACKAGE) -> list[Mutant]:
    """Every mutant of a package, in order of file and place."""
    found: list[Mutant] = []
    for path in sorted((source / package).rglob("*.py")):
        name = path.relative_to(source).as_posix()
        if not name.startswith(NOT_MUTATED):
            found += mutants(path.read_text(encoding="utf-8"), name)
    return found


def sample(every: list[Mutant], package: str, count: int, seed: int) -> list[Mutant]:
    """The first `count` of an order fixed by seed and package: a larger count begins with the same ones."""
    order = generator(seed, f"mutants of {package}").permutation(len(every))
    return [every[number] for number in order[:count]]


# --- the copy ---------------------------------------------------------------------------------------------------


class Copy:
    """The repository's files in another folder, where mutants live; the folder may be one that an earlier run left."""

    def __init__(self, folder: pathlib.Path, source: pathlib.Path | None = CHECKOUT) -> None:
        if source is None:
            raise UserError("mutants need a checkout with its .git")
        self.folder = folder = folder.resolve()  # programs there have a different working folder
        self.source = source
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
            cwd=source,
            capture_output=True,
            check=False,
        )
        if listed.returncode:
            raise UserError(f"{source}: mutants need a checkout with its .git: {listed.stderr.decode().strip()}")
        names = [
            name
            for name in listed.stdout.decode().split("\0")
            if name and ((source / name).is_file() or (source / name).is_symlink())
        ]
        for name in names:
            there = folder / name
            there.parent.mkdir(parents=True, exist_ok=True)
            there.unlink(missing_ok=True)
            shutil.copy2(source / name, there, follow_symlinks=False)
        for path in [path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts]:
            if path.relative_to(folder).as_posix() not in set(names) and path.suffix in (".py", ".pxd", ".toml"):
                path.unlink()  # gone since an earlier run
        for cache in [path for path in folder.rglob("__pycache__") if path.is_dir()]:
            shutil.rmtree(cache)  # an earlier run gave its files the same time stamps
        self.stamp = int((folder / "pyproject.toml").stat().st_mtime)
        self.compiled = RUNS_COMPILED and source == CHECKOUT
        if self.compiled and COMPILED is not None:
            shutil.copytree(COMPILED, folder / COMPILED.relative_to(source), dirs_exist_ok=True)

    def runs_compiled(self, mutant: Mutant) -> bool:
        """True when the rest of the robot may run compiled: the mutant's own file never is."""
        return self.compiled and not IS_COMPILED.search((self.folder / mutant.path).read_bytes())

    def put(self, path: str, text: str) -> None:
        """Set the file's text, with a new time stamp, so that no earlier byte code is used."""
        self.stamp += 10
        (self.folder / path).write_text(text, encoding="utf-8")
        os.utime(self.folder / path, (self.stamp, self.stamp))

    def pytest(self, arguments: Iterable[str], limit_s: float, compiled: bool = False) -> tuple[int | None, str]:
        """Run pytest there: (exit code, output); None when it took longer than the limit."""
        with self._started(arguments, compiled, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
            try:
                said, _ = process.communicate(timeout=limit_s)
                return process.returncode, said
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                return None, process.communicate()[0]

    def _started(self, arguments: Iterable[str], compiled: bool, **options: Any) -> subprocess.Popen:
        environment = {
            "RANGER_SIM_INTERPRETED": "0" if compiled else "1",
            "OPENBLAS_NUM_THREADS": "1",
            **options.pop("environment", {}),
        }
        return subprocess.Popen(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *arguments],
            cwd=self.folder,
            env={**os.environ, **environment},
            start_new_session=True,  # so that processes started by the tests end with them
            text=True,
            errors="replace",
            **options,
        )

    @contextlib.contextmanager
    def server(self, tests: list[str], compiled: bool = False) -> Iterator["Asked"]:
        """A process that has collected these tests and forks for each request (`serve.py`)."""
        asking, requests = os.pipe()
        answers, answering = os.pipe()
        log = self.folder.parent / "server.log"
        with log.open("w", encoding="utf-8") as said:
            process = self._started(
                ["-p", "dev.mutate.serve", *tests],
                compiled,
                pass_fds=(asking, answering),
                stdin=subprocess.DEVNULL,
                stdout=said,
                stderr=subprocess.STDOUT,
                environment={ASKED_BY: f"{asking},{answering}"},
            )
        os.close(asking)
        os.close(answering)
        with os.fdopen(requests, "w", encoding="utf-8") as out, os.fdopen(answers, encoding="utf-8") as back:
            asked = Asked(out, back, log, compiled)
            asked.answer()  # all is collected: from now on files may be changed
            yield asked
        process.wait()


class Built(Copy):
    """A copy whose compiled modules are rebuilt with each mutant, as `make test` would run them."""

    def __init__(self, folder: pathlib.Path, source: pathlib.Path | None = CHECKOUT) -> None:
        super().__init__(folder, source)
        if not self.compiled:
            raise UserError(
                f"{source}: nothing is compiled there, so that no mutant can be: {RUNS_INTERPRETED_BECAUSE}"
            )
        shutil.rmtree(self.folder / "build", ignore_errors=True)  # an earlier run may have left a mutant in it
        for made in ("cython", "compiled", *(each.name for each in (self.source / "build").glob("temp.*"))):
            shutil.copytree(self.source / "build" / made, self.folder / "build" / made)

    def put(self, path: str, text: str) -> None:
        """Set the file's text, newer than all built files."""
        (self.folder / path).write_text(text, encoding="utf-8")

    def build(self) -> bool:
        """Build files newer than their object files; False when one cannot be compiled."""
        subprocess.run(
            [sys.executable, "setup.py", "-q", "build_ext", "--inplace"],
            cwd=self.folder,
            env={**os.environ, "RANGER_SIM_INTERPRETED": "0"},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            check=False,
            timeout=BUILD_S,
        )
        [record] = (self.folder / "build" / "compiled").glob(f"*/{RECORD}")
        return json.loads(record.read_text(encoding="utf-8"))["compiled"]


class Asked:
    """The client side of a server; `compiled`: whether it runs compiled code."""

    def __init__(self, requests: TextIO, answers: TextIO, log: pathlib.Path, compiled: bool) -> None:
        self.requests = requests
        self.answers = answers
        self.log = log
        self.compiled = compiled

    def __call__(self, **request: Any) -> dict:
        """The answer to a request."""
        with contextlib.suppress(BrokenPipeError):
            print(json.dumps(request), file=self.requests, flush=True)
        return self.answer()

    def answer(self) -> dict:
        """The next answer. UserError when the server has ended: the tests cannot be collected."""
        line = self.answers.readline()
        if not line:
            said = self.log.read_text(encoding="utf-8").strip().splitlines() or ["pytest says nothing"]
            raise UserError(f"{self.log}: the tests do not run: {said[-1]}")
        return json.loads(line)


# --- which tests ------------------------------------------------------------------------------------------------


class TestsOf:
    """The tests of a package by the functions that they run, cheapest first."""

    __test__ = False  # pytest: not a test

    def __init__(self, found: dict[str, dict[str, Any]], importers: dict[str, set[str]] | None = None) -> None:
        self.importers = importers or {}
        self.tests: dict[str, dict] = {name: test for each in found.values() for name, test in each["tests"].items()}
        self.known = set(self.tests) | {name for each in found.values() for name in each["late"]}
        self.tables = {name for name in self.tests if name.partition("::")[0] in TABLES}
        self.starting = {name for name, test in self.tests.items() if test["starts"]}
        self.late: dict[str, set[str]] = {}
        for each in found.values():
            for name, functions in each["late"].items():
                for place in functions:
                    self.late.setdefault(place, set()).add(name)
        self.imported = {place for each in found.values() for place in each["imported"]}
        self.witnesses: dict[str, bool] = {}
        self.by_function: dict[str, set[str]] = {}
        self.by_module: dict[str, set[str]] = {}
        for each in found.values():
            for name, test in each["tests"].items():
                for place in test["functions"]:
                    self._note(place, [name])
            for place in each["shared"]:
                self._note(place, list(each["tests"]))

    def at_import(self, mutant: Mutant) -> bool:
        """True for code that runs while modules are imported or tests collected."""
        return not mutant.first_line or f"{mutant.path}:{mutant.first_line}" in self.imported

    def _note(self, place: str, names: list[str]) -> None:
        self.by_function.setdefault(place, set()).update(names)
        self.by_module.setdefault(place.partition(":")[0], set()).update(names)

    def of(self, mutant: Mutant, limit_s: float) -> tuple[list[str], int]:
        """Tests that can detect it, cheapest first, and the number of further ones.

        Those that reach it in their own process come first, as many as fit into `limit_s` (at least one). After them,
        as many as fit into it again: for what runs at import, those of modules that import this one, which may read a
        constant of it; and those that start processes, for which the map does not see the functions run there.
        """
        place = f"{mutant.path}:{mutant.first_line}"
        late = not self.at_import(mutant)
        reach = self.by_function.get(place, set()) if late else self.by_module.get(mutant.path, set()) | self.tables
        of_readers: set[str] = set()
        if not late:
            of_readers = of_readers.union(
                *(self.by_module.get(path, ()) for path in self.importers.get(mutant.path, ()))
            )
        chosen: list[str] = []
        left = len(self.late.get(place, ()))
        for names in (reach, of_readers - reach, self.starting - reach - of_readers):
            total = 0.0
            for name in sorted(names, key=lambda each: (self.tests[each]["seconds"], each)):
                total += self.tests[name]["seconds"]
                if total <= limit_s or not chosen:
                    chosen.append(name)
                else:
                    left += 1
        return chosen, left

    def built_of(self, mutant: Mutant, plain: "TestsOf", limit_s: float) -> tuple[list[str], int]:
        """Tests that can detect it in a compiled module, cheapest first as they run compiled, and the number of further
        ones.

        `plain` has the tests that run the mutant's function, for those that finish in time interpreted; all others may.
        """
        place = f"{mutant.path}:{mutant.first_line}"
        reach = plain.by_module if plain.at_import(mutant) else plain.by_function
        seen = reach.get(mutant.path if plain.at_import(mutant) else place, set()) | plain.late.get(place, set())
        # some functions run compiled alone
        seen = seen or plain.by_module.get(mutant.path, set())
        names = [name for name in self.tests if name in seen | self.starting or name not in plain.known]
        chosen: list[str] = []
        total = 0.0
        for name in sorted(names, key=lambda each: (self.tests[each]["seconds"], each)):
            total += self.tests[name]["seconds"]
            if total <= limit_s:
                chosen.append(name)
        return chosen, len(names) - len(chosen)

    def is_witness(self, name: str, ask: Asked, mutant: Mutant, original: str) -> bool:
        """True for a test that passes on the original, tried once in the same way as mutants."""
        if name not in self.witnesses:
            limit = START_S + SLOWER * self.tests[name]["seconds"]
            same = {"path": mutant.path, "before": original, "after": original, "tests": [name]}
            answer = ask(**same, limit_s=limit, limit_test_s=SLOWER * LIMIT_TEST_S)
            self.witnesses[name] = answer["code"] == 0
        return self.witnesses[name]

    def leave_out(self, name: str) -> None:
        """Never choose this test again."""
        del self.tests[name]
        for names in (*self.by_function.values(), *self.by_module.values(), self.starting, self.tables):
            names.discard(name)

    def seconds(self, names: list[str]) -> float:
        """Their total time."""
        return sum(self.tests[name]["seconds"] for name in names)


def reach_of(
    copy: Copy, ask: Asked, package: str, tests: list[str], limit_s: float, say: Callable[[str], None]
) -> TestsOf:
    """The map of a package's tests, file by file: made by running them once, kept until the package or file changes.

    A test that takes longer than LIMIT_TEST_S is not run again, one that fails or a file that takes longer than
    `limit_s` takes no part, and this is reported. UserError when a map cannot be made at all.
    """
    folder = copy.folder.parent / f"reach-{package}{'-compiled' if ask.compiled else ''}"
    folder.mkdir(exist_ok=True)
    files = list(dict.fromkeys(file for path in tests for file in files_of_tests(copy.folder / path)))
    if not files:
        raise UserError(f"{package}: there are no tests in {', '.join(tests)}")
    found: dict[str, Any] = {}
    for file in files:
        name = file.relative_to(copy.folder).as_posix()
        kept = folder / f"{name.replace('/', '.')}.json"
        state = state_of(copy.folder, package, file)
        if not kept.exists() or json.loads(kept.read_text(encoding="utf-8")).get("state") != state:
            partial = kept.with_suffix(".partial")
            answer = ask(map=name, to=str(partial), limit_s=limit_s, limit_test_s=LIMIT_TEST_S)
            if answer["code"] == 0:
                say(f"{package}: {name} is mapped")
            elif answer["code"] is None:
                say(f"{package}: {name} takes no part: it takes too long")
                partial.write_text(json.dumps(NOTHING | {"failed": [name]}), "utf-8")
            else:
                raise UserError(f"{name}: its map cannot be made: {answer['by']}")
            seen = json.loads(partial.read_text(encoding="utf-8"))
            partial.write_text(json.dumps(seen | {"state": state}), encoding="utf-8")
            partial.replace(kept)
        found[name] = json.loads(kept.read_text(encoding="utf-8"))
    failed = [name for each in found.values() for name in each["failed"]]
    if failed:
        say(f"{package}: {len(failed)} tests fail or skip and take no part: {', '.join(failed[:3])} ...")
    late = [name for each in found.values() for name in each["late"]]
    if late:
        some = ", ".join(late[:3])
        say(f"{package}: {len(late)} tests last longer than {LIMIT_TEST_S:g} s and are not run: {some} ...")
    return TestsOf(found, importers_in(copy.folder))


def importers_in(folder: pathlib.Path) -> dict[str, set[str]]:
    """{module: modules that import it or from it}, as paths; folder: the checkout or a copy of it."""
    importers: dict[str, set[str]] = {}
    for package in packages():
        for path in (folder / package).rglob("*.py"):
            reader = path.relative_to(folder).as_posix()
            for node in ast.walk(ast.parse(path.read_bytes())):
                names = []
                if isinstance(node, ast.Import):
                    names = [each.name for each in node.names]
                elif isinstance(node, ast.ImportFrom) and node.module:
                    names = [node.module, *(f"{node.module}.{each.name}" for each in node.names)]
                for name in names:
                    module = name.removeprefix(f"{PACKAGE.name}.").replace(".", "/") + ".py"
                    if (folder / module).is_file():
                        importers.setdefault(module, set()).add(reader)
    return importers


def state_of(folder: pathlib.Path, package: str, tests: pathlib.Path) -> str:
    """A digest of the inputs of a map: the package's sources, a file of tests and its helpers."""
    digest = hashlib.sha256()
    helpers = [path for path in tests.parent.glob("*.py") if not path.name.startswith("test_")]
    for path in (*sorted((folder / package).rglob("*.py")), *sorted(helpers), tests):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def files_of_tests(path: pathlib.Path) -> list[pathlib.Path]:
    """Files of tests in a folder, or the file itself."""
    return [path] if path.is_file() else sorted(path.rglob("test_*.py"))


# --- verdicts ---------------------------------------------------------------------------------------------------


class Results:
    """Verdicts of a package in a file of JSON lines; the last one of a key counts."""

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


def judge(copy: Copy, ask: Asked, mutant: Mutant, tests: TestsOf, limit_s: float) -> Verdict:
    """Put it into the copy, run the tests that reach it, and take it out again.

    A test that fails with it must pass on the original, otherwise it takes no part from then on. Tests that do not
    finish must finish with the original: otherwise the machine is the cause, and the mutant was not detected.
    """
    original = (copy.folder / mutant.path).read_text(encoding="utf-8")
    begun = wallclock.monotonic_s()
    while True:
        chosen, left = tests.of(mutant, limit_s)
        if not chosen:
            return Verdict(mutant.key, mutant.line, NOT_WITHIN if left else NOT_REACHED, left=left)
        copy.put(mutant.path, mutant.applied(original))  # also for processes that tests start
        try:
            code, by = verdict_of(copy, ask, mutant, tests, chosen, original, mutant.applied(original))
        finally:
            copy.put(mutant.path, original)
        if code == 1 and by in tests.tests and not tests.is_witness(by, ask, mutant, original):
            tests.leave_out(by)
        elif code is None and by and verdict_of(copy, ask, mutant, tests, [by], original, original, chosen)[0] is None:
            tests.leave_out(by)  # it needs the results of an earlier test, which takes longer than itself
        elif code is None and not by and verdict_of(copy, ask, mutant, tests, chosen, original, original)[0] is None:
            return Verdict(mutant.key, mutant.line, TOO_SLOW, "", len(chosen), limit_of(tests, chosen), left)
        else:
            break
    seconds = round(wallclock.monotonic_s() - begun, 1)
    outcome = {None: TIMEOUT, 0: NOT_WITHIN if left else SURVIVED}.get(code, KILLED)
    return Verdict(mutant.key, mutant.line, outcome, by, len(chosen), seconds, left)


def limit_of(tests: TestsOf, chosen: list[str]) -> float:
    """Wall time that these tests may take, on a machine that has other work."""
    return START_S + SLOWER * tests.seconds(chosen)


def verdict_of(
    copy: Copy,
    ask: Asked,
    mutant: Mutant,
    tests: TestsOf,
    chosen: list[str],
    original: str,
    text: str,
    limits_of: list[str] | None = None,
) -> tuple[int | None, str]:
    """(pytest's exit code or None for too long, the test that failed), with `text` in the mutant's file.

    One of a function is tried in memory first; where that function also runs at import, in a new process after that.
    limits_of: tests by which the limit of each is set, where they are others.
    """
    limit = limit_of(tests, chosen)
    code: int | None = 0
    by = ""
    if mutant.first_line:
        answer = ask(
            path=mutant.path,
            before=original,
            after=text,
            tests=chosen,
            limit_s=limit,
            limit_test_s=LOOP_S + SLOWER * max(tests.tests[name]["seconds"] for name in limits_of or chosen),
        )
        code, by = answer["code"], answer.get("by", "")
    if code == 0 and tests.at_import(mutant):
        return from_the_start(copy, chosen, limit, ask.compiled)
    return code, by


def from_the_start(copy: Copy, chosen: list[str], limit_s: float, compiled: bool) -> tuple[int | None, str]:
    """Run these tests in a separate process: (pytest's exit code or None for too long, the test that failed)."""
    listed = copy.folder.parent / "chosen-tests"
    listed.write_text("".join(f"{name}\n" for name in chosen), encoding="utf-8")
    code, said = copy.pytest(["-x", "--no-header", f"@{listed}"], limit_s, compiled)
    if code == NO_SUCH_TEST:  # the mutant changed the parametrisation of tests: then all of their files
        files = dict.fromkeys(name.partition("::")[0] for name in chosen)
        code, said = copy.pytest(["-x", "--no-header", *files], limit_s + 300.0, compiled)
    blamed = [line for line in said.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    if not code:
        return code, ""
    return code, blamed[0].split(" ", 1)[1].partition(" - ")[0] if blamed else f"pytest ends with {code}"


def judge_built(built: Built, mutant: Mutant, plain: TestsOf, compiled: TestsOf, limit_s: float) -> Verdict:
    """Build it into the library and run tests that passed with the original; then take it out again.

    As with `judge`, a detected failure must not occur with the original, built the same way.
    """
    original = (built.folder / mutant.path).read_text(encoding="utf-8")
    begun = wallclock.monotonic_s()
    while True:
        chosen, left = compiled.built_of(mutant, plain, limit_s)
        limit = limit_of(compiled, chosen)
        built.put(mutant.path, mutant.applied(original))
        try:
            code, by = built_verdict(built, chosen, limit)
        finally:
            built.put(mutant.path, original)
        same: int | None = 0
        if code is None or by in compiled.tests:
            same = built_verdict(built, [by] if by else chosen, limit)[0]
        if code is None and same is None:
            return Verdict(mutant.key, mutant.line, TOO_SLOW, "", len(chosen), limit, left)
        if not same or not by:
            break
        compiled.leave_out(by)
    outcome = {None: TIMEOUT, 0: NOT_WITHIN if left else SURVIVED}.get(code, KILLED)
    return Verdict(mutant.key, mutant.line, outcome, by, len(chosen), round(wallclock.monotonic_s() - begun, 1), left)


def built_verdict(built: Built, chosen: list[str], limit_s: float) -> tuple[int | None, str]:
    """Result of these tests on the present files: (pytest's exit code or None for too long, the test that failed)."""
    if not built.build():
        return 1, "the build"
    return from_the_start(built, chosen, limit_s, True) if chosen else (0, "")
