"""A test in a forked process: it has its own copy of everything that was warmed up before, and leaves nothing behind.

The child runs the whole protocol of the test (set-up, call, teardown) and sends its reports back over a pipe, in the
form in which pytest itself passes reports between processes. A child that dies is a failed test that says of what.
What fixtures of a wider scope the parent has set up stays set up there, and is not torn down by the child.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
import signal
import sys
import traceback
import warnings
from typing import Any

import pytest
from _pytest.runner import CallInfo, runtestprotocol

LOST = 70  # exit code of a child that could not tell what became of the test


def possible(config: pytest.Config) -> bool:
    """Whether tests can be forked: the system can, and nobody sits at a debugger."""
    debugger = config.getoption("usepdb", False) or config.getoption("trace", False)
    return hasattr(os, "fork") and not debugger


def run(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Run `item` in a child and log its reports, as the protocol of pytest does it in this process."""
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    if "tmp_path_factory" in getattr(item, "fixturenames", ()):
        item.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # one for all children
    child = Child(item)
    told: dict[str, Any] = {}
    # a time limit of another plugin is an exception here, as in a test that runs in this process
    call = CallInfo.from_call(child.result, "call", (KeyboardInterrupt, pytest.exit.Exception))
    child.end()
    if call.excinfo is None:
        told = call.result or {}
    reports = [hook.pytest_report_from_serializable(config=item.config, data=each) for each in told.get("reports", [])]
    for category, text, filename, line in told.get("warnings", []):
        warnings.warn_explicit(text, category, filename, line)
    if call.excinfo is not None:
        reports.append(hook.pytest_runtest_makereport(item=item, call=call))
    elif not told:
        reports.append(died(item, child))
    for report in reports:
        hook.pytest_runtest_logreport(report=report)
    tear_down(item, nextitem)
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    if "exit" in told:
        pytest.exit(*told["exit"])


class Child:
    """The process of one test, and the pipe from it."""

    def __init__(self, item: pytest.Item) -> None:
        from ranger_sim.firmware_sim.native import crash  # only here: everybody's pytest imports this

        self.notebook = crash.Notebook()  # a program in C may end the child
        self.read, write = os.pipe()
        self.status: int | None = None
        parent = os.getpid()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
            self.process = os.fork()
        if self.process == 0:
            code = LOST
            try:
                os.close(self.read)
                crash.notebook = self.notebook
                from ranger_sim.harness.branching import die_with  # only here: everybody's pytest imports this

                die_with(parent)
                code = serve(item, write)
            except BaseException:  # noqa: BLE001  (a child must never return into the parent's program)
                traceback.print_exc()
            finally:
                with contextlib.suppress(Exception):
                    sys.stdout.flush()
                    sys.stderr.flush()
                os._exit(code)
        os.close(write)

    def result(self) -> dict[str, Any] | None:
        """Wait for what the child tells; None when it ends without."""
        with os.fdopen(self.read, "rb") as pipe:
            data = pipe.read()
        self.wait()
        try:
            return pickle.loads(data) if data else None  # noqa: S301  (it comes from our own child)
        except (pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError):
            return None

    def wait(self) -> None:
        """Wait for its end."""
        if self.status is None:
            self.status = os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])

    def end(self) -> None:
        """Whatever became of it, it is gone after this."""
        if self.status is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.process, signal.SIGKILL)
            self.wait()


def serve(item: pytest.Item, pipe: int) -> int:
    """In the child: run the protocol and write what came of it; the exit code."""
    gc.freeze()  # what the parent made is not for this process to finalize
    # What the parent has set up is torn down by the parent: here it has nothing to finalize.
    for finalizers, _ in item.session._setupstate.stack.values():
        finalizers.clear()
    told: dict[str, Any] = {}
    with warnings.catch_warnings(record=True) as caught:
        try:
            reports = runtestprotocol(item, log=False, nextitem=None)
        except pytest.exit.Exception as end:
            reports = []
            told["exit"] = (end.msg, end.returncode)
    to_text = item.config.hook.pytest_report_to_serializable
    told["reports"] = [to_text(config=item.config, report=each) for each in reports]
    told["warnings"] = [(each.category, str(each.message), each.filename, each.lineno) for each in caught]
    save_coverage()
    with os.fdopen(pipe, "wb") as file:
        file.write(pickle.dumps(told))
    return 0


def save_coverage() -> None:
    """If coverage is measured, what was measured in this process."""
    module = sys.modules.get("coverage")
    measuring = module.Coverage.current() if module is not None else None
    if measuring is not None:
        measuring.stop()
        measuring.save()


def died(item: pytest.Item, child: Child) -> pytest.TestReport:
    """The report of a test whose process ended before it could tell."""
    code = child.status or 0
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else "?"
        text = f"{item.nodeid}: the process of the test was killed by signal {-code} ({name})"
    else:
        text = f"{item.nodeid}: the process of the test ended with code {code} before the test did"
    if where := child.notebook.told():
        text += f"\n{where}"

    def fail() -> None:
        pytest.fail(text, pytrace=False)

    call = CallInfo.from_call(fail, "call")
    report: pytest.TestReport = item.ihook.pytest_runtest_makereport(item=item, call=call)
    capture = item.config.pluginmanager.getplugin("capturemanager")
    if capture is not None and capture.is_globally_capturing():  # what it wrote lies where we capture as well
        for stream, written in zip(("stdout", "stderr"), capture.read_global_capture(), strict=True):
            if written:
                report.sections.append((f"Captured {stream} call", written))
    return report


def tear_down(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """In the parent: fixtures of a wider scope that the next test does not need; a failure belongs to this test."""
    setup_state = item.session._setupstate
    call = CallInfo.from_call(
        lambda: setup_state.teardown_exact(nextitem), "teardown", (KeyboardInterrupt, pytest.exit.Exception)
    )
    if call.excinfo is not None:
        report = item.ihook.pytest_runtest_makereport(item=item, call=call)
        item.ihook.pytest_runtest_logreport(report=report)
