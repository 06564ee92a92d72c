"""Frames of a bus as the page lists them, from rows by hand."""

import numpy as np
import pytest

from ranger_sim.can_bus.frame import FIELD_DATA
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.row_stream import FrameStream
from ranger_sim.tools.panel.inside.frames import (
    ERROR,
    RecentFrames,
    listed,
    of_the_robot,
    rows_of_frame,
    unknown_source,
)

ANGLE = all_variables.ID_OF["MCH_ANGLE"]
ONE = 0x3F800000  # 1.0 in single precision


def row(time_ns, identifier, flags=8, low=0, high=0):
    return (time_ns, low << 12 | flags << 4, high << 29 | identifier)


def rows(*each):
    return np.array([row(*frame) for frame in each], np.int64)


def shown(frames, until_ns=None, read=of_the_robot):
    return listed(frames.until(until_ns, 40), lambda keys: frames.counts(until_ns, keys), 1_000_000_000, read)


@pytest.fixture
def frames():
    found = RecentFrames(100)
    found.append(rows((1_500_000_000, ANGLE, 8, ONE, 7), (2_500_000_000, 5, 3, 0xAABBCC, 0)))
    found.append(rows((3_500_000_000, ANGLE, 8, ONE, 8)))
    return found


def test_variables_are_listed_by_name_and_value_the_newest_first(frames):
    first, second, third = shown(frames)
    assert first == {
        "time_s": pytest.approx(2.5),
        "count": 2,
        "id": ANGLE,
        "name": "MCH_ANGLE",
        "value": 1.0,
        "data": "00 00 80 3f 08 00 00 00",
    }
    assert (second["data"], second["count"], third["count"]) == ("cc bb aa", 1, 2)
    assert shown(frames, read=unknown_source)[0]["name"] == ""


def test_at_an_earlier_time_there_were_fewer(frames):
    assert [each["count"] for each in shown(frames, 2_500_000_000)] == [1, 1]
    assert shown(frames, 1_499_999_999) == []


def test_error_remote_and_long_frames_are_not_taken_for_variables():
    found = RecentFrames(100)
    found.append(
        rows(
            (1, ANGLE, FLAG_ERROR | 8, FIELD_DATA, 30), (2, ANGLE, FLAG_REMOTE | 8), (3, ANGLE, FLAG_EXTENDED | 8, ONE)
        )
    )
    long, remote, error = shown(found)
    assert (long["id"], long["name"], long["value"], long["count"]) == (ANGLE, "", None, 1)
    assert (remote["data"], remote["value"]) == ("remote", None)
    assert (error["id"], error["name"], error["data"]) == (None, "error frame, data", "")
    assert found.counts(None, [ERROR, ANGLE]) == [1, 1]


def test_the_last_frames_are_kept_and_all_are_counted():
    found = RecentFrames(100)
    for first in range(0, 1000, 30):
        found.append(rows(*((time_ns, 5) for time_ns in range(first, first + 30))))
    assert found.until(None, 5)[:, 0].tolist() == [1015, 1016, 1017, 1018, 1019]
    assert found.until(950, 3)[:, 0].tolist() == [948, 949, 950]
    assert found.counts(None, [5]) == [1020] and found.counts(950, [5]) == [951]
    assert found.within(940, 950) == 10 and found.within(2, 950) is None
    assert len(found.kept) == 200


def test_another_robot_of_the_same_name_begins_anew():
    found = RecentFrames(100)
    found.append(rows((1000, 5), (2000, 5)))
    found.append(rows((10, 6)))
    assert found.counts(None, [5, 6]) == [0, 1] and len(found.until(None, 9)) == 1


LONG = bytes(range(64))


def fd_rows(time_ns, identifier, flags, data):
    low, high = int.from_bytes(data[:4], "little"), int.from_bytes(data[4:], "little")
    return np.array(rows_of_frame(time_ns, identifier, flags, low, high), np.int64)


@pytest.mark.parametrize(("code", "length"), [(0, 0), (1, 1), (8, 8), (9, 12), (15, 64)])
def test_the_rows_of_a_can_fd_frame_are_those_of_a_buss_record(code, length):
    blocks = []
    stream = FrameStream(0)
    stream.sink = lambda _, block: blocks.append(block)
    stream.add_fd(5, 0x123, FLAG_FD | FLAG_BRS | code, LONG[:length])
    stream.flush()
    expected = np.frombuffer(b"".join(blocks), np.int64).reshape(-1, 3)
    np.testing.assert_array_equal(fd_rows(5, 0x123, FLAG_FD | FLAG_BRS | code, LONG[:length]), expected)


def test_can_fd_frames_are_listed_with_their_format_and_all_their_bytes():
    found = RecentFrames(100)
    found.append(fd_rows(1, ANGLE, FLAG_FD | FLAG_BRS | 15, LONG))
    found.append(rows((2, ANGLE, 8, ONE, 7)))
    found.append(fd_rows(3, ANGLE, FLAG_FD | FLAG_ESI | 9, LONG[:12]))
    short, classic, long = shown(found)
    assert (long["fd"], long["bytes"], long["data"], long["count"]) == ("FD BRS", 64, LONG.hex(" "), 3)
    assert (short["fd"], short["bytes"], short["data"], short["count"]) == ("FD ESI", 12, LONG[:12].hex(" "), 3)
    assert "fd" not in classic and (classic["name"], classic["value"]) == ("MCH_ANGLE", 1.0)
    assert (long["name"], long["value"]) == ("", None)  # the robot's variables are classic frames
    assert found.within(1, 3) == 2 and found.counts(2, [ANGLE]) == [2]
    assert [each["bytes"] for each in shown(found, 1)] == [64]


def test_the_last_frames_are_whole_however_many_rows_they_have():
    found = RecentFrames(100)  # rows: at most a dozen frames of eight
    for number in range(50):
        found.append(fd_rows(10 * number, 5, FLAG_FD | 15, bytes([number]) * 64))
        found.append(rows((10 * number + 5, 6)))
        newest = shown(found)
        assert [each["data"] for each in newest[1::2]] == [
            (bytes([number - back]) * 64).hex(" ") for back in range(len(newest) // 2)
        ]
    assert len(shown(found)) >= 20 and found.counts(None, [5, 6]) == [50, 50]
    assert [each["id"] for each in listed(found.until(None, 3), lambda keys: [0] * len(keys), 0, unknown_source)] == [
        6,
        5,
        6,
    ]
