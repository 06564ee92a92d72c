"""`Timeline`: the timeline of Ranger, with its link, states, variables, and the way of a frame through the router."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.harness.timeline import happenings
from ranger_sim.harness.timeline.frames import BusFrames
from ranger_sim.harness.timeline.machine_timeline import MachineTimeline
from ranger_sim.harness.timeline.model import Counter, Events, Instants
from ranger_sim.harness.timeline.processors import Processor
from ranger_sim.ranger import wiring
from ranger_sim.ranger.timeline import flows, signals

LINK_COLUMNS = 5  # a row of SspWire: ns, from the slave, header, two words


class Timeline(MachineTimeline):
    """Attached to a Ranger before it runs; as its base class, with what only this robot has."""

    name = "Ranger"

    def _attach(self) -> None:
        super()._attach()
        robot = self.robot
        self.words = self._store(robot.recorder.words)
        self.sampled_words = robot.loop.sampler.words
        robot.loop.sampler.words = robot.recorder.words
        self.main_brain = robot.loop.wires[robot.loop.place("MB")]
        self.main_brain.link.watch = RowStream("q", LINK_COLUMNS, False)
        self.link = self._store(self.main_brain.link.watch, in_detail=True)

    def _words(self, begin_ns: int) -> np.ndarray:
        return self.since(self.words.rows(), begin_ns)

    def _happenings(self) -> list[Instants]:
        return happenings.happenings(self.robot)

    def _add_states(self, found: Events) -> None:
        words = self._words(found.begin_ns)
        found.slices += signals.machine_states(self.robot, words, self.robot.start_ns, found.end_ns)

    def _connect(self, found: Events, processors: dict[str, Processor], buses: list[BusFrames]) -> None:
        link = flows.Exchanges(self.detail(self.link.rows()), self.robot.start_ns)
        found.slices += [link.to_main_brain.slices, link.to_router.slices]
        flows.connect_all(self.robot, processors, buses, link)

    def _pins(self, board: str) -> dict[str, int]:
        return dict(wiring.PINS.get(board, {}))

    def _counters_of(self, board: str, outputs: np.ndarray) -> Iterable[Counter]:
        return signals.duties(board, outputs, self.robot.start_ns)

    def _add_variables(self, found: Events) -> None:
        found.counters += signals.variables(self._words(found.begin_ns), self.robot.start_ns)

    def title(self) -> str:
        scenario: Any = self.robot.scenario
        return (
            f"ranger-sim: controller {scenario.controller}, body {scenario.body}, seed {scenario.seed}, "
            f"slope {scenario.slope_rad:g} rad, roughness {scenario.floor_roughness_m:g} m"
        )

    def close(self) -> None:
        if self.streams:
            self.robot.loop.sampler.words = self.sampled_words
            self.main_brain.link.watch = None
        super().close()
