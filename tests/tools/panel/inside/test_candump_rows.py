"""Many lines of a log at once: by hand, and against the reader that takes line by line."""

import numpy as np
import pytest

from ranger_sim.can_bus.edge.candump import line_of_frame, read_candump
from ranger_sim.foundation.events import FLAG_ERROR, FLAG_EXTENDED, FLAG_REMOTE
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel.inside.candump_rows import rows_of


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
