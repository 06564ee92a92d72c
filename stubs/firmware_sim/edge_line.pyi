# Generated from firmware_sim/edge_line.py and firmware_sim/edge_line.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from typing import final

@final
class EdgeLine:
    next_time: int
    levels: int
    buffer: EdgeBuffer
    pin: int
    partner_pin: int
    channel: int
    peripheral: Peripheral
    source: InterruptSource
    def __init__(self, buffer: EdgeBuffer, pin: int = 0, partner_pin: int = 0, peripheral: Peripheral | None = None, channel: int = 0, source: InterruptSource | None = None) -> None: ...
