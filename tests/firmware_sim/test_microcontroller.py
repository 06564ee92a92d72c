"""What the microcontroller refuses when a board is put together, and in which order it takes what comes."""

import pytest

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.scheduler import Schedule
from ranger_sim.firmware_sim.vic import FIQ, SOFTWARE
from ranger_sim.foundation.events import NEVER, PIN_EDGE, PIN_OUTPUT, UART_BYTE
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.board import Log, raise_at


def test_only_peripherals_can_be_reached_from_outside():
    chip = Microcontroller("chip", 60_000_000, Crystal())
    for connect in (
        lambda: chip.claim(UART_BYTE, 1, object()),
        lambda: chip.claim_pin(3, 0, object()),
        lambda: chip.new_alarm(object(), 0),
    ):
        with pytest.raises(UserError, match="not a Peripheral"):
            connect()


class Bells(Peripheral):
    """Alarms that note when they ring, and of which one may set another in the middle of that."""

    def __init__(self, chip, count):
        Peripheral.__init__(self, chip)
        self.alarms = [chip.new_alarm(self, number) for number in range(count)]
        self.heard = []
        self.next = {}  # {number: (number of the other, its instant)}

    def on_alarm(self, alarm, time):
        self.heard.append((time, alarm))
        other, then = self.next.pop(alarm, (alarm, NEVER))
        if then > time:
            self.alarms[other].set(then)


def test_alarms_ring_in_the_order_of_their_times_and_then_of_their_making():
    dice = RandomStream(5, "alarms")
    for _ in range(200):
        chip = Microcontroller("chip", 60_000_000, Crystal())
        bells = Bells(chip, 1 + dice.integer(16))
        expected = {}
        for _ in range(dice.integer(40)):  # set, set again, taken back
            number = dice.integer(len(bells.alarms))
            expected[number] = [NEVER, *range(100, 112)][dice.integer(13)]
            first = bells.alarms[number].set(expected[number])
            assert first == chip.alarm_time == chip.next_time or first > chip.next_time
            assert first == min(expected.values())
        if expected:
            number = list(expected)[dice.integer(len(expected))]
            other, then = dice.integer(len(bells.alarms)), expected[number] + 1 + dice.integer(9)
            if other != number and then < expected.get(other, NEVER):
                bells.next[number] = other, then
        rung = []
        while expected and min(expected.values()) < NEVER:
            time, number = min((time, number) for number, time in expected.items())
            rung.append((time, number))
            expected[number] = NEVER
            if number in bells.next:
                other, then = bells.next[number]
                expected[other] = then
        chip.advance(1_000)
        assert bells.heard == rung


class Matches(Peripheral):
    """An alarm that notes when the slot timer matched last."""

    def on_alarm(self, alarm, time):
        self.found = self.chip.match_time


def test_at_one_time_the_slot_timer_matches_after_the_alarms_however_late_they_were_made():
    chip = Microcontroller("chip", 60_000_000, Crystal())
    chip.start(Schedule(slot_us=500), 0)
    matches = Matches(chip)
    chip.new_alarm(matches, 0).set(500_000)
    chip.advance(500_001)
    assert (matches.found, chip.match_time, chip.tick_time) == (0, 500_000, 1_000_000)
    with pytest.raises(UserError, match="more than 16"):
        Bells(chip, 16)


def test_an_unclaimed_message_waits_in_its_interrupt_source_or_is_counted():
    chip = Microcontroller("chip", 60_000_000, Crystal())
    seen = []
    chip.vic.attach(UART_BYTE, 1, lambda queue: seen.append((queue.kind, queue.a, queue.b)), cost=600)
    for time, byte in ((1_000, 65), (2_000, 66), (3_000, 67), (40_000, 68)):  # 66 and 67 come during the service of 65
        chip.inbox.push(time, 0, UART_BYTE, 1, byte)
    chip.inbox.push(50_000, 0, UART_BYTE, 2, 69)
    chip.inbox.push(50_000, 0, PIN_OUTPUT, 2, 1)  # kind 36: none of a message to a board
    chip.advance(100_000)
    assert seen == [(UART_BYTE, 1, 65), (UART_BYTE, 1, 67), (UART_BYTE, 1, 68)]
    assert chip.unclaimed == 2


def test_interrupts_of_one_time_are_served_after_all_inputs_of_that_time():
    chip = Microcontroller("chip", 60_000_000, Crystal())
    served = []
    for number, slot in ((0, 7), (1, FIQ), (2, 3)):
        source = chip.vic.attach(SOFTWARE, number, lambda queue, n=number: served.append(n), cost=60, slot=slot)
        raise_at(chip, source, 1_000)
    chip.advance(2_000_000)
    assert served == [1, 2, 0]


def test_an_edge_has_the_level_of_its_partner_pin_which_may_be_pin_0():
    log = Log()
    for partner, level in ((0, 1), (1, 1), (-1, 1)):  # -1: it has none
        log.chip.inbox.push(1_000, 0, PIN_EDGE, 9, 1, partner, level)
    log.chip.advance(2_000)
    assert [log.chip.pins[pin] for pin in (0, 1, 9)] == [1, 1, 1]
    assert log.chip.pins[2] == 0 and log.chip.pins[len(log.chip.pins) - 1] == 0
