"""Our motor boards compared with the robot's own firmware of 2016: the same stimulus, frame by frame."""

import functools

import pytest

from ranger_sim.boards.quirks import Quirks
from ranger_sim.foundation.numbers import float_of_word
from tests.boards.original_images import DATA, frames_of_our_board, frames_of_the_image

STIMULI = {"MCH_ramp": "MCH", "MCFI_up": "MCFI"}
# The images' first two slots take up to 100 us longer or 15 us less than others: start-up, which is not modelled.
FIRST_US = 1_500.0
# From then on a frame is asked for within this of the image's. Half of them are within 4 us: what is left is what a
# division or a float costs by its operands.
APART_US = 17.0
HALF_APART_US = 4.0
# Times that a slot took, in s: never equal to the bit, but to the share that the slots are.
EXECUTION_TIMES = {"MCH": (23, 24), "MCFI": (79, 80)}
# An encoder's edge, or the end of a stretch, can fall on the other side of a reading 2 us later, and stays there: the
# angle of a motor is then one count off (MCH, 12), an error's count and first time one slot.
ONE_STEP = {"MCH": {12: 5, 3: 1}, "MCFI": {}}

pytestmark = pytest.mark.skipif(
    not (DATA / "image_MCH_ramp_frames.csv").exists(), reason=f"no measurements of the original images in {DATA.name}/"
)


@functools.cache
def both(name):
    """(frames of the image, ours as far as the image's go)."""
    image = frames_of_the_image(name)
    ours = frames_of_our_board(name, STIMULI[name], Quirks.firmware_2016(), image[-1].t_us + 200.0)
    return image, ours[: len(image)]


@pytest.mark.parametrize("name", STIMULI)
def test_the_same_variables_leave_in_the_same_order(name):
    image, ours = both(name)
    assert [each.identifier for each in ours] == [each.identifier for each in image]


@pytest.mark.parametrize("name", STIMULI)
def test_every_frame_is_asked_for_within_a_few_microseconds(name):
    image, ours = both(name)
    apart = sorted(
        abs(mine.t_us - theirs.t_us) for theirs, mine in zip(image, ours, strict=True) if theirs.t_us > FIRST_US
    )
    assert apart[-1] < APART_US
    assert apart[len(apart) // 2] < HALF_APART_US


@pytest.mark.parametrize("name", STIMULI)
def test_values_and_stamps_are_equal_to_the_bit(name):
    image, ours = both(name)
    board = STIMULI[name]
    different = {}
    for theirs, mine in zip(image, ours, strict=True):
        if theirs.identifier in EXECUTION_TIMES[board]:
            assert mine.time == theirs.time
        elif (mine.value, mine.time) != (theirs.value, theirs.time):
            different.setdefault(theirs.identifier, []).append((theirs, mine))
    assert {identifier: len(pairs) for identifier, pairs in different.items()} == ONE_STEP[board]
    for theirs, mine in different.get(12, ()):
        # one count is 2.48e-4 rad, in 16.16 either 16 or 17
        assert mine.time == theirs.time
        assert abs(float_of_word(mine.value) - float_of_word(theirs.value)) * 65536 in (16, 17)
    for theirs, mine in different.get(3, ()):
        assert mine.value & 0x3FFFFF == theirs.value & 0x3FFFFF  # code and board
        assert abs((mine.value >> 22) - (theirs.value >> 22)) <= 1 and abs(mine.time - theirs.time) <= 1


@pytest.mark.parametrize("name", STIMULI)
def test_the_longest_slot_is_as_long_as_the_images(name):
    image, ours = both(name)
    times = [
        (float_of_word(theirs.value), float_of_word(mine.value))
        for theirs, mine in zip(image, ours, strict=True)
        # the first ones hold the first slots
        if theirs.identifier in EXECUTION_TIMES[STIMULI[name]] and theirs.t_us > 100_000
    ]
    assert len(times) > 15
    assert all(mine == pytest.approx(theirs, rel=0.05) for theirs, mine in times)
