# Generated from firmware_sim/lpc2194/converter.py and firmware_sim/lpc2194/converter.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from typing import Any
from typing import final

@final
class ConverterBlock(Block):
    adc: AdcInternal
    control: int
    inten: int
    done: int
    seen: bool
    data: MutableSequence[int]
    burst_read: MutableSequence[int]
    READ_ACTS: Any
    REGISTERS: dict[int, Any]
    def __init__(self, chip: Any, clocks: Any, hardware: Any) -> None: ...
    def requests(self) -> int: ...
    def clocked(self) -> None: ...
    def _set_clock(self) -> None: ...
    def read(self, offset: int) -> int: ...
    def _burst_result(self, channel: Any) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def _control(self, value: Any) -> None: ...
