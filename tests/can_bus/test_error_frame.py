"""Who notices an error when, and how long the flags are: answers counted on paper."""

import pytest

from ranger_sim.can_bus.error_frame import collision, error_frame
from ranger_sim.can_bus.frame import FIELD_ACK_SLOT, FIELD_CRC_DELIMITER, FIELD_DATA, wire
from ranger_sim.can_bus.node import ICR_FIELD_SHIFT, ICR_KIND_SHIFT, ICR_RECEIVING, KIND_BIT, KIND_OTHER, KIND_STUFF

ALTERNATING = wire(0x555, 8, 0xAAAAAAAA, 0xAAAAAAAA)  # data 1010..., without stuff bits, from bit 19 on
FLAG, DELIMITER = 6, 8


def kinds(error):
    return error.sender_capture >> ICR_KIND_SHIFT & 3, error.receiver_capture >> ICR_KIND_SHIFT & 3


@pytest.mark.parametrize(
    ("position", "passive", "seen"),
    [
        (30, False, 0),  # a 0 that reads 1: the dominant flag begins a run of its own
        (29, False, 2),  # a 1 that reads 0, behind a 0
        (30, True, 2),  # a 0 that reads 1, behind a 1: a recessive flag continues it
        (29, True, 0),
    ],
)
def test_receivers_inside_the_stuffed_region_notice_with_the_sixth_equal_bit(position, passive, seen):
    assert ALTERNATING[0][28:32] == [0, 1, 0, 1]
    error = error_frame([ALTERNATING], position, passive, True)
    assert error.sender_notices == position + 1
    assert error.receivers_notice == position + 1 + FLAG - seen
    assert error.end == error.receivers_notice + FLAG + DELIMITER
    assert (error.field, kinds(error)) == (FIELD_DATA, (KIND_BIT, KIND_STUFF))
    assert error.receiver_capture & ICR_RECEIVING and not error.sender_capture & ICR_RECEIVING


def test_behind_the_crc_everybody_notices_at_once():
    position = len(ALTERNATING[0]) - 10
    error = error_frame([ALTERNATING], position, False, True)
    assert (error.field, error.receivers_notice) == (FIELD_CRC_DELIMITER, position + 1)
    assert error.end == position + 1 + FLAG + DELIMITER


def test_a_frame_that_nobody_acknowledges_fails_at_its_ack_slot():
    position = len(ALTERNATING[0]) - 9
    error = error_frame([ALTERNATING], position, False, False)
    assert error.sender_capture >> ICR_FIELD_SHIFT & 31 == FIELD_ACK_SLOT
    assert kinds(error)[0] == KIND_OTHER
    assert error.end == position + 1 + FLAG + DELIMITER


def test_frames_with_one_arbitration_field_collide_at_the_first_bit_that_differs():
    other = wire(0x555, 8, 0xAAAAAA2A, 0xAAAAAAAA)  # the first bit of the data is 0
    assert collision([ALTERNATING, other]) == 19
    assert collision([ALTERNATING, ALTERNATING]) == -1
    error = error_frame([ALTERNATING, other], 19, False, True)
    # the dominant bit stands behind the three 0 of the length code 1000: two more complete six
    assert ALTERNATING[0][15:20] == [1, 0, 0, 0, 1]
    assert error.receivers_notice == 20 + 2
