"""`MachineTimeline`: records kept during a run of any machine, and the events made from them on request."""

import pathlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from ranger_sim.can_bus.frame_log import FrameTimes
from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS
from ranger_sim.foundation.events import NEVER, PIN_OUTPUT
from ranger_sim.foundation.row_stream import RowStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.records.activity import activity_of
from ranger_sim.harness.timeline import arrows, files, happenings
from ranger_sim.harness.timeline.frames import BusFrames
from ranger_sim.harness.timeline.gathering import Gathering
from ranger_sim.harness.timeline.model import Counter, Events, Instants, Slices, changes
from ranger_sim.harness.timeline.processors import Processor
from ranger_sim.harness.timeline.row_store import RowStore

OUTPUT_COLUMNS = 5  # a row of BoardWires: ns, kind, three numbers
AROUND_NS = 1_000_000_000  # in detail, before and after a fault begins to act; chosen by us
MOST_FAULTS = 8  # that are shown so: each takes 50 MB of memory, 100 when it acts long after it was activated
NEAR_NS = 200_000_000  # between two times in detail: the time between is shown as well, so that no arrow crosses a gap


class MachineTimeline:
    """Attached to a machine before it runs: keeps the last `last_s` seconds of virtual time, or everything (None).

    detail_s: what processors, buses and links do is kept for so many seconds before the end, and for a second before
    and after each of the first faults is activated and first acts; None: as long as the rest. It changes nothing: the
    trace digest stays the same. Boards may run in separate processes; one that is outside shows nothing of what its
    processor does. Memory is flat with `last_s`; without, everything is in unnamed temporary files. Use `write`
    (format by the file's suffix), or `events` to inspect it in a test.
    """

    name = "machine"  # the root of its tracks

    def __init__(self, machine: Any, last_s: float | None = None, detail_s: float | None = None) -> None:
        for name, length_s in (("last_s", last_s), ("detail_s", detail_s)):
            if length_s is not None and not length_s > 0.0:
                raise UserError(f"timeline: {name} is {length_s!r}, it must be above 0 s")
        self.robot = machine
        self.last_ns = None if last_s is None else round(last_s * 1e9)
        self.detail_ns = None if detail_s is None else round(detail_s * 1e9)
        self.begin_ns = machine.loop.time - machine.start_ns
        self.stores: list[RowStore] = []
        self.streams: list[Any] = []
        self._attach()

    def _store(self, stream: Any, in_detail: bool = False) -> RowStore:
        store = self._made(stream.columns, in_detail, stream.sink)
        stream.sink = store.take
        self.stores.append(store)
        self.streams.append(stream)
        return store

    def _made(self, columns: int, in_detail: bool, before: Any = None) -> RowStore:
        if not in_detail or self.detail_ns is None:
            return RowStore(columns, self.last_ns, before)
        kept_ns = max(self.detail_ns, AROUND_NS)  # a block is dropped when it is known whether a fault acted near it
        return RowStore(columns, min(kept_ns, self.last_ns or kept_ns), before, self._near_a_fault)

    def _attach(self) -> None:
        """Begin to keep records; subclasses add theirs."""
        robot = self.robot
        self.frames: list[RowStore] = []
        for bus in robot.buses:
            bus.log.times = FrameTimes()
            self.frames.append(self._store(bus.log.times, in_detail=True))
        self.samples = self._store(robot.recorder.samples)
        self.outputs: dict[str, RowStore] = {}
        for wires in robot.loop.wires:
            wires.watch = RowStream("q", OUTPUT_COLUMNS, False)
            self.outputs[wires.board.name] = self._store(wires.watch)
        self.activity: dict[str, RowStore] = {}
        for name in robot.boards:
            log = activity_of(robot, name)
            if log is not None:
                self.activity[name] = self._made(ACTIVITY_COLUMNS, in_detail=True)
                log.add_sink(self.activity[name].take)
                log.keep_ns = self.last_ns or 0
        self.gathering = Gathering(self)
        if self.last_ns is None:
            robot.loop.watchers.append(self.gathering)

    # --- what was kept --------------------------------------------------------------------------------------

    def _near_a_fault(self, begin_ns: int, end_ns: int) -> bool:
        return any(begin_ns <= end and begin <= end_ns for begin, end in self._of_faults())

    def _of_faults(self) -> list[tuple[int, int]]:
        """Times (ns, as the machine counts them) around the beginnings of the faults that began first."""
        begun = sorted(
            (each for each in self.robot.faults if each.activated_ns >= 0), key=lambda each: each.activated_ns
        )
        stamps = {time for each in begun[:MOST_FAULTS] for time in (each.activated_ns, each.acted_ns) if time >= 0}
        return [(time - AROUND_NS, time + AROUND_NS) for time in sorted(stamps)]

    def windows(self) -> list[tuple[int, int]]:
        """[(begin, end)] of the times that are kept in detail, ns since the run began, in order."""
        zero, end = self.robot.start_ns, self.robot.loop.time - self.robot.start_ns
        begin = self.begin_ns if self.last_ns is None else max(self.begin_ns, end - self.last_ns)
        if self.detail_ns is None or end - self.detail_ns <= begin:
            return [(begin, end)]
        around = [(at - zero, until - zero) for at, until in self._of_faults()]
        found: list[tuple[int, int]] = []
        for at, until in sorted([*around, (end - self.detail_ns, end)]):
            at, until = max(at, begin), min(until, end)
            if found and at - found[-1][1] < NEAR_NS:
                found[-1] = (found[-1][0], max(found[-1][1], until))
            elif at < until:
                found.append((at, until))
        return found

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
        samples = self.samples.rows(np.float64)
        chosen = samples[:, 0] * 1e9 - zero >= begin
        samples = samples if chosen.all() else samples[chosen]
        found = Events(begin, end, name=self.name)
        found.instants = self._happenings()
        for instants in found.instants:
            instants.events = [event for event in instants.events if begin <= event.time_ns <= end]
        found.slices += self._parts(found)
        self._add_states(found)
        windows = self._detail_windows()
        processors = {
            name: Processor(robot.boards[name].legend(), store.parts(), zero, windows)
            for name, store in self.activity.items()
        }
        for processor in processors.values():
            found.slices += processor.tracks()
            if processor.overruns.events:
                found.instants.append(processor.overruns)
        buses = [
            BusFrames(bus, robot.names, self.detail(store.rows()), zero)
            for bus, store in zip(robot.buses, self.frames, strict=True)
        ]
        for bus in buses:
            found.slices += [bus.slices, *bus.waits()]
        self._connect(found, processors, buses)
        for board, store in self.outputs.items():
            outputs = self.since(store.rows(), begin)
            found.counters += self._counters_of(board, outputs)
            pins = pin_levels(self._pins(board), outputs, zero)
            if pins:
                found.pins[board] = pins
        self._add_variables(found)
        found.counters += body(robot.plant.sample_names, samples, zero)
        return found

    def _happenings(self) -> list[Instants]:
        return [Instants(("Faults",), happenings.faults(self.robot))] if self.robot.faults else []

    def _add_states(self, found: Events) -> None:
        """Slices of the machine's states, in front of the boards'."""

    def _connect(self, found: Events, processors: dict[str, Processor], buses: list[BusFrames]) -> None:
        """Write the arrows into the slices, from the function that sends a frame to the frame."""
        book = arrows.FlowBook()
        for bus in buses:
            arrows.publish(book, bus, processors)

    def _pins(self, board: str) -> dict[str, int]:
        """Names and numbers of a board's pins: those of its wiring, without analog inputs and registers."""
        wiring = self.robot.wiring
        others = {each.input for each in wiring.analog if each.board == board}
        others |= {each.register for each in wiring.words if each.board == board}
        return {name: pin for name, pin in wiring.names.get(board, {}).items() if name not in others}

    def _counters_of(self, board: str, outputs: np.ndarray) -> Iterable[Counter]:
        """Counters made from the outputs of a board."""
        return ()

    def _add_variables(self, found: Events) -> None:
        """Counters of variables, in front of the body's."""

    def gather(self, name: str) -> None:
        """Fetch what board `name` has written by now, from another process where it runs there."""
        activity_of(self.robot, name).flush()

    def since(self, rows: np.ndarray, begin_ns: int, time_column: int = 0) -> np.ndarray:
        """The rows whose time, mostly the first number, is in the time to be shown."""
        chosen = rows[:, time_column] - self.robot.start_ns >= begin_ns
        return rows if chosen.all() else rows[chosen]  # hundreds of megabytes are not copied

    def _detail_windows(self) -> list[tuple[int, int]]:
        """[(begin, end)] of the times in detail, as the machine counts them; the last also has what ends later."""
        windows = self.windows()
        if len(windows) == 1 and windows[0][0] <= self.begin_ns:
            return [(-NEVER, NEVER)]
        zero = self.robot.start_ns
        return [*((begin + zero, end + zero) for begin, end in windows[:-1]), (windows[-1][0] + zero, NEVER)]

    def detail(self, rows: np.ndarray) -> np.ndarray:
        """The rows whose time, their first number, is in the times in detail."""
        windows = self._detail_windows()
        if windows == [(-NEVER, NEVER)]:
            return rows
        chosen = np.zeros(len(rows), dtype=bool)
        for begin, end in windows:
            chosen |= (rows[:, 0] >= begin) & (rows[:, 0] <= end)
        return rows[chosen]

    def _parts(self, found: Events) -> list[Slices]:
        """A track that shows which times are in detail, where some are not."""
        windows = self.windows()
        if len(windows) == 1 and windows[0][0] <= found.begin_ns:
            return []
        start, end = (np.array(each, dtype=np.int64) for each in zip(*windows, strict=True))
        names = ["boards, buses and links in detail"]
        return [Slices(("Detail",), names, start, end, np.zeros(len(start), dtype=np.int64))]

    def title(self) -> str:
        """The run in one line."""
        return f"ranger-sim: boards {', '.join(self.robot.boards)}, seed {self.robot.seed}"

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
        for bus in self.robot.buses:
            bus.log.times = None
        for wires in self.robot.loop.wires:
            wires.watch = None
        self.streams, self.stores = [], []


def body(names: dict[str, str], rows: np.ndarray, zero_ns: int) -> list[Counter]:
    """The plant's samples by name and unit; `rows`: of the samples' stream (time in s first)."""
    time = np.round(rows[:, 0] * 1e9).astype(np.int64) - zero_ns
    found = []
    for column, (name, unit) in enumerate(names.items(), start=1):
        at, values = changes(time, rows[:, column])
        found.append(Counter(("Body", name), unit, at, values))
    return found


def pin_levels(names: dict[str, int], rows: np.ndarray, zero_ns: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{pin's name: (time_ns, level)} of the pins that a board drove."""
    writes = rows[rows[:, 1] == PIN_OUTPUT]
    found = {}
    for name, pin in names.items():
        of_pin = writes[writes[:, 2] == pin]
        if len(of_pin):
            found[name] = changes(of_pin[:, 0] - zero_ns, of_pin[:, 3])
    return found
