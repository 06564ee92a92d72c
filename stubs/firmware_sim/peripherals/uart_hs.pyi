# Generated from firmware_sim/peripherals/uart_hs.py and firmware_sim/peripherals/uart_hs.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any

BITS_PER_BYTE: int
SAMPLES_PER_BIT: int

class HsUart(Peripheral):
    number: int
    rate: int
    hz: int
    byte_ns: int
    done_alarm: Alarm
    baud: float
    source: InterruptSource
    busy: bool
    waits_for_cts: bool
    clear_to_send: bool
    overrun: bool
    held: Any
    sent: int
    buffer_bytes: int
    active: int
    filled: int
    received: int
    lost: int
    buffers: MutableSequence[int]
    def __init__(self, chip: Any, number: int, channel: Any, rate: int = 0, hz: int = 13000000, buffer_bytes: int = 1000, cts_pin: Any = ...) -> None: ...
    def retune(self, now: Any, before: Any) -> None: ...
    def transmit(self, data: Any) -> bool: ...
    def on_pin(self, channel: int, level: int, time: int) -> int: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def on_message(self, queue: Any) -> InterruptSource | None: ...
    def swap(self) -> int: ...
    def taken(self, place: int) -> int: ...
