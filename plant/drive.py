# cython: boundscheck=False, wraparound=False
# (places in the queue are below `count`, and `count` below `capacity`)
"""The H-bridge of a motor board: two PWM leads, low-side enables, and the watchdog that takes its power away.

What a board does arrives stamped (ns) and takes effect at its stamp, also inside a step of the plant; a stamp
that has passed takes effect at the start of the next step. The watchdog is judged here, in plant time: the
bridge has power until `watchdog_ns` after the last edge on the watchdog line, and again from the next edge on
(appendix 3.9; facts network-and-boards 4.3).
"""

import cython

from foundation.numbers import integers

PWM_WRITE = 0
WATCHDOG_EDGE = 1
LOW_SIDE_WRITE = 2
QUEUE_CAPACITY = 16


class Drive:
    """One bridge. `duty`: net drive (MR2 - MR6) / MR0 of the battery voltage across the motor, -1 ... 1.

    `is_open`: no transistor conducts (no power, or a low side off), so the winding can only freewheel through the
    diodes. `switching_leads`: leads that toggle with the PWM. `sensed_lead_switches`: lead 2, where the current
    sensor sits (chosen by us, because no fact says which), is one of them. `ripple`: (|D| (1 - |D|))^2 of the duty D,
    to which the loss of the current's ripple is proportional.
    """

    def __init__(self, watchdog_ns=10_000_000) -> None:
        self.watchdog_ns = watchdog_ns
        self.mr2 = 0
        self.mr6 = 0
        self.mr0 = 600  # 100 kHz at 60 MHz, facts network-and-boards 4.4
        self.enable2 = True
        self.enable6 = True
        self.powered = False  # nothing has fed the watchdog yet
        self.power_off_ns = 0
        self.duty = 0.0
        self.ripple = 0.0
        self.is_open = True
        self.switching_leads = 0
        self.sensed_lead_switches = False
        self.power_losses = 0  # times the watchdog ran out
        self.times = integers(16)
        self.kinds = integers(16)
        self.values = integers(48)
        self.capacity = 16
        self.count = 0
        self.next_change_ns = 1 << 62  # first queued change or the end of the watchdog's time

    def write_pwm(
        self,
        time: cython.longlong,
        mr2: cython.longlong,
        mr6: cython.longlong,
        mr0: cython.longlong,
    ) -> cython.void:
        """Match values of the two leads and of the period, in counts, from `time` on."""
        self._queue(time, 0, mr2, mr6, mr0)

    def watchdog_edge(self, time: cython.longlong) -> cython.void:
        """The watchdog line changed its level at `time`."""
        if not self.powered or time > self.power_off_ns:
            self._queue(time, 1, 0, 0, 0)  # the bridge gets its power back at this edge
            return
        # it keeps its power, as it would if the edge were kept until its time
        self.power_off_ns = time + self.watchdog_ns
        self.next_change_ns = self.power_off_ns
        if self.count > 0 and self.times[0] < self.next_change_ns:
            self.next_change_ns = self.times[0]

    def low_side(self, time: cython.longlong, enable2: cython.bint, enable6: cython.bint) -> cython.void:
        """The two low-side enables from `time` on."""
        self._queue(time, 2, enable2, enable6, 0)

    def _queue(
        self,
        time: cython.longlong,
        kind: cython.longlong,
        a: cython.longlong,
        b: cython.longlong,
        c: cython.longlong,
    ) -> cython.void:
        """Keep a change until its time; equal times keep their order of arrival."""
        i: cython.longlong
        if self.count == self.capacity:
            self._grow()
        i = self.count
        while i > 0 and self.times[i - 1] > time:
            self.times[i] = self.times[i - 1]
            self.kinds[i] = self.kinds[i - 1]
            self.values[3 * i] = self.values[3 * i - 3]
            self.values[3 * i + 1] = self.values[3 * i - 2]
            self.values[3 * i + 2] = self.values[3 * i - 1]
            i -= 1
        self.times[i] = time
        self.kinds[i] = kind
        self.values[3 * i] = a
        self.values[3 * i + 1] = b
        self.values[3 * i + 2] = c
        self.count += 1
        if self.times[0] < self.next_change_ns:
            self.next_change_ns = self.times[0]

    def _grow(self) -> None:
        self.capacity = 2 * self.capacity
        for name, width in (("times", 1), ("kinds", 1), ("values", 3)):
            old = getattr(self, name)
            grown = integers(width * self.capacity)
            for i, value in enumerate(old):
                grown[i] = value
            setattr(self, name, grown)

    def apply(self, time: cython.longlong) -> cython.void:
        """Let everything stamped up to and including `time` take effect, then judge the watchdog at `time`."""
        done: cython.longlong = 0
        i: cython.longlong
        kind: cython.longlong
        count: cython.longlong = self.count
        if time < self.next_change_ns:
            return
        while done < count and self.times[done] <= time:
            kind = self.kinds[done]
            i = 3 * done
            if kind == 0:
                self.mr2 = self.values[i]
                self.mr6 = self.values[i + 1]
                self.mr0 = self.values[i + 2]
            elif kind == 1:
                self.powered = True
                self.power_off_ns = self.times[done] + self.watchdog_ns
            else:
                self.enable2 = self.values[i] != 0
                self.enable6 = self.values[i + 1] != 0
            done += 1
        count -= done
        self.count = count
        if done > 0 and count > 0:
            for i in range(count):
                self.times[i] = self.times[i + done]
                self.kinds[i] = self.kinds[i + done]
            for i in range(3 * count):
                self.values[i] = self.values[i + 3 * done]
        self.next_change_ns = self.times[0] if count > 0 else 1 << 62
        if self.powered:
            if time >= self.power_off_ns:
                self.powered = False
                self.power_losses += 1
            elif self.power_off_ns < self.next_change_ns:
                self.next_change_ns = self.power_off_ns
        self._update()

    def _update(self) -> cython.void:
        """Duty and switching leads from the registers; a match value at or above MR0 is always on."""
        high2: cython.longlong = self.mr2
        high6: cython.longlong = self.mr6
        period: cython.longlong = self.mr0
        duty: cython.double
        first: cython.bint
        second: cython.bint
        self.is_open = not (self.powered and self.enable2 and self.enable6)
        if self.is_open or period <= 0:
            self.duty = 0.0
            self.ripple = 0.0
            self.switching_leads = 0
            self.sensed_lead_switches = False
            return
        first = 0 < high2 < period
        if high2 > period:
            high2 = period
        elif high2 < 0:
            high2 = 0
        second = 0 < high6 < period
        if high6 > period:
            high6 = period
        elif high6 < 0:
            high6 = 0
        duty = (high2 - high6) / period
        self.duty = duty
        if duty < 0.0:
            duty = -duty
        duty *= 1.0 - duty
        self.ripple = duty * duty
        self.sensed_lead_switches = first
        self.switching_leads = first + second
