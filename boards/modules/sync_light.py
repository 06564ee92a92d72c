"""The light that lines up video with the log: a pattern of flashes, started and stopped by key 4.

Key 4 down for 100 slots in all, also with pauses, toggles it. The time is cut into cells of 125 ms, a
flash lasts 50 ms, and ten patterns follow each other. A low level at P0.16 lights it, and light 2
shows the same. Source: robot.md N4.11. The patterns are ours: pattern n is ten cells with
flashes in the first n + 1, so the run of flashes shows where in the cycle a video frame lies.
"""

import cython

from ranger_sim.boards.modules.colour_leds import DARK, TRANSFERS_PER_LED, WHITE, ColourLeds
from ranger_sim.boards.modules.front_panel import SYNC_PIN
from ranger_sim.boards.modules.keypad import Keypad
from ranger_sim.firmware_sim.peripherals.gpio import Gpio

SYNC_KEY = 4
SYNC_LED = 1  # light 2
TOGGLE_SLOTS = 100
CELL_MS = 125
FLASH_MS = 50
CELLS_PER_PATTERN = 10
PATTERNS = 10


@cython.cclass
class SyncLight:
    """`watch_key` and `update` run once per slot of 1 ms, in this order."""

    gpio: Gpio
    keypad: Keypad
    leds: ColourLeds
    running: cython.bint
    lit: cython.bint
    held_slots: cython.longlong
    milliseconds: cython.longlong
    flashes: cython.longlong
    pin: cython.longlong

    def __init__(self, gpio: Gpio, keypad: Keypad, leds: ColourLeds) -> None:
        self.gpio = gpio
        self.keypad = keypad
        self.leds = leds
        self.running = False
        self.lit = False
        self.held_slots = 0
        self.milliseconds = 0
        self.flashes = 0
        self.pin = SYNC_PIN
        gpio.write(SYNC_PIN, 1)

    @cython.ccall
    def watch_key(self) -> cython.longlong:
        """Count the slots in which key 4 is down; at the hundredth start or stop the pattern."""
        if not self.keypad.pressed(SYNC_KEY):
            return 0
        self.held_slots += 1
        if self.held_slots >= TOGGLE_SLOTS:
            self.held_slots = 0
            self.running = not self.running
            self.milliseconds = 0
            if not self.running:
                self._show(False)
        return 0

    @cython.ccall
    def update(self) -> cython.longlong:
        """One millisecond of the pattern; returns how many light transfers it made."""
        cell: cython.longlong
        inside: cython.longlong
        on: cython.bint
        if not self.running:
            return 0
        cell = self.milliseconds // CELL_MS
        inside = self.milliseconds % CELL_MS
        on = inside < FLASH_MS and cell % CELLS_PER_PATTERN <= cell // CELLS_PER_PATTERN
        self.milliseconds += 1
        if self.milliseconds >= PATTERNS * CELLS_PER_PATTERN * CELL_MS:
            self.milliseconds = 0
        if on == self.lit:
            return 0
        if on:
            self.flashes += 1
        self._show(on)
        return TRANSFERS_PER_LED

    @cython.ccall
    def _show(self, on: cython.bint) -> None:
        """Switch both lights on or off."""
        self.lit = on
        self.gpio.write(self.pin, 0 if on else 1)
        self.leds.set_led(SYNC_LED, WHITE if on else DARK)
