# Generated from firmware_sim/lpc2194/uart.py and firmware_sim/lpc2194/uart.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.uart import Uart
from typing import Any
from typing import final

IER_RECEIVE: int
IER_TRANSMIT: int
IER_STATUS: int
IIR_STATUS: int
LCR_DLAB: int
TER_ON: int
TRIGGERS: tuple[int, ...]

@final
class UartBlock(Block):
    uart: Uart
    IER: int
    LCR: int
    MCR: int
    SCR: int
    FCR: int
    FDR: int
    TER: int
    divisor: int
    holds: bool
    READ_ACTS: Any
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any, number: Any) -> None: ...
    def clocked(self) -> None: ...
    def _set_rate(self) -> None: ...
    def requests(self) -> int: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def _enable(self, value: Any) -> None: ...
