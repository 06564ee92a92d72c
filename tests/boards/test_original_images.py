"""Our motor boards beside the robot's own firmware of 2016: the same stimulus, frame by frame."""

import functools

import pytest

from ranger_sim.boards.quirks import Quirks
from tests.boards.original_images import DATA, frames_of_our_board, frames_of_the_image

STIMULI = {"MCH_ramp": "MCH", "MCFI_up": "MCFI"}
# Our tasks' costs are not the firmware's instruction by instruction: a slot's frame is asked for up to this much sooner
# or later. A slot has 500 us.
APART_US = 110.0

pytestmark = pytest.mark.skipif(
    not (DATA / "image_MCH_ramp_frames.csv").exists(), reason=f"no measurements of the original images in {DATA.name}/"
)


@functools.cache
def both(name):
    """(frames of the image, ours as far as the image's go)."""
    image = frames_of_the_image(name)
    ours = frames_of_our_board(name, STIMULI[name], Quirks.firmware_2016(), image[-1].t_us + APART_US)
    return image, ours[: len(image)]


@pytest.mark.parametrize("name", STIMULI)
def test_the_same_variables_leave_in_the_same_order(name):
    image, ours = both(name)
    assert [each.identifier for each in ours] == [each.identifier for each in image]


@pytest.mark.parametrize("name", STIMULI)
def test_every_frame_leaves_in_the_slot_of_the_images(name):
    image, ours = both(name)
    assert max(abs(mine.t_us - theirs.t_us) for theirs, mine in zip(image, ours, strict=True)) < APART_US
