"""Error frames as SocketCAN has them: numbers of linux/can/error.h, written here a second time."""

import pytest

from ranger_sim.can_bus.edge.linux_errors import frame_of_status
from ranger_sim.can_bus.node import ICR_BUS_ERROR, ICR_ERROR_PASSIVE, ICR_ERROR_WARNING

CONTROLLER, COUNTERS, BUS_OFF, RESTARTED = 0x004, 0x200, 0x040, 0x100
TX_WARNING, RX_WARNING, TX_PASSIVE, RX_PASSIVE, ACTIVE = 0x08, 0x04, 0x20, 0x10, 0x40


def reported(interrupts, counters, was_off=False, off=False):
    """(classes, controller's status, transmit errors, receive errors) of the frame."""
    classes, _, low, high = frame_of_status(interrupts, counters, was_off, off)
    return classes, low >> 8 & 0xFF, high >> 16 & 0xFF, high >> 24 & 0xFF


@pytest.mark.parametrize(
    ("counters", "status"),
    [
        ((95, 95), ACTIVE),
        ((96, 95), TX_WARNING),
        ((95, 96), RX_WARNING),
        ((127, 127), TX_WARNING | RX_WARNING),
        ((128, 96), TX_PASSIVE | RX_WARNING),
        ((0, 128), RX_PASSIVE),
        ((128, 128), TX_PASSIVE | RX_PASSIVE),
    ],
)
@pytest.mark.parametrize("interrupt", [ICR_ERROR_WARNING, ICR_ERROR_PASSIVE])
def test_the_status_of_a_controller_follows_its_counters(counters, status, interrupt):
    assert reported(interrupt, counters) == (CONTROLLER | COUNTERS, status, *counters)


def test_bus_off_and_the_way_back_have_their_own_classes():
    assert reported(ICR_ERROR_PASSIVE, (300, 7), off=True) == (BUS_OFF | COUNTERS, 0, 255, 7)
    assert reported(ICR_ERROR_WARNING, (0, 0), was_off=True) == (RESTARTED | COUNTERS, 0, 0, 0)


def test_changed_counters_alone_are_not_reported():
    assert frame_of_status(0, (5, 5), False, False) is None
    assert frame_of_status(0, (300, 0), True, True) is None
    assert frame_of_status(ICR_BUS_ERROR, (5, 5), False, False) is not None
