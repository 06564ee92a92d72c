# Generated from boards/modules/compliant_control.py and boards/modules/compliant_control.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.receiver import Receiver
from typing import final

COMMAND: int
STIFFNESS: int
DAMPNESS: int
TARGET: int
GAIN_CYCLES: int

@final
class CompliantControl:
    sign: int
    latch_with_current: bool
    command: int
    stiffness: int
    dampness: int
    received_stiffness: int
    received_dampness: int
    target: int
    def __init__(self, sign: int = ..., latch_with_current: bool = False) -> None: ...
    def set_command(self, current: int) -> None: ...
    def set_stiffness(self, gain: int) -> None: ...
    def set_dampness(self, gain: int) -> None: ...
    def update(self, position: int, velocity: int) -> int: ...

@final
class GainReceiver(Receiver):
    control: CompliantControl
    what: int
    def __init__(self, control: CompliantControl, what: int) -> None: ...
    def deliver(self, value_word: int, time_word: int) -> None: ...
