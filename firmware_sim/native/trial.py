"""A program in C is first loaded and started in a separate, confined process, so that a failure ends only that process.

The process reports over a pipe: what its confinement lacks, in a line, before it loads the program; its progress, a
letter each; and after the last one a description of the program as JSON, in a line. The program chooses its exit code,
so the code proves nothing, and it can write to the pipe: nothing in the description is taken for granted.
"""

import contextlib
import dataclasses
import functools
import importlib
import json
import mmap
import os
import pathlib
import signal
import warnings
from collections.abc import Callable
from typing import Any

from ranger_sim.firmware_sim.native import confinement, crash, sanitizers
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.user_error import FirmwareError, UserError

PATIENCE_S = 10.0  # of the clock, for all of it: to load and to start takes milliseconds; chosen by us
ASKING_S = 0.2  # of the clock, for a program that is asked for its position; it writes a few words
LONGEST_TEXT = 32768  # less than a pipe holds
LONGEST_DESCRIPTION = 1 << 20  # bytes; one of a large schedule has some 20,000. Chosen by us
LOADED, STARTED, REFUSED = b"L", b"S", b"R"  # reports of the process: its progress; after the last one the reason
IN_TRIAL = "RANGER_SIM_TRIAL"  # in the environment of that process: runtime.c prints nothing there


def record_words() -> memoryview:
    """Memory for a record (crash.py) that forked processes share."""
    return memoryview(mmap.mmap(-1, 8 * crash.RECORD)).cast("q")


@dataclasses.dataclass(frozen=True)
class Tried:
    """A program that loads and starts. lacks: what the confinement of its process lacks, None: it had no process.

    description: what `start` returned there.
    """

    lacks: tuple[str, ...] | None
    description: Any


def needs_of(library: pathlib.Path, sources: pathlib.Path, counts: pathlib.Path | None = None) -> confinement.Needs:
    """What the process of a program needs: it reads its folder, and writes findings and counts of coverage."""
    findings = sanitizers.place_of_findings()
    write = [each for each in (findings, counts) if each is not None]
    if counts is not None:
        counts.mkdir(parents=True, exist_ok=True)
    return confinement.Needs((library.parent, sources), tuple(write), large_memory=findings is not None)


def tried(
    what: str,
    library: pathlib.Path,
    sources: pathlib.Path,
    start: Callable[[Any], Any] = lambda record: None,
    made: pathlib.Path | None = None,
    patience_s: float | None = None,
) -> Tried:
    """Load a library in a forked process, then call `start(record)` there. UserError, which begins with `what`, when
    the program ends that process or does not return in time; a UserError of `start` is raised here as well.

    record: where the program leaves its place (`leave_record_in`). made: the file, where it is not at `library` yet;
    what it prints is dropped then, because it is loaded again from there. patience_s: the time, of the clock; None:
    PATIENCE_S.
    """
    importlib.import_module("cffi")  # a missing library is not the program's fault
    record = record_words()
    if not hasattr(os, "fork"):
        return Tried(None, _load_and_start(library, start, made, record, lambda reached: None))
    needs = needs_of(made or library, sources)
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
        process = confinement.fork(needs.has_own_numbers)
    if process == 0:
        os.close(reading)
        work = functools.partial(_load_and_start, library, start, made, record)
        _be_the_trial(work, writing, needs, is_silent=made is not None)
    os.close(writing)
    patience_s = PATIENCE_S if patience_s is None else patience_s
    until_s = wallclock.monotonic_s() + patience_s
    output = _all_of(reading, until_s)
    os.close(reading)
    code = _end_of(process, until_s, is_over=_is_through(output))
    lacks, _, progress = output.partition(b"\n")
    if _is_through(output):
        try:
            return Tried(tuple(json.loads(lacks)), json.loads(progress[len(LOADED + STARTED) :]))
        except (ValueError, TypeError, RecursionError):
            raise FirmwareError(f"{what}: its program writes over the reports of its start") from None
    reached, _, mistake = progress.partition(REFUSED)
    if mistake:
        raise FirmwareError(*mistake.decode(errors="replace").split("\n"))
    place = crash.describe(library, sources, record.tolist())
    if code is None:
        how = ": ".join(filter(None, (f"no answer for {patience_s:g} s", place)))
    else:
        how = place or (
            f"its process was killed by signal {-code}" if code < 0 else f"it ended its process with code {code}"
        )
    when = "start" if reached == LOADED else "loading (what runs in it before firmware_start, such as a constructor)"
    raise FirmwareError(f"{what}: its program fails in its {when}: {how}")


def _load_and_start(
    library: pathlib.Path,
    start: Callable[[Any], Any],
    made: pathlib.Path | None,
    record: Any,
    reached: Callable[[bytes], object],
) -> Any:
    from ranger_sim.firmware_sim.native.library import Library  # only here: it loads cffi

    Library(made or library, library).leave_record_in(record)
    reached(LOADED)
    return start(record)


def _is_through(output: bytes) -> bool:
    """Whether these are all the reports of a program that has started."""
    progress = output.partition(b"\n")[2]
    return progress.startswith(LOADED + STARTED) and progress.endswith(b"\n")


def _all_of(pipe: int, until_s: float) -> bytes:
    """Bytes from a pipe until the program is done, the pipe ends, or it is `until_s` by the clock."""
    output = b""
    while not _is_through(output) and descriptors.wait([pipe], [], max(0.0, until_s - wallclock.monotonic_s()))[0]:
        part = os.read(pipe, LONGEST_TEXT)
        if not part or len(output) > LONGEST_DESCRIPTION:
            break
        output += part
    return output


def _end_of(process: int, until_s: float, is_over: bool) -> int | None:
    """The exit code of a process that ends before `until_s`; None when it did not and was asked for its position and
    killed, or `is_over`: nothing more is wanted of it.
    """
    if not is_over and hasattr(os, "pidfd_open"):
        watch = os.pidfd_open(process)
        try:
            if descriptors.wait([watch], [], max(0.0, until_s - wallclock.monotonic_s()))[0]:
                return confinement.wait_for(process)
            for number in (crash.ASKED, signal.SIGCONT):
                os.kill(process, number)
            descriptors.wait([watch], [], ASKING_S)
        finally:
            os.close(watch)
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    confinement.wait_for(process)
    return None


def _be_the_trial(
    work: Callable[[Callable[[bytes], object]], Any], writing: int, needs: confinement.Needs, is_silent: bool
) -> None:
    """Run the trial in the forked process, which exits here."""
    from ranger_sim.firmware_sim.native import library

    if is_silent:
        nothing = os.open(os.devnull, os.O_WRONLY)
        for output in (1, 2):
            os.dup2(nothing, output)
        os.close(nothing)
    else:
        os.dup2(1, 2)  # all that it prints is its board's output
    os.environ[IN_TRIAL] = "1"
    library.runs_one_program = True
    try:
        os.write(writing, json.dumps(confinement.confine(needs, [writing])).encode() + b"\n")
        description = work(lambda reached: os.write(writing, reached))
        report = STARTED + json.dumps(description).encode() + b"\n"
        while report:
            report = report[os.write(writing, report) :]
    except UserError as mistake:
        os.write(writing, REFUSED + str(mistake).encode()[:LONGEST_TEXT])
    except BaseException as error:  # noqa: BLE001  (the program may have damaged anything here)
        os.write(writing, REFUSED + f"{type(error).__name__}: {error}".encode()[:LONGEST_TEXT])
    finally:
        os._exit(1)
