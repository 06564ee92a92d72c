"""The plant process's small parts, each alone: the rest-bus's transmitter, the pace, a board's activity, settings."""

import array
import collections
import dataclasses
from types import SimpleNamespace

import pytest

from ranger_sim.can_bus.bus import Bus
from ranger_sim.datatable.packing import word_of_value
from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import CAN_REQUEST, CAN_RX, CAN_TX_DONE, TX_SENT, EventQueue
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside import profile
from ranger_sim.harness.processes import activity, hardware, places
from ranger_sim.harness.processes.hardware import HardwareInTheLoop, RestNode
from ranger_sim.harness.processes.pace import Pace
from ranger_sim.harness.processes.settings import Settings

MS = 1_000_000


# ---- the transmitter of the rest-bus


@pytest.fixture
def node():
    asked = []
    made = RestNode(EventQueue(), lambda *request: asked.append(request))
    made.asked = asked
    return made


def through(node, buffer, time):
    node.inbox.push(time, 1, CAN_TX_DONE, 1, buffer, TX_SENT)


def test_three_frames_are_under_way_and_the_others_follow_in_order(node):
    for number in range(5):
        node.offer(0x100 + number, 8, number, 0)
    node.poll(1000)
    assert node.asked == [(number + 1, 1000, 0x100 + number, 8, number, 0) for number in range(3)]
    node.poll(1500)
    assert len(node.asked) == 3
    through(node, 2, 2000)
    through(node, 1, 3000)
    node.poll(1999)  # not yet
    assert len(node.asked) == 3
    node.poll(2000)
    assert node.asked[3:] == [(2, 2000, 0x103, 8, 3, 0)]
    node.poll(3000)
    assert node.asked[4:] == [(1, 3000, 0x104, 8, 4, 0)] and not node.waiting


def test_what_comes_back_otherwise_frees_no_buffer(node):
    for number in range(4):
        node.offer(number, 8, 0, 0)
    node.poll(0)
    node.inbox.push(5, 1, CAN_RX, 1, 2, 8)
    node.poll(10)
    assert len(node.asked) == 3 and node.free == []


def test_a_hundred_frames_wait_and_the_next_is_lost(node):
    for number in range(102):
        node.offer(number, 8, 0, 0)
    assert (len(node.waiting), node.lost) == (100, 2)
    node.poll(0)
    node.offer(7, 8, 0, 0)
    assert (len(node.waiting), node.lost) == (98, 2)


# ---- a robot with an absent and an external board


class Robot:
    """What the rest-bus needs of one: its boards, its buses and where its time begins."""

    def __init__(self):
        self.start_ns = 50 * MS
        self.boards = ("MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB")
        self.buses = [Bus(f"can{number}", 3_000_000) for number in range(1, 5)]
        self.attached = []
        for bus in self.buses:
            bus.add_node("somebody", EventQueue(), 1, 1)

    def attach(self, end):
        self.attached.append(end)


class Outside:
    """A bus on real hardware, with the peers that were put on it."""

    def __init__(self, name):
        self.name, self.sinks, self.sent, self.labels = name, [], [], []

    def add_peer(self, label, inbox, controller, order):
        self.labels.append((label, controller, order))
        return SimpleNamespace(from_board=lambda *what: self.sent.append(what))


def with_boards(**boards):
    base = profile.default()
    return dataclasses.replace(base, boards={**base.boards, **boards})


def test_an_absent_boards_frames_go_onto_the_emulated_bus_when_they_are_due():
    robot = Robot()
    end = HardwareInTheLoop(robot, with_boards(MCH="absent"), [])
    assert robot.attached == [end] and end.filenos() == [] and set(end.nodes) == {bus.name for bus in robot.buses}
    now = robot.start_ns
    while now < robot.start_ns + 20 * MS:
        for bus in robot.buses:
            bus.advance(now)
        following = end.poll(now)
        assert now <= following <= now + 10 * MS
        now = max(following, now + 1000)
    frames = {bus.name: bus.counters.frames for bus in robot.buses}
    assert frames["can1"] > 20 and sum(frames.values()) == frames["can1"]
    counts = end.counters()
    assert counts["rest_bus_frames"] >= frames["can1"] and counts["rest_bus_lost"] == 0
    assert counts["faults_of_external_boards"] == 0


def test_on_a_bus_outside_they_go_through_a_peer_behind_every_board():
    robot = Robot()
    outside = Outside("can1")
    end = HardwareInTheLoop(robot, with_boards(MCH="absent"), [outside])
    assert [(label, controller) for label, controller, _ in outside.labels] == [("can1, rest-bus", 1)]
    end.poll(robot.start_ns + 5 * MS)
    assert outside.sent and outside.sinks == []  # nobody is external who would have to be heard
    kind, time, buffer, identifier, flags, *_ = outside.sent[0]
    assert (kind, time, buffer, flags) == (CAN_REQUEST, robot.start_ns + 5 * MS, 1, 8)
    assert identifier in end.rest.words
    assert robot.buses[0].buffers.waiting_count == 0


def test_an_external_board_is_received_and_judged_every_10_ms():
    robot = Robot()
    outside = Outside("can1")
    end = HardwareInTheLoop(robot, with_boards(MCH="external"), [outside])
    assert end.nodes == {} and len(outside.sinks) == 1
    assert end.poll(robot.start_ns) == robot.start_ns + 10 * MS
    angle = end.watch.boards["MCH"][0].variable
    outside.sinks[0](robot.start_ns + MS, angle.id, 8, word_of_value("f32", 0.0), 0)
    assert end.watch.boards["MCH"][0].seen == 1
    assert end.poll(robot.start_ns + 9 * MS) == robot.start_ns + 10 * MS
    assert end.counters()["faults_of_external_boards"] == 0
    end.poll(robot.start_ns + 5000 * MS)  # long after the last one
    assert end.counters()["faults_of_external_boards"] > 10


def test_while_frames_wait_it_asks_to_be_polled_soon():
    robot = Robot()
    end = HardwareInTheLoop(robot, with_boards(MCH="absent"), [Outside("can1")])
    for number in range(5):
        end.nodes["can1"].offer(number, 8, 0, 0)
    assert end.poll(robot.start_ns) in (robot.start_ns + 125_000, max(end.rest.next_time, robot.start_ns))
    assert hardware.CHECK_NS == 10 * MS


# ---- the pace


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_what_is_due_later_on_the_wall_is_ahead_by_that(speed, monkeypatch):
    now = [7_000]
    monkeypatch.setattr(wallclock, "monotonic_ns", lambda: now[0])
    words, doubles = collections.defaultdict(int), collections.defaultdict(float)
    pace = Pace(words, doubles, speed)
    pace.start(1_000_000)
    assert words[places.PACED] == 1
    assert pace.ahead_s(1_000_000) == 0.0
    assert pace.ahead_s(1_000_000 + 2_000_000_000) == pytest.approx(2.0 / speed, rel=1e-12)
    now[0] += 500_000_000
    assert pace.ahead_s(1_000_000) == pytest.approx(-0.5, rel=1e-12)


def test_as_fast_as_it_goes_nothing_is_ever_ahead():
    words = collections.defaultdict(int)
    pace = Pace(words, {}, None)
    pace.start(5)
    assert pace.ahead_s(10**12) == 0.0 and words[places.PACED] == 0


# ---- a board's activity, kept until somebody asks


ROW = 8 * ACTIVITY_COLUMNS


class Log:
    def __init__(self):
        self.sinks, self.flushed = [], 0

    def add_sink(self, sink):
        self.sinks.append(sink)

    def flush(self):
        self.flushed += 1


def store(keep_ns=0, log=None):
    made = Log()
    board = SimpleNamespace(scheduler=SimpleNamespace(log=log), activity=lambda: made)
    return activity.ActivityStore(board, {places.KEEP_NS: keep_ns}), made


def answer(kept):
    """(rows given up, bytes left, bytes of this answer) of the next one."""
    said = kept.next()
    lost, left = array.array("q", said[:16])
    return lost, left, said[16:]


def test_the_log_begins_with_the_first_question_and_is_handed_over_once():
    kept, log = store()
    assert log.sinks == []
    assert answer(kept) == (0, 0, b"") and log.sinks == [kept.take] and log.flushed == 1
    kept.take(1, b"a" * ROW)
    kept.take(2, b"b" * 2 * ROW)
    assert answer(kept) == (0, 0, b"a" * ROW + b"b" * 2 * ROW)
    assert answer(kept) == (0, 0, b"") and len(log.sinks) == 1


def test_a_log_that_was_there_before_has_its_readers_in_another_memory():
    before = Log()
    before.sinks.append("somebody's")
    kept, log = store(log=before)
    assert before.sinks == [] and log.sinks == [kept.take]


def test_an_answer_has_a_bounded_number_of_rows_and_the_rest_comes_with_the_next():
    kept, _ = store()
    blocks = [bytes([n]) * (3000 * ROW) for n in range(3)]
    for n, block in enumerate(blocks):
        kept.take(n, block)
    whole = b"".join(blocks)
    first, second, third = (answer(kept) for _ in range(3))
    assert [each[0] for each in (first, second, third)] == [0, 0, 0]
    assert (len(first[2]), len(second[2]), len(third[2])) == (4096 * ROW, 4096 * ROW, 808 * ROW)
    assert (first[1], second[1], third[1]) == (4904 * ROW, 808 * ROW, 0)
    assert first[2] + second[2] + third[2] == whole


def test_rows_older_than_the_kept_span_are_dropped_and_reported_once():
    kept, _ = store(keep_ns=100)
    for time in (0, 50, 100, 150, 151):
        kept.take(time, bytes(ROW))
    assert [time for time, _ in kept.blocks] == [100, 150, 151]
    assert answer(kept)[0] == 2
    kept.take(152, bytes(ROW))
    assert answer(kept)[0] == 0


def test_what_does_not_fit_is_given_up_from_the_old_end(monkeypatch):
    monkeypatch.setattr(activity, "MOST_BYTES", 3 * ROW)
    kept, _ = store()
    for time in range(5):
        kept.take(time, bytes([time]) * ROW)
    assert (kept.kept, [time for time, _ in kept.blocks]) == (3 * ROW, [2, 3, 4])
    assert answer(kept) == (2, 0, b"".join(bytes([time]) * ROW for time in (2, 3, 4)))


def test_the_reader_gets_all_rows_left_and_adds_up_those_dropped():
    kept, _ = store()
    words = {places.KEEP_NS: 0}
    remote = SimpleNamespace(reached=77, notes_of=lambda command, kind: kept.next())
    reader = activity.RemoteActivity(remote, words, None)
    received = []
    reader.add_sink(lambda time, rows: received.append((time, rows)))
    received.clear()
    kept.take(1, b"x" * (5000 * ROW))
    kept.lost = 3
    reader.flush()
    assert b"".join(rows for _, rows in received) == b"x" * (5000 * ROW)
    assert {time for time, _ in received} == {77} and reader.lost == 3
    kept.lost = 2
    reader.flush()
    assert reader.lost == 5
    reader.keep_ns = 9
    assert (words[places.KEEP_NS], reader.keep_ns) == (9, 9)
    remote.notes_of = lambda command, kind: b""  # it is gone
    received.clear()
    reader.flush()
    assert received == []


# ---- settings


@pytest.mark.parametrize("speed", [1e-4, 1000.0, None])
def test_both_limits_of_the_speed_are_taken(speed):
    assert Settings(speed=speed).speed == speed


@pytest.mark.parametrize(
    ("wrong", "reported"),
    [
        (dict(speed=0.99e-4), "speed is"),
        (dict(speed=1000.1), "speed is"),
        (dict(restart="always"), "restart is 'always'"),
        (dict(name=""), "name is ''"),
        (dict(name="a" * 65), "name is"),
        (dict(name="a b"), "name is 'a b'"),
        (dict(processor=1 << 20), "processor is"),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong, reported):
    with pytest.raises(UserError, match=reported):
        Settings(**wrong)


def test_names_have_letters_digits_dashes_and_underscores_up_to_64():
    for name in ("a" * 64, "walk-2_b"):
        assert Settings(name=name).name == name


def test_real_time_is_asked_for_only_where_there_is_a_pace():
    assert Settings().wants_fifo
    assert not Settings(speed=None).wants_fifo and not Settings(real_time=False).wants_fifo
