"""What the microcontroller refuses when a board is put together."""

import pytest

from firmware_sim.clock import Crystal
from firmware_sim.microcontroller import Microcontroller
from foundation.events import UART_BYTE
from foundation.user_error import UserError


def test_only_peripherals_can_be_reached_from_outside():
    chip = Microcontroller("chip", 60_000_000, Crystal())
    for connect in (
        lambda: chip.claim(UART_BYTE, 1, object()),
        lambda: chip.claim_pin(3, 0, object()),
        lambda: chip.new_alarm(object(), 0),
    ):
        with pytest.raises(UserError, match="no Peripheral"):
            connect()
