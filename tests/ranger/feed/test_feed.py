"""The feed: a reader gets what the log would keep, changes nothing, and the robot waits for no reader."""

import contextlib
import json
import socket

import numpy as np
import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.datatable.generated import all_variables
from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS, COLUMN_CYCLES, COLUMN_KIND, COLUMN_START, SLOT_ENDED
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.feed import records
from ranger_sim.harness.processes.forked_boards import ForkedBoards
from ranger_sim.ranger.feed import FeedServer

SECONDS = 0.1


class Viewer:
    """A program that looks."""

    def __init__(self, name):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.connect(records.address(name))
        self.socket.setblocking(False)
        self.buffer = bytearray()

    def received(self):
        """Every record that has come."""
        found = []
        while True:
            try:
                data = self.socket.recv(1 << 20)
            except BlockingIOError:
                return found
            if not data:
                return found
            self.buffer += data
            found += list(records.taken(self.buffer))


@pytest.fixture
def shown():
    """(robot, its feed, a function that makes viewers)."""
    robot = Ranger(Scenario(seed=3), log="full")
    feed = FeedServer(robot, "feed-of-a-test")
    robot.attach(feed)
    viewers = []

    def look():
        viewers.append(Viewer("feed-of-a-test"))
        return viewers[-1]

    yield robot, feed, look
    for viewer in viewers:
        viewer.socket.close()
    robot.close()


def rows_of(found, hello, stream):
    """All rows of a stream, as one array."""
    number = next(place for place, each in enumerate(hello["streams"]) if each["name"] == stream)
    columns = hello["streams"][number]["columns"]
    kind = np.float64 if hello["streams"][number]["reals"] else np.int64
    data = b"".join(body[1:] for kind_of, body in found if kind_of == records.ROWS and body[0] == number)
    return np.frombuffer(data, kind).reshape(-1, columns)


def watched(robot, viewer, seconds=SECONDS):
    """Pass time, as often looked at as at real time; every record."""
    found = []
    for _ in range(round(seconds / 0.02)):
        robot.run_for(0.02)
        found += viewer.received()
    return found


def test_a_viewer_sees_frames_body_and_variables_as_the_log_keeps_them(shown):
    robot, feed, look = shown
    viewer = look()
    found = watched(robot, viewer)
    robot.run_for(0.001)
    feed.poll(robot.loop.time)
    found += viewer.received()
    kind, body = found[0]
    hello = json.loads(body)
    assert kind == records.HELLO and hello["version"] == 1 and hello["seed"] == 3
    assert np.array_equal(rows_of(found, hello, "samples"), robot.logbook.samples())
    times, words = robot.logbook.words()
    seen = rows_of(found, hello, "words")
    assert np.array_equal(seen[:, 0], times) and np.array_equal(seen[:, 1:], words)
    frames = robot.logbook.frames()
    assert np.array_equal(rows_of(found, hello, "can1")[:, 0], frames["time_ns"][frames["bus"] == 0])
    assert hello["states"]["FSM_HIP"] and set(hello["states"]) <= set(all_variables.ID_OF)


def test_the_panel_shows_what_the_user_interface_board_drives(shown):
    robot, feed, look = shown
    viewer = look()
    states = [json.loads(body) for kind, body in watched(robot, viewer, 0.5) if kind == records.STATE]
    assert len(states) == 5 and states[-1]["panel"][0] == ord("C")
    board = robot.board("UI")
    robot.run_for(0.001)  # all boards are at one instant
    panel = feed.state(robot.loop.time)["panel"]
    text = "".join(map(chr, panel[:16]))
    assert f"{text[:8]}\n{text[8:]}" == board.panel.text()
    assert panel[16:22] == [board.panel.colour(light) for light in range(6)]
    assert panel[22] == board.buzzer.hertz and panel[23] == board.sync_light.lit


def test_a_viewer_changes_nothing():
    digests = []
    for looks in (False, True):
        robot = Ranger(Scenario(seed=5))
        robot.attach(FeedServer(robot, "feed-that-changes-nothing"))
        viewer = Viewer("feed-that-changes-nothing") if looks else None
        watched(robot, viewer) if looks else robot.run_for(SECONDS)
        digests.append(robot.trace_digest())
        robot.close()
        if viewer is not None:
            viewer.socket.close()
    robot = Ranger(Scenario(seed=5))
    robot.run_for(SECONDS)
    assert digests == [robot.trace_digest()] * 2
    robot.close()


def test_a_viewer_that_takes_nothing_misses_rows_and_receives_their_number(shown):
    robot, feed, look = shown
    viewer = look()
    robot.run_for(0.04)
    most = LIMITS["feed"].backlog
    feed.peers[0].outgoing += records.text_record(records.STATE, {"filler": "x" * (most - len(feed.peers[0].outgoing))})
    robot.run_for(0.1)
    assert len(feed.peers[0].outgoing) <= most + 100 and feed.totals["rows_left_out"] > 0
    missed = feed.totals["rows_left_out"]
    found = []
    for _ in range(40):
        found += viewer.received()
        robot.run_for(0.02)
    reported = [json.loads(body) for kind, body in found if kind == records.GAP]
    assert sum(sum(each.values()) for each in reported) == feed.totals["rows_left_out"] >= missed


def test_when_viewers_have_all_places_one_that_has_missed_rows_gives_up_its_place(shown):
    robot, feed, look = shown
    for _ in range(LIMITS["feed"].peers):
        look()
    robot.run_for(0.04)
    late = look()
    robot.run_for(0.04)
    assert feed.sent_away == {"full": 1}  # all of them take what they are shown
    assert [kind for kind, _ in late.received()] == [records.HELLO]
    slow = feed.peers[1]
    slow.outgoing += bytes(LIMITS["feed"].backlog)
    robot.run_for(0.02)
    later = look()
    robot.run_for(0.04)
    assert feed.sent_away == {"full": 1, "idle": 1} and slow not in feed.peers
    assert later.received()[0][0] == records.HELLO


def test_a_viewer_that_speaks_is_sent_away(shown):
    robot, feed, look = shown
    viewer, other = look(), look()
    robot.run_for(0.04)
    viewer.socket.send(b"x")
    robot.run_for(0.04)
    assert feed.sent_away["malformed"] == 1 and len(feed.peers) == 1
    assert other.received()


def test_a_robot_that_keeps_no_log_has_variables_only_while_a_viewer_is_connected():
    robot = Ranger(Scenario())
    robot.attach(FeedServer(robot, "feed-without-a-log"))
    robot.run_for(0.02)
    assert robot.loop.sampler.words is None
    viewer = Viewer("feed-without-a-log")
    found = watched(robot, viewer)
    hello = json.loads(found[0][1])
    assert len(rows_of(found, hello, "words")) > 20
    viewer.socket.close()
    robot.run_for(0.1)
    assert robot.loop.sampler.words is None
    robot.close()


def test_a_name_that_is_taken_is_reported(shown):
    robot, _, _ = shown
    with pytest.raises(UserError, match="a robot named feed-of-a-test is already running"):
        FeedServer(robot, "feed-of-a-test")


@pytest.mark.parametrize("head", [b"\x00\x00\x00\x00\x01", b"\xff\xff\xff\xff\x01"])
def test_bytes_that_are_not_a_record_are_refused(head):
    with pytest.raises(ValueError, match="a record of"):
        list(records.taken(bytearray(head)))


def test_half_a_record_waits_for_the_rest():
    whole = records.text_record(records.STATE, {"a": 1})
    buffer = bytearray(whole + whole[:-1])
    assert list(records.taken(buffer)) == [(records.STATE, b'{"a":1}')]
    buffer += whole[-1:]
    assert list(records.taken(buffer)) == [(records.STATE, b'{"a":1}')]
    assert not buffer


def test_a_viewer_sees_the_slots_of_boards_in_their_own_processes():
    """Held against the log that a board in this process keeps of itself."""
    names = ("MCH", "UI")
    ended = {}
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        logs = {name: [] for name in names}
        for name in names:
            robot.board(name).activity().add_sink(lambda _, rows, own=logs[name]: own.append(rows))
        robot.run_for(0.3)
        for name in names:
            robot.board(name).activity().flush()
            rows = np.frombuffer(b"".join(logs[name]), np.int64).reshape(-1, ACTIVITY_COLUMNS)
            ended[name] = rows[rows[:, COLUMN_KIND] == SLOT_ENDED][:, [COLUMN_START, COLUMN_CYCLES]]
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        feed = FeedServer(robot, "feed-of-slots")
        robot.attach(feed)
        apart = ForkedBoards(robot, names)
        try:
            viewer = Viewer("feed-of-slots")
            found = watched(robot, viewer, 0.3)
        finally:
            apart.close()
        viewer.socket.close()
    hello = json.loads(found[0][1])
    assert [board["name"] for board in hello["boards"]] == list(names) and hello["boards"][0]["hz"] == 60_000_000
    for number, name in enumerate(names):
        data = b"".join(body[1:] for kind, body in found if kind == records.SLOTS and body[0] == number)
        slots = np.frombuffer(data, np.int64).reshape(-1, 3)
        assert len(slots) > 0.8 * len(ended[name]) and (slots[:, 2] == -1).all()  # nobody keeps a pace here
        first = int(np.searchsorted(ended[name][:, 0], slots[0, 0]))  # who looks sees what is from then on
        np.testing.assert_array_equal(slots[:, :2], ended[name][first : first + len(slots)])
