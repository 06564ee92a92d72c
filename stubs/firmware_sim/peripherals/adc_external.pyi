# Generated from firmware_sim/peripherals/adc_external.py and firmware_sim/peripherals/adc_external.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

START: int
GAIN_SHIFT: int
GAIN_MASK: int
CHANNEL_MASK: int
COUNTS: int
LEAST_COUNT: int
LAST_COUNT: int
RESTART_NS: int
CONVERSION_NS: int
GAINS: tuple[int, ...]
REFERENCE_V: float

def register4(channel_code: Any, gain_code: Any) -> int: ...

@final
class Ads7871(Peripheral):
    busy: bool
    done: bool
    step: int
    length: int
    register4: int
    alarm: Alarm
    source: InterruptSource
    conversion_ns: int
    offset_counts: int
    sequence: MutableSequence[int]
    inputs: MutableSequence[int]
    gains: MutableSequence[float]
    count_V: float
    result: int
    results: MutableSequence[int]
    eint: int
    not_finished: int
    def __init__(self, chip: Any, eint: int = 1, reference_V: Any = ..., conversion_ns: int = ..., scale: Any = 1.0, offset_counts: int = 0) -> None: ...
    def set_sequence(self, *entries: Any) -> None: ...
    def convert(self, volts: float, gain_code: int) -> int: ...
    def start(self, register4: int) -> bool: ...
    def write(self, register4: int, time: int) -> bool: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    @property
    def registers(self) -> Any: ...
    def read_result(self) -> int: ...
    def start_sequence(self) -> bool: ...
    def on_busy(self, queue: Any) -> Any: ...
    def sequence_done(self) -> bool: ...
    def unplug(self) -> None: ...
