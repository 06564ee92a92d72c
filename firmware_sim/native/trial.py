"""A program in C is first loaded and started in a separate process, so that a failure ends only that process.

The process reports its progress over a pipe; the program chooses its exit code, so the code proves nothing.
"""

import contextlib
import mmap
import os
import pathlib
import signal
import warnings
from collections.abc import Callable
from typing import Any

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.user_error import FirmwareError, UserError

PATIENCE_S = 10.0  # of the clock: to load and to start takes milliseconds; chosen by us
LONGEST_TEXT = 32768  # less than a pipe holds
LOADED, STARTED, REFUSED = b"L", b"S", b"R"  # reports of the process: its progress; after the last one the reason
THROUGH = (LOADED + STARTED, STARTED)
IN_TRIAL = "RANGER_SIM_TRIAL"  # in the environment of that process: runtime.c prints nothing there


def record_words() -> memoryview:
    """Memory for a record (crash.py) that forked processes share."""
    return memoryview(mmap.mmap(-1, 8 * crash.RECORD)).cast("q")


def tried(
    what: str,
    library: pathlib.Path,
    sources: pathlib.Path,
    start: Callable[[Any], None] = lambda record: None,
    made: pathlib.Path | None = None,
) -> None:
    """Load a library in a forked process, then call `start(record)` there. UserError, which begins with `what`, when
    the program ends that process or does not return in time; a UserError of `start` is raised here as well.

    record: where the program leaves its place (`leave_record_in`). made: the file, where it is not at `library` yet.
    """
    record = record_words()
    if not hasattr(os, "fork"):
        _load_and_start(library, start, made, record, lambda reached: None)
        return
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
        process = os.fork()
    if process == 0:
        os.close(reading)
        _be_the_trial(lambda reached: _load_and_start(library, start, made, record, reached), writing)
    os.close(writing)
    said = _all_of(reading)
    os.close(reading)
    code = _end_of(process, is_over=said in THROUGH)
    if said in THROUGH:
        return
    reached, _, mistake = said.partition(REFUSED)
    if mistake:
        raise FirmwareError(*mistake.decode(errors="replace").split("\n"))
    how = crash.told(library, sources, record.tolist()) or (
        f"no answer for {PATIENCE_S:g} s"
        if code is None
        else f"its process was killed by signal {-code}"
        if code < 0
        else f"it ended its process with code {code}"
    )
    when = "start" if reached == LOADED else "loading (what runs in it before firmware_start, such as a constructor)"
    raise FirmwareError(f"{what}: its program does not get through its {when}: {how}")


def _load_and_start(
    library: pathlib.Path,
    start: Callable[[Any], None],
    made: pathlib.Path | None,
    record: Any,
    reached: Callable[[bytes], object],
) -> None:
    from ranger_sim.firmware_sim.native.library import Library  # only here: it loads cffi

    Library(made or library, library).leave_record_in(record)
    reached(LOADED)
    start(record)
    reached(STARTED)


def _all_of(pipe: int) -> bytes:
    """Bytes from a pipe until the program is done, the pipe ends, or PATIENCE_S are over."""
    said = b""
    until_s = wallclock.monotonic_s() + PATIENCE_S
    while said not in THROUGH and descriptors.wait([pipe], [], until_s - wallclock.monotonic_s())[0]:
        part = os.read(pipe, LONGEST_TEXT)
        if not part:
            break
        said += part
    return said


def _end_of(process: int, is_over: bool) -> int | None:
    """The exit code of an ending process; None when it did not end and was killed."""
    if not is_over and hasattr(os, "pidfd_open"):
        watch = os.pidfd_open(process)
        is_over = not descriptors.wait([watch], [], PATIENCE_S)[0]
        os.close(watch)
        if not is_over:
            return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    with contextlib.suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    os.waitpid(process, 0)
    return None


def _be_the_trial(work: Callable[[Callable[[bytes], object]], None], writing: int) -> None:
    """Run the trial in the forked process, which exits here."""
    os.environ[IN_TRIAL] = "1"
    try:
        work(lambda reached: os.write(writing, reached))
    except UserError as mistake:
        os.write(writing, REFUSED + str(mistake).encode()[:LONGEST_TEXT])
    except BaseException:  # noqa: BLE001  (the caller comes across it again, and reports it)
        os.write(writing, STARTED)
    finally:
        os._exit(1)
