"""The logs of a run in its folder: frames per bus as candump writes them, variables as MDF."""

import functools
import pathlib
from collections.abc import Callable
from typing import IO, Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.firmware.printed import Printed
from ranger_sim.harness.records.logbook import decoded
from ranger_sim.tools.run.folder import BUS_LOGS, FAILURES, VARIABLES, RunFolder, printed_name

Takers = dict[str, Callable[[Any], None]]  # of rows, by the stream that supplies them
Close = Callable[[], None]


class Part:
    """One file of the logs, fed by some of the recorder's streams: {stream: function that takes its rows}."""

    def __init__(self, name: str, takers: Takers, close: Close) -> None:
        self.name = name
        self.takers = takers
        self.close = close
        self.is_open = True


class RunLogs:
    """Files that take the rows of the robot's recorder. A write error is reported once, and the run continues.

    follow: write from now on, as rows arrive; otherwise at the end, from the robot's log.
    """

    def __init__(self, robot: Any, folder: RunFolder, follow: bool) -> None:
        self.robot = robot
        self.folder = folder
        self.follows = follow
        self.parts: list[Part] = []
        if follow:
            self._open()
            for part in self.parts:
                for stream in part.takers:
                    robot.logbook.listen(stream, functools.partial(self._take, part, stream))

    def finish(self) -> None:
        """Write the remaining or all kept rows, and finish every file."""
        if self.follows:
            self.robot.logbook.flush()
        else:
            self._open()
            for part in self.parts:
                for stream in part.takers:
                    for rows in self.robot.logbook.kept(stream):
                        self._take(part, stream, rows)
        for part in self.parts:
            if part.is_open:
                try:
                    part.close()
                except FAILURES as error:
                    self._failed(part, error)
                else:
                    self.folder.done(part.name)

    def _open(self) -> None:
        makers: dict[str, Callable[[pathlib.Path], tuple[Takers, Close]]] = {
            **{name: functools.partial(frame_part, f"can{number}") for number, name in enumerate(BUS_LOGS, 1)},
            VARIABLES: functools.partial(variables_part, self.robot),
        }
        for name, make in makers.items():
            path = self.folder.begin(name)
            try:
                self.parts.append(Part(name, *make(path)))
            except (*FAILURES, UserError) as error:
                self.folder.failed(name, error)

    def _take(self, part: Part, stream: str, rows: Any) -> None:
        if part.is_open:
            try:
                part.takers[stream](rows)
            except FAILURES as error:
                self._failed(part, error)

    def _failed(self, part: Part, error: BaseException) -> None:
        part.is_open = False
        until = f", at {self.robot.time_s:.1f} s of the walk" if self.follows else ""
        self.folder.failed(part.name, error, until)


class PrintedFiles:
    """Output of a run's programs in C, in its folder: a file for each board that prints something."""

    def __init__(self, printed: Printed, folder: RunFolder) -> None:
        self.folder = folder
        self.files: dict[str, IO[bytes] | None] = {}  # None: it could not be written any more
        printed.keep = self.take

    def take(self, board: str, data: bytes) -> None:
        """More of a board's output."""
        name = printed_name(board)
        try:
            if board not in self.files:
                self.files[board] = self.folder.begin(name).open("wb", buffering=0)
            file = self.files[board]
            if file is not None:
                file.write(data)
        except FAILURES as error:
            self._close(board)
            self.folder.failed(name, error)

    def finish(self) -> None:
        """Give every file its name."""
        for board, file in self.files.items():
            if file is not None:
                file.close()
                self.folder.done(printed_name(board))
        self.files.clear()

    def _close(self, board: str) -> None:
        file, self.files[board] = self.files.get(board), None
        if file is not None:
            file.close()


def frame_part(bus: str, path: pathlib.Path) -> tuple[Takers, Close]:
    """The frames of one bus."""
    from ranger_sim.can_bus.edge.candump import CandumpWriter

    log = CandumpWriter(path)

    def take(rows: Any) -> None:
        frames = decoded(rows)
        columns = (frames[name].tolist() for name in ("time_ns", "identifier", "flags", "word0", "word1"))
        log.write(bus, zip(*columns, strict=True))

    return {bus: take}, log.close


def variables_part(robot: Any, path: pathlib.Path) -> tuple[Takers, Close]:
    """Body and variables."""
    from ranger_sim.tools.recordings.variables_file import VariablesFile

    file = VariablesFile(robot, path)
    return {"samples": file.add_samples, "words": file.add_words}, file.close


def write_frames(robot: Any, folder: pathlib.Path) -> None:
    """Write the frames in the robot's log into `folder`: one file per bus. OSError on failure."""
    for name, bus in zip(BUS_LOGS, robot.buses, strict=True):
        takers, close = frame_part(bus.name, folder / name)
        for rows in robot.logbook.kept(bus.name):
            takers[bus.name](rows)
        close()
