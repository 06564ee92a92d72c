# Generated from firmware_sim/peripherals/uart.py and firmware_sim/peripherals/uart.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any
from typing import final

FIFO_BYTES: int
BITS_PER_BYTE: int
CLOCKS_PER_BIT: int
TIMEOUT_BYTES: int
TIMEOUT_ALARM: int
TRANSMIT_ALARM: int
IIR_NONE: int
IIR_TRANSMIT: int
IIR_RECEIVED: int
IIR_TIMEOUT: int
LSR_RDR: int
LSR_OE: int
LSR_THRE: int
LSR_TEMT: int

@final
class Uart(Peripheral):
    source: InterruptSource
    byte_ns: int
    trigger: int
    fifo_count: int
    IIR: int
    received: int
    fifo: MutableSequence[int]
    overruns: int
    errors: int
    number: int
    DL: int
    DIVADDVAL: int
    MULVAL: int
    hz: int
    baud: float
    transmit_free: int
    sent: int
    refused: int
    timeout_alarm: Alarm
    transmit_alarm: Alarm
    transmit_source: InterruptSource
    def __init__(self, chip: Any, number: int = 0, divisor: Any = 6, divaddval: Any = 0, mulval: Any = 1, trigger: int = 8, hz: Any = 0) -> None: ...
    def set_divisor(self, DL: int, DIVADDVAL: int = 0, MULVAL: int = 1) -> None: ...
    def retune(self, now: Any, before: Any) -> None: ...
    def waiting(self) -> int: ...
    def on_message(self, queue: Any) -> InterruptSource | None: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
    def RBR(self) -> int: ...
    def were_read(self, count: int) -> None: ...
    def THR(self, byte: int) -> bool: ...
    def LSR(self) -> int: ...
    def unplug(self) -> None: ...
