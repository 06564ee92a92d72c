"""Error confinement of one controller, by ISO 11898-1's numbers."""

import pytest

from ranger_sim.can_bus.node import (
    BUS_OFF,
    ICR_BUS_ERROR,
    ICR_ERROR_PASSIVE,
    ICR_ERROR_WARNING,
    JOINING,
    OPERATING,
    RESET,
    Node,
)
from ranger_sim.foundation.events import CAN_STATUS, EventQueue


def node_with(transmit_errors=0, receive_errors=0):
    node = Node("n0", 0, EventQueue(8), 1, 512)
    node.transmit_errors, node.receive_errors = transmit_errors, receive_errors
    return node


def reported(node):
    """The last CAN_STATUS: interrupts, transmit errors, receive errors, bus-off."""
    while node.inbox.take():
        pass
    assert node.inbox.kind == CAN_STATUS
    return node.inbox.b, node.inbox.c, node.inbox.d, node.inbox.e


@pytest.mark.parametrize(
    ("transmit_errors", "receive_errors", "warning", "passive", "off"),
    [
        (95, 95, False, False, False),
        (96, 0, True, False, False),
        (0, 96, True, False, False),
        (127, 127, True, False, False),
        (128, 0, True, True, False),
        (0, 128, True, True, False),
        (255, 0, True, True, False),
        (0, 256, True, True, False),
        (256, 0, True, True, True),
    ],
)
def test_the_error_state_is_that_of_the_higher_counter_and_only_transmit_errors_lead_to_bus_off(
    transmit_errors, receive_errors, warning, passive, off
):
    node = node_with(transmit_errors, receive_errors)
    assert node.confine(5, ICR_BUS_ERROR) == off
    assert (node.warning, node.passive, node.mode) == (warning, passive, BUS_OFF if off else OPERATING)
    interrupts = ICR_BUS_ERROR | ICR_ERROR_WARNING * warning | ICR_ERROR_PASSIVE * passive
    assert reported(node) == (interrupts, 127 if off else transmit_errors, receive_errors, off)
    if not off:
        node.confine(6, 0)  # no interrupt for a state that it is in already
        assert reported(node)[0] == 0


def test_reset_does_not_spare_a_node_that_was_thrown_off_its_recovery():
    node = node_with(256)
    node.confine(5, 0)
    node.start_joining(100)
    assert (node.mode, node.sequences_left) == (JOINING, 128)
    node.leave()
    assert node.mode == BUS_OFF
    node.start_joining(200)
    assert (node.join_from, node.sequences_left) == (200, 128)
    assert node.join()
    assert (node.mode, node.transmit_errors, node.passive, node.warning) == (OPERATING, 0, False, False)
    node.leave()
    assert node.mode == RESET
    node.start_joining(300)
    assert node.sequences_left == 1
    assert not node.join()


def test_a_gap_counts_as_many_sequences_as_it_holds_with_the_one_that_ends_the_frame_before():
    node = node_with(256)
    node.confine(5, 0)
    node.start_joining(100)
    node.count_sequences(1000, 1000)  # the bus was never idle: the end of the frame is one sequence
    assert node.sequences_left == 127
    node.count_sequences(2000, 2010)
    assert node.sequences_left == 126
    node.count_sequences(3000, 3011)
    assert node.sequences_left == 124
    node.start_joining(4000)
    node.count_sequences(3990, 4010)  # ten bits since it has waited
    assert node.sequences_left == 1


@pytest.mark.parametrize(("before", "penalty", "after"), [(0, 1, 1), (247, 8, 255), (248, 8, 255), (255, 1, 255)])
def test_the_receive_error_counter_ends_at_what_eight_bits_hold(before, penalty, after):
    node = node_with(0, before)
    node.count_receive_errors(penalty)
    assert node.receive_errors == after
