"""A recording into one board: the same frames at the same times, whatever the format."""

import pathlib

import can
import pytest

from ranger_sim.can_bus.edge.candump import CandumpWriter
from ranger_sim.can_bus.edge.messages import message_of_frame
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.testing.frames import Frame
from ranger_sim.harness.testing.wire import observe
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.ranger.testing.bench import BoardAlone
from ranger_sim.ranger.testing.replay import read_log


@pytest.fixture(scope="module")
def recorded():
    """Frames of 100 ms of the robot on all buses."""
    robot = Ranger(Scenario(seed=3))
    keeper = observe(robot).keeper
    robot.run_for(0.1)
    return sorted(frame for bus in keeper.streams for frame in keeper.frames(bus))


@pytest.fixture(scope="module")
def folder(recorded, tmp_path_factory):
    """The same as the folder of a walk has it: times cut to microseconds."""
    folder = tmp_path_factory.mktemp("walk")
    for name in ("can1", "can2", "can3", "can4"):
        with CandumpWriter(folder / f"{name}.log") as writer:
            writer.write(name, [(frame.time_ns, *frame[2:]) for frame in recorded if frame.bus == name])
    return folder


def cut(frames):
    return sorted(frame._replace(time_ns=frame.time_ns // 1000 * 1000) for frame in frames)


def test_the_folder_of_a_walk_is_read_as_one_recording(recorded, folder):
    assert read_log(folder) == cut(recorded)


def test_formats_of_python_can_are_read(recorded, tmp_path):
    chosen = [frame for frame in cut(recorded) if frame.bus == "can1"]
    for suffix in (".asc", ".blf", ".mf4"):
        path = tmp_path / f"one{suffix}"
        with can.Logger(str(path)) as logger:
            for frame in chosen:
                logger.on_message_received(message_of_frame(frame.time_ns, *frame[2:], channel=0))
        found = read_log(path, bus="can1")
        assert [frame[1:] for frame in found] == [frame[1:] for frame in chosen], suffix
        # some formats count from their first frame; all have microseconds
        offset = found[0].time_ns - chosen[0].time_ns
        assert all(abs(a.time_ns - b.time_ns - offset) <= 2000 for a, b in zip(found, chosen, strict=True)), suffix


def test_frames_of_others_are_replayed_at_their_times_and_the_board_answers_anew(recorded):
    board = BoardAlone("MCH", network_time=False)
    given = board.replay(recorded)
    others = [f for f in recorded if f.bus == "can1" and f.identifier not in board.chip.table.SEND]
    assert given == len(others) > 100
    board.run_for("110 ms")
    again = [f for f in board.wire().frames() if f.identifier not in board.chip.table.SEND]
    assert [frame[2:] for frame in again] == [frame[2:] for frame in others]
    # the board's own frames lie elsewhere than in the recording, so now and then one of them is on the wire first
    late = [a.time_ns - (b.time_ns - others[0].time_ns) for a, b in zip(again, others, strict=True)]
    assert min(late) >= 0 and sorted(late)[len(late) // 2] < 40_000 and max(late) < 200_000
    assert len(board.can().received("MCH_ANGLE")) >= 50
    assert board.chip.counters().can[0].received == given


def test_the_same_recording_gives_the_same_answers(recorded):
    answers = []
    for _ in range(2):
        board = BoardAlone("MCFI", network_time=False)
        board.replay(recorded)
        board.run_for("50 ms")
        answers.append(board.can().received())
    assert answers[0] == answers[1] and answers[0]


def test_recordings_that_cannot_be_replayed_are_reported(recorded, tmp_path):
    board = BoardAlone("MCH")
    with pytest.raises(UserError, match=r"channel 'vcan0' is not a bus of MCH: read_log\(path, bus='can1'\)"):
        board.replay([Frame(0, "vcan0", 14, 8, 0, 0)])
    with pytest.raises(UserError, match="a folder without can1.log"):
        read_log(tmp_path)
    for name, text in (("a.log", "nonsense"), ("b.csv", "nonsense"), ("c.xyz", ""), ("d.log", None)):
        path = pathlib.Path(tmp_path, name)
        if text is not None:
            path.write_text(text, encoding="utf-8")
        with pytest.raises(UserError, match=str(path)):
            read_log(path)


def test_an_identifier_on_two_buses_is_a_question_and_not_merged(tmp_path):
    path = tmp_path / "two.log"
    path.write_text("(1.0) vcan0 00E#01\n(1.1) vcan1 00E#02\n(1.2) vcan1 02A#03\n", encoding="utf-8")
    assert [(frame.bus, frame.lo) for frame in read_log(path)] == [("vcan0", 1), ("vcan1", 2), ("vcan1", 3)]
    with pytest.raises(UserError, match=r"buses vcan0, vcan1, and 0xe on more than one.*bus={'vcan0': 'can1'}"):
        read_log(path, bus="can1")
    chosen = read_log(path, bus={"vcan1": "can1"})
    assert [(frame.bus, frame.lo) for frame in chosen] == [("can1", 2), ("can1", 3)]
    assert chosen.ledger == {"two.log": {"frames": 2, "other buses": 1}}
    assert [frame.lo for frame in read_log(path, bus="vcan0")] == [1]
    with pytest.raises(UserError, match=r"bus 'vcan2': unknown bus \(available: vcan0, vcan1\)"):
        read_log(path, bus={"vcan2": "can1"})


def test_a_recording_that_is_cut_off_is_not_replayed(recorded, tmp_path):
    path = tmp_path / "a.blf"
    with can.Logger(path) as writer:
        for number in range(4000):
            writer(can.Message(timestamp=0.01 * number, arbitration_id=291, data=bytes(8), is_extended_id=False))
    assert len(read_log(path, bus="can1")) == 4000
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(UserError, match=r"a.blf: \d+ of 4000 frames are lost \(\d+ cut off, behind byte"):
        read_log(path, bus="can1")
    part = read_log(path, bus="can1", accept_loss=1.0)
    assert 0 < len(part) < 4000 and sum(part.ledger["a.blf"].values()) == 4000
    assert part.ledger["a.blf"]["frames"] == len(part)
