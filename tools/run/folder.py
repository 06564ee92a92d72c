"""The folder of one run: its owner, which of its files are complete, and its state when the run is interrupted.

While a run lasts, the folder holds `incomplete.json` and the growing files, with `.partial` in their names. A whole
file gets its own name. At the end `incomplete.json` becomes `summary.json`, last of all: if that exists, the run has
ended and every other file belongs to it. After anything else, a full disk or a kill -9, the names show which files are
partial.
"""

import contextlib
import json
import os
import pathlib
from collections.abc import Callable, Iterator
from typing import Any, Self

from ranger_sim.foundation import json_text, systems
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.command_line.files import writable_folder

SUMMARY = "summary.json"
OPEN = "incomplete.json"
BUS_LOGS = ("can1.log", "can2.log", "can3.log", "can4.log")
VARIABLES = "variables.mf4"
REPORT = "report.html"
LCOV = "lcov.info"
FILES = (*BUS_LOGS, VARIABLES, REPORT, LCOV)  # in addition to the summary
# Bytes that incomplete.json takes from the disk at the start, so that a summary (some 20 kB) fits into it when the disk
# is full at the end. Chosen by us.
RESERVED = 65_536
BROKEN_OFF = "the run has not ended, or was broken off: this folder is incomplete"
FAILURES = (OSError, MemoryError)  # of the machine: a file then stays partial, and the run continues


def printed_name(board: str) -> str:
    """The file for the output of a board's program in C."""
    return f"printed-{board}.txt"


def partial(name: str) -> str:
    """The name of a file until it is whole."""
    stem, dot, suffix = name.rpartition(".")
    return f"{stem}.partial{dot}{suffix}"


def cause_of(error: BaseException) -> str:
    """A failure of the machine as text."""
    if isinstance(error, MemoryError):
        return "out of memory"
    return (error.strerror if isinstance(error, OSError) else None) or str(error) or type(error).__name__


class RunFolder:
    """One run's folder. A context manager: if left by an exception, it records that in `incomplete.json`.

    Files of an older run are removed first: only those of the names above, and only if a record of ours marks a run.
    UserError for a folder in which a file of such a name is not from a run, or in which another run is writing.
    report: called with a line for every file that could not be finished.
    """

    def __init__(self, name: str | pathlib.Path, command: str, report: Callable[[str], None]) -> None:
        self.path = writable_folder(name)
        self.command = command
        self.report = report
        self.files: dict[str, str] = {}  # "complete", or why it is not
        self.is_done = False
        self.lock = -1  # the descriptor of the record, while this run owns the folder
        self._claim()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: Any, error: BaseException | None, _trace: Any) -> None:
        if not self.is_done:
            with contextlib.suppress(*FAILURES):  # a failure to record it must not hide the error itself
                why = f"{type(error).__name__}: {error}" if error is not None else BROKEN_OFF
                self._write_record({**self._record(), "ended": why})
        self._release()

    @contextlib.contextmanager
    def file(self, name: str) -> Iterator[pathlib.Path]:
        """Yield the path to write the file `name` to; it gets its name when it is whole.

        A failure of the machine is reported and recorded, and does not affect anything else.
        """
        path = self.begin(name)
        try:
            yield path
        except FAILURES as error:
            self.failed(name, error)
        else:
            self.done(name)

    def begin(self, name: str) -> pathlib.Path:
        """The path at which `name` grows until it is `done` or has `failed`."""
        self.files[name] = "incomplete"
        return self.path / partial(name)

    def done(self, name: str) -> None:
        """`name` is whole."""
        (self.path / partial(name)).replace(self.path / name)
        self.files[name] = "complete"

    def failed(self, name: str, error: BaseException, until: str = "") -> None:
        """`name` stays partial."""
        self.files[name] = f"incomplete: {cause_of(error)}{until}"
        self.report(f"{self.path / partial(name)}: {cause_of(error)}: the file ends there{until}")

    @property
    def is_complete(self) -> bool:
        """True when every file that was begun is complete."""
        return all(state == "complete" for state in self.files.values())

    def finish(self, summary: dict) -> None:
        """Write the summary, with the complete files, in its reserved place, and give the folder its final state."""
        summary.update(complete=self.is_complete, files=self.files)
        self._write_record(summary)
        if systems.is_windows():
            self._release()
        try:
            (self.path / OPEN).replace(self.path / SUMMARY)
        except OSError as error:
            raise UserError(f"{self.path / SUMMARY}: {cause_of(error)}; the summary is in {OPEN}") from None
        self.is_done = True

    # --- ownership ------------------------------------------------------------------------------------------

    def _release(self) -> None:
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1

    def _claim(self) -> None:
        record = self.path / OPEN
        is_new = not record.exists()
        try:
            self.lock = os.open(record, os.O_RDWR | os.O_CREAT | systems.O_NOFOLLOW | systems.O_BINARY, 0o644)
        except OSError as error:
            raise UserError(f"{record}: {cause_of(error)}") from None
        try:
            systems.lock(self.lock)
            older = self._files_of_older_run(is_new)
            self._write_record(self._record())  # before they go: a killed run leaves no file that belongs to none
            for name in older:
                (self.path / name).unlink()
        except BaseException as error:
            if systems.is_windows():
                self._release()
            if is_new:
                record.unlink(missing_ok=True)
            self._release()
            if isinstance(error, BlockingIOError):
                raise UserError(f"{self.path}: another run is writing there") from None
            if isinstance(error, OSError):
                raise UserError(f"{record}: {cause_of(error)}") from None
            raise

    def _files_of_older_run(self, is_new: bool) -> list[str]:
        """The summary first: from then on nothing marks the rest as a whole run. UserError where one is not a run's."""
        printed = sorted(each.name for each in self.path.glob(printed_name("*")))  # partial ones as well
        names = [SUMMARY, *FILES, *map(partial, FILES), *printed]
        there = [name for name in names if (self.path / name).is_symlink() or (self.path / name).exists()]
        if not there:
            return []
        is_ours = is_run_record(self.path / SUMMARY) or (not is_new and is_run_record(self.path / OPEN))
        foreign = there if not is_ours else [name for name in there if (self.path / name).is_dir()]
        if SUMMARY in there and not is_run_record(self.path / SUMMARY):
            foreign = [SUMMARY, *foreign]
        if foreign:
            raise UserError(
                f"{self.path / foreign[0]}: exists and belongs to no run of this folder; "
                "remove it or choose another folder"
            )
        return there

    def _record(self) -> dict:
        return {"complete": False, "what": BROKEN_OFF, "command": self.command, "files": self.files}

    def _write_record(self, content: dict) -> None:
        """`content` into incomplete.json, padded with blanks to the reserved length, which JSON does not mind."""
        data = (json.dumps(content, indent=2) + "\n").encode()
        data = data.ljust(RESERVED if "what" in content else len(data))
        at = 0
        while at < len(data):
            at += systems.write_at(self.lock, data[at:], at)
        os.ftruncate(self.lock, len(data))
        os.fsync(self.lock)


def is_run_record(path: pathlib.Path) -> bool:
    """True for a summary or an incomplete.json of a run, whatever version wrote it."""
    try:
        content = json_text.loads(path.read_bytes(), path.name)
    except (OSError, json_text.JsonError):
        return False
    return isinstance(content, dict) and ("trace_digest" in content or {"complete", "command"} <= content.keys())
