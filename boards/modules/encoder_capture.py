# cython: boundscheck=False, wraparound=False
# (pins are those of the table in motor_board.py)
"""The fast interrupt of an incremental encoder: from a timer capture to a count and a time
(appendix 4.6; robot.md N4.1).

The capture channel is armed for one edge of channel A at a time; its handler compares the pin's level with what
that edge leaves, looks at channel B for the direction, and arms the other edge.
"""

from typing import Final

import cython

from ranger_sim.boards.modules.quadrature_decoder import QuadratureDecoder
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.vic import FIQ, TIMER_MATCH
from ranger_sim.foundation.events import EventQueue

LONGEST_TIME: Final = 0x7F000000  # cycles, about 35 s: longer silences count as this
# Bits of T0IR: the match that wraps the timer, the first capture channel. Of T0CCR: both edges of that channel.
IR_MR0: Final = 1
IR_CR0: Final = 16
CCR_BOTH_EDGES: Final = 3
CCR_BITS: Final = 3  # per channel
WRAP: Final = 30_000  # cycles from wrap to wrap
EARLY: Final = 15_000  # a capture below this is of after the wrap

# Counted in the images, two cycles per instruction (robot.md T2), latency included; appendix 4.6: about 150.
EDGE_CYCLES = 2 * 47
WRAP_CYCLES = 2 * 9
LATENCY_CYCLES = 12


@cython.final
@cython.cclass
class WrapCounter:
    """Counts the wraps of the capture timer (every 0.5 ms) in the fast interrupt: `cycles` of them since power-up."""

    timer: TimerCapture
    cycles: cython.longlong

    def __init__(self, timer: TimerCapture) -> None:
        self.timer = timer
        self.cycles = 0

    def attach(self, chip: Microcontroller) -> None:
        """Take the timer's match interrupt. Attach after the encoders: captures of before a wrap come first."""
        chip.vic.attach(
            TIMER_MATCH,
            self.timer.number,
            self.on_wrap,
            cost=WRAP_CYCLES - LATENCY_CYCLES,
            slot=FIQ,
            latency=LATENCY_CYCLES,
            name="encoder_timer_wrap",
        )

    def on_wrap(self, queue: EventQueue) -> None:
        """Fast interrupt: the timer restarted at 0."""
        self.timer.IR &= ~IR_MR0
        self.cycles += WRAP


@cython.final
@cython.cclass
class EncoderCapture:
    """One encoder on capture `channel`: A on `pin`, B on `partner_pin`."""

    chip: Microcontroller
    timer: TimerCapture
    wraps: WrapCounter
    decoder: QuadratureDecoder
    armed_level: cython.longlong
    channel: cython.longlong
    flag: cython.longlong
    edge_bits: cython.longlong
    pin: cython.longlong
    partner_pin: cython.longlong
    last: cython.longlong

    def __init__(
        self, chip: Microcontroller, wraps: WrapCounter, channel, pin, partner_pin, decoder: QuadratureDecoder
    ) -> None:
        self.chip = chip
        self.timer = wraps.timer
        self.wraps = wraps
        self.channel = channel
        self.flag = IR_CR0 << channel
        self.edge_bits = CCR_BOTH_EDGES << CCR_BITS * channel  # rising and falling in T0CCR
        self.pin = pin
        self.partner_pin = partner_pin
        self.decoder = decoder
        self.armed_level = 1  # which the edge that the channel waits for leaves
        self.last = 0  # cycles at the edge before
        source = self.timer.use_channel(channel, pin, rising=True, falling=False)
        chip.vic.attach(
            source.kind,
            source.index,
            self.on_capture,
            cost=EDGE_CYCLES - LATENCY_CYCLES,
            slot=FIQ,
            latency=LATENCY_CYCLES,
            name=f"encoder_edge_{channel}",
        )

    def on_capture(self, queue: object) -> None:
        """Fast interrupt: count the edge and keep the time since the one before. Rising with B low counts up."""
        timer: TimerCapture = self.timer
        level: cython.longlong = self.chip.pins[self.pin]
        capture: cython.longlong = timer.captures[self.channel]
        now: cython.longlong = capture + self.wraps.cycles
        elapsed: cython.longlong
        timer.IR &= ~self.flag
        # a wrap that is not counted yet came before this capture if the capture is a small number
        if timer.IR & IR_MR0 and capture < EARLY:
            now += WRAP
        elapsed = now - self.last
        self.last = now
        if elapsed > LONGEST_TIME:
            elapsed = LONGEST_TIME
        if level == self.armed_level:
            self.armed_level = 1 - level
            timer.CCR ^= self.edge_bits  # from one of the two to the other
            self.decoder.edge(2 * (level ^ self.chip.pins[self.partner_pin]) - 1, elapsed)
        else:
            self.decoder.glitch()  # the edge that would leave the other level stays armed
