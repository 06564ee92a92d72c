# Generated from firmware_sim/lpc2194/pins.py and firmware_sim/lpc2194/pins.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.lpc2194.timer import ProgrammedTimer
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from typing import Any
from typing import final

TIMER_BIT: int
NO_CAPTURE: int
CAPTURES: dict[tuple[int, ...], tuple[int, ...]]
EXTERNAL_INTERRUPTS: dict[tuple[int, ...], int]

@final
class PinSelectBlock(Block):
    words: MutableSequence[int]
    timer0: ProgrammedTimer
    timer1: ProgrammedTimer
    capture: MutableSequence[int]
    interrupt: MutableSequence[int]
    external: Peripheral | None
    REGISTERS: dict[int, tuple[str, ...]]
    def __init__(self, chip: Any, clocks: Any, timers: Any) -> None: ...
    def connect(self) -> None: ...
    def on_pin(self, pin: int, level: int, time: int) -> int: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...

@final
class Ports(Gpio):
    direction: MutableSequence[int]
    latch: MutableSequence[int]
    hidden: MutableSequence[int]
    def __init__(self, chip: Any) -> None: ...

@final
class FastGpioBlock(Block):
    ports: Ports
    REGISTERS: Any
    def __init__(self, chip: Any, clocks: Any, ports: Ports) -> None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
    def write_part(self, offset: int, size: int, value: int) -> int: ...

@final
class OldGpioBlock(Block):
    ports: Ports
    REGISTERS: Any
    def __init__(self, chip: Any, clocks: Any, ports: Ports) -> None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
