"""A pytest plugin: one process that has collected the tests once, and forks for each requested mutant.

A mutant inside a function is put into the loaded module: every function made from that piece of the file gets the
changed code. Nothing is imported a second time, so a verdict costs what its tests cost. Code that runs while modules
are imported cannot be exchanged afterwards; such mutants are written to a file (`work.py`).

RANGER_SIM_MUTANTS names two descriptors: requests come from the first as lines of JSON, answers go to the second.
    {"map": FILE, "to": PATH, ...}                                which test of a file runs which function
    {"path": PATH, "before": TEXT, "after": TEXT, "tests": [...]}   whether these tests notice the changed text
with `limit_s`, wall time of it all, and `limit_test_s`, processor time of one test. The answer is an object with `code`
(0: all passed, 1: one failed, null: over the limit) and `by`. The first answer is sent without a request, when all is
collected: a mutant written to a file before that would be imported as if it were the original.

Compiled functions cannot be exchanged nor watched: a server that runs compiled serves for plain Python modules alone.
"""

import contextlib
import functools
import gc
import json
import os
import pathlib
import select
import signal
import sys
from collections.abc import Callable, Generator, Iterator
from types import CodeType, FrameType, FunctionType
from typing import Any

import pytest

from ranger_sim.loading import PACKAGE, packages

ROOTS = tuple(str(PACKAGE / name) + os.sep for name in packages())
ASKED_BY = "RANGER_SIM_MUTANTS"
STARTING = ("subprocess.Popen", "os.fork", "os.posix_spawn")  # the interpreter's audit events


class TooLong(BaseException):
    """A test has used up its processor time. Not an Exception, so that no code takes it for an error of the program."""


# --- functions and their code -----------------------------------------------------------------------------------


def functions_of_packages() -> list[FunctionType]:
    """Every function of the packages that exists now, decorated ones and methods as well."""
    return [
        each
        for each in gc.get_objects()
        if isinstance(each, FunctionType) and each.__code__.co_filename.startswith(ROOTS)
    ]


def pieces(code: CodeType) -> Iterator[CodeType]:
    """A code object and all inside it, in order of place."""
    yield code
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield from pieces(each)


def by_name(code: CodeType) -> dict[tuple[str, int], CodeType]:
    """Every piece by its qualified name and its number among those of this name: both survive a change elsewhere."""
    found: dict[tuple[str, int], CodeType] = {}
    for each in pieces(code):
        number = 0
        while (each.co_qualname, number) in found:
            number += 1
        found[each.co_qualname, number] = each
    return found


def exchange(path: pathlib.Path, before: str, after: str) -> None:
    """Give every function made from this file the code of its changed text.

    Results kept from before (functools.cache) are forgotten.
    """
    changed = by_name(compile(after, str(path), "exec"))
    new = {
        (old.co_qualname, old.co_firstlineno): (old, changed[key])
        for key, old in by_name(compile(before, str(path), "exec")).items()
        if key in changed
    }
    for each in functions_of_packages():
        code = each.__code__
        old, other = new.get((code.co_qualname, code.co_firstlineno), (code, code))
        same_names = len(other.co_freevars) == len(code.co_freevars)
        if code.co_filename == str(path) and other != code and old == code and same_names:
            each.__code__ = other
    for each in gc.get_objects():
        if isinstance(each, functools._lru_cache_wrapper):
            each.cache_clear()


class Watch:
    """Functions that note their first call of a test in `seen`, and are themselves again from then on.

    In place of its code a function has two instructions that call `_first`; calls after the first cost nothing.
    Functions with cells of an outer one cannot be watched so: `unwatched` are always counted as run.
    """

    def __init__(self) -> None:
        every = functions_of_packages()
        self.codes = {each: each.__code__ for each in every if not each.__code__.co_freevars}
        self.unwatched = {each.__code__ for each in every if each.__code__.co_freevars}
        self.stubs = {each: self._stub(each, code) for each, code in self.codes.items()}
        self.seen: set[CodeType] = set()

    def _stub(self, function: FunctionType, code: CodeType) -> CodeType:
        def first(arguments: tuple, named: dict) -> Any:
            self.seen.add(code)
            function.__code__ = code
            return function(*arguments, **named)

        def stub(*arguments: Any, **named: Any) -> Any:
            called: Any = None  # the constant becomes `first`
            return called(arguments, named)

        return stub.__code__.replace(
            co_consts=tuple(first if each is None else each for each in stub.__code__.co_consts),
            co_filename=code.co_filename,
            co_name=code.co_name,
            co_qualname=code.co_qualname,
        )

    def begin(self) -> None:
        """Clear the seen functions, and watch every function."""
        self.seen = set(self.unwatched)
        for function, stub in self.stubs.items():
            function.__code__ = stub

    def end(self) -> set[CodeType]:
        """Restore every function; returns those that ran."""
        for function, code in self.codes.items():
            function.__code__ = code
        return self.seen


def places(codes: set[CodeType]) -> list[str]:
    """`path:line` of those that belong to the packages, in order."""
    root = len(str(PACKAGE)) + 1
    return sorted(
        {f"{code.co_filename[root:]}:{code.co_firstlineno}" for code in codes if code.co_filename.startswith(ROOTS)}
    )


# --- the server -------------------------------------------------------------------------------------------------


class Server:
    """Answers requests in place of pytest's own loop over the tests."""

    def __init__(self, requests: int, answers: int) -> None:
        self.requests = os.fdopen(requests, encoding="utf-8")
        self.answers = os.fdopen(answers, "w", encoding="utf-8")
        self.imported: set[CodeType] = set()
        self.items: dict[str, pytest.Item] = {}
        self.watch: Watch | None = None
        self.in_test: set[CodeType] = set()
        self.started = False

    def note(self, frame: FrameType, event: str, _argument: object) -> None:
        """Called by the interpreter at every call, until the tests are collected."""
        if event == "call":
            self.imported.add(frame.f_code)

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Instead of running tests: serve until the client closes."""
        sys.setprofile(None)
        self.items = {item.nodeid: item for item in session.items}
        print(json.dumps({"code": 0}), file=self.answers, flush=True)
        for line in self.requests:
            request = json.loads(line)
            work = self.map if "map" in request else self.judge
            answer = forked(functools.partial(work, request), request["limit_s"])
            print(json.dumps(answer), file=self.answers, flush=True)
        return True

    def map(self, request: dict) -> dict:
        """Run the tests of one file, each with its own list of functions, and write the seen functions to `to`.

        Functions that run while fixtures are set up or torn down may serve every test of the file: `shared`. A test
        that was ended at its limit is `late`: the functions it ran before that are known, not whether it passes. Tests
        that start processes run more than is seen here: `starts`.
        """

        def audit(event: str, _arguments: tuple) -> None:
            self.started = self.started or event in STARTING

        sys.addaudithook(audit)
        self.watch = Watch()
        found: dict[str, Any] = {"imported": places(self.imported), "tests": {}, "late": {}, "failed": []}
        shared: set[CodeType] = set()
        chosen = [item for name, item in self.items.items() if name.partition("::")[0] == request["map"]]
        for item, following in zip(chosen, [*chosen[1:], None], strict=True):
            self.in_test = set()
            self.started = False
            self.watch.begin()
            reports = run(item, following, request["limit_test_s"])
            shared |= self.watch.end()
            if len(reports) == 3 and all(report.outcome == "passed" for report in reports):
                seconds = round(sum(report.duration for report in reports), 4)
                functions = places(self.in_test)
                found["tests"][item.nodeid] = {"seconds": seconds, "functions": functions, "starts": self.started}
            elif not reports:
                found["late"][item.nodeid] = places(self.in_test)
            else:
                found["failed"].append(item.nodeid)
        found["shared"] = places(shared)
        pathlib.Path(request["to"]).write_text(json.dumps(found), encoding="utf-8")
        return {"code": 0}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None, Any, Any]:
        """While a file is mapped: between set-up and teardown the calls are the test's own."""
        if self.watch is None:
            return (yield)
        outside = self.watch.end()
        self.watch.begin()
        try:
            return (yield)
        finally:
            self.in_test = self.watch.end()
            self.watch.begin()
            self.watch.seen |= outside

    def judge(self, request: dict) -> dict:
        """Run the tests until one fails."""
        exchange(PACKAGE / request["path"], request["before"], request["after"])
        chosen = [self.items[name] for name in request["tests"]]
        for item, following in zip(chosen, [*chosen[1:], None], strict=True):
            reports = run(item, following, request["limit_test_s"])
            if not reports:
                return {"code": None, "by": item.nodeid}
            if any(report.failed for report in reports):
                return {"code": 1, "by": item.nodeid}
        return {"code": 0}


def run(item: pytest.Item, following: pytest.Item | None, limit_s: float) -> list[pytest.TestReport]:
    """The reports of one test; none when it took more processor time than `limit_s`, two when it was skipped."""
    from _pytest.runner import runtestprotocol

    late = False

    def over(_signal: int, _frame: object) -> None:
        nonlocal late
        late = True
        raise TooLong

    old = signal.signal(signal.SIGPROF, over)
    signal.setitimer(signal.ITIMER_PROF, limit_s)
    try:
        reports = runtestprotocol(item, log=False, nextitem=following)
    except (Exception, TooLong):  # plugins also fail on a test that ends this way
        if not late:
            raise
        with contextlib.suppress(Exception):
            item.session._setupstate.teardown_exact(following)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)
    return [] if late else reports


def forked(work: Callable[[], dict], limit_s: float) -> dict:
    """Result of `work` in a child process with its own group, which ends with all processes that it has started."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.setsid()
            answer = work()
        except BaseException as error:  # noqa: B036  (whatever ends it, the child must not go on as the server)
            answer = {"code": 3, "by": repr(error)}
        os.write(writing, json.dumps(answer).encode())
        os._exit(0)
    os.close(writing)
    ready, _, _ = select.select([reading], [], [], limit_s)
    said = os.read(reading, 65536) if ready else b""
    os.close(reading)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    if not ready:
        return {"code": None}
    return json.loads(said) if said else {"code": 1, "by": "the process died"}


def pytest_configure(config: pytest.Config) -> None:
    """Serve, if requested."""
    asked = os.environ.pop(ASKED_BY, "")
    if asked:
        requests, answers = (int(each) for each in asked.split(","))
        server = Server(requests, answers)
        config.pluginmanager.register(server, "ranger-sim-mutants")
        sys.setprofile(server.note)
