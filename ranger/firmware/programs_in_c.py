"""The programs in C of one robot: their trial, what they print, where they crash, and which of their lines ran."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

from ranger_sim.firmware_sim.native import confinement, coverage, crash
from ranger_sim.firmware_sim.native.stand_in import description
from ranger_sim.firmware_sim.native.trial import Tried, tried
from ranger_sim.foundation.user_error import FirmwareError
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.firmware.printed import Printed


class ProgramsInC:
    """`firmware`: by board; those compiled for coverage have a folder for their counts.

    printed: takes what they print; without it they print on standard output. elsewhere: they run in other processes,
    and none of them is loaded in this one. patience_s: how long the trial of each may take; 0 or None: as long as
    trial.py says.
    """

    def __init__(
        self,
        firmware: dict[str, Firmware],
        printed: Printed | None,
        elsewhere: bool = False,
        patience_s: float | None = None,
    ) -> None:
        self.patience_s = patience_s or None
        self.printed = printed
        self.elsewhere = elsewhere
        self.trials: dict[str, Tried] = {}  # by board
        self.folder: tempfile.TemporaryDirectory[str] | None = None  # of the counts, where none was chosen
        self.are_watched = False
        if any(each.coverage and each.counts is None for each in firmware.values()):
            self.folder = tempfile.TemporaryDirectory(prefix="ranger-sim-counts-")
            place = pathlib.Path(self.folder.name)
            firmware = {
                name: dataclasses.replace(each, counts=each.counts or place / name) if each.coverage else each
                for name, each in firmware.items()
            }
        self.firmware = firmware

    def try_each(self, new_board: Callable[[str, Any], Any]) -> None:
        """Start each program once in a process that it may crash. UserError where it does.

        new_board(name, record): a board whose program leaves its position in `record` when it ends its process.
        """
        for name, firmware in self.firmware.items():

            def start(record: Any, name: str = name) -> Any:
                self.load_here()
                board = new_board(name, record)
                board.counters()
                return description(board)

            with self.printing(name):
                self.trials[name] = tried(
                    f"{firmware.folder}: {name}",
                    firmware.library,
                    firmware.folder,
                    start,
                    patience_s=self.patience_s,
                )
            if self.printed is not None:
                self.printed.drop(name)  # its program will print that again

    def load_here(self) -> None:
        """In the process of one program, whose output is the board's already: it is loaded here from now on."""
        self.elsewhere, self.printed = False, None

    def lacks(self, board: str) -> tuple[str, ...] | None:
        """What the confinement of a board's process lacks; None: its program runs in this process, or unconfined."""
        return self.trials[board].lacks if self.elsewhere and not confinement.unavailable() else None

    def require_confined(self) -> None:
        """UserError for a program that is not confined in every way."""
        for name in self.firmware:
            confined = confinement.describe(self.lacks(name))
            if confined != "yes":
                why = confinement.unavailable() or "its program runs in the run's own process"
                reason = f"{confined} ({why})" if self.lacks(name) is None else confined
                raise FirmwareError(f"{name}: every program in C is to be confined (--require-confined): {reason}")

    def printing(self, board: str) -> contextlib.AbstractContextManager[None]:
        """Within it, output of programs in C in this process counts as output of `board`."""
        return self.printed.during(board) if self.printed is not None else contextlib.nullcontext()

    @contextlib.contextmanager
    def running(self, loop: Any) -> Iterator[None]:
        """Within it, the programs of this process run, and their crashes leave their position."""
        here = [name for name in self.firmware if not loop.board(name).out_of_process]
        if not self.are_watched:
            self.are_watched = True
            for name in here:
                self.watch(loop.board(name))
        try:
            with self.printing("+".join(here)) if here else contextlib.nullcontext():
                yield
        finally:
            if self.printed is not None:
                self.printed.poll()

    def watch(self, board: Any) -> None:
        """Let the program of a board in this process record its position if it ends the process."""
        firmware = self.firmware[board.name]
        if board.counts is not None:
            os.environ[coverage.PREFIX] = str(board.counts)  # for a crash, which writes them as well
        board.leave_record_in(*crash.record_of(board.name, firmware.library, firmware.folder))

    def finish(self, machine: Any) -> None:
        """Let boards with programs compiled for coverage write which of their lines ran, where another process reads
        that: before `machine` closes.
        """
        if self.folder is not None or machine.lost:
            return
        for name, firmware in self.firmware.items():
            board = machine.loop.board(name)
            if firmware.coverage and not board.out_of_process:
                board.write_counts()
            elif firmware.coverage:
                machine.mode.fetch_counters((name,))

    def close(self) -> None:
        """Remove the folder of the counts, if it was made here."""
        if self.folder is not None:
            self.folder.cleanup()
