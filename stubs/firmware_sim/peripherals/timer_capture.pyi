# Generated from firmware_sim/peripherals/timer_capture.py and firmware_sim/peripherals/timer_capture.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.firmware_sim.alarm import Alarm
from ranger_sim.firmware_sim.clock import TickTrain
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from typing import Any

IR_MR0: int
IR_CR0: int
CCR_RISING: int
CCR_FALLING: int
CCR_INTERRUPT: int
CCR_MASK: int
CCR_BITS: int

class TimerCapture(Peripheral):
    IR: int
    CCR: int
    wrap_time: int
    next_wrap_time: int
    counts_per_ns: float
    MR0: int
    captures: MutableSequence[int]
    alarm: Alarm
    match_source: InterruptSource
    ticks: TickTrain
    period_ns: int
    lost: MutableSequence[int]
    pins: MutableSequence[int]
    number: int
    phase_ns: int
    hz: int
    match_interrupt: bool
    def __init__(self, chip: Any, number: int = 0, period: Any = 30000, hz: Any = 0, phase_ns: int = 0, match_interrupt: bool = False) -> None: ...
    def retune(self, now: Any, before: Any) -> None: ...
    def use_channel(self, channel: Any, pin: Any, rising: Any = True, falling: Any = True, source: Any = None) -> Any: ...
    def arm(self, channel: int, rising: bool, falling: bool) -> None: ...
    def clear(self, mask: int) -> int: ...
    @property
    def wraps(self) -> Any: ...
    def CR(self, channel: int) -> int: ...
    @property
    def CR0(self) -> Any: ...
    @property
    def CR1(self) -> Any: ...
    @property
    def CR2(self) -> Any: ...
    @property
    def CR3(self) -> Any: ...
    def TC(self) -> int: ...
    def count_at(self, time: int) -> int: ...
    def on_pin(self, channel: int, level: int, time: int) -> int: ...
    def on_alarm(self, alarm: int, time: int) -> InterruptSource | None: ...
