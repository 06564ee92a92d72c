"""A crystal that runs otherwise from a time on: slots, timers, cycles and serial lines go on at the new rate."""

import pytest

from ranger_sim.firmware_sim.clock import Crystal, TickTrain
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.peripherals.uart import Uart
from ranger_sim.firmware_sim.scheduler import Schedule, Task

SLOT_NS = 500_000


class Chip:
    """A chip whose slots note their starts; retuned at 10.1 ms, a fifth of a slot after a match."""

    def __init__(self, ppb):
        self.starts = []
        self.chip = Microcontroller("TEST", crystal=Crystal())
        self.timer = TimerCapture(self.chip, 0, period=30_000)
        self.uart = Uart(self.chip, 0, divisor=6)
        self.chip.start(Schedule(slot_us=500, every=(Task(self.note, cost=6000),)), 0)
        self.chip.advance(10_100_000)
        self.count = self.timer.count_at(10_100_000)
        self.chip.retune(ppb, 10_100_000)
        self.chip.advance(60_000_000)

    def note(self):
        self.starts.append(self.chip.now)


@pytest.mark.parametrize("ppb", [5_000_000, -5_000_000, 50_000_000])
def test_slots_are_as_long_as_the_new_rate_makes_them(ppb):
    one = Chip(ppb)
    assert one.starts[19] - one.starts[18] == SLOT_NS  # the last two whole slots before
    # what was left of the slot, 400 us, at the new rate; then whole slots, without an error that accumulates
    rate = 1 + ppb * 1e-9
    matches = [10_100_000 + (400_000 + n * SLOT_NS) / rate for n in range(90)]
    # from the match to the task: the interrupt's latency and cycles, some microseconds at either rate
    began = one.starts[21] - matches[0]
    assert 0 < began < 10_000
    for start, match in zip(one.starts[21:], matches, strict=False):
        assert start - match == pytest.approx(began, abs=2)  # whole ns, rounded down twice


def test_cycles_bytes_and_counts_take_as_long_as_the_new_rate_makes_them():
    one = Chip(10_000_000)  # 1 % fast: the largest that CAN stands
    assert one.chip.ns_per_cycle == pytest.approx(1e9 / 60e6 / 1.01)
    assert one.uart.byte_ns == pytest.approx(10 * 16 * 6 * 1e9 / 60e6 / 1.01, abs=1)
    # the count went on where it was, and gained one per cent since
    assert one.count == 6000
    assert one.timer.count_at(10_100_000 + 100_000) == pytest.approx(6000 + 6060, abs=1)
    # and so the timer's wraps: 60 MHz and 1 % over 30,000
    wraps = one.timer.wraps
    one.timer.count_at(110_000_000)
    assert one.timer.wraps - wraps == pytest.approx(99.8e-3 * 60.6e6 / 30_000, abs=1.0)


def test_a_crystal_that_is_retuned_to_what_it_was_keeps_its_slots():
    same, other = Chip(0), Chip(0)
    other.chip.retune(7_000_000, 60_000_000)
    other.chip.retune(0, 60_000_000)
    for one in (same, other):
        one.chip.advance(70_000_000)
    # two roundings of what was left of one slot
    assert all(abs(a - b) <= 2 for a, b in zip(same.starts, other.starts, strict=True))


def test_a_train_that_is_moved_has_its_present_tick_where_it_was_put():
    train = TickTrain(Crystal(ppb=123_456), 333_333, 17)
    for _ in range(1000):
        train.next()
    moved = train.moved(Crystal(ppb=-5_000_000), 400_000_000)
    assert (moved.number, moved.time) == (train.number, 400_000_000)
    assert moved.next() == pytest.approx(400_000_000 + 333_333 / 0.995, abs=1)
