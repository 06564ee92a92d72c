"""What the page is shown: a robot that runs, a recording, a data link; each against what is known of it otherwise."""

import asyncio
import contextlib
import json
import pathlib
import threading

import can
import numpy as np
import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.datatable.generated import all_variables
from ranger_sim.datatable.packing import error_word
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.feed import FeedServer
from ranger_sim.tools.cli import main
from ranger_sim.tools.panel.inside.errors import ErrorList
from ranger_sim.tools.panel.link import LinkSource
from ranger_sim.tools.panel.recording import Event, RecordingSource
from ranger_sim.tools.panel.robot import RobotSource
from ranger_sim.tools.panel.source import ANKLES, KNOWN_POSE, TRUE_POSE, known_pose
from ranger_sim.tools.robodaq.codec import Point
from ranger_sim.tools.run.logs import variables_part, write_frames
from tests.tools.robodaq.on_a_line import OnALine

SECONDS = 0.6
GENERATED = pathlib.Path(all_variables.__file__).parent


@pytest.fixture(scope="module")
def walked():
    """(robot that has walked a little and kept all of it, the source that looked at it meanwhile)."""
    robot = Ranger(Scenario(seed=2), log="full")
    feed = FeedServer(robot, "panel-of-a-test")
    robot.attach(feed)
    seen = threading.Event()

    def walk():
        while not seen.is_set():  # it is looked at from its first instant on: until then its time stands
            robot.poll_now()
        for _ in range(round(SECONDS / 0.02)):
            robot.run_for(0.02)
        robot.poll_now()
        while feed.peers and feed.peers[0].outgoing:
            feed.write()
        feed.close()  # the robot has ended

    thread = threading.Thread(target=walk)
    thread.start()
    source = RobotSource("panel-of-a-test")
    seen.set()
    asyncio.run(source.run())
    thread.join()
    log = robot.logbook
    loads = {bus.name: bus.load.windows() for bus in robot.buses}
    kept = {"samples": log.samples(), "words": log.words(), "frames": log.frames(), "loads": loads, "robot": robot}
    yield kept, source
    robot.close()


def number_of(source, name):
    return next(place for place, channel in enumerate(source.channels) if channel.name == name)


def test_the_body_is_shown_as_the_log_has_it(walked):
    kept, source = walked
    trace = source.trace(number_of(source, "hip_rad"), -1.0, 10.0, 4000)
    column = [channel.name for channel in source.body].index("hip_rad")
    assert trace.high is None
    np.testing.assert_array_equal(trace.x, kept["samples"][:, 0])
    np.testing.assert_array_equal(trace.low, kept["samples"][:, 1 + column].astype(np.float32))


def test_what_is_saved_is_what_the_log_has(walked):
    kept, source = walked
    column = [channel.name for channel in source.body].index("hip_rad")
    times, values = source.samples(number_of(source, "hip_rad"), 0.1, 0.3)
    rows = kept["samples"][(kept["samples"][:, 0] >= 0.1) & (kept["samples"][:, 0] <= 0.3)]
    np.testing.assert_array_equal(times, rows[:, 0])
    np.testing.assert_array_equal(values, rows[:, 1 + column].astype(np.float32))


@pytest.mark.parametrize("name", ["MCH_ANGLE", "UI_BUTTONS", "FSM_HIP", "MCH_EXECUTION_TIME"])
def test_variables_are_shown_as_their_types_have_them(walked, name):
    kept, source = walked
    times, words = kept["words"]
    word = words[:, all_variables.ID_OF[name]].astype(np.uint32)
    kind = {"f32": np.float32, "i32": np.int32, "u32": np.uint32}[all_variables.TYPES[all_variables.ID_OF[name]]]
    trace = source.trace(number_of(source, name), -1.0, 10.0, 4000)
    np.testing.assert_array_equal(trace.low, word.view(kind).astype(np.float32))
    assert source.values([number_of(source, name)], None) == [pytest.approx(float(word.view(kind)[-1]))]
    assert source.values([number_of(source, name)], -5.0) == [None]


def test_the_newest_frames_are_those_of_the_bus(walked):
    kept, source = walked
    frames = kept["frames"]
    on_bus = frames["bus"] == 0
    shown = source.state(None)["frames"]["can1"]
    assert [row["id"] for row in shown] == frames["identifier"][on_bus][::-1][: len(shown)].tolist()
    first = shown[0]
    data = bytes.fromhex(first["data"])
    assert int.from_bytes(data[:4], "little") == frames["word0"][on_bus][-1] & 0xFFFFFFFF
    assert int.from_bytes(data[4:], "little") == frames["word1"][on_bus][-1] & 0xFFFFFFFF
    identifiers = frames["identifier"][on_bus]
    assert first["count"] == np.sum(identifiers == first["id"])


@pytest.mark.parametrize("bus", ["can1", "can2", "can3", "can4"])
def test_frames_and_how_often_each_came_are_those_until_the_cursor(walked, bus):
    kept, source = walked
    frames = kept["frames"]
    until = (frames["bus"] == int(bus[3]) - 1) & (frames["time_ns"] <= 300_000_000)
    shown = source.state(0.3)["frames"][bus]
    assert [row["id"] for row in shown] == frames["identifier"][until][::-1][:40].tolist()
    for row in shown:
        assert row["count"] == np.sum(frames["identifier"][until] == row["id"])


@pytest.mark.parametrize("bus", ["can1", "can2", "can3", "can4"])
def test_the_load_at_the_cursor_is_that_of_the_buss_own_meter(walked, bus):
    """In single precision, per cent: a bit of a window of 30,000 is 3e-3."""
    kept, source = walked
    meter = kept["loads"][bus]
    at = source.state(0.3011)["buses"][bus]  # the window that ended last is the one until 0.3 s
    assert at["load"] == pytest.approx(100 * meter[29], abs=1e-4)
    channel = number_of(source, f"load_{bus}")
    assert source.values([channel], 0.3011) == [pytest.approx(at["load"])]
    assert at["of_second"]["worst"] == pytest.approx(100 * max(meter[1:30]), abs=1e-4)  # all since the robot was there
    assert at["errors"] == 0
    trace = source.trace(channel, 0.0, SECONDS, 4000)
    assert trace.low.max() == pytest.approx(100 * max(meter[1:]), abs=1e-4)


def test_the_number_of_frames_in_the_second_before_is_shown(walked):
    kept, source = walked
    times = kept["frames"]["time_ns"][kept["frames"]["bus"] == 3]
    bus = next(bus for bus in source.buses if bus.name == "can4")
    assert bus.frames.within(100_000_000, 300_000_000) == np.sum((times > 100_000_000) & (times <= 300_000_000))
    assert bus.content(0.3, SECONDS)["frames_per_s"] is None  # it is not there for a second yet


def test_the_robot_is_shown_as_its_body_was_at_that_time(walked):
    kept, source = walked
    time, values = source.pose(0.2)
    row = kept["samples"][np.searchsorted(kept["samples"][:, 0], 0.2, "right") - 1]
    names = [channel.name for channel in source.body]
    assert time == row[0]
    assert dict(zip(source.pose_names, values, strict=True))["leg_outer_rad"] == pytest.approx(
        row[1 + names.index("leg_outer_rad")], rel=1e-6
    )


def test_requests_that_are_not_allowed_are_refused(walked):
    _, source = walked
    with pytest.raises(UserError, match="'stop' is not a request"):
        asyncio.run(source.request({"do": "stop"}))
    assert source.lost == "the robot panel-of-a-test has ended"


def test_a_name_without_a_robot_is_reported():
    with pytest.raises(UserError, match="no robot named nobody-here is running"):
        RobotSource("nobody-here")


def test_a_silent_robot_is_reported(monkeypatch):
    """It listens, but never looks at who has come. A panel that starts a robot then asks again."""
    monkeypatch.setattr("ranger_sim.tools.panel.robot.CONNECT_S", 0.1)
    robot = Ranger()
    feed = FeedServer(robot, "silent-robot-of-a-test")
    with pytest.raises(UserError, match=r"silent-robot-of-a-test has sent nothing for 0\.1 s"):
        RobotSource("silent-robot-of-a-test")
    feed.close()
    robot.close()


def test_errors_are_counted_by_board_and_code_and_those_of_a_healthy_walk_are_separate():
    errors = ErrorList()
    code = next(code for code, boards in all_normal().items() if "MCH" in boards)
    for time, count in ((1.0, 1), (2.5, 3)):
        errors.note(error_word(code, 3, count), time)
    errors.note(error_word(1, 3, 900), 3.0)
    errors.note(0, 4.0)
    rows = errors.content(10.0)
    assert [(row["board"], row["count"], row["first_s"], row["last_s"], row["normal"]) for row in rows] == [
        ("MCH", 4, 1.0, 2.5, True),  # a row keeps its place while others come
        ("MCH", 900, 3.0, 3.0, False),
    ]
    assert [row["until"] for row in errors.content(10.0, 2.4)] == [1, 0]
    assert [row["until"] for row in errors.content(10.0, 2.5)] == [4, 0]


def all_normal():
    from ranger_sim.datatable.generated import errors

    return errors.NORMAL_PER_S


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A walk's folder."""
    from ranger_sim.tools import cli

    place = tmp_path_factory.mktemp("panel") / "run"
    assert cli.main(["walk", "--time", "2s", "--log", "full", "--out", str(place)]) == 0
    return place


def test_a_runs_folder_is_shown_with_its_body_and_its_variables(folder):
    source = RecordingSource([str(folder)])
    begin, end = source.span()
    assert (begin, end) == (0.0, pytest.approx(2.0, abs=0.01))
    groups = {channel.name: channel.group for channel in source.channels}
    assert groups["hip_rad"] == "body" and groups["MCH_ANGLE"] == "MCH" and groups["FSM_HIP"] == "MB"
    time, values = source.pose(1.9)
    assert time == 1.9 and len(values) == len(source.pose_names)
    trace = source.trace(number_of(source, "FSM_HIP"), 0.0, 2.0, 500)  # told when it changes: it stands in between
    assert trace.x[-1] == 2.0 and np.isfinite(trace.low).all()
    angle, body = (source.values([number_of(source, name)], 1.9)[0] for name in ("MCH_ANGLE", "hip_rad"))
    assert angle == pytest.approx(body, abs=0.02)
    source.close()


def test_states_have_their_names_also_where_the_source_has_numbers_only(folder):
    link = LinkSource("loop://")
    recording = RecordingSource([str(folder)])
    for source in (recording, link):
        hip = source.channels[number_of(source, "FSM_HIP")].states
        assert hip[5] == "HI_premid" and hip[2] == "HO_premid" and len(hip) == 10
        assert source.channels[number_of(source, "MCH_ANGLE")].states == {}
    recording.close()
    link.close()


@pytest.fixture(scope="module")
def recorded(walked, tmp_path_factory):
    """The same walk, of which a folder was kept."""
    robot, place = walked[0]["robot"], tmp_path_factory.mktemp("recorded")
    write_frames(robot, place)
    takers, close = variables_part(robot, place / "variables.mf4")
    for stream, take in takers.items():
        for rows in robot.logbook.kept(stream):
            take(rows)
    close()
    with contextlib.closing(RecordingSource([str(place)])) as source:
        asyncio.run(source.run())
        yield source


@pytest.mark.parametrize("at", [0.0213, 0.3011, 0.5555])
def test_inside_of_a_robot_that_ran_and_of_its_recording_are_one(walked, recorded, at):
    running, kept = walked[1].state(at), recorded.state(at)
    for bus, rows in running["frames"].items():
        for row, found in zip(rows, kept["frames"][bus], strict=True):
            stamps = row.pop("time_s"), found.pop("time_s")
            assert 0.0 <= stamps[0] - stamps[1] < 1e-6 and row == found  # a log has microseconds
    assert len(kept["errors"]) > 2
    for row, found in zip(running["errors"], kept["errors"], strict=True):
        times = [(each.pop("first_s"), each.pop("last_s")) for each in (row, found)]
        assert times[0] == pytest.approx(times[1], abs=1e-6) and row == found


@pytest.mark.parametrize("bus", ["can1", "can2", "can3", "can4"])
def test_the_load_of_a_recorded_bus_is_that_of_its_own_meter(walked, recorded, bus):
    """In every window; a stamp in microseconds moves up to 3 bits of 30,000 over an edge, 0.01 %."""
    meter = walked[0]["loads"][bus]
    times, shares = recorded.samples(number_of(recorded, f"load_{bus}"), 0.0, SECONDS)
    numbers = np.rint(times / 0.01).astype(int) - 1
    assert len(numbers) >= 56 and shares.max() > 5.0
    np.testing.assert_allclose(shares, 100 * np.array(meter)[numbers], atol=0.0101)
    assert recorded.values([number_of(recorded, f"load_{bus}")], 0.3011) == [pytest.approx(100 * meter[29], abs=0.0101)]


def test_the_frames_of_a_walks_folder_are_those_that_python_can_reads(folder):
    with contextlib.closing(RecordingSource([str(folder)])) as source:
        assert "being read" in source.state(1.0)["missing"]["buses"]
        asyncio.run(source.run())
        shown = source.state(1.2345)
    with can.LogReader(folder / "can3.log") as reader:
        messages = [message for message in reader if message.timestamp <= 1.2345]
    rows = shown["frames"]["can3"]
    assert [row["id"] for row in rows] == [message.arbitration_id for message in messages[::-1][:40]]
    assert [row["data"] for row in rows] == [message.data.hex(" ") for message in messages[::-1][:40]]
    identifiers = [message.arbitration_id for message in messages]
    assert [row["count"] for row in rows] == [identifiers.count(row["id"]) for row in rows]
    second = [message for message in messages if message.timestamp > 0.2345]
    assert shown["buses"]["can3"]["frames_per_s"] == len(second)
    assert shown["missing"]["buses"] == "" and "keeps no slots" in shown["missing"]["slots"]


def test_the_errors_of_a_walks_folder_are_those_of_its_summary_as_far_as_they_were_sent(folder):
    summary = json.loads((folder / "summary.json").read_text())["errors"]
    with contextlib.closing(RecordingSource([str(folder)])) as source:
        asyncio.run(source.run())
        rows = source.state(None)["errors"]
    assert "errors" in source.can and {row["board"] for row in rows} == {
        board for board, found in summary.items() if found
    }
    for row in rows:
        assert 0 < row["count"] <= summary[row["board"]][row["name"]]


def test_frames_with_their_dbc_file_are_shown_by_it_and_their_load_is_not_known(folder):
    path, database = str(folder / "can1.log"), GENERATED / "can1.dbc"
    with contextlib.closing(RecordingSource([path], {"databases": [str(database)]})) as source:
        shown = source.state(1.2345)
    with contextlib.closing(RecordingSource([str(folder)])) as known:
        asyncio.run(known.run())
        expected = known.state(1.2345)["frames"]["can1"]
    for row, by_dbc in zip(expected, shown["frames"]["can1"], strict=True):
        assert [row[name] for name in ("id", "data", "count")] == [by_dbc[name] for name in ("id", "data", "count")]
        assert by_dbc["name"].startswith(row["name"])
    assert shown["buses"]["can1"]["errors"] is None
    assert shown["buses"]["can1"]["load"] is None and "do not show the bit rate" in shown["missing"]["buses"]
    assert source.can == {"play"}


def test_parts_that_a_recording_of_variables_or_a_link_lacks_are_reported(folder):
    with contextlib.closing(RecordingSource([str(folder / "variables.mf4")])) as source:
        state = source.state(1.0)
    assert state["buses"] == {} and "keeps no frames" in state["missing"]["buses"]
    assert {"MB", "MCSI"} <= {row["board"] for row in state["errors"]}


def test_a_second_recording_lies_over_the_first_moved_in_time(folder):
    source = RecordingSource([str(folder), str(folder)], shift_s=0.5)
    first, second = (number_of(source, name) for name in ("hip_rad", "hip_rad (run)"))
    assert source.values([first], 1.0) == source.values([second], 1.5)
    assert source.span()[1] == pytest.approx(2.5, abs=0.01)
    asyncio.run(source.run())
    first, second = source.state(1.0003)["frames"]["can1"], source.state(1.5003)["frames"]["can1 (run)"]
    assert len(first) == 40 and [row.pop("time_s") for row in first] == pytest.approx(
        [row.pop("time_s") - 0.5 for row in second]
    )
    assert first == second
    source.close()


@pytest.mark.parametrize(("path", "words"), [("nowhere.mf4", "there is no such file"), (".", "not a folder of a walk")])
def test_a_file_that_is_not_a_recording_is_reported(tmp_path, monkeypatch, path, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UserError, match=words):
        RecordingSource([path])


def test_assumptions_and_recipes_say_how_a_recording_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("a.csv").write_text("t_s;level_V\n" + "".join(f"{k};{1 + k % 5},{100 + k}\n" for k in range(20)))
    served = []
    monkeypatch.setattr("ranger_sim.tools.panel.command.serve", lambda source, *_: served.append(source.data) or 0)
    assert main(["panel", "a.csv", "--http-port", "0", "--assume", "decimal=comma", "--map", "level_V=a_V"]) == 0
    assert main(["read", "a.csv", "--assume", "decimal=point", "--write-recipe", "lab.toml"]) == 0
    assert main(["panel", "a.csv", "--http-port", "0", "--recipe", "lab.toml"]) == 0
    assert [float(data[0][1][0]) for data in served] == [pytest.approx(1.1), 1100.0]
    pathlib.Path("other.csv").write_text("t_s;volume\n0;1\n1;2\n")
    assert main(["panel", "other.csv", "--http-port", "0", "--recipe", "lab.toml"]) == 2


def test_a_port_that_is_not_there_is_reported():
    with pytest.raises(UserError, match="serial port"):
        LinkSource("/dev/no-such-port")


def test_the_links_silences_are_gaps_and_never_lines_before_its_lists_are_known():
    """Points every 2 ms, then 0.3 s of nothing."""
    source = LinkSource("loop://")
    number = all_variables.ID_OF["MCH_ANGLE"]
    for ms in [*range(0, 400, 2), *range(700, 1000, 2)]:
        source._on_point(Point(number, 0x3F800000, 5000 + ms))
    channel = number_of(source, "MCH_ANGLE")
    trace = source.trace(channel, 0.0, 1.0, 2000)
    (place,) = np.flatnonzero(np.isnan(trace.low))
    assert trace.x[[place - 1, place + 1]].tolist() == pytest.approx([0.398, 0.7])
    assert source.values([channel], None) == [1.0]
    source.close()


@pytest.fixture(scope="module")
def linked():
    """(source, begin, end of the bytes that were lost on the line, s): a robot on its link, three channels fast."""
    line = OnALine()
    source = LinkSource("loop://")
    names = ("MCH_ANGLE", "FSM_HIP", "MCFO_RIGHT_LS")
    source.want([number_of(source, name) for name in names])
    line.pass_on(source.session, 2.0)
    begin = source.span()[1]
    line.pass_on(source.session, 0.4, loses=True)
    end = source._seconds(source.session.clock_ms) + 0.4
    line.pass_on(source.session, 1.5)
    yield source, begin, end
    source.close()
    line.robot.close()


@pytest.mark.parametrize("points", [4000, 300])  # as they came; the extremes of a pixel's time
def test_bytes_that_are_lost_on_the_line_are_a_gap_in_the_plot(linked, points):
    source, begin, end = linked
    trace = source.trace(number_of(source, "MCH_ANGLE"), begin - 1.0, end + 1.0, points)
    nothing = np.isnan(trace.low)
    inside = (trace.x > begin + 0.01) & (trace.x < end - 0.02)
    assert nothing.any() and nothing[inside].all()
    there = trace.x[~nothing]
    assert np.diff(there).max() == pytest.approx(0.4, abs=0.03)  # that one, and no other
    assert np.sum(np.diff(there) > 0.05) == 1


def test_a_value_that_is_written_now_and_then_is_held_between_on_the_link(linked):
    """The hip's state: whole numbers, never a slope from one to the next."""
    source, begin, _ = linked
    trace = source.trace(number_of(source, "FSM_HIP"), 0.5, begin, 4000)
    values = trace.low[~np.isnan(trace.low)]
    steps = np.flatnonzero(np.diff(values))
    assert len(steps) >= 2
    assert (np.diff(trace.x[~np.isnan(trace.low)])[steps] < 2e-3).all()


def test_a_parameter_of_the_link_has_a_line_although_it_is_not_written(linked):
    source, begin, _ = linked
    trace = source.trace(number_of(source, "P_H_PM_TIME"), 0.0, begin, 4000)
    assert set(trace.low.tolist()) == {300.0} and trace.x[-1] - trace.x[0] > 1.0


def test_the_page_receives_the_lists_of_the_link(linked):
    source, begin, end = linked

    async def state():
        return source.state(None)

    link = asyncio.run(state())["link"]
    assert [row["list"] for row in link["lists"]] == ["fast", "medium", "slow"]
    angle = next(row for row in link["chosen"] if row["name"] == "MCH_ANGLE")
    assert (angle["list"], angle["gaps"]) == ("fast", 1) and angle["last_s"] == pytest.approx(end, abs=0.03)
    assert {row["list"] for row in link["chosen"] if row["name"] in ANKLES} == {"medium"}
    assert link["asked"] is False and link["gaps"] == 1


def test_a_robot_that_gets_its_power_anew_is_shown_anew():
    source = LinkSource("loop://")
    time, angle = (all_variables.ID_OF[name] for name in ("TIMESTAMP", "MCH_ANGLE"))
    for stamp in (50_000, 50_002, 50_004):
        source.session._take(Point(time, stamp, stamp))
        source.session._take(Point(angle, 0x3F800000, stamp))
    source.session._take(Point(time, 10, 10))
    source.session._take(Point(angle, 0x40000000, 12))
    channel = number_of(source, "MCH_ANGLE")
    assert source.values([channel], None) == [2.0] and len(source.kept[channel].times) == 1
    assert source.span()[1] == pytest.approx(0.002)
    source.close()


def test_the_robot_is_asked_to_send_often_what_the_plots_show():
    source = LinkSource("loop://")
    channel = number_of(source, "MCH_ANGLE")
    source.want([channel])
    assert all_variables.ID_OF["MCH_ANGLE"] in {word & 0x7FFF for word in source.session.selection}
    sent = source.session.outgoing(0.0)
    assert sent
    source.want([channel])
    assert source.session.outgoing(0.1) == b""  # the same wish once more sends nothing
    source.close()


def test_the_cost_of_transport_is_energy_over_weight_and_way(walked):
    """The robot of this test has not walked; 1 Wh over 10 m of 98.1 N is 3.67 (3600 / 981)."""
    _, source = walked
    assert source.state(None)["tcot"] is None
    source.shown = {**source.shown, "distance_m": 10.0, "energy_Wh": {"total": 1.0}}
    source.weight_N = 98.1
    assert source.state(None)["tcot"] == pytest.approx(3600.0 / 981.0)


def test_a_recording_without_a_body_shows_the_pose_that_the_robot_knows_itself(folder):
    """Against the body's true angles in the same walk; the robot's estimate of its legs is some hundredths off."""
    source = RecordingSource([str(folder)])
    true = dict(zip(source.pose_names, source.pose(1.9)[1], strict=True))
    source.number = {name: place for name, place in source.number.items() if name not in TRUE_POSE}
    source.pose_names = KNOWN_POSE
    known = dict(zip(KNOWN_POSE, source.pose(1.9)[1], strict=True))
    assert all(known[name] == pytest.approx(true[name], abs=0.06) for name in KNOWN_POSE)
    source.close()


def test_the_estimates_of_the_program_that_runs_are_taken():
    feet = {"MCFO_RIGHT_ANKLE_ANGLE": 1.68, "MCFI_MID_ANKLE_ANGLE": 0.68}
    record = {"E_LO_ANGLE": 0.1, "E_LI_ANGLE": -0.2, "EST_STATE_TH0": 0.0, "EST_STATE_TH1": 0.0}
    later = {"EST_STATE_TH0": 0.3, "EST_STATE_TH1": 0.4, "E_LO_ANGLE": 0.0, "E_LI_ANGLE": 0.0}
    assert known_pose({**feet, **record}) == pytest.approx([0.1, -0.2, 0.1, -1.2])
    assert known_pose({**feet, **later}) == pytest.approx([0.3, 0.4, 0.3, -0.6])
    assert known_pose({**record, "MCFO_RIGHT_ANKLE_ANGLE": 1.0}) is None
    assert known_pose(feet) is None


@pytest.fixture
def stepped(tmp_path):
    """Two recordings of a step, the second 0.7 s later."""
    for name, at in (("one.csv", 1.0), ("two.csv", 1.7)):
        rows = [f"{time:.2f},{int(time >= at)}" for time in np.arange(0.0, 3.0, 0.05)]
        (tmp_path / name).write_text("t_s,level_V\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return [str(tmp_path / "one.csv"), str(tmp_path / "two.csv")]


def test_two_recordings_are_laid_over_each_other_by_an_event(stepped):
    source = RecordingSource(stepped, align=Event.typed("level_V > 0.5"))
    assert source.values([0, 1], 0.97) == [0.0, 0.0] and source.values([0, 1], 1.01) == [1.0, 1.0]
    apart = RecordingSource(stepped)
    assert apart.values([0, 1], 1.5) == [1.0, 0.0]


@pytest.mark.parametrize(
    ("event", "words"),
    [
        ("level_V", "it reads like FSM_HIP = 3"),
        ("level_V = much", "it reads like FSM_HIP = 3"),
        ("level_V > 5", "level_V > 5 does not begin anywhere in it"),
        ("nothing = 1", "unknown channel 'nothing'"),
    ],
)
def test_an_event_that_never_comes_is_reported(stepped, event, words):
    with pytest.raises(UserError, match=words):
        RecordingSource(stepped, align=Event.typed(event))
