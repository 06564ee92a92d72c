"""A board in a process of its own keeps its activity there, and its slots are what they are in one process."""

import array
import contextlib
import sys

import pytest

from ranger_sim.harness.processes import activity, places
from ranger_sim.harness.processes.forked_boards import ProcessReaper
from ranger_sim.harness.processes.modes import InProcess
from ranger_sim.harness.testing.process_per_board import ProcessPerBoard
from ranger_sim.harness.timeline import perfetto_reader
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.timeline import Timeline

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs Linux (eventfd, pidfd)")


def slots_of(robot, name, begin_s):
    """(row, start, cycles, overran, functions by cycles) of the slots that were recorded from `begin_s` on."""
    if begin_s:
        robot.run_for(begin_s)
    view = robot.slots(name)
    robot.run_for(0.06)
    robot.run_for(0.06)
    slots = view.between(begin_s + 0.001, begin_s + 0.118)
    return [(slot.row, slot.start_ns, slot.cycles, slot.overran, slot.cycles_by_function()) for slot in slots], view


@pytest.mark.parametrize("name", ["MCFI", "CSR"])
@pytest.mark.parametrize("begin_s", [0.0, 0.05])
def test_recorded_before_or_after_the_processes_begin_the_slots_are_the_same(name, begin_s):
    with contextlib.closing(Ranger()) as robot:
        alone, _ = slots_of(robot, name, begin_s)
        digest = robot.trace_digest()
    with contextlib.closing(Ranger(mode=ProcessPerBoard())) as robot:
        apart, view = slots_of(robot, name, begin_s)
        assert robot.trace_digest() == digest
        view.assert_no_overrun()
    assert len(apart) >= 115 and apart == alone


class Written:
    """A board whose log has these blocks."""

    def __init__(self):
        self.scheduler = type("scheduler", (), {"log": None})
        self.sinks = []

    def activity(self):
        return self

    def add_sink(self, sink):
        self.sinks.append(sink)

    def flush(self):
        pass


def test_a_reader_that_does_not_ask_for_long_gets_the_newest_and_the_number_dropped(monkeypatch):
    monkeypatch.setattr(activity, "MOST_BYTES", 10 * activity.ROW_BYTES)
    monkeypatch.setattr(activity, "ANSWER_BYTES", 4 * activity.ROW_BYTES)
    board, words = Written(), array.array("q", bytes(8 * places.SLOTS))
    store = activity.ActivityStore(board, words)

    class Remote:
        reached = 5

        def notes_of(self, command, what):
            return store.next()

    log = activity.RemoteActivity(Remote(), words, None)
    got = []
    log.add_sink(lambda time_ns, rows: got.append(rows))
    for block in range(5):
        board.sinks[0](0, bytes([block]) * 3 * activity.ROW_BYTES)
    log.flush()
    assert log.lost == 6  # two blocks of three rows
    assert b"".join(got) == b"".join(bytes([block]) * 3 * activity.ROW_BYTES for block in (2, 3, 4))
    assert [len(rows) // activity.ROW_BYTES for rows in got] == [4, 4, 1]
    log.flush()
    assert log.lost == 6 and b"".join(got[3:]) == b""


def test_of_a_board_that_is_gone_nothing_comes():
    class Gone:
        reached = 0

        def notes_of(self, command, what):
            return b""

    log = activity.RemoteActivity(Gone(), array.array("q", bytes(8 * places.SLOTS)), None)
    log.add_sink(lambda time_ns, rows: pytest.fail("nothing was to come"))
    log.flush()


@pytest.mark.parametrize("last_s", [None, 0.05])
def test_the_timeline_of_boards_in_processes_is_byte_for_byte_that_of_one_process(last_s, tmp_path):
    pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")
    for kind, robot in ((InProcess, Ranger()), (ProcessPerBoard, Ranger(mode=ProcessPerBoard()))):
        with contextlib.closing(robot):
            timeline = Timeline(robot, last_s)
            robot.run_for(0.15)
            timeline.write(tmp_path / f"{kind.__name__}.pftrace")
            timeline.close()
            assert all(
                isinstance(watcher, ProcessReaper) for watcher in robot.loop.watchers
            )  # it belongs to the processes
    written = [path.read_bytes() for path in sorted(tmp_path.iterdir())]
    assert len(written) == 2 and written[0] == written[1]
    assert len(perfetto_reader.contents(tmp_path / "InProcess.pftrace")) > 900_000


def test_a_board_in_a_process_keeps_no_more_of_the_past_than_ordered(monkeypatch):
    board, words = Written(), array.array("q", bytes(8 * places.SLOTS))
    log = activity.RemoteActivity(None, words, None)
    log.keep_ns = 100
    store = activity.ActivityStore(board, words)
    store.next()
    for time_ns in (0, 50, 149, 150, 250):
        store.take(time_ns, bytes([time_ns]) * activity.ROW_BYTES)
    answer = store.next()
    assert answer[activity.HEAD_BYTES :] == bytes([150]) * activity.ROW_BYTES + bytes([250]) * activity.ROW_BYTES
    assert array.array("q", answer[: activity.HEAD_BYTES]).tolist() == [3, 0]  # given up, left
