# Generated from firmware_sim/peripherals/adc_internal.py and firmware_sim/peripherals/adc_internal.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

CONVERSION_CLOCKS: int
COUNTS: int
LAST_COUNT: int
CR_CLKDIV_SHIFT: int
CR_BURST: int
CR_PDN: int
CR_START: int
GDR_RESULT_SHIFT: int
GDR_CHN_SHIFT: int
GDR_DONE_ABOVE_CHN: int

@final
class AdcInternal(Peripheral):
    busy: bool
    channel: int
    alarm: Alarm
    source: InterruptSource
    conversion_ns: int
    single: int
    CR: int
    GDR: int
    scale: float
    count_V: float
    result: int
    offset_counts: int
    inputs: MutableSequence[int]
    channels: MutableSequence[int]
    burst_count: int
    burst_start: int
    hz: int
    clkdiv: int
    not_finished: int
    def __init__(self, chip: Any, clkdiv: int = 200, hz: Any = 0, reference_V: Any = 3.3, scale: float = 1.0, offset_counts: int = 0) -> None: ...
    def convert(self, volts: float) -> int: ...
    def start(self, channel: int) -> bool: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def start_burst(self, *channels: Any) -> None: ...
    def DR(self, channel: int) -> int: ...
