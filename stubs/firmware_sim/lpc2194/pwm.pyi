# Generated from firmware_sim/lpc2194/pwm.py and firmware_sim/lpc2194/pwm.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.lpc2194.block import Block
from ranger_sim.firmware_sim.peripherals.pwm import Pwm
from typing import Any
from typing import final

TCR_COUNTS: int
TCR_PWM: int
MCR_RESET_MR0: int
MATCHES: tuple[str, ...]
MATCH_OFFSETS: tuple[int, ...]

@final
class PwmBlock(Block):
    pwm: Pwm
    TCR: int
    MCR: int
    PCR: int
    begun: bool
    REGISTERS: dict[int, Any]
    def __init__(self, chip: Any, clocks: Any) -> None: ...
    def clocked(self) -> None: ...
    def _look(self) -> None: ...
    def _drive(self) -> None: ...
    def read(self, offset: int) -> int: ...
    def write(self, offset: int, value: int) -> int: ...
