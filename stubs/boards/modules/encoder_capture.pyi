# Generated from boards/modules/encoder_capture.py and boards/modules/encoder_capture.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.foundation.events import EventQueue
from typing import Any
from typing import final

LONGEST_TIME: int
IR_MR0: int
IR_CR0: int
CCR_BOTH_EDGES: int
CCR_BITS: int
WRAP: int
EARLY: int
EDGE_CYCLES: int
WRAP_CYCLES: int
LATENCY_CYCLES: int

@final
class WrapCounter:
    timer: TimerCapture
    cycles: int
    def __init__(self, timer: TimerCapture) -> None: ...
    def attach(self, chip: Microcontroller) -> None: ...
    def on_wrap(self, queue: EventQueue) -> None: ...

@final
class EncoderCapture:
    chip: Microcontroller
    timer: TimerCapture
    wraps: WrapCounter
    decoder: QuadratureDecoder
    armed_level: int
    channel: int
    flag: int
    edge_bits: int
    pin: int
    partner_pin: int
    last: int
    def __init__(self, chip: Microcontroller, wraps: WrapCounter, channel: int, pin: int, partner_pin: int, decoder: QuadratureDecoder) -> None: ...
    def on_capture(self, queue: Any) -> None: ...
