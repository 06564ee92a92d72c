# Generated from boards/can_router.py and boards/can_router.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.boards.firmware_board import FirmwareBoard
from ranger_sim.boards.modules.can_load import CanLoad
from ranger_sim.boards.modules.mcu_led import Heartbeat
from ranger_sim.boards.modules.network_clock import NetworkClock
from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.boards.modules.routing import Router
from ranger_sim.boards.modules.sender import Sender
from ranger_sim.boards.modules.ssp_link import RouterSspLink
from ranger_sim.firmware_sim.peripherals.adc_internal import AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller import CanController
from ranger_sim.firmware_sim.peripherals.gpio import Gpio
from ranger_sim.firmware_sim.peripherals.ssp import SspPort
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.scheduler import Schedule
from typing import Any
from typing import final

BUSES: int
LED_OFF: int
LED_TRAFFIC: int
LED_WARNING: int
LED_FULL: int
WARNING_FRAMES_PER_MS: int
FULL_FRAMES_PER_MS: int
RECEIVE_CYCLES: Any
SEGMENT_TIMER_CYCLES: int
SEGMENT_CYCLES: int
HALF_WORD_CYCLES: int
ROUTE_IDLE_CYCLES: int
ROUTE_FRAME_CYCLES: int
FLUSH_IDLE_CYCLES: int
FLUSH_FRAME_CYCLES: int
ERROR_CYCLES: int
LOOP_CYCLES: int
ERROR_SLOT: int
SEGMENT_PERIOD_CYCLES: int
CURRENT_GAIN_A: float
CURRENT_OFFSET: int
VOLTAGE_GAIN_V: float
VOLTAGE_OFFSET: int
ANALOG: dict[str, int]

def supply_pins_V(current_A: Any, voltage_V: Any) -> tuple[Any, ...]: ...

@final
class BusReceiver:
    controller: CanController
    router: Router
    def __init__(self, controller: CanController, router: Router) -> None: ...
    def on_frame(self, queue: Any) -> None: ...

@final
class OwnFrames(Sender):
    router: Router
    report: Any
    report_full: bool
    lost: int
    def __init__(self, router: Router, time: NetworkTime, report: Any, report_full: bool) -> None: ...
    def send_words(self, identifier: int, value_word: int, time_word: int) -> bool: ...

@final
class CanRouterBoard(FirmwareBoard):
    router: Router
    link: RouterSspLink
    controllers: list[Any]
    load: CanLoad
    idle_since: int
    flush_next: int
    pair_ns: int
    idle: bool
    route_ns: MutableSequence[int]
    flush_ns: MutableSequence[int]
    ssp: SspPort
    timer1: TimerCapture
    clock: NetworkClock
    own: OwnFrames
    adc: AdcInternal
    lost_before: int
    sync_cycles: int
    can_leds: MutableSequence[int]
    gpio: Gpio
    heartbeat: Heartbeat
    can1: CanController
    can2: CanController
    can3: CanController
    can4: CanController
    can_errors: list[Any]
    def __init__(self, crystal: Any, quirks: Any, phase_ns: int = 0) -> None: ...
    def _time_turns(self) -> None: ...
    def retune(self, ppb: Any, now: Any) -> None: ...
    def counters(self) -> Any: ...
    def schedule(self) -> Schedule: ...
    def on_segment_timer(self, queue: Any) -> None: ...
    def on_segment(self, queue: Any) -> Any: ...
    def on_can_error(self, queue: Any) -> None: ...
    def urgent_kinds(self) -> int: ...
    def nothing_waits(self) -> bool: ...
    def flush(self, controller: CanController, began: int) -> int: ...
    def can_flush(self, at: int) -> bool: ...
    def main_loop(self) -> int: ...
    def send_time(self) -> None: ...
    def update_errors(self) -> Any: ...
    def count_load(self) -> None: ...
    def show_load(self) -> None: ...
    def current_A(self) -> float: ...
    def voltage_V(self) -> float: ...
    def power_W(self) -> float: ...
