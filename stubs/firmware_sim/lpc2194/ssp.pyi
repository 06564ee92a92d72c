# Generated from firmware_sim/lpc2194/ssp.py and firmware_sim/lpc2194/ssp.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.adc_external import Ads7871
from ranger_sim.firmware_sim.peripherals.ssp import SspDevice
from ranger_sim.firmware_sim.peripherals.ssp import SspSegment
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

DEPTH: int
WORD_ALARM: int
SILENCE_ALARM: int
SILENT_BITS: int
SR_TFE: int
SR_TNF: int
SR_RNE: int
SR_RFF: int
SR_BSY: int
ROR: int
RT: int
RX: int
TX: int
CR1_LOOPBACK: int
CR1_ENABLE: int
CR1_SLAVE: int
SEGMENT_WORDS: int

@final
class SerialConverter(SspDevice):
    adc: Ads7871
    def __init__(self, chip: Any, adc: Ads7871) -> None: ...
    def exchange(self, word: int, time: int) -> int: ...

@final
class SegmentLink(SspDevice):
    sent: int
    interval_ns: int
    earliest: int
    words: list[Any]
    coming: list[Any]
    came: list[Any] | None
    going: SspSegment
    alarm: Alarm
    def __init__(self, chip: Any, interval_ns: int) -> None: ...
    def on_message(self, queue: Any) -> InterruptSource | None: ...
    def begin(self, time: int) -> int: ...
    def exchange(self, word: int, time: int) -> int: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def _start(self, time: Any) -> None: ...

def used_of(words: Any) -> int: ...

@final
class SspBlock(Block):
    device: SspDevice
    CR0: int
    CR1: int
    CPSR: int
    IMSC: int
    flags: int
    going: MutableSequence[int]
    came: MutableSequence[int]
    going_count: int
    came_count: int
    word: int
    word_ns: int
    bit_ns: int
    words: int
    busy: bool
    word_alarm: Alarm
    silence_alarm: Alarm
    READ_ACTS: Any
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any, device: SspDevice) -> None: ...
    def requests(self) -> int: ...
    def clocked(self) -> None: ...
    def _set_rate(self) -> None: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
