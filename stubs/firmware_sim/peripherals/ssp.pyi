# Generated from firmware_sim/peripherals/ssp.py and firmware_sim/peripherals/ssp.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

SEGMENT_WORDS: int
LONGEST_WORD: int
BIT_RATE: int
WORD_BITS: int

def segment_time_ns(words: int, word_bits: int, bit_rate: int) -> int: ...

class SspDevice(Peripheral):
    bits: int
    def __init__(self, chip: Any) -> None: ...
    def begin(self, time: int) -> int: ...
    def exchange(self, word: int, time: int) -> int: ...

@final
class SspMaster(Peripheral):
    device: SspDevice
    bits: int
    def __init__(self, chip: Any, device: SspDevice, bits: int = ...) -> None: ...
    def word(self, word: int) -> int: ...

@final
class SspSegment:
    used: int
    checksum_error: int
    rows: MutableSequence[int]
    def __init__(self) -> None: ...
    @property
    def words(self) -> list[Any]: ...
    @words.setter
    def words(self, half_words: list[Any]) -> None: ...
    def clear(self) -> None: ...
    def copy_from(self, other: SspSegment) -> None: ...

@final
class SspPort(Peripheral):
    fresh: bool
    number: int
    source: InterruptSource
    received: SspSegment
    loaded: SspSegment
    received_time: int
    exchanges: int
    overwritten: int
    def __init__(self, chip: Any, number: int = 0) -> None: ...
    def start(self, segment: SspSegment) -> None: ...
    def load(self, segment: SspSegment) -> None: ...
    def on_message(self, queue: Any) -> InterruptSource | None: ...
    def take(self) -> SspSegment: ...
