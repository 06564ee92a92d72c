"""The slots of a machine's board: where their recording begins, and which of them a condition selects."""

from __future__ import annotations

from typing import Any, Self

import numpy as np

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.activity import activity_of
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.timing.recording import Recording
from ranger_sim.harness.timing.slots import SlotView
from ranger_sim.harness.waiting import Condition, Wanted


class Held(StepWatch):
    """When a condition held, as far as it was checked: once per step of the plant, every 250 us."""

    def __init__(self, robot: Any, wanted: Condition) -> None:
        StepWatch.__init__(self)
        self.wanted = wanted
        self.origin_ns: int = robot.start_ns
        self.changes = [-1]  # times since power-up: it did not hold, then it held, then not ...
        wanted.begin(robot)

    def before_step(self, now_ns: int) -> None:
        if self.wanted.met() != (len(self.changes) % 2 == 0):
            self.changes.append(now_ns - self.origin_ns)

    def at(self, instants: np.ndarray) -> np.ndarray:
        """True where the latest check up to a time found that it held."""
        held: np.ndarray = np.searchsorted(self.changes, instants, side="right") % 2 == 0
        return held


class MachineSlots(SlotView):
    """The slots of a machine's board since the recording began, or a selection of them."""

    def __init__(self, recording: Recording, robot: Any) -> None:
        SlotView.__init__(self, recording)
        self.robot = robot

    def where(self, wanted: Wanted) -> Self:
        """Only slots that begin while a condition of the machine holds; it is checked from now on."""
        held = Held(self.robot, self.robot.condition(wanted))
        self.robot.loop.watchers.append(held)
        return self.during(f"where {held.wanted.text}", held.at)


def slot_view(robot: Any, name: str) -> MachineSlots:
    """Begin to record board `name` of `robot`, in any process. UserError for a board that has no activity to show."""
    if name not in robot.boards:
        robot.board(name)  # its error lists the known names

    def find_board() -> Any:
        return robot.boards[name]  # a different one after its supply failed

    def find_log() -> Any:
        log = activity_of(robot, name)
        if log is None:
            raise UserError(f"slots of {name}: this board is external and reports no activity")
        return log

    begun_ns = robot.loop.time - robot.start_ns
    recording = Recording(robot.boards[name], robot.start_ns, begun_ns, find_log=find_log, find_board=find_board)
    return MachineSlots(recording, robot)
