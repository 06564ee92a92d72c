# Generated from firmware_sim/peripherals/spi_encoder.py and firmware_sim/peripherals/spi_encoder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

SPSR_SPIF: int

@final
class SpiEncoder(Peripheral):
    busy: bool
    alarm: Alarm
    word: int
    mask: int
    latched: int
    SPDR: int
    SPSR: int
    transfer_ns: int
    source: InterruptSource
    number: int
    bits: int
    bit_rate: int
    not_finished: int
    def __init__(self, chip: Any, number: int = 0, word: int = 0, bits: int = 14, bit_rate: int = 1000000, value_bits: Any = 13) -> None: ...
    def start(self) -> bool: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def read(self) -> int: ...
