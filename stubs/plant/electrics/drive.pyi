# Generated from plant/electrics/drive.py and plant/electrics/drive.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.bridge import Bridge
from typing import final

PWM_WRITE: int
WATCHDOG_EDGE: int
LOW_SIDE_WRITE: int
ROW: int
DRIVEN: int
HELD_OPEN: int
HELD_LOW: int
HELD_HIGH: int

@final
class Drive(Bridge):
    next_change_ns: int
    duty: float
    ripple: float
    is_open: bool
    sensed_lead_switches: bool
    switching_leads: int
    power_off_ns: int
    count: int
    powered: bool
    enable2: bool
    enable6: bool
    mr2: int
    mr6: int
    mr0: int
    watchdog_ns: int
    changes: MutableSequence[int]
    capacity: int
    power_losses: int
    held2: int
    held6: int
    healthy_duty: float
    healthy_open: bool
    def __init__(self, watchdog_ns: int = 10000000) -> None: ...
    def write_pwm(self, time: int, mr2: int, mr6: int, mr0: int) -> None: ...
    def watchdog_edge(self, time: int) -> None: ...
    def low_side(self, time: int, enable2: bool, enable6: bool) -> None: ...
    def hold_leg(self, leg: int, state: int) -> None: ...
    def _queue(self, time: int, kind: int, a: int, b: int, c: int) -> None: ...
    def _grow(self) -> None: ...
    def apply(self, time: int) -> None: ...
    def _update(self) -> None: ...
