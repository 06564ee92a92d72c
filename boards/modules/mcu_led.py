"""The three LEDs next to the processor, and the heartbeat (robot.md N1.8, N4.11)."""

from typing import Final

import cython

from ranger_sim.boards.modules.network_time import NetworkTime
from ranger_sim.firmware_sim.peripherals.gpio import Gpio, p1

GREEN: Final = 0
RED: Final = 1
BLUE: Final = 2
FIRST_PIN: Final = 55  # P1.23; the others follow
HEARTBEAT_MS: Final = 50
HEARTBEAT_BIT: Final = 8  # of the network time

PINS = {"green": p1(23), "red": p1(24), "blue": p1(25)}  # active low


@cython.cclass
class McuLed:
    """Green, red and blue with software timers. `slot_us`: period of `update`, which is a slot task.

    `remaining` per LED: slots until it goes out; -1 stays on until switched off; 0 is off.
    """

    lit: cython.longlong
    remaining_green: cython.longlong
    remaining_red: cython.longlong
    remaining_blue: cython.longlong
    gpio: Gpio
    slots_per_ms: cython.double

    def __init__(self, gpio: Gpio, slot_us) -> None:
        self.gpio = gpio
        self.slots_per_ms = 1000.0 / slot_us
        self.remaining_green = 0
        self.remaining_red = 0
        self.remaining_blue = 0
        self.lit = 0

    @cython.ccall
    @cython.exceptval(check=False)
    def pin(self, led: cython.longlong) -> cython.longlong:
        """Pin number of an LED."""
        return FIRST_PIN + led

    @cython.ccall
    def set_remaining(self, led: cython.longlong, slots: cython.longlong) -> None:
        """Slots until `led` goes out (-1: never, 0: now)."""
        if led == GREEN:
            self.remaining_green = slots
        elif led == RED:
            self.remaining_red = slots
        else:
            self.remaining_blue = slots
        if slots != 0:
            if not self.lit >> led & 1:
                self.lit |= 1 << led
                self.gpio.write(self.pin(led), 0)
        elif self.lit >> led & 1:
            self.lit &= ~(1 << led)
            self.gpio.write(self.pin(led), 1)

    @cython.ccall
    def flash(self, led: cython.longlong, ms: cython.longlong) -> None:
        """Light `led` for `ms` from now; a running flash starts anew."""
        slots: cython.longlong = int(ms * self.slots_per_ms)
        self.set_remaining(led, slots)

    @cython.ccall
    def on(self, led: cython.longlong) -> None:
        """Light `led` until it is switched off."""
        self.set_remaining(led, -1)

    @cython.ccall
    def off(self, led: cython.longlong) -> None:
        """Put `led` out."""
        self.set_remaining(led, 0)

    def update(self) -> None:
        """Slot task: advance the timers."""
        if self.lit == 0:
            return
        if self.remaining_green > 0:
            self.remaining_green -= 1
            if self.remaining_green == 0:
                self.set_remaining(GREEN, 0)
        if self.remaining_red > 0:
            self.remaining_red -= 1
            if self.remaining_red == 0:
                self.set_remaining(RED, 0)
        if self.remaining_blue > 0:
            self.remaining_blue -= 1
            if self.remaining_blue == 0:
                self.set_remaining(BLUE, 0)


@cython.final
@cython.cclass
class Heartbeat(McuLed):
    """The LEDs of a board, whose blue one flashes for 50 ms when the network time's bit 8 goes from 0 to 1, so every
    512 ms."""

    time: NetworkTime
    last_bit: cython.longlong
    beats: cython.longlong

    def __init__(self, time: NetworkTime, gpio: Gpio, slot_us) -> None:
        McuLed.__init__(self, gpio, slot_us)
        self.time = time
        self.last_bit = 0
        self.beats = 0

    def beat(self) -> None:
        """Slot task."""
        bit: cython.longlong = self.time.ms >> HEARTBEAT_BIT & 1
        if bit != self.last_bit:
            self.last_bit = bit
            if bit:
                self.beats += 1
                self.flash(BLUE, HEARTBEAT_MS)
