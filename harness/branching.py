"""One run in a forked process: a branch of a robot that walks already, or a robot of its own.

The branch has everything of the robot as it is at that instant, and nothing that it does comes back but its result. A
branch that raises, dies or takes too long is a result as well, and harms nobody.
"""

import contextlib
import json
import os
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation import descriptors, wallclock

CHUNK = 1 << 16


class BranchError(Exception):
    """The branch gave no result. `outcome`: "crashed" or "timed out"; the text says why."""

    def __init__(self, outcome: str, why: str) -> None:
        Exception.__init__(self, why)
        self.outcome = outcome


def fork() -> int:
    """`os.fork` of a process whose other threads, if there are any, hold nothing that the branch needs."""
    with warnings.catch_warnings():
        # Python 3.12 on warns of threads; the callers have none of their own, those of numerical libraries sleep
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def branch(work: Callable[[], dict[str, Any]], cpu_s: float, wall_s: float) -> dict[str, Any]:
    """What `work` returns in a forked process; BranchError when it raises, dies, or takes too long.

    cpu_s: of computing, which a machine that does other things does not change. wall_s: of the wall clock, for what
    waits for ever and computes nothing.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    reading, writing = os.pipe()
    child = fork()
    if child == 0:
        os.close(reading)
        _be_the_branch(work, writing, cpu_s)
    os.close(writing)
    try:
        answer = _read(reading, wallclock.monotonic_s() + wall_s)
    finally:
        os.close(reading)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)  # it has told all it will, or is late
        _, status = os.waitpid(child, 0)
    if answer is None:
        raise BranchError("timed out", f"no result within {wall_s:g} s of the wall clock")
    code = os.waitstatus_to_exitcode(status)
    if code == -signal.SIGXCPU:
        raise BranchError("timed out", f"longer than {cpu_s:g} s of computing")
    if not answer:
        raise BranchError("crashed", f"its process ended with {code}")
    told: dict[str, Any] = json.loads(answer)
    if "raised" in told:
        raise BranchError("crashed", told["raised"])
    return told


def _be_the_branch(work: Callable[[], dict[str, Any]], writing: int, cpu_s: float) -> None:
    """Work, write the result, and end without any of the parent's clean-up."""
    code = 1
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        allowed = max(1, round(cpu_s))  # whole seconds; a forked process counts from nothing
        resource.setrlimit(resource.RLIMIT_CPU, (allowed, allowed + 1))
        try:
            told = work()
        except BaseException as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            told = {"raised": f"{type(error).__name__}: {error} ({os.path.basename(place.filename)}:{place.lineno})"}
        with os.fdopen(writing, "w", encoding="utf-8") as pipe:
            json.dump(told, pipe)
        code = 0
    finally:
        os._exit(code)


def _read(pipe: int, deadline_s: float) -> bytes | None:
    """Everything until the other end is closed; None when that is not before the deadline."""
    parts: list[bytes] = []
    while True:
        left = deadline_s - wallclock.monotonic_s()
        if left <= 0.0 or not descriptors.wait([pipe], [], left)[0]:
            return None
        part = os.read(pipe, CHUNK)
        if not part:
            return b"".join(parts)
        parts.append(part)
