"""An encoder on two pins of a chip: the most frequent input of all, read where the sensor writes it."""

from typing import TYPE_CHECKING

import cython

from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import NEVER

if TYPE_CHECKING:
    from ranger_sim.firmware_sim.peripheral import Peripheral
    from ranger_sim.firmware_sim.vic import InterruptSource


@cython.final
@cython.cclass
class EdgeLine:
    """An encoder on two pins: its edges are read where its sensor writes them, each at its stamp.

    Channel A changes on `pin`; channel B, whose level comes with each edge, is connected to `partner_pin`.
    """

    next_time: cython.longlong
    levels: cython.longlong
    buffer: EdgeBuffer
    pin: cython.longlong
    partner_pin: cython.longlong
    channel: cython.longlong
    peripheral: "Peripheral"
    source: "InterruptSource"

    def __init__(self, buffer: EdgeBuffer, pin=0, partner_pin=0, peripheral=None, channel=0, source=None) -> None:
        self.buffer = buffer
        self.pin = pin
        self.partner_pin = partner_pin
        self.peripheral = peripheral
        self.channel = channel
        self.source = source
        self.next_time = NEVER
        self.levels = 0

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.final
    def find_next(self) -> cython.longlong:
        """Find the first edge of the buffer that has not been taken: its time, NEVER for none, and its levels."""
        edge: cython.longlong
        if self.buffer.read < self.buffer.count:
            edge = self.buffer.packed[self.buffer.read]
            self.next_time = edge >> 2
            self.levels = edge & 3  # of A x 2 + of B
        else:
            self.next_time = NEVER
        return self.next_time
