"""The timeline of a machine of one's own: CAN FD frames, the boards' slots and pins, the body, and its files."""

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline import perfetto_reader
from tests.can_bus import fd_oracle
from tests.firmware_sim.native.support import COMPILER, SCHEDULE, folder_with, library_of
from tests.harness.test_can_fd_machine import CLASSIC, ECHO, SENDER, machine

pytestmark = pytest.mark.skipif(not COMPILER, reason="no C compiler is installed here")
NOMINAL_NS, DATA_NS, SAMPLE_POINT = 2000, 500, 0.8


@pytest.fixture(scope="module")
def programs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("programs")
    sources = {"SENDER": SENDER.replace("DATA_RATE", "2000000"), "ECHO": ECHO, "CLASSIC": CLASSIC}
    return {name: library_of(folder_with(folder / name, text + SCHEDULE)) for name, text in sources.items()}


def times_of(frame):
    """(length, begin of the data phase, its end) in ns from the start of frame, counted bit by bit."""
    text, brs, delimiter = fd_oracle.transmitted(frame)
    at, begin, end = 0.0, 0.0, 0.0
    for place in range(len(text)):
        before, after = (DATA_NS if brs < place <= delimiter else NOMINAL_NS for _ in range(2))
        if place == brs:
            after, begin = DATA_NS, at + SAMPLE_POINT * NOMINAL_NS
        if place == delimiter:
            after, end = NOMINAL_NS, at + SAMPLE_POINT * DATA_NS
        at += SAMPLE_POINT * before + (1 - SAMPLE_POINT) * after
    return at, begin, end


def test_a_can_fd_frame_has_its_bytes_its_bits_and_its_data_phase(programs):
    with machine(programs, "SENDER", "ECHO", "CLASSIC") as robot:
        robot.buses[0].set_classic(2, classic=False)  # it takes part and disturbs nothing
        timeline = robot.timeline()
        robot.run_for(0.05)
        frames = timeline.events().track("Buses", "can1", "frames")
        names = [frames.names[each] for each in frames.name]
        assert set(names) == {"123", "124", "10"}
        assert {frames.labels["sender"][each] for each in frames.name} == {"SENDER", "ECHO", "CLASSIC"}
        notes = {
            name: {frames.notes[note][row] for row, each in enumerate(names) if each == name}
            for name in set(names)
            for note in ["bytes"]
        }
        assert notes == {"123": {64}, "124": {64}, "10": {8}}
        for note in ("FDF", "BRS"):
            assert {(name, int(value)) for name, value in zip(names, frames.notes[note], strict=True)} == {
                ("123", 1),
                ("124", 1),
                ("10", 0),
            }
        assert not frames.notes["ESI"].any()
        phases = frames.inside
        assert phases.names == ["data phase, 2 Mbit/s"]
        fd = [row for row, name in enumerate(names) if name != "10"]
        sent = robot.wire().frames(0x123)
        assert len(phases) == len(fd) and len(sent) == names.count("123") == 25
        first = fd_oracle.FdFrame(0x123, sent[0].data, brs=True)
        length, begin, end = times_of(first)
        start = frames.start_ns[fd[0]]
        assert frames.end_ns[fd[0]] - start == pytest.approx(length, abs=1)  # times are whole nanoseconds
        assert phases.start_ns[0] - start == pytest.approx(begin, abs=1)
        assert phases.end_ns[0] - start == pytest.approx(end, abs=2)
        timeline.close()


def test_the_error_state_of_a_sender_is_shown_and_an_error_frame_has_no_data_phase(programs):
    with machine(programs, "SENDER", "ECHO", "CLASSIC") as robot:
        timeline = robot.timeline()
        robot.run_for(0.1)
        frames = timeline.events().track("Buses", "can1", "frames")
        names = [frames.names[each] for each in frames.name]
        errors = [row for row, name in enumerate(names) if name.startswith("error frame")]
        assert len(errors) == robot.buses[0].counters.errors >= 14
        assert not any(frames.notes[note][row] for row in errors for note in ("bytes", "FDF", "BRS", "ESI"))
        assert len(frames.inside) == frames.notes["BRS"].sum() > 0
        passive = robot.buses[0].nodes[0].passive
        last = max(row for row, name in enumerate(names) if name == "123")
        assert frames.notes["ESI"][last] == passive


def test_the_function_that_sends_leads_to_its_frame_and_the_file_is_read_back(programs, tmp_path):
    with machine(programs, "SENDER", "ECHO") as robot, machine(programs, "SENDER", "ECHO") as other:
        timeline = robot.timeline(last_s=10.0)
        for each in (robot, other):
            each.run_for(0.02)
        assert robot.trace_digest() == other.trace_digest()  # a timeline changes nothing
        events = timeline.events()
        sending = events.track("Boards", "SENDER", "slots").inside
        frames = events.track("Buses", "can1", "frames")
        flows = dict(zip(sending.flow_id.tolist(), sending.flow_at.tolist(), strict=True))
        ends = dict(zip(frames.flow_id.tolist(), frames.flow_at.tolist(), strict=True))
        assert len(flows) == 10 and set(flows) <= set(ends)
        for flow, row in flows.items():
            assert sending.names[sending.name[row]] == "send" and frames.names[frames.name[ends[flow]]] == "123"
            assert 0 < frames.start_ns[ends[flow]] - sending.start_ns[row] < 400_000
        assert events.counter("Body", "zero").unit == "1"
        timeline.write(tmp_path / "run.pftrace")
        read = perfetto_reader.read(tmp_path / "run.pftrace", 0, 20_000_000)
        root = next(track for track in read.tracks.values() if not track.parent)
        assert (root.name, root.description) == ("machine", "ranger-sim: boards SENDER, ECHO, seed 1")
        track = next(track for track in read.tracks.values() if track.name == "frames")
        long = [each for each in track.slices if each.name == "123"]
        assert [each.notes["bytes"] for each in long] == [64] * 10 and {each.notes["BRS"] for each in long} == {1}
        inner = [each for each in track.slices if each.depth == 1]
        assert {each.name for each in inner} == {"data phase, 2 Mbit/s"} and len(inner) == len(track.slices) // 2
        timeline.close()
        assert robot.buses[0].log.times is None


def test_no_time_is_refused(programs):
    with machine(programs, "SENDER") as robot, pytest.raises(UserError, match="last_s is 0.0, it must be above 0 s"):
        robot.timeline(0.0)
