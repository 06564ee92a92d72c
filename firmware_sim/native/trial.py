"""A program is first tried in a process of its own: what it does to that, it does not do to us."""

import mmap
import os
import pathlib
import signal
import warnings
from collections.abc import Callable
from typing import Any

from ranger_sim.firmware_sim.native import crash
from ranger_sim.foundation.user_error import UserError

PATIENCE_S = 60  # of the clock, for a program that sleeps in the system: to start takes microseconds; chosen by us
LONGEST_TEXT = 32768  # less than a pipe holds
DONE, RAISED = 0, 1


def record_words() -> memoryview:
    """Memory for a record (crash.py) that forked processes share."""
    return memoryview(mmap.mmap(-1, 8 * crash.RECORD)).cast("q")


def tried(what: str, library: pathlib.Path, sources: pathlib.Path, work: Callable[[Any], None]) -> None:
    """Call `work(record)` in a forked process. UserError, which begins with `what`, when the program ends that process.

    A UserError of `work` is raised here as well. record: where the program leaves its place (`leave_record_in`).
    """
    record = record_words()
    if not hasattr(os, "fork"):
        work(record)
        return
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # other threads: nothing in the child needs them
        process = os.fork()
    if process == 0:
        _be_the_trial(work, record, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        mistake = pipe.read().decode()
    status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    if mistake:
        raise UserError(*mistake.split("\n"))
    if status != DONE:
        how = crash.told(library, sources, record.tolist()) or (
            f"it has not ended within {PATIENCE_S} s"
            if status == -signal.SIGALRM
            else f"its process was killed by signal {-status}"
            if status < 0
            else f"it ended its process with code {status}"
        )
        raise UserError(f"{what}: its program does not get through its start: {how}")


def _be_the_trial(work: Callable[[Any], None], record: Any, writing: int) -> None:
    """In the forked process, which leaves here."""
    code = RAISED
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(PATIENCE_S)
    try:
        work(record)
        code = DONE
    except UserError as mistake:
        os.write(writing, str(mistake).encode()[:LONGEST_TEXT])
    except BaseException:  # noqa: BLE001  (who called comes across it again, and tells)
        code = DONE
    finally:
        os._exit(code)
