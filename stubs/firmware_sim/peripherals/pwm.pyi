# Generated from firmware_sim/peripherals/pwm.py and firmware_sim/peripherals/pwm.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.firmware_sim.peripheral import Peripheral
from typing import Any
from typing import final

LER_MR0: int
LER_MR1: int
LER_MR2: int
LER_MR3: int
LER_MR4: int
LER_MR5: int
LER_MR6: int
LONGEST_PERIOD_S: int

@final
class Pwm(Peripheral):
    MR2: int
    MR6: int
    period_start: int
    rest: int
    rate: int
    period_ns: int
    LER: int
    driven: int
    latched_MR0: int
    latched_MR2: int
    latched_MR6: int
    MR0: int
    MR1: int
    MR3: int
    MR4: int
    MR5: int
    hz: int
    phase_ns: int
    latched_MR1: int
    latched_MR3: int
    latched_MR4: int
    latched_MR5: int
    def __init__(self, chip: Any, period: int = 600, hz: Any = 0, phase_ns: int = 0) -> None: ...
    def retune(self, now: Any, before: Any) -> None: ...
    def write(self, MR2: int, MR6: int) -> None: ...
    def latch(self, mask: int) -> None: ...
    def tell(self) -> None: ...
