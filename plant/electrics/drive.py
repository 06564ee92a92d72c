# cython: boundscheck=False, wraparound=False
# (indices in the queue are below `count`, and `count` is at most `capacity`)
"""The H-bridge of a motor board: two PWM leads, low-side enables, and the watchdog that removes its power.

A board's writes arrive stamped (ns) and take effect at their stamps, also inside a step of the plant; a stamp
that has passed takes effect at the start of the next step. The watchdog is judged here, in plant time: the
bridge has power until `watchdog_ns` after the last edge on the watchdog line, and again from the next edge on
(appendix 3.9; robot.md N4.3).
"""

from typing import Final

import cython

from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.numbers import integers
from ranger_sim.plant.bridge import Bridge

# kinds of changes
PWM_WRITE: Final = 0
WATCHDOG_EDGE: Final = 1
LOW_SIDE_WRITE: Final = 2

ROW: Final = 5  # numbers of a change in the queue

# what holds a leg (`hold_leg`)
DRIVEN: Final = 0  # its PWM
HELD_OPEN: Final = 1
HELD_LOW: Final = 2
HELD_HIGH: Final = 3


@cython.final
@cython.cclass
class Drive(Bridge):
    """One bridge. `duty`: net drive (MR2 - MR6) / MR0 of the battery voltage across the motor, -1 ... 1.

    `is_open`: no transistor conducts (no power, or a low side off), so the winding can only freewheel through the
    diodes. `switching_leads`: leads that toggle with the PWM. `sensed_lead_switches`: lead 2, where the current
    sensor sits (chosen by us, because no source specifies it), is one of them. `ripple`: (|D| (1 - |D|))^2 of the duty
    D, to which the loss of the current's ripple is proportional. `healthy_duty`, `healthy_open`: duty and openness if
    no leg were held.
    """

    # fields that a motor reads at every step come first, next to each other
    next_change_ns: cython.longlong
    duty: cython.double
    ripple: cython.double
    is_open: cython.bint
    sensed_lead_switches: cython.bint
    switching_leads: cython.longlong
    power_off_ns: cython.longlong
    count: cython.longlong
    powered: cython.bint
    enable2: cython.bint
    enable6: cython.bint
    mr2: cython.longlong
    mr6: cython.longlong
    mr0: cython.longlong
    watchdog_ns: cython.longlong
    changes: cython.longlong[::1]
    capacity: cython.longlong
    power_losses: cython.longlong
    held2: cython.longlong
    held6: cython.longlong
    healthy_duty: cython.double
    healthy_open: cython.bint

    def __init__(self, watchdog_ns=10_000_000) -> None:
        self.watchdog_ns = watchdog_ns
        self.mr2 = 0
        self.mr6 = 0
        self.mr0 = 600  # 100 kHz at 60 MHz, robot.md N4.4
        self.enable2 = True
        self.enable6 = True
        self.powered = False  # nothing has fed the watchdog yet
        self.power_off_ns = 0
        self.duty = 0.0
        self.ripple = 0.0
        self.is_open = True
        self.switching_leads = 0
        self.sensed_lead_switches = False
        self.held2 = DRIVEN
        self.held6 = DRIVEN
        self.healthy_duty = 0.0
        self.healthy_open = True
        self.power_losses = 0  # times the watchdog ran out
        # the queue, a row of numbers per change: time (ns), kind, written values
        self.changes = integers(ROW * 16)
        self.capacity = 16
        self.count = 0
        self.next_change_ns = NEVER  # first queued change or the end of the watchdog's time

    def write_pwm(
        self,
        time: cython.longlong,
        mr2: cython.longlong,
        mr6: cython.longlong,
        mr0: cython.longlong,
    ) -> None:
        """Match values of the two leads and of the period, in counts, from `time` on."""
        self._queue(time, PWM_WRITE, mr2, mr6, mr0)

    def watchdog_edge(self, time: cython.longlong) -> None:
        """The watchdog line changed its level at `time`."""
        if not self.powered or time > self.power_off_ns:
            self._queue(time, WATCHDOG_EDGE, 0, 0, 0)  # the bridge gets its power back at this edge
            return
        # it keeps its power, as it would if the edge were kept until its time
        self.power_off_ns = time + self.watchdog_ns
        self.next_change_ns = self.power_off_ns
        if self.count > 0 and self.changes[0] < self.next_change_ns:
            self.next_change_ns = self.changes[0]

    def low_side(self, time: cython.longlong, enable2: cython.bint, enable6: cython.bint) -> None:
        """The two low-side enables from `time` on."""
        self._queue(time, LOW_SIDE_WRITE, enable2, enable6, 0)

    @cython.ccall
    def hold_leg(self, leg: cython.longlong, state: cython.longlong) -> cython.void:
        """From now on leg 2 or 6 is held in this state; DRIVEN: it follows its PWM again."""
        if leg == 2:
            self.held2 = state
        else:
            self.held6 = state
        self._update()

    @cython.ccall
    def _queue(
        self,
        time: cython.longlong,
        kind: cython.longlong,
        a: cython.longlong,
        b: cython.longlong,
        c: cython.longlong,
    ) -> cython.void:
        """Keep a change until its time; equal times keep their order of arrival."""
        at: cython.longlong = ROW * self.count
        k: cython.longlong
        if self.count == self.capacity:
            self._grow()
        while at > 0 and self.changes[at - ROW] > time:
            for k in range(at, at + ROW):
                self.changes[k] = self.changes[k - ROW]
            at -= ROW
        self.changes[at] = time
        self.changes[at + 1] = kind
        self.changes[at + 2] = a
        self.changes[at + 3] = b
        self.changes[at + 4] = c
        self.count += 1
        if at == 0 and time < self.next_change_ns:
            self.next_change_ns = time

    def _grow(self) -> None:
        """Double the queue, keeping its content."""
        self.capacity = 2 * self.capacity
        grown = integers(ROW * self.capacity)
        for k, number in enumerate(self.changes):
            grown[k] = number
        self.changes = grown

    @cython.ccall
    def apply(self, time: cython.longlong) -> cython.void:
        """Let everything stamped up to and including `time` take effect, then judge the watchdog at `time`."""
        at: cython.longlong = 0
        k: cython.longlong
        kind: cython.longlong
        left: cython.longlong = self.count
        following: cython.longlong = NEVER
        if time < self.next_change_ns:
            return
        while left > 0 and self.changes[at] <= time:
            kind = self.changes[at + 1]
            if kind == PWM_WRITE:
                self.mr2 = self.changes[at + 2]
                self.mr6 = self.changes[at + 3]
                self.mr0 = self.changes[at + 4]
            elif kind == WATCHDOG_EDGE:
                self.powered = True
                self.power_off_ns = self.changes[at] + self.watchdog_ns
            else:
                self.enable2 = self.changes[at + 2] != 0
                self.enable6 = self.changes[at + 3] != 0
            at += ROW
            left -= 1
        self.count = left
        if left > 0:
            following = self.changes[at]
            for k in range(ROW * left):
                self.changes[k] = self.changes[k + at]
        if self.powered:
            if time >= self.power_off_ns:
                self.powered = False
                self.power_losses += 1
            elif self.power_off_ns < following:
                following = self.power_off_ns
        self.next_change_ns = following
        self._update()

    @cython.ccall
    def _update(self) -> cython.void:
        """Duty and switching leads from the registers, and from what holds a leg."""
        high2: cython.longlong = self.mr2
        high6: cython.longlong = self.mr6
        conducts: cython.bint = self.powered and self.enable2 and self.enable6
        self._switch(conducts, high2, high6)
        self.healthy_duty = self.duty
        self.healthy_open = self.is_open
        if self.held2 != DRIVEN or self.held6 != DRIVEN:
            if self.held2 == HELD_OPEN or self.held6 == HELD_OPEN:
                conducts = False
            if self.held2 != DRIVEN:
                high2 = self.mr0 if self.held2 == HELD_HIGH else 0
            if self.held6 != DRIVEN:
                high6 = self.mr0 if self.held6 == HELD_HIGH else 0
            self._switch(conducts, high2, high6)

    @cython.cfunc
    def _switch(self, conducts: cython.bint, high2: cython.longlong, high6: cython.longlong) -> cython.void:
        """Duty and switching leads for two match values; one at or above MR0 is always on."""
        period: cython.longlong = self.mr0
        leads: cython.longlong = 0
        duty: cython.double
        self.sensed_lead_switches = False
        self.is_open = not conducts
        if self.is_open or period <= 0:
            self.duty = 0.0
            self.ripple = 0.0
            self.switching_leads = 0
            return
        if 0 < high2 < period:
            self.sensed_lead_switches = True
            leads = 1
        elif high2 > period:
            high2 = period
        elif high2 < 0:
            high2 = 0
        if 0 < high6 < period:
            leads += 1
        elif high6 > period:
            high6 = period
        elif high6 < 0:
            high6 = 0
        self.switching_leads = leads
        duty = (high2 - high6) / period
        self.duty = duty
        if duty < 0.0:
            duty = -duty
        duty *= 1.0 - duty
        self.ripple = duty * duty
