"""Frames of a recording become channels by their messages' own numbers; what was left out is counted."""

import pathlib

import can
import numpy as np
import pytest

from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.sysid import losses, sanity
from ranger_sim.sysid.readers import frames
from ranger_sim.tools.recordings import datasets
from tests.boards.original_images import DATA

DBC = """VERSION ""

NS_ :

BS_:

BU_: A

BO_ 291 ANGLE: 4 A
 SG_ value : 0|16@1- (0.001,0) [0|0] "rad" A

BO_ 292 DRIVE: 8 A
 SG_ current : 0|16@1- (0.01,0) [0|0] "A" A
 SG_ level : 32|8@1+ (1,0) [0|0] "" A

BO_ 2147483939 OTHER: 2 A
 SG_ value : 0|8@1+ (1,0) [0|0] "V" A
"""


@pytest.fixture
def dbc(tmp_path) -> pathlib.Path:
    path = tmp_path / "robot.dbc"
    path.write_text(DBC, encoding="utf-8")
    return path


def angle(time_ns, value, length=4, identifier=291, flags=0):
    return ("can1", time_ns, identifier, flags | length, value & 0xFFFF, 0)


def test_signals_have_their_message_s_scale_and_length_and_the_recording_s_stamps(dbc):
    rows = [
        angle(1_000_000_000, 1500),
        ("can1", 1_500_000_000, 292, 8, 250, 7),
        angle(2_000_000_000, -250),
        angle(2_250_000_000, 9, 2, flags=FLAG_EXTENDED),  # 291 as an extended identifier is another message
        angle(2_500_000_000, 1, flags=FLAG_REMOTE),
        angle(2_600_000_000, 1, flags=FLAG_ERROR),
    ]
    found = frames.decode("log", rows, [dbc])
    assert set(found.channels) == {"ANGLE", "DRIVE.current", "DRIVE.level", "OTHER"}
    assert found["ANGLE"].value.tolist() == [1.5, -0.25] and found["ANGLE"].time_s.tolist() == [1.0, 2.0]
    assert found["DRIVE.current"].value.tolist() == [2.5] and found["DRIVE.level"].value.tolist() == [7.0]
    assert [found[name].unit for name in ("ANGLE", "DRIVE.current", "DRIVE.level", "OTHER")] == ["rad", "A", "", "V"]
    assert found["OTHER"].value.tolist() == [9.0] and found["OTHER"].time_s.tolist() == [2.25]
    assert not [each for each in found.findings if each.kind in ("unknown_frames", "broken_frames")]


def test_frames_of_unknown_senders_and_those_that_do_not_fit_are_counted(dbc):
    rows = [
        angle(1_000, 5),
        angle(2_000, 5, 1),
        angle(3_000, 5, 1),
        *(angle(4_000 + k, 0, identifier=7 + k % 2) for k in range(5)),
    ]
    found = frames.decode("log", rows, [dbc])
    told = {each.kind: each for each in found.findings}
    assert (told["unknown_frames"].size, told["unknown_frames"].severity) == (5.0, "note")
    assert told["unknown_frames"].text.startswith(
        "5 frames have identifiers that the DBC file does not know (0x7, 0x8)"
    )
    assert (told["broken_frames"].channel, told["broken_frames"].size) == ("ANGLE", 2.0)
    assert told["broken_frames"].unit == "frames" and told["broken_frames"].severity == "warning"
    assert len(found["ANGLE"].value) == 1
    assert (found["ANGLE"].read, found["ANGLE"].lost_share) == (3, 2 / 3)


def test_stamps_of_the_epoch_begin_at_the_first_frame_that_was_one(dbc):
    begin = 1_700_000_000_000_000_000
    rows = [angle(begin, 0, identifier=9), angle(begin + 250_000_000, 1), angle(begin + 1_250_000_001, 2)]
    found = frames.decode("log", rows, [dbc])
    assert found["ANGLE"].time_s.tolist() == [0.25, 1.250000001]
    late = frames.decode("log", [angle(5_000_000_000, 1)], [dbc])
    assert late["ANGLE"].time_s.tolist() == [5.0]


def test_recordings_and_files_that_say_nothing_are_reported(dbc, tmp_path):
    with pytest.raises(UserError, match=r"log: none of its frames is a message of the DBC file \(1 others\)"):
        frames.decode("log", [angle(1, 1, identifier=9), angle(2, 1, flags=FLAG_ERROR)], [dbc])
    with pytest.raises(UserError, match="none.dbc: cannot be read"):
        frames.decode("log", [], [tmp_path / "none.dbc"])
    empty = tmp_path / "empty.dbc"
    empty.write_text('VERSION ""\n', encoding="utf-8")
    with pytest.raises(UserError, match="a recording of CAN frames needs a DBC file with messages"):
        frames.decode("log", [], [empty])
    wrong = tmp_path / "wrong.dbc"
    wrong.write_text("BO_ nothing", encoding="utf-8")
    with pytest.raises(UserError, match="wrong.dbc: not a DBC file that cantools can read"):
        frames.decode("log", [], [wrong])


def on(bus, number, value, identifier=291):
    return (bus, number * 1_000_000, identifier, 4, value & 0xFFFF, 0)


def test_a_message_on_two_buses_is_two_channels(dbc):
    rows = [on(bus, number, value) for number in range(1, 5) for bus, value in (("can0", number), ("can1", 1000))]
    rows += [("can1", 9_000_000, 292, 8, 250, 7)]  # on one bus only
    found = frames.decode("log", rows, [dbc])
    assert set(found.channels) == {"can0.ANGLE", "can1.ANGLE", "DRIVE.current", "DRIVE.level"}
    assert found["can0.ANGLE"].value == pytest.approx([0.001, 0.002, 0.003, 0.004])
    assert found["can1.ANGLE"].value == pytest.approx([1.0] * 4)
    (said,) = [each for each in found.findings if each.kind == "several_buses"]
    assert "ANGLE on can0, can1" in said.text and said.kind in sanity.KINDS
    mapped = frames.decode("log", rows, [dbc], {"can1.ANGLE": "hip_angle_rad"})
    assert "hip_angle_rad" in mapped and "can0.ANGLE" in mapped


def test_one_bus_is_read_where_it_is_asked_for(dbc):
    rows = [on("can0", 1, 7), on("can1", 2, 8), on("can0", 3, 9), on("can1", 4, 1, 7)]
    found = frames.decode("log", rows, [dbc], buses=["can0"])
    assert found["ANGLE"].value == pytest.approx([0.007, 0.009]) and found.findings == []
    assert set(frames.decode("log", rows, [dbc], buses=["can0", "can1"]).channels) == {"can0.ANGLE", "can1.ANGLE"}
    with pytest.raises(UserError, match=r"log: --bus can7: unknown bus \(available: can0, can1\)"):
        frames.decode("log", rows, [dbc], buses=["can7"])


def test_frames_that_do_not_fit_are_lost_on_their_own_bus(dbc):
    rows = [on("can0", 1, 7), on("can1", 2, 8), ("can1", 3_000_000, 291, 1, 8, 0)]
    found = frames.decode("log", rows, [dbc])
    assert (found["can0.ANGLE"].lost_share, found["can1.ANGLE"].lost_share) == (0.0, 0.5)
    assert [each.channel for each in found.findings if each.kind == "broken_frames"] == ["can1.ANGLE"]


def test_an_identifier_that_two_files_call_otherwise_is_refused(dbc, tmp_path):
    other = tmp_path / "other.dbc"
    other.write_text(DBC.replace("ANGLE", "SPEED"), encoding="utf-8")
    with pytest.raises(UserError, match=r"other.dbc: the identifier 0x123 is SPEED here and ANGLE in another DBC file"):
        frames.decode("log", [on("can0", 1, 7)], [dbc, other])
    assert "ANGLE" in frames.decode("log", [on("can0", 1, 7)], [dbc, dbc])


CASE = DATA.parent / "cases" / "01-two-buses-one-id"


@pytest.mark.skipif(not CASE.exists(), reason=f"no case in {CASE.name}/")
def test_the_case_of_one_identifier_on_two_buses():
    files = CASE / "m_two_buses.log", None, [CASE / "m.dbc"]
    both = datasets.open_recording(*files)
    assert {"can0.DRIVE.angle", "can1.DRIVE.angle"} <= set(both.channels)
    assert set(both["can1.DRIVE.angle"].value) == {1.0} != set(both["can0.DRIVE.angle"].value)
    one = datasets.open_recording(*files, buses=["can1"])
    assert set(one["DRIVE.angle"].value) == {1.0}
    with pytest.raises(UserError, match="--bus can1: .* is not a recording of CAN frames"):
        datasets.open_recording(CASE / "m.dbc", buses=["can1"])


def test_frames_that_a_file_lacks_are_in_the_ledger_and_stop_a_verdict(dbc, tmp_path):
    path = tmp_path / "a.blf"
    with can.Logger(path) as writer:
        for number in range(4000):
            data = (number % 1000).to_bytes(2, "little") + bytes(2)
            writer(can.Message(timestamp=1000 + 0.01 * number, arbitration_id=291, data=data, is_extended_id=False))
    whole = datasets.open_recording(path, databases=[dbc])
    assert (whole.rows, whole.losses) == (4000, [])
    losses.stop_if_too_many(whole, whole.channels)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    half = datasets.open_recording(path, databases=[dbc])
    (loss,) = half.losses
    assert half.rows == 4000 == len(half["ANGLE"].value) + loss.count
    assert half.ledger()[""]["kept"] == len(half["ANGLE"].value)
    (said,) = [each for each in half.findings if each.kind == "lost_frames"]
    assert said.kind in sanity.KINDS and "the file is cut off" in said.text
    with pytest.raises(
        UserError, match=r"a.blf: \d+ of 4000 frames are lost, .* the file is cut off, the first behind"
    ):
        losses.stop_if_too_many(half, half.channels)


@pytest.mark.parametrize("suffix", [".csv", ".db"])
def test_python_cans_table_and_data_base_are_recordings_of_frames(dbc, tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with can.Logger(path) as writer:
        for number in range(5):
            writer(
                can.Message(timestamp=0.01 * number, arbitration_id=291, data=[number, 0, 0, 0], is_extended_id=False)
            )
    assert datasets.open_recording(path, databases=[dbc])["ANGLE"].value == pytest.approx(0.001 * np.arange(5))
    with pytest.raises(UserError, match=f"a{suffix}: a recording of CAN frames needs a DBC file"):
        datasets.open_recording(path)


def test_every_frame_of_a_recording_is_given_to_what_keeps_them(dbc, tmp_path):
    path = tmp_path / "a.log"
    path.write_text("(1.0) can0 123#01000000\n(2.0) can0 007#\n(3.0) can0 123#02000000\n")
    kept = []
    datasets.open_recording(path, databases=[dbc], each_frame=kept.append)
    assert [frame[2] for frame in kept] == [0x123, 7, 0x123]
