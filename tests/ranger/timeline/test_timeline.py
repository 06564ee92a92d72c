"""What a timeline holds of a run, read back from its file by Perfetto's schema; and that keeping it changes nothing."""

import collections
import contextlib
import zlib

import numpy as np
import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timeline import files, perfetto_reader
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.timeline import Timeline, flows

perfetto_trace_pb2 = pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")

RUN_S = 0.06  # the boards have their power within 2 ms, and some thirty rows of each have run
CAN_BIT_NS = 1e9 / 3e6
EXCHANGE_US = 165.333  # 31 half-words of 16 bits at 3 Mbit/s


class Run:
    """A short run with its timeline: the robot, the file and what was read from it."""

    def __init__(self, folder):
        self.file = folder / "run.pftrace"
        self.robot = Ranger(Scenario())
        timeline = Timeline(self.robot)
        self.robot.run_for(RUN_S)
        self.events = timeline.events()
        timeline.write(self.file)
        timeline.close()
        self.digest = self.robot.trace_digest()
        self.trace = perfetto_reader.read(self.file)

    def slices(self, *path, depth=None, name=None):
        return [
            each
            for each in self.trace.find(*path).slices
            if (depth is None or each.depth == depth) and (name is None or each.name == name)
        ]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    made = Run(tmp_path_factory.mktemp("timeline"))
    yield made
    made.robot.close()


@pytest.fixture(scope="module")
def packets(run):
    """The packets as the schema and zlib alone read them."""
    found = []
    for packet in perfetto_trace_pb2.Trace.FromString(run.file.read_bytes()).packet:
        if packet.HasField("compressed_packets"):
            found += perfetto_trace_pb2.Trace.FromString(zlib.decompress(packet.compressed_packets)).packet
        else:
            found.append(packet)
    return found


# --- it is a trace ----------------------------------------------------------------------------------------


def test_begins_and_ends_of_slices_match_on_every_track(packets):
    event = perfetto_trace_pb2.TrackEvent
    open_slices = collections.Counter()
    latest = collections.defaultdict(int)
    ended = 0
    for packet in packets:
        if packet.HasField("track_event"):
            track = packet.track_event.track_uuid
            assert packet.timestamp >= latest[track], packet
            latest[track] = packet.timestamp
            if packet.track_event.type == event.TYPE_SLICE_BEGIN:
                open_slices[track] += 1
            elif packet.track_event.type == event.TYPE_SLICE_END:
                open_slices[track] -= 1
                ended += 1
                assert open_slices[track] >= 0, packet
    assert ended > 10_000 and set(open_slices.values()) == {0}


def test_the_file_has_a_quarter_of_its_packets_bytes_at_most(run, packets):
    assert run.file.stat().st_size < sum(packet.ByteSize() for packet in packets) / 4


def test_a_trace_with_plain_packets_is_read_as_the_compressed_one(run, packets, tmp_path):
    plain = tmp_path / "plain.pftrace"
    plain.write_bytes(perfetto_trace_pb2.Trace(packet=packets).SerializeToString())
    assert perfetto_reader.read(plain) == run.trace


@pytest.mark.parametrize("packets", [b"not deflated", zlib.compress(bytes(1000))[:-3], zlib.compress(bytes(1 << 27))])
def test_packets_that_do_not_inflate_or_never_end_are_an_error(packets, tmp_path):
    damaged = tmp_path / "damaged.pftrace"
    trace = perfetto_trace_pb2.Trace()
    trace.packet.add().compressed_packets = packets
    damaged.write_bytes(trace.SerializeToString())
    with pytest.raises(UserError, match="damaged at byte"):
        perfetto_reader.read(damaged)


def test_every_packet_belongs_to_a_track_that_was_described_and_has_a_name(packets):
    described = {packet.track_descriptor.uuid for packet in packets if packet.HasField("track_descriptor")}
    names = {each.iid for packet in packets for each in packet.interned_data.event_names}
    notes = {each.iid for packet in packets for each in packet.interned_data.debug_annotation_names}
    parents = {packet.track_descriptor.parent_uuid for packet in packets if packet.HasField("track_descriptor")}
    assert parents - {0} <= described
    begin = perfetto_trace_pb2.TrackEvent.TYPE_SLICE_BEGIN
    for packet in packets:
        if packet.HasField("track_event"):
            assert packet.track_event.track_uuid in described
            if packet.track_event.type == begin:
                assert packet.track_event.name_iid in names
                assert {each.name_iid for each in packet.track_event.debug_annotations} <= notes
    first = packets[0]  # from which on the names count
    assert first.sequence_flags == perfetto_trace_pb2.TracePacket.SEQ_INCREMENTAL_STATE_CLEARED


def test_every_flow_has_both_its_ends_and_none_leads_back_in_time(packets):
    begins, ends = {}, {}
    for packet in packets:
        for number in packet.track_event.flow_ids:
            assert number not in begins
            begins[number] = packet.timestamp
        for number in packet.track_event.terminating_flow_ids:
            assert number not in ends
            ends[number] = packet.timestamp
    assert len(begins) > 2000 and begins.keys() == ends.keys()
    assert all(begins[number] <= ends[number] for number in begins)


def test_counters_are_in_order_of_time_and_end_where_the_robots_own_numbers_are(run):
    counters = [track for track in run.trace.tracks.values() if track.unit is not None]
    assert len(counters) > 100
    for track in counters:
        assert all(a < b for a, b in zip(track.time_ns, track.time_ns[1:], strict=False)), track.name
    hip = run.trace.find("Body", "hip_rad")
    assert hip.unit == "rad" and hip.values[-1] == pytest.approx(0.35, abs=0.01)  # as it is held at first
    angle = run.trace.find("Variables", "MCH", "MCH_ANGLE")
    assert angle.unit == "rad" and angle.values[-1] == pytest.approx(run.robot.variable("MCH_ANGLE"), abs=1e-3)


def test_the_same_run_gives_the_same_bytes(run, tmp_path):
    again = Run(tmp_path)
    assert again.file.read_bytes() == run.file.read_bytes()
    again.robot.close()


def test_a_run_is_the_same_with_a_timeline_and_without(run):
    with contextlib.closing(Ranger(Scenario())) as robot:
        robot.run_for(RUN_S)
        assert robot.trace_digest() == run.digest


# --- it says what happened --------------------------------------------------------------------------------


@pytest.mark.parametrize("board", ["MCH", "MCFO", "MCFI", "MCSI", "UI", "CSR", "MB"])
def test_every_slot_is_a_slice_as_long_as_the_scheduler_says_with_its_functions_inside(run, board):
    scheduler = run.robot.boards[board].scheduler
    slots = run.slices("Boards", board, "slots", depth=0)
    assert len(slots) == scheduler.slot_count
    assert max(each.notes["cycles"] for each in slots) == scheduler.max_slot_cycles
    rows = [f"row {row % scheduler.row_count}" for row in range(len(slots))]
    assert [each.name for each in slots] == rows
    begins = [each.start_ns for each in slots]
    gaps = {b - a for a, b in zip(begins, begins[1:], strict=False)}
    # a crystal is off by at most 50 ppm
    assert all(abs(gap - scheduler.slot_ns) <= 1 + scheduler.slot_ns * 50e-6 for gap in gaps)
    of_row = [task.name for task in scheduler.schedule.row_tasks(1)]
    second = slots[1]
    inside = [
        each.name
        for each in run.slices("Boards", board, "slots", depth=1)
        if second.start_ns <= each.start_ns and each.end_ns <= second.end_ns
    ]
    assert inside == of_row


def test_every_frame_is_a_slice_of_its_length_in_bits(run):
    for bus in run.robot.buses:
        frames = run.slices("Buses", bus.name, "frames")
        assert len(frames) == bus.counters.frames > 50
        for frame in frames:
            bits = (frame.end_ns - frame.start_ns) / CAN_BIT_NS
            assert abs(bits - round(bits)) < 0.01 and 44 <= round(bits) <= 44 + 64 + 24, frame
        for earlier, later in zip(frames, frames[1:], strict=False):
            assert later.start_ns - earlier.end_ns > 2.99 * CAN_BIT_NS  # the intermission


def test_a_frame_shows_its_sender_its_content_and_how_long_it_waited(run):
    angles = run.slices("Buses", "can1", "frames", name="MCH_ANGLE")
    # 500 a second from the first slots on, which come within 2.5 ms after power-up
    assert len(angles) in (29, 30)
    assert {frame.notes["sender"] for frame in angles} == {"MCH"}
    assert angles[-1].notes["value"] == pytest.approx(run.robot.variable("MCH_ANGLE"), abs=1e-3)
    waits = {each.end_ns: each for each in run.slices("Buses", "can1", "MCH waits, buffer 1", name="MCH_ANGLE")}
    for frame in angles:
        wait = waits[frame.start_ns]
        assert frame.notes["waited_us"] == pytest.approx((wait.end_ns - wait.start_ns) * 1e-3)
        assert frame.notes["waited_us"] > 0.0


def following(run, flows):
    """(path of the track, slice) at the end of each of these flows."""
    return [
        (run.trace.path(track), each)
        for track in run.trace.tracks.values()
        for each in track.slices
        if set(each.flow_ends) & set(flows)
    ]


def test_the_hip_angle_can_be_followed_from_the_function_that_sends_it_to_the_main_brain(run):
    frame = run.slices("Buses", "can1", "frames", name="MCH_ANGLE")[10]
    asked_ns = frame.start_ns - round(frame.notes["waited_us"] * 1e3)
    [sender] = [each for each in run.slices("Boards", "MCH", "slots") if set(each.flows) & set(frame.flow_ends)]
    assert sender.name == "can_transmit" and sender.start_ns == asked_ns
    [(path, interrupt)] = following(run, frame.flows)
    assert path == ("Boards", "CSR", "interrupts") and interrupt.name == "can1 receive"
    assert frame.end_ns - interrupt.start_ns == pytest.approx(CAN_BIT_NS, abs=1)  # it is heard a bit before its end
    [(path, exchange)] = following(run, interrupt.flows)
    assert path == ("Link", "to the main brain")
    assert (exchange.end_ns - exchange.start_ns) * 1e-3 == pytest.approx(EXCHANGE_US, abs=1e-3)
    # the router starts an exchange every 200 us
    assert 0 < exchange.start_ns - interrupt.start_ns < 400_000
    [(path, interrupt)] = following(run, exchange.flows)
    assert path == ("Boards", "MB", "interrupts") and interrupt.name == "ssp"
    assert interrupt.start_ns >= exchange.end_ns
    [(path, task)] = following(run, interrupt.flows)
    assert path == ("Boards", "MB", "slots") and task.name == "parse_ssp" and not task.flows
    assert interrupt.start_ns < task.start_ns <= interrupt.start_ns + 2_000_000  # the next slot of 2 ms


def test_a_command_of_the_main_brain_can_be_followed_to_the_hip_board(run):
    frame = run.slices("Buses", "can1", "frames", name="MCH_COMMAND_CURRENT")[5]
    assert frame.notes["sender"] == "CSR"
    [turn] = [each for each in run.slices("Boards", "CSR", "main loop") if set(each.flows) & set(frame.flow_ends)]
    [interrupt] = [each for each in run.slices("Boards", "CSR", "interrupts") if set(each.flows) & set(turn.flow_ends)]
    assert interrupt.name == "ssp"
    [exchange] = [each for each in run.slices("Link", "to the router") if set(each.flows) & set(interrupt.flow_ends)]
    [sender] = [each for each in run.slices("Boards", "MB", "slots") if set(each.flows) & set(exchange.flow_ends)]
    assert sender.name == "send_ssp" and sender.start_ns < exchange.start_ns
    [(path, interrupt)] = following(run, frame.flows)
    assert path == ("Boards", "MCH", "interrupts") and interrupt.name == "can_receive"
    [(path, task)] = following(run, interrupt.flows)
    assert path == ("Boards", "MCH", "slots") and task.name == "can_rx_dispatch_all"


def test_nearly_every_frame_has_the_function_that_published_it_and_an_interrupt_that_took_it(run):
    for bus in run.robot.buses:
        frames = run.slices("Buses", bus.name, "frames")
        assert sum(bool(frame.flow_ends) for frame in frames) >= len(frames) - 2, bus.name
        assert sum(bool(frame.flows) for frame in frames) >= len(frames) - 2, bus.name  # the last ones are on their way


def test_machines_are_slices_of_their_states_by_name(run):
    states = run.slices("Machines", "hip")
    assert [each.name for each in states] == ["HI_starthold"]
    assert states[0].start_ns == 0 and states[0].end_ns == round(RUN_S * 1e9)


# --- how much of it ---------------------------------------------------------------------------------------


def test_only_the_last_part_is_kept_where_that_is_asked_for_and_it_is_the_same_as_in_the_whole(run, tmp_path):
    with contextlib.closing(Ranger(Scenario())) as robot:
        timeline = Timeline(robot, last_s=0.01)
        robot.run_for(RUN_S)
        timeline.write(tmp_path / "last.pftrace")
        kept = max(store.size for store in timeline.stores)
    short = perfetto_reader.read(tmp_path / "last.pftrace")
    begin = round((RUN_S - 0.01) * 1e9)
    assert short.begin_ns >= begin - 2_000_000  # a slot of the main brain that ended in that time began before
    for path in (("Boards", "MCH", "slots"), ("Buses", "can1", "frames")):
        whole, part = (
            [(each.name, each.start_ns, each.end_ns) for each in trace.find(*path).slices if each.start_ns >= begin]
            for trace in (run.trace, short)
        )
        assert len(part) > 10 and part == whole
    # some 56 rows of 64 bytes a ms on a motor board, and a block beyond
    assert kept < 3_000_000


def test_a_closed_timeline_leaves_the_robot_as_it_was():
    with contextlib.closing(Ranger(Scenario(), log="window")) as robot:
        before = {name: stream.sink for name, stream in robot.recorder.streams().items()}
        timeline = Timeline(robot)
        robot.run_for(0.01)
        timeline.close()
        assert {name: stream.sink for name, stream in robot.recorder.streams().items()} == before
        assert all(bus.log.times is None for bus in robot.buses)
        assert all(board.scheduler.log is None for board in robot.boards.values())
        robot.run_for(0.01)
        assert len(robot.logbook.frames()["time_ns"]) > 0  # what was kept beside is still kept


@pytest.mark.parametrize("last_s", [0.0, -1.0, float("nan")])
def test_a_text_that_is_not_a_time_is_refused(last_s):
    with contextlib.closing(Ranger(Scenario())) as robot, pytest.raises(UserError, match="last_s"):
        Timeline(robot, last_s=last_s)


@pytest.mark.parametrize(
    ("name", "reason"),
    [("run.txt", "'.txt' is not a format"), ("missing/run.pftrace", "No such file"), ("", "is not a format")],
)
def test_a_file_that_cannot_be_is_refused_in_one_line(run, tmp_path, name, reason):
    with contextlib.closing(Ranger(Scenario())) as robot:
        with pytest.raises(UserError, match=reason) as reported:
            Timeline(robot).write(tmp_path / name)
        assert "\n" not in str(reported.value)


# --- arrows where something went wrong ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("came_ns", "asked_ns", "pairs"),
    [
        ([100, 200, 300], [100, 201, 298], [0, 1, 2]),  # be it by a rounded bit
        ([100, 200, 300], [100, 300], [0, -1, 1]),  # a lost one shifts nothing
        ([100, 200, 300], [100, 250, 300], [0, 1, 2]),  # it waited behind the first
        ([100, 150, 200, 300], [100, 250, 300], [0, -1, 1, 2]),  # of two the later: the first was overwritten
        ([100, 150, 200], [100, 250, 260], [0, 1, 2]),
        ([100, 200], [50, 100, 200, 300], [1, 2]),  # asked for without a frame, before and behind
        ([100, 5000], [2000, 5000], [-1, 1]),  # too late for the first
        ([], [100], []),
        ([100], [], [-1]),
    ],
)
def test_frames_are_paired_with_the_interrupts_that_they_asked_for(came_ns, asked_ns, pairs):
    found = flows.paired(np.array(came_ns, dtype=np.int64), np.array(asked_ns, dtype=np.int64), 1500)
    assert found.tolist() == pairs


def test_lost_frames_have_no_arrow_and_those_behind_them_have_theirs():
    with contextlib.closing(Ranger(Scenario())) as robot:
        timeline = Timeline(robot)
        robot.inject("MCH.can1", "loss", at="0.02 s", until="0.03 s")
        robot.run_for(RUN_S)
        events = timeline.events()
        timeline.close()
    frames, interrupts = events.track("Buses", "can1", "frames"), events.track("Boards", "MCH", "interrupts")
    begins, ends = frames.flow_ends == 0, interrupts.flow_ends == 1
    numbers, sent, received = np.intersect1d(
        frames.flow_id[begins], interrupts.flow_id[ends], assume_unique=True, return_indices=True
    )
    came = np.stack(
        [
            frames.end_ns[frames.flow_at[begins][sent]],
            interrupts.start_ns[interrupts.flow_at[ends][received]],
        ],
        axis=1,
    )
    assert len(numbers) > 100
    # heard a bit before the frame's end, and served within the longest handler and task that disables nothing
    waited_us = (came[:, 1] - came[:, 0]) * 1e-3
    assert ((waited_us > -0.34) & (waited_us < 20)).all()
    # plant steps of 250 us begin and end the fault
    lost = (frames.end_ns > 20.3e6) & (frames.end_ns < 29.9e6)
    assert lost.sum() > 30 and not any((came[:, 0] > 20.3e6) & (came[:, 0] < 29.9e6))
    assert (came[:, 0] > 30.3e6).sum() > 60


def test_a_disk_that_fills_up_while_the_file_is_written_is_reported_in_one_line_and_leaves_nothing(
    run, tmp_path, monkeypatch
):
    def full(events, file, title):
        file.write(b"some")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(files.FORMATS, ".pftrace", full)
    with pytest.raises(UserError, match=r"run\.pftrace: cannot be written: No space left on device"):
        files.write(run.events, tmp_path / "run.pftrace", "")
    assert list(tmp_path.iterdir()) == []


# --- only a part in detail --------------------------------------------------------------------------------


def walked(detail_s):
    """Events of 5.5 s with a fault at 2 s, with what boards do in detail for so long."""
    robot = Ranger(Scenario())
    try:
        timeline = Timeline(robot, detail_s=detail_s)
        robot.inject("MCH.joint_encoder", "stuck", at="2 s", until="2.1 s")
        robot.run_for(5.5)
        return timeline.events(), timeline.windows()
    finally:
        robot.close()


def tracks(events):
    """{(path, level): slices} of a timeline."""
    found = {(each.path, 0): each for each in events.slices}
    return found | {(each.path, 1): each.inside for each in events.slices if each.inside is not None}


def arrows_of(events):
    """The pairs of slices that an arrow joins, by track and start."""
    ends = collections.defaultdict(list)
    for path, slices in tracks(events).items():
        for at, number, is_end in zip(slices.flow_at, slices.flow_id, slices.flow_ends, strict=True):
            ends[number].append((bool(is_end), path, int(slices.start_ns[at])))
    return {tuple(sorted(pair)) for pair in ends.values()}


def test_a_part_in_detail_is_what_the_whole_has_there_and_all_else_is_there_as_a_whole():
    whole, _ = walked(None)
    part, windows = walked(0.7)
    assert [name for (path, _), each in tracks(part).items() if path == ("Detail",) for name in each.names]
    [fault] = [each for each in part.instants if each.path == ("Faults",)]
    begins = [event.time_ns for event in fault.events if event.name.startswith(("activated", "acted"))]
    assert windows == [(begins[0] - 10**9, begins[-1] + 10**9), (part.end_ns - 700_000_000, part.end_ns)]
    assert 1.9e9 < begins[0] <= begins[-1] < 2.2e9 and 5.4e9 < part.end_ns < 5.6e9
    # states, variables and the body over the whole time
    assert [each.path for each in part.counters] == [each.path for each in whole.counters]
    for one, other in zip(part.counters, whole.counters, strict=True):
        assert np.array_equal(one.time_ns, other.time_ns) and np.array_equal(one.values, other.values), one.path
    assert [len(each.events) for each in part.instants] == [len(each.events) for each in whole.instants]
    # slices: those of the windows, where both have begin and end in them
    shown = tracks(part)
    for path, slices in tracks(whole).items():
        mine = shown[path]
        if path[0][0] not in ("Boards", "Buses", "Link"):
            assert np.array_equal(slices.start_ns, mine.start_ns), path
            continue
        for begin, end in windows:
            # a slot in which a part ends has no end there: up to one of the main brain, and its overrun
            expected, found = (
                each.start_ns[(each.start_ns >= begin) & (each.end_ns <= end - 3_000_000)] for each in (slices, mine)
            )
            assert np.array_equal(expected, found), path
        outside = np.ones(len(mine), dtype=bool)
        for begin, end in windows:
            outside &= (mine.end_ns < begin) | (mine.start_ns > end)
        assert not outside.any(), path
    # arrows: no other ones than the whole has, and all that are further from an edge than the longest wait
    arrows, all_arrows = arrows_of(part), arrows_of(whole)
    assert arrows <= all_arrows
    inside = {
        pair
        for pair in all_arrows
        if any(all(begin + 10**8 <= time <= end - 10**8 for *_, time in pair) for begin, end in windows)
    }
    assert len(inside) > 50_000 and inside <= arrows


def test_parts_in_detail_are_shown_also_when_the_first_begins_with_the_run():
    robot = Ranger(Scenario())
    try:
        timeline = Timeline(robot, detail_s=0.1)
        for number in range(10):  # of which eight count
            robot.inject("MCH.joint_encoder", "stuck", at=f"{200 + 20 * number} ms", until=f"{205 + 20 * number} ms")
        robot.run_for(2.0)
        events = timeline.events()
    finally:
        robot.close()
    (first, last), [shown] = timeline.windows(), [each for each in events.slices if each.path == ("Detail",)]
    assert first[0] == 0 and last[1] - last[0] == 10**8 and last[1] == events.end_ns
    assert 1.34e9 <= first[1] < 1.36e9  # a second after the eighth begins, which stands still and acts a little later
    assert np.column_stack([shown.start_ns, shown.end_ns]).tolist() == [list(first), list(last)]
