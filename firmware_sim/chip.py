"""What a chip's peripherals and its processor share: time, interrupts, pins, and the order of the alarms."""

from typing import Final

import cython

from ranger_sim.firmware_sim.board import Board
from ranger_sim.firmware_sim.clock import Crystal, TickTrain
from ranger_sim.firmware_sim.vic import SLOT_TIMER, InterruptController, InterruptSource
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.user_error import FirmwareError

PINS: Final = 64  # P0.0 ... P0.31 are 0 ... 31, P1.0 ... P1.31 are 32 ... 63
ALARMS: Final = 16  # of peripherals
ALARM_PLACES: Final = 18  # with the slot timer's, and one that never comes


@cython.cclass
class Chip(Board):
    """The hardware of a microcontroller of `hz` core clock on `crystal`, as its peripherals see it.

    `now`: the time (ns) at which the present input, handler or task takes effect. `pins`: levels 0/1. `unclaimed`:
    messages that no peripheral claimed. The slot timer matched at `match_time` and will match at `tick_time`.
    `panel`: what a person sees of the board, or None (`carry`).
    """

    # Fields that nearly every event touches come first, close together.
    now: cython.longlong
    instant: cython.longlong
    code_time: cython.longlong
    stop_time: cython.longlong
    alarm_time: cython.longlong
    alarms_set: cython.longlong
    waiting: cython.bint
    check_wait: cython.bint
    vic: InterruptController
    ns_per_cycle: cython.double
    cycles_per_ns: cython.double
    ticks: TickTrain
    tick_source: "InterruptSource"
    tick_time: cython.longlong
    match_time: cython.longlong
    pins: cython.longlong[::1]
    alarm_times: cython.longlong[ALARM_PLACES]
    alarm_places: cython.longlong[ALARM_PLACES]
    hz: cython.longlong
    crystal: Crystal
    unclaimed: cython.longlong
    peripherals: list
    followers: list
    pwm_follower: object
    panel: object

    def __init__(self, name, hz, crystal=None) -> None:
        if hz <= 0:
            raise FirmwareError(f"{name}: hz {hz} must be above 0")
        Board.__init__(self, name)
        self.hz = hz
        self.crystal = crystal if crystal is not None else Crystal()
        self.ns_per_cycle = self.crystal.ns_per_cycle(hz)
        self.cycles_per_ns = self.crystal.cycles_per_ns(hz)
        self.vic = InterruptController(self.ns_per_cycle)
        self.peripherals = []
        self.pins = integers(PINS)
        # per pin the Peripheral on the board that sees each change of its level (`on_level`), or None; and who sees
        # what drives the PWM unit's pins (`on_pwm`)
        self.followers = [None] * 64  # PINS
        self.pwm_follower = None
        self.panel = None
        self.now = 0
        self.instant = 0  # up to which inputs have been taken in
        self.code_time = 0  # when the processor goes on with its code
        self.stop_time = 0  # how far the processor may run before it checks the inputs again
        self.waiting = False  # a task waits for a condition
        self.check_wait = False  # which may hold now
        # alarms that are set: instants and places in the order of making, the first to come last; at 0 stands one
        # that never comes
        self.alarm_times = [NEVER] * 18  # ALARM_PLACES
        self.alarm_places = [0] * 18
        self.alarms_set = 1  # where the next one would stand
        self.alarm_time = NEVER  # of the first to come
        self.ticks = TickTrain(self.crystal, 1, 0)
        self.tick_source = self.vic.source(SLOT_TIMER, 0)
        self.tick_time = NEVER
        self.match_time = 0
        self.unclaimed = 0

    def carry(self, panel) -> None:
        """Attach `panel`, the person's view of the board: its `words` are the board's memory, for others to read."""
        self.panel = panel
        self.memory = panel.words

    def move_memory(self, words) -> None:
        """Keep the panel's state in `words` from now on."""
        if self.panel is None:
            Board.move_memory(self, words)
        self.panel.move(words)
        self.memory = words
