"""`Timeline`: records kept during a run, and the events made from them on request."""

import itertools
import pathlib
from typing import Any

import numpy as np

from ranger_sim.can_bus.frame_log import FrameTimes
from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS, COLUMN_END
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.activity import activity_of
from ranger_sim.harness.step_watch import StepWatch
from ranger_sim.harness.timeline import files, happenings
from ranger_sim.harness.timeline.model import Events
from ranger_sim.harness.timeline.processors import Processor
from ranger_sim.harness.timeline.row_store import RowStore
from ranger_sim.ranger.timeline import flows, frames, signals

LINK_COLUMNS = 5  # a row of SspWire: ns, from the slave, header, two words
OUTPUT_COLUMNS = 5  # a row of BoardWires: ns, kind, three numbers
GATHER_NS = 50_000_000  # of seven boards each every 0.35 s: some 2 MB of a motor board (chosen by us)


class Timeline:
    """Attached to a Ranger before it runs: keeps the last `last_s` seconds of virtual time, or everything (None).

    It changes nothing: the trace digest stays the same. Boards may run in separate processes; one that is outside
    shows nothing of what its processor does. Memory is flat with `last_s`; without, everything is in unnamed temporary
    files. Use `write` (format by the file's suffix), or `events` to inspect it in a test.
    """

    def __init__(self, robot: Any, last_s: float | None = None) -> None:
        if last_s is not None and not last_s > 0.0:
            raise UserError(f"timeline: last_s is {last_s!r}, it must be above 0 s")
        self.robot = robot
        self.last_ns = None if last_s is None else round(last_s * 1e9)
        self.begin_ns = robot.loop.time - robot.start_ns
        self.stores: list[RowStore] = []
        self.streams: list[Any] = []
        self._attach()

    def _store(self, stream: Any) -> RowStore:
        store = RowStore(stream.columns, self.last_ns, stream.sink)
        stream.sink = store.take
        self.stores.append(store)
        self.streams.append(stream)
        return store

    def _attach(self) -> None:
        robot = self.robot
        self.frames: list[RowStore] = []
        for bus in robot.buses:
            bus.log.times = FrameTimes()
            self.frames.append(self._store(bus.log.times))
        self.samples = self._store(robot.recorder.samples)
        self.words = self._store(robot.recorder.words)
        self.sampled_words = robot.loop.sampler.words
        robot.loop.sampler.words = robot.recorder.words
        self.outputs: dict[str, RowStore] = {}
        for wires in robot.loop.wires:
            wires.watch = RowStream("q", OUTPUT_COLUMNS, False)
            self.outputs[wires.board.name] = self._store(wires.watch)
        self.activity: dict[str, RowStore] = {}
        for name in robot.boards:
            log = activity_of(robot, name)
            if log is not None:
                self.activity[name] = RowStore(ACTIVITY_COLUMNS, self.last_ns)
                log.add_sink(self.activity[name].take)
                log.keep_ns = self.last_ns or 0
                log.keep_ns = self.last_ns or 0
        self.gathering = Gathering(self)
        if self.last_ns is None:
            robot.loop.watchers.append(self.gathering)
        link = robot.loop.wires[robot.loop.place("MB")].link
        link.watch = RowStream("q", LINK_COLUMNS, False)
        self.link = self._store(link.watch)

    # --- what was kept --------------------------------------------------------------------------------------

    def events(self) -> Events:
        """The events of the time that was kept."""
        robot = self.robot
        for stream in self.streams:
            stream.flush()
        for name in self.activity:
            self.gather(name)
        zero = robot.start_ns
        end = robot.loop.time - zero
        begin = self.begin_ns if self.last_ns is None else max(self.begin_ns, end - self.last_ns)
        words = self._since(self.words.rows(), begin)
        samples = self.samples.rows(np.float64)
        samples = samples[samples[:, 0] * 1e9 - zero >= begin]
        found = Events(begin, end)
        found.instants = happenings.happenings(robot)
        for instants in found.instants:
            instants.events = [event for event in instants.events if begin <= event.time_ns <= end]
        found.slices += signals.machine_states(robot, words, zero, end)
        processors = {
            name: Processor(robot.boards[name].legend(), self._since(store.rows(), begin, COLUMN_END), zero)
            for name, store in self.activity.items()
        }
        for processor in processors.values():
            found.slices += processor.tracks()
            if processor.overruns.events:
                found.instants.append(processor.overruns)
        buses = [
            frames.BusFrames(bus, self._since(store.rows(), begin), zero)
            for bus, store in zip(robot.buses, self.frames, strict=True)
        ]
        for bus in buses:
            found.slices += [bus.slices, *bus.waits()]
        link = flows.Exchanges(self._since(self.link.rows(), begin), zero)
        found.slices += [link.to_main_brain.slices, link.to_router.slices]
        flows.connect_all(robot, processors, buses, link)
        for board, store in self.outputs.items():
            outputs = self._since(store.rows(), begin)
            found.counters += signals.duties(board, outputs, zero)
            pins = signals.pin_levels(board, outputs, zero)
            if pins:
                found.pins[board] = pins
        found.counters += signals.variables(words, zero)
        found.counters += signals.body(samples, zero)
        return found

    def gather(self, name: str) -> None:
        """Fetch what board `name` has written by now, from another process where it runs there."""
        activity_of(self.robot, name).flush()

    def _since(self, rows: np.ndarray, begin_ns: int, time_column: int = 0) -> np.ndarray:
        """The rows whose time, mostly the first number, is in the time to be shown."""
        return rows[rows[:, time_column] - self.robot.start_ns >= begin_ns]

    def title(self) -> str:
        """The run in one line."""
        scenario = self.robot.scenario
        return (
            f"ranger-sim: controller {scenario.controller}, body {scenario.body}, seed {scenario.seed}, "
            f"slope {scenario.slope_rad:g} rad, roughness {scenario.floor_roughness_m:g} m"
        )

    def write(self, path: str | pathlib.Path) -> None:
        """Write the timeline into a file; the suffix gives the format (`files.FORMATS`)."""
        files.write(self.events(), pathlib.Path(path), self.title())

    def close(self) -> None:
        """Discard all records and stop recording."""
        for stream, store in zip(self.streams, self.stores, strict=True):
            stream.sink = store.before
            store.close()
        for name, store in self.activity.items():
            log, board = self.robot.loop.board(name).activity(), self.robot.boards[name]
            log.sinks.remove(store.take)
            if not log.sinks and board.scheduler.log is log:
                board.keep_activity(None)
            store.close()
            log.keep_ns = 0
        self.activity = {}
        if self.gathering in self.robot.loop.watchers:
            self.robot.loop.watchers.remove(self.gathering)
        self.robot.loop.sampler.words = self.sampled_words
        for bus in self.robot.buses:
            bus.log.times = None
        for wires in self.robot.loop.wires:
            wires.watch = None
            if wires.link is not None:
                wires.link.watch = None
        self.streams, self.stores = [], []


class Gathering(StepWatch):
    """Fetches the records of boards in other processes, one after another, before they keep too much.

    Only for a timeline that keeps everything: each board keeps the last seconds itself until the end.
    """

    def __init__(self, timeline: Timeline) -> None:
        StepWatch.__init__(self)
        self.timeline = timeline
        self.names = itertools.cycle(tuple(timeline.activity))
        self.next_ns = 0

    def before_step(self, now_ns: int) -> None:
        if now_ns >= self.next_ns and self.timeline.robot.loop.side_by_side:
            self.next_ns = now_ns + GATHER_NS
            self.timeline.gather(next(self.names))
