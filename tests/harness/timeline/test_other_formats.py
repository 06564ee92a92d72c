"""The value change dump and the MCAP file of a run, read back by what shares no code with their writers."""

import collections
import contextlib
import re

import pytest

from ranger_sim.harness.timeline import files as formats
from ranger_sim.harness.timeline.model import Events, Instant, Instants
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.timeline import Timeline

RUN_S = 0.03


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """(robot, its events, folder with run.vcd and run.mcap)."""
    pytest.importorskip("vcd")
    folder = tmp_path_factory.mktemp("formats")
    with contextlib.closing(Ranger(Scenario())) as robot:
        timeline = Timeline(robot)
        robot.run_for(RUN_S)
        events = timeline.events()
        timeline.write(folder / "run.vcd")
        timeline.close()
        yield robot, events, folder


class Dump:
    """A VCD as IEEE 1364 describes it: declarations, then times and value changes."""

    def __init__(self, path):
        head, _, body = path.read_text(encoding="ascii").partition("$enddefinitions $end")
        self.timescale = re.search(r"\$timescale\s+(.*?)\s+\$end", head)[1]
        self.names, scopes = {}, []
        for kind, rest in re.findall(r"\$(scope|var|upscope)\b(.*?)\$end", head, re.DOTALL):
            if kind == "scope":
                scopes.append(rest.split()[1])
            elif kind == "upscope":
                scopes.pop()
            else:
                _, _, code, name = rest.split()[:4]
                self.names[code] = ".".join((*scopes, name))
        self.changes = collections.defaultdict(list)
        time = 0
        for line in body.split("\n"):
            line = line.rstrip("\n")
            if line.startswith("#"):
                assert int(line[1:]) >= time
                time = int(line[1:])
            elif line and line[0] in "bs" and " " in line:
                value, _, code = line[1:].rpartition(" ")
                self.changes[self.names[code]].append((time, value))
            elif line and line[0] in "01xz":
                self.changes[self.names[line[1:]]].append((time, line[0]))
        self.end = time

    def rises(self, name):
        return [time for time, value in self.changes[name] if value == "1"]

    def high(self, name):
        """[(from, to)] of the times at which a line is 1."""
        spans, since = [], None
        for time, value in self.changes[name]:
            if value == "1" and since is None:
                since = time
            elif value == "0" and since is not None:
                spans.append((since, time))
                since = None
        return spans


@pytest.fixture(scope="module")
def dump(files):
    return Dump(files[2] / "run.vcd")


def test_a_boards_slot_line_rises_with_each_slot(files, dump):
    robot, events, _ = files
    assert dump.timescale == "1 ns"
    for board in ("MCH", "MCFO", "UI", "MB", "CSR"):
        assert len(dump.rises(f"boards.{board}.slot")) == robot.boards[board].scheduler.slot_count
    slots = events.track("Boards", "MCH", "slots")
    spans = list(zip(slots.start_ns.tolist(), slots.end_ns.tolist(), strict=True))
    assert dump.high("boards.MCH.slot") == spans


def test_a_bus_is_busy_for_as_long_as_its_load_says(files, dump):
    robot, _, _ = files
    for bus in robot.buses:
        busy_ns = sum(end - begin for begin, end in dump.high(f"buses.{bus.name}"))
        # the load counts the intermission of each frame, three bits, as well
        expected = bus.load_mean(robot.loop.time) * RUN_S * 1e9 - bus.counters.frames * 1000
        assert busy_ns == pytest.approx(expected, rel=0.02)


def test_a_frame_and_a_state_are_shown_by_name(dump):
    frames = [value for _, value in dump.changes["buses.can1_frame"]]
    # every 2 ms from the first slot on, 1.4 ms after power-up
    assert frames.count("MCH_ANGLE") == 15 and "TIMESTAMP" in frames
    assert "HI_starthold" in [value for _, value in dump.changes["machines.hip"]]


def test_the_watchdog_pin_changes_its_level_in_every_slot(files, dump):
    """robot.md N4.4: the heartbeat of a running motor board feeds it; before that it is unknown."""
    levels = [value for _, value in dump.changes["boards.MCH.motor_watchdog"]]
    assert levels[0] == "x" and len(levels) > 10
    assert all(a != b for a, b in zip(levels, levels[1:], strict=False))


def test_the_same_run_gives_the_same_dump(files, tmp_path):
    with contextlib.closing(Ranger(Scenario())) as robot:
        timeline = Timeline(robot)
        robot.run_for(RUN_S)
        timeline.write(tmp_path / "again.vcd")
        timeline.close()
    assert (tmp_path / "again.vcd").read_bytes() == (files[2] / "run.vcd").read_bytes()


def test_body_and_signals_come_back_from_an_mcap_file(tmp_path):
    reader = pytest.importorskip("mcap.reader")
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import message_factory

    with contextlib.closing(Ranger(Scenario())) as robot:
        timeline = Timeline(robot)
        robot.run_for(RUN_S)
        timeline.write(tmp_path / "run.mcap")
        timeline.write(tmp_path / "again.mcap")
        timeline.close()
        angle = robot.variable("MCH_ANGLE")
    assert (tmp_path / "run.mcap").read_bytes() == (tmp_path / "again.mcap").read_bytes()
    seen, last = collections.defaultdict(list), {}
    with (tmp_path / "run.mcap").open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            described = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            kinds = message_factory.GetMessages(described.file)
            last[channel.topic] = kinds[schema.name].FromString(message.data)
            seen[channel.topic].append(message.log_time)
            if channel.topic == "/body":
                assert channel.metadata["hip_rad"] == "rad"
    # the body is sampled every 2 ms, from 0 on
    assert seen["/body"] == [2_000_000 * number for number in range(15)]
    assert last["/body"].hip_rad == pytest.approx(0.35, abs=0.01)
    assert last["/variables/MCH"].MCH_ANGLE == pytest.approx(angle, abs=1e-3)


def test_what_happened_comes_back_from_an_mcap_file_as_foxgloves_log(tmp_path):
    reader = pytest.importorskip("mcap.reader")
    descriptor_pb2 = pytest.importorskip("google.protobuf.descriptor_pb2")
    from google.protobuf import message_factory

    events = Events(0, 3_000_000_000)
    events.instants = [
        Instants(
            ("Steps",), [Instant(1_250_000_000, "step 3", {"length_m": 0.25}), Instant(2_500_000_007, "fell: hip")]
        ),
        Instants(("Faults",), [Instant(2_000_000_000, "acted: MCH.joint_encoder:stuck")]),
    ]
    formats.write(events, tmp_path / "run.mcap", "title")
    found = []
    with (tmp_path / "run.mcap").open("rb") as file:
        for schema, channel, message in reader.make_reader(file).iter_messages():
            described = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
            log = message_factory.GetMessages(described.file)[schema.name].FromString(message.data)
            assert (schema.name, channel.topic) == ("foxglove.Log", "/events")
            assert log.timestamp.seconds * 10**9 + log.timestamp.nanos == message.log_time
            found.append((message.log_time, log.level, log.message, log.name))
    # levels of foxglove.Log: 2 informs, 3 warns, 4 is an error
    assert found == [
        (1_250_000_000, 2, "step 3 (length_m 0.25)", "Steps"),
        (2_000_000_000, 3, "acted: MCH.joint_encoder:stuck", "Faults"),
        (2_500_000_007, 4, "fell: hip", "Steps"),
    ]
