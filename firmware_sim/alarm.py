# cython: boundscheck=False, wraparound=False
# (places in a chip's order of alarms lie between the one that never comes and the last one set)
"""Alarms of a chip: times set by peripherals, and those of the timer that steps the scheduler."""

import cython

from ranger_sim.firmware_sim.chip import ALARMS, Chip
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.vic import InterruptSource
from ranger_sim.foundation.events import NEVER


@cython.final
@cython.cclass
class Alarm:
    """An alarm of a chip: when it is due, `owner.on_alarm(number, time)` runs.

    The chip keeps the alarms that are set in the order of their times, the earliest one last; of two at the same time
    the one that was made first comes first.
    """

    chip: "Chip"
    owner: Peripheral
    number: cython.longlong
    place: cython.longlong
    time: cython.longlong

    def __init__(self, chip, owner: Peripheral, number, place) -> None:
        self.chip = chip
        self.owner = owner
        self.number = number
        self.place = place  # in the order of making
        self.time = NEVER

    @cython.ccall
    @cython.exceptval(check=False)
    def set(self, time: cython.longlong) -> cython.longlong:
        """Set it to `time` (ns); NEVER cancels it. Returns the time of the chip's first alarm."""
        at: cython.longlong = self.chip.alarms_set
        if self.time < NEVER:
            return self._set_again(time)
        self.time = time
        if time < NEVER:
            self.chip.alarms_set = at + 1
            while self.chip.alarm_times[at - 1] <= time and (
                self.chip.alarm_times[at - 1] < time or self.chip.alarm_places[at - 1] < self.place
            ):
                self._move(at - 1, at)
                at -= 1
            self.chip.alarm_times[at] = time
            self.chip.alarm_places[at] = self.place
            if time < self.chip.alarm_time:
                self.chip.alarm_time = time
                if time < self.chip.next_time:
                    self.chip.next_time = time
                if time < self.chip.stop_time:
                    self.chip.stop_time = time
        return self.chip.alarm_time

    @cython.cfunc
    @cython.exceptval(check=False)
    @cython.final
    def _set_again(self, time: cython.longlong) -> cython.longlong:
        """Move an alarm that is set already."""
        at: cython.longlong = 1
        while self.chip.alarm_places[at] != self.place:
            at += 1
        self.chip.alarms_set -= 1
        while at < self.chip.alarms_set:
            self._move(at + 1, at)
            at += 1
        self.chip.alarm_time = self.chip.alarm_times[at - 1]
        self.time = NEVER
        return self.set(time)

    @cython.cfunc
    @cython.final
    def _move(self, a: cython.longlong, b: cython.longlong) -> cython.void:
        """Move the alarm at `a` in the chip's order to `b`."""
        self.chip.alarm_times[b] = self.chip.alarm_times[a]
        self.chip.alarm_places[b] = self.chip.alarm_places[a]

    @cython.cfunc
    @cython.final
    def ring(self, time: cython.longlong) -> InterruptSource | None:
        """Run the owner's handler; this is the chip's first alarm, and due. Returns the handler's result."""
        self.chip.now = time
        self.chip.alarms_set -= 1
        self.chip.alarm_time = self.chip.alarm_times[self.chip.alarms_set - 1]
        self.time = NEVER
        if self.chip.waiting:
            self.chip.check_wait = True
            if self.chip.code_time < time:
                self.chip.code_time = time
        return self.owner.on_alarm(self.number, time)


@cython.final
@cython.cclass
class SlotTimer(Peripheral):
    """The timer whose match interrupt steps the scheduler; at equal times its alarm is the last."""

    alarm: Alarm

    def __init__(self, chip) -> None:
        Peripheral.__init__(self, chip)
        self.alarm = Alarm(chip, self, 0, ALARMS)

    def on_alarm(self, alarm: cython.longlong, time: cython.longlong) -> InterruptSource | None:
        """The timer matches and restarts."""
        self.chip.match_time = time
        self.chip.tick_time = self.chip.ticks.next()
        self.alarm.set(self.chip.tick_time)
        return self.chip.tick_source
