"""Records of a run for a comparison: frames, the body, the variables that the log keeps, the boards' errors.

An `Evidence` records a machine from its creation on; its `record()` is arrays, the same for the same run, also
when it was made in a forked process.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from ranger_sim.foundation.user_error import FaultError
from ranger_sim.harness.faults.error_rows import StateWord
from ranger_sim.harness.names import Names


@dataclasses.dataclass
class Record:
    """A run between two times (ns since the simulation's zero, as all times here).

    frames: {bus: rows of `foundation.row_stream.FrameStream`}. samples: rows of time (s) and the plant's quantities,
    words: rows of time and the memory of the board `memory` (empty: of none), both every 2 ms. errors: rows of
    `ErrorRows`, places as in `boards`. quantities: names of the samples' columns after the time. machines: those whose
    state is in the words. fell_ns: -1 when it has not fallen by the end.
    """

    begin_ns: int
    end_ns: int
    frames: dict[str, np.ndarray]
    samples: np.ndarray
    words: np.ndarray
    errors: np.ndarray
    boards: list[str]
    names: Names
    quantities: tuple[str, ...]
    machines: dict[str, StateWord]
    memory: str = ""
    fell_ns: int = -1
    fall_cause: str = ""

    def until(self, end_ns: int) -> "Record":
        """The same run as if it had ended at `end_ns`."""
        return dataclasses.replace(
            self,
            end_ns=min(self.end_ns, end_ns),
            frames={bus: rows[rows[:, 0] <= end_ns] for bus, rows in self.frames.items()},
            samples=self.samples[self.samples[:, 0] <= end_ns * 1e-9],
            words=self.words[self.words[:, 0] <= end_ns],
            errors=self.errors[self.errors[:, 0] <= end_ns],
            fell_ns=self.fell_ns if self.fell_ns <= end_ns else -1,
        )

    def sample(self, name: str) -> np.ndarray:
        """One quantity of the body over the run."""
        return self.samples[:, 1 + self.quantities.index(name)]

    def machine(self, name: str) -> np.ndarray:
        """The state numbers of a machine, one per row of `words`."""
        return self.words[:, 1 + self.machines[name].word]


class Evidence:
    """Records `robot` (a `harness.machine.Machine`) from now on, in addition to its log.

    UserError for one with boards in other processes: their errors arrive too late to be timed.
    """

    def __init__(self, robot: Any) -> None:
        if any(board.apart for board in robot.loop.boards):
            raise FaultError(
                "proof of a fault: every board must run in this process (backend sim; firmware in C: --in-process, "
                "or Ranger(in_process=True))"
            )
        self.robot = robot
        self.begin_ns = robot.loop.time
        self.blocks: dict[str, list[bytes]] = {}
        self.streams = robot.recorder.streams()
        if robot.loop.sampler.words is None and robot.loop.sampler.board is not None:
            robot.loop.sampler.words = robot.recorder.words
        self.watch = robot.error_watch()
        self.streams["errors"] = self.watch.rows
        for name, stream in self.streams.items():
            stream.flush()
            self.blocks[name] = []
            stream.sink = self._keeper(self.blocks[name], stream.sink)
        robot.loop.watchers.append(self.watch)

    @staticmethod
    def _keeper(blocks: list[bytes], before: Callable[[int, bytes], None] | None) -> Callable[[int, bytes], None]:
        def keep(last_time_ns: int, block: bytes) -> None:
            blocks.append(block)
            if before is not None:
                before(last_time_ns, block)

        return keep

    def alone(self) -> None:
        """Take the robot's streams exclusively from now on: in a branch, whose parent has the log's files."""
        for name, stream in self.streams.items():
            stream.sink = self._keeper(self.blocks[name], None)

    def record(self) -> Record:
        """Everything until now."""
        robot = self.robot
        rows = {}
        for name, stream in self.streams.items():
            stream.flush()
            kind = np.float64 if stream.is_real else np.int64
            rows[name] = np.frombuffer(b"".join(self.blocks[name]), dtype=kind).reshape(-1, stream.columns)
        remembered = robot.loop.sampler.board
        return Record(
            begin_ns=self.begin_ns,
            end_ns=robot.loop.time,
            frames={bus.name: rows[bus.name] for bus in robot.buses},
            samples=rows["samples"],
            words=rows["words"],
            errors=rows["errors"],
            boards=[board.name for board in robot.loop.boards],
            names=robot.names,
            quantities=tuple(robot.plant.sample_names),
            machines=robot.machines(),
            memory=remembered.name if remembered is not None else "",
            fell_ns=robot.fell_ns(),
            fall_cause=robot.plant.fall_cause,
        )
