"""What the tests of this package share: a chip whose tasks write down when they ran."""

from typing import NamedTuple

from ranger_sim.firmware_sim.activity import ACTIVITY_COLUMNS, ActivityLog
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.scheduler import Schedule, Task

FULL_SPEED_HZ = 60_000_000
TICK_CYCLES = 85  # latency 25 and cost 60 of the slot timer's interrupt
TICK_NS = 1_416  # 85 cycles at 60 MHz, rounded down


class Log:
    """Tasks and handlers that note (name, time), and the chip they run on."""

    def __init__(self, crystal=None, hz=FULL_SPEED_HZ):
        self.chip = Microcontroller("TEST", hz, crystal)
        self.entries = []

    def function(self, name, items=None):
        def run(queue=None):
            self.entries.append((name, self.chip.now))
            return items

        return run

    def task(self, name, cost, limit=0, **more):
        return Task(self.function(name), cost=cost, limit=limit, name=name, **more)

    def start(self, phase_ns=0, **table):
        self.chip.start(Schedule(**table), phase_ns)
        return self.chip.scheduler

    def names(self):
        return [name for name, _ in self.entries]

    def times(self, name):
        return [time for what, time in self.entries if what == name]


class Row(NamedTuple):
    """A row of an activity log."""

    kind: int
    number: int
    start: int
    end: int
    cycles: int
    latency: int
    row: int
    items: int


def kept(chip, rows=4096):
    """A new activity log of `chip`."""
    log = ActivityLog(rows)
    chip.keep_activity(log)
    return log


def rows_of(log):
    """The rows that `log` keeps, as tuples with names."""
    numbers = log.newest()
    return [Row(*numbers[at : at + ACTIVITY_COLUMNS]) for at in range(0, len(numbers), ACTIVITY_COLUMNS)]


class Raiser(Peripheral):
    """A peripheral that requests an interrupt when its alarm is due."""

    def __init__(self, chip, source):
        Peripheral.__init__(self, chip)
        self.source = source
        self.alarm = chip.new_alarm(self, 0)

    def on_alarm(self, alarm, time):
        self.chip.request(self.source)


def raise_at(chip, source, time):
    """Let `source` be requested at `time`."""
    Raiser(chip, source).alarm.set(time)
