# Generated from firmware_sim/lpc2194/system.py and firmware_sim/lpc2194/system.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from typing import Any
from typing import final

EINTS: int
LOCK_NS: int
PLLCON_ENABLED: int
PLLCON_CONNECTED: int
PLOCK: int
FEEDS: tuple[int, ...]
DIVIDERS: dict[int, int]
MAM_SLOWEST: int

@final
class SystemBlock(Block):
    converter: Ads7871
    EXTINT: int
    EXTMODE: int
    EXTPOLAR: int
    levels: MutableSequence[int]
    plain: dict[Any, Any]
    MAMCR: int
    MAMTIM: int
    feed: int
    lock_ns: int
    active: tuple[Any, ...]
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any, converter: Ads7871) -> None: ...
    def on_pin(self, number: int, level: int, time: int) -> int: ...
    def requests(self) -> int: ...
    def _feed(self, value: Any) -> None: ...
    def _set_clock(self) -> None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def _accelerate(self, offset: Any, value: Any) -> None: ...
