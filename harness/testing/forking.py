"""A test in a forked process: it has its own copy of everything that was warmed up before, and leaves nothing behind.

Both processes run pytest's own protocol, each phase with the hooks of every plugin. The child has the test: function
fixtures, body and their tear-down. The parent has three substitutes on the item (`setup`, `runtest`, `teardown`), each
of which lets the child run one phase, waits, and raises what was raised there. So all that plugins do around a phase
acts on the test in the child, and on its report in the parent: reruns, time limits, records of outcomes.

The parent takes over the child's reports, warnings and properties. Fixtures of a wider scope are set up and torn down
in the parent. A child that dies is a failed phase whose message names the signal.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import gc
import io
import os
import pickle
import signal
import socket
import sys
import traceback
import warnings
from collections.abc import Callable
from typing import Any

import pytest
from _pytest import outcomes
from _pytest.runner import CallInfo

from ranger_sim.foundation import descriptors, wallclock

LOST = 70  # exit code of a child that could not report its test
PLACES = ("setup", "runtest", "teardown")  # what pytest calls of an item, one in each phase
PHASES = ("setup", "call", "teardown")
END = "end"
GRACE_S = 3.0  # for a child to leave its phase when the parent does not wait any more (a time limit); chosen by us
OWN_LIMIT_S = 0.2  # for a child to report the same time limit by itself; chosen by us
STALE_S = 60.0  # a wait without a limit is cut into pieces of this length
HEAD = 8  # bytes before a message: its length

CHILD = pytest.StashKey[bool]()  # of an item, in the process that was forked for it


def possible(config: pytest.Config) -> bool:
    """Whether tests can be forked: the system can, no debugger is used, and fixtures are set up."""
    unfit = any(config.getoption(name, False) for name in ("usepdb", "trace", "setupplan"))
    return hasattr(os, "fork") and not unfit


class Pickler(pickle.Pickler):
    """pytest's outcomes (skip, fail, xfail) claim the module `builtins`, where pickle does not find them."""

    def reducer_override(self, value: Any) -> Any:
        name = getattr(value, "__name__", "")
        if isinstance(value, type) and getattr(outcomes, name, None) is value:
            return outcome, (name,)
        return NotImplemented


def outcome(name: str) -> Any:
    """A class of pytest's outcomes."""
    return getattr(outcomes, name)


def pickled(value: Any) -> bytes:
    """`value` as bytes."""
    data = io.BytesIO()
    Pickler(data).dump(value)
    return data.getvalue()


class Channel:
    """Messages between the two processes, each a pickle after its length."""

    def __init__(self, end: socket.socket, process: int = 0) -> None:
        self.end = end
        self.received = bytearray()
        self.watched = [end.fileno()]
        self.death = -1
        # the end of `process` is seen also while a child of its own holds the socket
        if process and hasattr(os, "pidfd_open"):
            with contextlib.suppress(OSError):
                self.death = os.pidfd_open(process)
                self.watched.append(self.death)

    def send(self, message: Any) -> None:
        """Send a message; does nothing where the other side is gone."""
        data = pickled(message)
        with contextlib.suppress(OSError):
            self.end.sendall(len(data).to_bytes(HEAD) + data)

    def receive(self, within_s: float | None = None) -> Any:
        """Return the next message; None when the other side has ended, or after `within_s`."""
        __tracebackhide__ = True
        end = None if within_s is None else wallclock.monotonic_s() + within_s
        while True:
            end_of_message = HEAD + int.from_bytes(self.received[:HEAD])
            if HEAD <= end_of_message <= len(self.received):
                data = bytes(self.received[HEAD:end_of_message])
                del self.received[:end_of_message]
                return pickle.loads(data)  # noqa: S301  (our own other process)
            left = STALE_S if end is None else end - wallclock.monotonic_s()
            ready, _ = descriptors.wait(self.watched, [], left)
            if self.watched[0] in ready:
                try:
                    part = self.end.recv(1 << 16)
                except OSError:
                    part = b""
                if not part:
                    return None
                self.received += part
            elif ready or left <= 0.0:
                return None

    def close(self) -> None:
        self.end.close()
        if self.death >= 0:
            os.close(self.death)
            self.death = -1


class ForkedTest:
    """The substitutes of a test in the parent, for one attempt at it.

    `prepare` is called directly before the process is forked; where it returns False the test runs in the parent.
    """

    def __init__(self, item: pytest.Item, prepare: Callable[[], bool]) -> None:
        self.item = item
        self.prepare = prepare
        self.forked = True
        self.child: Child | None = None
        self.reports: dict[str, tuple[pytest.TestReport, BaseException | None]] = {}
        for place in PLACES:
            setattr(item, place, getattr(self, place))

    def withdraw(self) -> None:
        """Give the item its own methods back."""
        for place in PLACES:
            self.item.__dict__.pop(place, None)

    # ---- instead of the item's own

    def setup(self) -> None:
        __tracebackhide__ = True
        if not self.prepare():
            self.forked = False
            self.withdraw()
            self.item.setup()
            return
        if "tmp_path_factory" in getattr(self.item, "fixturenames", ()):
            self.item.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # one for all children
        set_up_wider_fixtures(self.item)
        self.child = Child(self)
        self.follow("setup")

    def runtest(self) -> None:
        __tracebackhide__ = True
        self.follow("call")

    def teardown(self) -> None:
        __tracebackhide__ = True
        if not self.forked:
            self.item.teardown()
            return
        try:
            self.follow("teardown")
        finally:
            self.withdraw()
            self.close()

    # ---- inside

    def follow(self, when: str) -> None:
        """Let the child run a phase; raises what was raised in it."""
        __tracebackhide__ = True
        child = self.child
        if child is None or child.status is not None:
            return
        try:
            reply = child.phase(when)
        except BaseException as reason:  # a time limit, Ctrl-C
            self.adopt(child.interrupted(reason), when, reason)
            raise
        if reply is None:
            child.kill()
            pytest.fail(why_ended(self.item, child), pytrace=False)
        error = self.adopt(reply, when)
        if error is not None:
            raise error

    def adopt(
        self, reply: dict[str, Any] | None, when: str, reason: BaseException | None = None
    ) -> BaseException | None:
        """Take over the child's data of a phase; returns what was raised in it.

        reason: the exception by which the parent interrupted the phase; the child's report counts if it matches.
        """
        if reply is None:
            return None
        item = self.item
        for category, text, filename, line in reply["warnings"]:
            warnings.warn_explicit(text, category, filename, line)
        item._report_sections[:] = reply["sections"]
        item.user_properties[:] = reply["properties"]
        stop_as(item.session, reply["stop"])
        if "exit" in reply:
            return pytest.exit.Exception(*reply["exit"])
        error = error_of(reply)
        if reason is not None and type(error) is type(reason):
            error = reason
        self.reports[when] = reply["report"], error
        return error

    def report_of(self, call: CallInfo[None]) -> pytest.TestReport | None:
        """The child's report of a phase, unless the parent has another outcome of it."""
        report, error = self.reports.pop(call.when, (None, None))
        if report is None or (call.excinfo.value if call.excinfo is not None else None) is not error:
            return None
        report.duration, report.start, report.stop = call.duration, call.start, call.stop
        vars(report)["forked"] = True  # for `pytest_runtest_logreport` of the plugin
        return report

    def close(self) -> None:
        """End the child."""
        if self.child is not None:
            self.child.end()


class Child:
    """The process of one test, as its parent sees it. `status`: its exit code once it has ended."""

    def __init__(self, test: ForkedTest) -> None:
        from ranger_sim.firmware_sim.native import crash  # only here: the pytest of every user imports this

        self.item = test.item
        self.notebook = crash.Notebook()  # a program in C may end the child
        self.status: int | None = None
        ours, theirs = socket.socketpair()
        parent = os.getpid()
        sys.stdout.flush()
        sys.stderr.flush()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # other threads: the child needs nothing of them
            self.process = os.fork()
        if self.process == 0:
            code = LOST
            try:
                ours.close()
                crash.notebook = self.notebook
                from ranger_sim.harness.branching import die_with  # only here: the pytest of every user imports this

                die_with(parent)
                serve(test, Channel(theirs))
                code = 0
            except BaseException:  # noqa: BLE001  (a child must never return into the parent's program)
                traceback.print_exc()
            finally:
                with contextlib.suppress(Exception):
                    sys.stdout.flush()
                    sys.stderr.flush()
                os._exit(code)
        theirs.close()
        self.channel = Channel(ours, self.process)

    def phase(self, when: str) -> dict[str, Any] | None:
        """Run a phase; returns what the child sends, None when it ends in it."""
        __tracebackhide__ = True
        self.channel.send(when)
        return self._reply(None)

    def interrupted(self, reason: BaseException) -> dict[str, Any] | None:
        """Raise `reason` in its phase; returns what it sends, None after ending it when that takes too long.

        A time limit is set in both processes: the child's own, which expires at about the same time, goes first.
        """
        try:
            reply = self._reply(OWN_LIMIT_S)
            if reply is None:
                self.channel.send({"raise": sendable(reason)})
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self.process, signal.SIGINT)
                reply = self._reply(GRACE_S)
        except Exception:  # the parent was interrupted in the middle of a message
            reply = None
        if reply is None:
            self.kill()
        return reply

    def _reply(self, within_s: float | None) -> dict[str, Any] | None:
        """The next reply. Reports of parts of a test that come before it are logged here."""
        __tracebackhide__ = True
        session = self.item.session
        while True:
            message = self.channel.receive(within_s)
            if message is None or "log" not in message:
                reply: dict[str, Any] | None = message
                return reply
            self.item.ihook.pytest_runtest_logreport(report=message["log"])
            self.channel.send((session.shouldfail, session.shouldstop))

    def kill(self) -> None:
        """End it now."""
        with contextlib.suppress(ProcessLookupError):
            os.kill(self.process, signal.SIGKILL)
        self.end()

    def end(self) -> None:
        """Wait for its end: after its last phase, or because no other one is requested."""
        if self.status is None:
            self.channel.send(END)
            self.channel.close()
            self.status = os.waitstatus_to_exitcode(os.waitpid(self.process, 0)[1])


def set_up_wider_fixtures(item: pytest.Item) -> None:
    """Set up in the parent the requested fixtures of a wider scope, because other tests use them as well."""
    known = getattr(getattr(item, "_fixtureinfo", None), "name2fixturedefs", {})
    for name in getattr(item, "fixturenames", ()):
        if name in known and known[name][-1].scope != "function":
            item._request.getfixturevalue(name)  # type: ignore[attr-defined]


def error_of(reply: dict[str, Any]) -> BaseException | None:
    """What was raised in the child, as far as it can be sent."""
    if "error" not in reply:
        return None
    try:
        error = pickle.loads(reply["error"])  # noqa: S301  (it comes from our own child)
    except Exception:  # a class that cannot be made from its text
        error = None
    if isinstance(error, BaseException):
        return error
    try:
        pytest.fail(reply["text"], pytrace=False)
    except pytest.fail.Exception as failure:
        return failure


def stop_as(session: pytest.Session, wanted: tuple[bool | str, bool | str]) -> None:
    """Stop the session where the other process requests it."""
    shouldfail, shouldstop = wanted
    if shouldfail and not session.shouldfail:
        session.shouldfail = shouldfail
    if shouldstop and not session.shouldstop:
        session.shouldstop = shouldstop


def why_ended(item: pytest.Item, child: Child) -> str:
    """The message for a test whose process ended before it could report."""
    code = child.status or 0
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else "?"
        text = f"{item.nodeid}: the process of the test was killed by signal {-code} ({name})"
    else:
        text = f"{item.nodeid}: the process of the test ended with code {code} before the test did"
    where = child.notebook.describe()
    return f"{text}\n{where}" if where else text


# ---- in the child


def serve(test: ForkedTest, channel: Channel) -> None:
    """Run the phases that the parent asks for, until the last one or the parent's end."""
    item = test.item
    item.stash[CHILD] = True
    test.withdraw()
    gc.freeze()  # this process must not finalize the parent's objects
    stack = item.session._setupstate.stack
    stack.pop(item)  # it is set up here, in its own phase
    for finalizers, _ in stack.values():
        finalizers.clear()  # the parent tears down what it has set up
    forward_reports(item, channel)
    interruptible = Interruptible(channel)
    with warnings.catch_warnings(record=True) as caught:
        while (when := channel.receive()) not in (None, END):
            if when not in PHASES:
                continue  # an interrupt that came when the phase was over
            caught.clear()
            reply = run_phase(item, when, interruptible)
            reply["warnings"] = [
                (sendable(one.category, Warning), str(one.message), one.filename, one.lineno) for one in caught
            ]
            reply["sections"] = item._report_sections
            reply["properties"] = [(name, sendable(value, str(value))) for name, value in item.user_properties]
            reply["stop"] = (item.session.shouldfail, item.session.shouldstop)
            sys.stdout.flush()
            sys.stderr.flush()
            channel.send(reply)
            if when == "teardown":
                break
    save_coverage()


def run_phase(item: pytest.Item, when: Any, interruptible: Interruptible) -> dict[str, Any]:
    """Run a phase with the hooks of all plugins; returns its result."""
    hook, config = item.ihook, item.config
    run = getattr(hook, f"pytest_runtest_{when}")
    more = {"nextitem": None} if when == "teardown" else {}

    def phase() -> Any:
        return run(item=item, **more)

    if when == "call":  # not the plugins around the test: they may be at work on what it has raised
        body = item.runtest
        item.runtest = lambda: interruptible.run(body)  # type: ignore[method-assign]
        work = phase
    else:
        work = functools.partial(interruptible.run, phase)
    try:
        call = CallInfo.from_call(work, when, pytest.exit.Exception)
        report = hook.pytest_runtest_makereport(item=item, call=call)
        hook.pytest_report_teststatus(report=report, config=config)  # a test whose subtests failed fails by this
    except pytest.exit.Exception as end:
        return {"exit": (end.msg, end.returncode)}
    reply: dict[str, Any] = {"report": sendable_report(report)}
    if call.excinfo is not None:
        reply["text"] = call.excinfo.exconly()
        with contextlib.suppress(Exception):
            reply["error"] = b""
            reply["error"] = pickled(call.excinfo.value)
    return reply


class Interruptible:
    """Lets SIGINT interrupt what runs within it, and nothing more: the parent must not interrupt a reply in progress.

    It raises the parent's reason, where that sent one: a time limit is exceeded at the line that takes so long.
    """

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.running = False
        signal.signal(signal.SIGINT, self._interrupt)

    def _interrupt(self, number: int, frame: Any) -> None:
        __tracebackhide__ = True
        if self.running:
            self.running = False
            message = self.channel.receive(0.0)
            reason = message.get("raise") if isinstance(message, dict) else None
            raise reason or KeyboardInterrupt

    def run(self, work: Callable[[], Any]) -> Any:
        self.running = True
        try:
            return work()
        finally:
            self.running = False


def forward_reports(item: pytest.Item, channel: Channel) -> None:
    """Let the parent log reports that are logged while a phase runs (of a subtest)."""
    manager: Any = item.config.pluginmanager
    session = item.session
    execute = manager._inner_hookexec

    def forwarding(name: str, implementations: Any, arguments: Any, firstresult: bool) -> Any:
        if name != "pytest_runtest_logreport":
            return execute(name, implementations, arguments, firstresult)
        channel.send({"log": sendable_report(arguments["report"])})
        stop_as(session, channel.receive() or (False, False))
        return []

    manager._inner_hookexec = forwarding


def sendable(value: Any, instead: Any = None) -> Any:
    """`value`, or `instead` where it cannot be sent."""
    try:
        pickled(value)
    except Exception:
        return instead
    return value


def sendable_report(report: Any) -> Any:
    """`report` without attachments of plugins that cannot be sent."""
    copied = copy.copy(report)
    copied.longrepr = sendable(report.longrepr, report.longreprtext)
    copied.user_properties = [(name, sendable(value, str(value))) for name, value in report.user_properties]
    for name, value in vars(report).items():
        if name not in ("longrepr", "user_properties") and sendable(value) is not value:
            delattr(copied, name)
    return copied


def save_coverage() -> None:
    """Save this process's coverage, if coverage is measured."""
    module = sys.modules.get("coverage")
    measuring = module.Coverage.current() if module is not None else None
    if measuring is not None:
        measuring.stop()
        measuring.save()
