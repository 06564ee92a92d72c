# Generated from firmware_sim/lpc2194/spi.py and firmware_sim/lpc2194/spi.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.spi_encoder import SpiEncoder
from typing import Any
from typing import final

CR_BIT_ENABLE: int
CR_MASTER: int
CR_INTERRUPT: int

@final
class SpiBlock(Block):
    spi: SpiEncoder | None
    CR: int
    CCR: int
    SPINT: int
    under_way: bool
    status_read: bool
    READ_ACTS: Any
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any, number: Any, hardware: Any) -> None: ...
    def requests(self) -> int: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def _transfer(self) -> None: ...
