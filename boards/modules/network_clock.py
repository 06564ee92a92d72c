# cython: boundscheck=False, wraparound=False
# (every index below is a channel, 1 ... 4)
"""The robot's time: a millisecond count that the router sends to every bus in the sync frame.

Identifier 0, both words the count, on all four buses every fifth 200 us interrupt. It uses transmit buffer 3
with transmit and abort together: a frame that does not get through at once is not repeated, and when the
buffer is still busy the millisecond is skipped without an error. Source: robot.md N1.4.
"""

from typing import Final

import cython

from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.peripherals.can_controller import EIGHT_BYTES, CanController
from ranger_sim.foundation.events import FLAG_SINGLE_SHOT

TICKS_PER_MS: Final = 5
SYNC_BUFFER: Final = 3
SYNC_IDENTIFIER: Final = 0

CYCLES_PER_SYNC = 60  # four register writes and a command per controller: chosen by us, no listing says
# A C variable when compiled: Cython makes a Python object of every literal above 31 bits.
_MASK: cython.longlong = 4294967295


@cython.final
@cython.cclass
class NetworkClock:
    """`tick` is the work of the Timer1 interrupt. `time.ms`: the count, 0 at power-up, wraps after 2^32.

    `sent`, `skipped`: sync frames handed over and left out per bus, index 1-4.
    """

    time: NetworkTime
    load: CanLoad
    ticks: cython.longlong
    divider: cython.longlong
    controllers: list
    sent: cython.longlong[5]
    skipped: cython.longlong[5]

    def __init__(self, time: NetworkTime, controllers, load: CanLoad) -> None:
        self.time = time
        self.controllers = list(controllers)
        self.load = load
        self.ticks = 0
        self.divider = 0
        self.sent = [0] * 5
        self.skipped = [0] * 5

    @cython.ccall
    def tick(self) -> cython.bint:
        """One 200 us interrupt; True when a millisecond has passed and sync went out."""
        self.ticks += 1
        self.divider += 1
        if self.divider < TICKS_PER_MS:
            return False
        self.divider = 0
        self.time.ms = (self.time.ms + 1) & _MASK
        self.send_sync()
        return True

    @cython.ccall
    def send_sync(self) -> cython.longlong:
        """The count on every bus whose third transmit buffer is free, single shot; returns the count."""
        controller: CanController
        ms: cython.longlong = self.time.ms
        for controller in self.controllers:
            if controller.free_at(SYNC_BUFFER, controller.chip.input_time) and controller.transmit(
                SYNC_BUFFER, SYNC_IDENTIFIER, EIGHT_BYTES | FLAG_SINGLE_SHOT, ms, ms
            ):
                self.sent[controller.number] += 1
                self.load.counts[controller.number] += 1
            else:
                self.skipped[controller.number] += 1
        return ms
