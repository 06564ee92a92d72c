"""Rows of recorded frames: their numbers by hand, from the layout that the class states, and their blocks."""

import array
import hashlib

import pytest

from ranger_sim.foundation.row_stream import FrameStream

MS = 10**6
ROWS_OF_A_BLOCK = 512


class Kept:
    """A stream of bus 3 whose blocks are kept as rows of three numbers."""

    def __init__(self):
        self.blocks = []
        self.stream = FrameStream(3)
        self.stream.sink = self.take

    def take(self, last_time_ns, block):
        numbers = array.array("q", block)
        self.blocks.append((last_time_ns, [tuple(numbers[at : at + 3]) for at in range(0, len(numbers), 3)]))

    def rows(self):
        self.stream.flush()
        return [row for _, rows in self.blocks for row in rows]


def test_a_frame_is_one_row_of_time_first_word_with_flags_and_bus_and_second_word_with_identifier():
    kept = Kept()
    kept.stream.add(1_000, 0x123, 0x98, 0xAABBCCDD, 0x11223344)
    # the second word twice, four bits less far: 29 bits are seven digits and one bit
    assert kept.rows() == [(1_000, 0xAABBCCDD_98_3, 0x22446688_0000123)]


def test_a_can_fd_frame_has_its_further_flags_above_the_word_and_a_row_for_each_eight_bytes():
    kept = Kept()
    kept.stream.add_fd(2_000, 0x123, 0x309, bytes(range(1, 13)))
    assert kept.rows() == [
        (2_000, 0x3_04030201_09_3, 0x100E0C0A_0000123),
        (2_000, 0x8_0C0B0A09_00_3, 0x00000000_0000123),
    ]


def test_a_can_fd_frame_without_data_is_one_row():
    kept = Kept()
    kept.stream.add_fd(2_000, 0x7FF, 0x100, b"")
    assert kept.rows() == [(2_000, 0x1_00000000_00_3, 0x7FF)]


@pytest.mark.parametrize(("before", "blocks"), [(510, [512]), (511, [511, 2]), (0, [2])])
def test_all_rows_of_a_can_fd_frame_are_in_one_block(before, blocks):
    kept = Kept()
    for number in range(before):
        kept.stream.add(number, 1, 8, 0, 0)
    kept.stream.add_fd(5 * MS, 2, 0x109, bytes(12))
    kept.stream.flush()
    assert [len(rows) for _, rows in kept.blocks] == blocks
    assert kept.blocks[-1][0] == 5 * MS and kept.blocks[-1][1][-2][0] == kept.blocks[-1][1][-1][0] == 5 * MS


def test_the_digest_is_that_of_all_rows_one_after_another():
    kept = Kept()
    for number in range(ROWS_OF_A_BLOCK + 1):
        kept.stream.add(number, number % 2048, 8, number, 0)
    rows = kept.rows()
    assert len(rows) == ROWS_OF_A_BLOCK + 1
    numbers = array.array("q", [number for row in rows for number in row])
    assert kept.stream.digest.hexdigest() == hashlib.blake2b(numbers.tobytes(), digest_size=32).hexdigest()
