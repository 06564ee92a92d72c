"""Many lines of a log at once: by hand, and against the reader that takes line by line."""

import numpy as np
import pytest

from ranger_sim.can_bus.edge.candump import line_of_frame, read_candump
from ranger_sim.foundation.events import FLAG_BRS, FLAG_ERROR, FLAG_ESI, FLAG_EXTENDED, FLAG_FD, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.inside.candump_rows import rows_of
from ranger_sim.tools.panel.inside.frames import first_rows, rows_of_frame


def test_a_line_is_the_row_that_the_robots_record_has():
    (row,) = rows_of(b"(0000000012.345678) can1 0A1#0102030405060708\n").tolist()
    assert row == [12_345_678_000, 0x04030201 << 12 | 8 << 4, 0x08070605 << 29 | 0xA1]


FRAMES = [
    (1_000, 0, 8, 0xFFFFFFFF, 0xFFFFFFFF),
    (4_294_967_296_000_000, 0x7FF, 8, 0x89ABCDEF, 0x01234567),
    *((10**16 + 1000 * k, k % 0x800, 8, k * 2654435761 % 2**32, k) for k in range(500)),
    (2 * 10**16, 0x123, 3, 0xAABBCC, 0),
    (2 * 10**16, 0x7FF, FLAG_EXTENDED | 8, 1, 2),
    (2 * 10**16, 0x123, FLAG_REMOTE | 4, 0, 0),
    (2 * 10**16, 0, FLAG_ERROR, 10, 0),
    (2 * 10**16, 0x1, 0, 0, 0),
]


@pytest.mark.parametrize("name", ["c", "can1", "a_long_interface"])
def test_lines_of_every_form_are_read_as_line_by_line(tmp_path, name):
    text = "".join(line_of_frame(name, *frame) for frame in FRAMES)
    (tmp_path / "a.log").write_text(text)
    single = [(t, lo << 12 | flags << 4, hi << 29 | i) for _, t, i, flags, lo, hi in read_candump(tmp_path / "a.log")]
    np.testing.assert_array_equal(rows_of(text.encode()), np.array(single, np.int64))


def test_a_last_line_without_an_end_and_empty_lines_are_not_faults():
    rows = rows_of(b"\n(0000000012.345678) can1 0A1#0102030405060708\n\n(0000000012.345679) can1 0A1#0102030405060708")
    assert rows[:, 0].tolist() == [12_345_678_000, 12_345_679_000] and len(rows_of(b"")) == 0


@pytest.mark.parametrize("place", range(44))
def test_no_letter_of_a_line_is_taken_for_another(place):
    """Each letter becomes an `x`: it is refused, or it was one of the interface's name."""
    line = b"(0000000012.345678) can1 0A1#0102030405060708"
    wrong = line[:place] + b"x" + line[place + 1 :]
    if 20 <= place < 24:
        assert len(rows_of(wrong)) == 1
    else:
        with pytest.raises(UserError):
            rows_of(wrong)


def test_lines_of_can_fd_are_as_many_rows_as_their_data_take():
    long = int.from_bytes(bytes(range(4, 64)), "little")
    frames = [
        (1_000, 0x10, 8, 1, 2),
        (2_000, 0x123, FLAG_FD | FLAG_BRS | 15, 0x03020100, long),
        (3_000, 0x10, 8, 3, 4),
        (4_000, 0x18FF00AA, FLAG_FD | FLAG_EXTENDED | FLAG_ESI | 9, 0x03020100, 0x0B0A090807060504),
        (5_000, 0x124, FLAG_FD | 3, 0x020100, 0),
    ]
    first, *others = (line_of_frame("can1", *frame) for frame in frames)
    rows = rows_of(("\n" + first + "\n\n" + "".join(others) + "\n").encode())
    expected = [row for frame in frames for row in rows_of_frame(*frame)]
    np.testing.assert_array_equal(rows, np.array(expected, np.int64))
    assert np.count_nonzero(first_rows(rows)) == 5 and len(rows) == 1 + 8 + 1 + 2 + 1
