"""One run in a forked process: a branch of a robot that walks already, or a new robot.

The branch has the robot's whole state at that time, and returns only its result. A branch that raises, dies or takes
too long is a result as well, and harms no other process. Where the system cannot fork, this process does the work.
"""

import contextlib
import json
import os
import signal
import sys
import warnings
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation import descriptors, systems, wallclock
from ranger_sim.foundation.user_error import raised

CHUNK = 1 << 16


class BranchError(Exception):
    """The branch returned no result. `outcome`: "crashed" or "timed out"; the text says why."""

    def __init__(self, outcome: str, why: str) -> None:
        Exception.__init__(self, why)
        self.outcome = outcome


def fork() -> int:
    """`os.fork` of a process whose other threads, if any, hold nothing that the branch needs."""
    with warnings.catch_warnings():
        # Python 3.12 on warns about threads; the callers have none, those of numerical libraries sleep
        warnings.simplefilter("ignore", DeprecationWarning)
        return os.fork()


def die_with(parent: int) -> None:
    """Let the kernel, if it can, kill this process when `parent` (its parent's process id) ends in any way."""
    if sys.platform.startswith("linux"):
        from ranger_sim.harness.processes import kernel

        kernel.die_with_parent(parent)


def branch(work: Callable[[], dict[str, Any]], cpu_s: float, wall_s: float) -> dict[str, Any]:
    """Return what `work` returns in a forked process; BranchError when it raises, dies, or takes too long.

    cpu_s: of computing, which other load of the machine does not change. wall_s: of the wall clock, for work that waits
    for ever and computes nothing. Both hold only where the system can fork.
    """
    if not systems.can_fork():
        try:
            in_here: dict[str, Any] = json.loads(json.dumps(work()))
        except Exception as error:
            raise BranchError("crashed", raised(error)) from None
        return in_here
    sys.stdout.flush()
    sys.stderr.flush()
    reading, writing = os.pipe()
    parent = os.getpid()
    child = fork()
    if child == 0:
        _be_the_branch(work, parent, reading, writing, cpu_s)
    os.close(writing)
    try:
        answer = _read(reading, wallclock.monotonic_s() + wall_s)
    finally:
        os.close(reading)
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)  # its output is complete, or it is late
        _, status = os.waitpid(child, 0)
    if answer is None:
        raise BranchError("timed out", f"no result within {wall_s:g} s of the wall clock")
    code = os.waitstatus_to_exitcode(status)
    if code == -signal.SIGXCPU:
        raise BranchError("timed out", f"longer than {cpu_s:g} s of computing")
    if not answer:
        raise BranchError("crashed", f"its process ended with {code}")
    try:
        result: dict[str, Any] = json.loads(answer)
    except ValueError:
        raise BranchError("crashed", f"its process ended with {code} while it sent its result") from None
    if "raised" in result:
        raise BranchError("crashed", result["raised"])
    return result


def _be_the_branch(work: Callable[[], dict[str, Any]], parent: int, reading: int, writing: int, cpu_s: float) -> None:
    """Work, write the result, and end without any of the parent's clean-up."""
    import resource

    code = 1
    try:
        os.close(reading)
        die_with(parent)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        allowed = max(1, round(cpu_s))  # whole seconds; a forked process counts from 0
        resource.setrlimit(resource.RLIMIT_CPU, (allowed, allowed + 1))
        try:
            answer = json.dumps(work())
        except BaseException as error:
            answer = json.dumps({"raised": raised(error)})
        with os.fdopen(writing, "w", encoding="utf-8") as pipe:
            pipe.write(answer)
        code = 0
    finally:
        os._exit(code)


def _read(pipe: int, deadline_s: float) -> bytes | None:
    """Read until the other end is closed; None when that does not happen before the deadline."""
    parts: list[bytes] = []
    while True:
        left = deadline_s - wallclock.monotonic_s()
        if left <= 0.0 or not descriptors.wait([pipe], [], left)[0]:
            return None
        part = os.read(pipe, CHUNK)
        if not part:
            return b"".join(parts)
        parts.append(part)
