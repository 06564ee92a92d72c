"""What a board's process reads from a row of the stage, word by word."""

import array

import pytest

from ranger_sim.harness.processes import places
from ranger_sim.harness.processes.stage import Audience


def reals(*values):
    return array.array("d", values)


def wholes(*values):
    return array.array("q", values)


@pytest.mark.parametrize("row, place", [(0, 0), (2, 2), (places.STAGE_RING + 3, 3)])
def test_a_row_is_shown_with_its_step_its_words_and_its_voltages(row, place):
    size = places.STAGE_FIRST + places.STAGE_RING * places.ROW_SIZE
    words, doubles = wholes(*[-1] * size), reals(*[-1.0] * size)
    at = places.STAGE_FIRST + place * places.ROW_SIZE
    words[at + places.ROW_START], words[at + places.ROW_END] = 1000, 2000
    for number in range(3):
        words[at + places.ROW_WORDS + number] = 70 + number
    for number in range(2):
        doubles[at + places.ROW_ANALOG_START + number] = 0.5 + number
        doubles[at + places.ROW_ANALOG_END + number] = 10.5 + number
    step, start, end, board = wholes(0, 0), reals(0.0, 0.0), reals(0.0, 0.0), wholes(0, 0, 0, 0)
    audience = Audience(words, doubles, step, start, end, board, [(2, 0), (0, 3)])
    assert (audience.rows, audience.word_count, audience.voltage_count) == (0, 2, 2)
    assert audience.row_start(row) == 1000
    audience.show(row)
    assert list(step) == [1000, 2000]
    assert list(board) == [72, 0, 0, 70]
    assert (list(start), list(end)) == ([0.5, 1.5], [10.5, 11.5])
    assert audience.rows == row + 1
