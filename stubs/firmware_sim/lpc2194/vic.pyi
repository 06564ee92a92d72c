# Generated from firmware_sim/lpc2194/vic.py and firmware_sim/lpc2194/vic.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.lpc2194.block import Block
from typing import Any
from typing import final

TIMER0_INPUT: int
TIMER1_INPUT: int
UART0_INPUT: int
UART1_INPUT: int
SPI0_INPUT: int
SSP_INPUT: int
EINT0_INPUT: int
ADC_INPUT: int
CAN_INPUT: int
CAN1_TX_INPUT: int
CAN1_RX_INPUT: int
SLOTS: int
NO_SLOT: int
IDLE: int
SLOT_ENABLED: int
NAMES: dict[int, Any]

@final
class VicBlock(Block):
    raw: int
    soft: int
    enabled: int
    selected: int
    lines: int
    serving: int
    depth: int
    protection: int
    default_address: int
    addresses: MutableSequence[int]
    controls: MutableSequence[int]
    slot_of: MutableSequence[int]
    served: MutableSequence[int]
    READ_ACTS: Any
    REGISTERS: Any
    def __init__(self, chip: Any, clocks: Any) -> None: ...
    def place_slots(self) -> None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
