"""Edges that a chip reads where the sensor wrote them: the same as if each were a message."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.firmware_sim.microcontroller import Microcontroller
from ranger_sim.firmware_sim.peripheral import Peripheral
from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import CAN_RX, NEVER, PIN_EDGE
from ranger_sim.foundation.user_error import UserError
from tests.examples import examples
from tests.firmware_sim.board import kept, rows_of

PINS = ((22, 27), (16, 29))  # channels A and B of two encoders
PINS_ORDER = 256  # stage pins
STEP_NS = 125_000


class Note(Peripheral):
    """Writes down when it rings."""

    def __init__(self, chip, notes):
        Peripheral.__init__(self, chip)
        self.notes = notes
        self.alarm = chip.new_alarm(self, 0)

    def on_alarm(self, alarm, time):
        self.notes.append(("alarm", time))


class Bench:
    """A chip with two encoders on a timer, slots of two tasks and a frame interrupt; it writes down what happens.

    `second_slot`: where the second encoder's interrupt goes, None for nowhere. `recording`: with an activity log.
    `delay_ns`: after every edge of the first encoder an alarm rings, 0 for none.
    """

    def __init__(self, cost, second_slot=FIQ, recording=False, delay_ns=0):
        self.chip = chip = Microcontroller("TEST")
        self.timer = TimerCapture(chip, period=30_000)
        self.notes = []
        self.delay_ns = delay_ns
        self.alarm = Note(chip, self.notes).alarm
        for channel, (pin, partner) in enumerate(PINS):
            self.timer.use_channel(channel, pin)
            slot = second_slot if channel else FIQ
            if slot is not None:
                chip.vic.attach(PIN_EDGE, pin, self.edge(channel, pin, partner), cost=cost, slot=slot)
        chip.vic.attach(CAN_RX, 1, lambda queue: self.notes.append(("frame", chip.now, queue.b)), cost=700, slot=3)
        tasks = (Task(self.task("first"), cost=3_000), Task(self.task("second"), cost=2_000))
        chip.start(Schedule(slot_us=500, every=tasks), 7_000)  # so that ticks fall between the ends of steps
        self.activity = kept(chip) if recording else None

    def edge(self, channel, pin, partner):
        def served(queue):
            self.notes.append(
                (channel, self.chip.now, self.timer.CR(channel), self.chip.pins[pin], self.chip.pins[partner])
            )
            self.timer.clear(16 << channel)
            if self.delay_ns and channel == 0:
                self.alarm.set(self.chip.now + self.delay_ns)

        return served

    def task(self, name):
        return lambda: self.notes.append((name, self.chip.now, self.chip.pins[PINS[0][0]]))

    def outcome(self):
        timer = self.timer
        return (
            self.notes,
            list(timer.lost),
            [(each.served, each.merged, each.total_cycles) for each in self.chip.vic.sources.values()],
            self.chip.scheduler.total_slot_cycles,
            rows_of(self.activity) if self.activity is not None else None,
        )


def run(cost, trains, frames, by_lines, **bench):
    """Two milliseconds with the edges (time, level A, level B) of both encoders, in steps as a plant gives them."""
    bench = Bench(cost, **bench)
    buffers = [EdgeBuffer(1) for _ in PINS]
    if by_lines:
        for buffer, (pin, partner) in zip(buffers, PINS, strict=True):
            bench.chip.connect_edges(buffer, pin, partner)
    for time in frames:
        bench.chip.inbox.push(time, 512, CAN_RX, 1, time)
    for start in range(0, 2_000_000, STEP_NS):
        for train, buffer, (pin, partner) in zip(trains, buffers, PINS, strict=True):
            buffer.clear()
            for time, a, b in train:
                if start <= time < start + STEP_NS:
                    if by_lines:
                        buffer.push(time, a, b)
                    else:
                        bench.chip.inbox.push(time, PINS_ORDER, PIN_EDGE, pin, a, partner, b)
        bench.chip.note_edges()
        for part in range(1, 5):
            bench.chip.advance(start + part * STEP_NS // 4)
        assert all(buffer.read == buffer.count for buffer in buffers)
    return bench.outcome()


# anywhere, or closely around a tick and the tasks that follow it
instants = (
    st.integers(0, 1_999_999) | st.integers(490_000, 590_000) | st.sampled_from([500_000, 507_000, 507_001, 1_007_000])
)
trains = st.lists(st.tuples(instants, st.integers(0, 1), st.integers(0, 1)), min_size=5, max_size=40).map(
    lambda edges: sorted(edges, key=lambda edge: edge[0])
)

delays = st.sampled_from([0, 1, 4_000, 60_000])


@settings(max_examples=examples(150))
@given(st.sampled_from([10, 150, 500, 6_000]), trains, trains, st.lists(instants, max_size=6))
def test_edges_from_the_sensors_buffer_do_what_the_same_edges_do_as_messages(cost, first, second, frames):
    assert run(cost, (first, second), frames, True) == run(cost, (first, second), frames, False)


@settings(max_examples=examples(60))
@given(st.sampled_from([150, 500]), trains, trains, st.sampled_from([FIQ, 5, None]), st.booleans(), delays)
def test_it_is_so_too_with_other_interrupts_with_records_and_with_alarms(
    cost, first, second, slot, recording, delay_ns
):
    bench = dict(second_slot=slot, recording=recording, delay_ns=delay_ns)
    assert run(cost, (first, second), (), True, **bench) == run(cost, (first, second), (), False, **bench)


def test_a_handler_longer_than_the_time_between_edges_loses_captures_and_a_short_one_none():
    # appendix 4.6: 107,520 edges/s are 558 cycles apart; a second encoder shares the fast interrupt
    every_ns = 9_300
    fast = [(time, n & 1, 0) for n, time in enumerate(range(100, 2_000_000, every_ns))]
    slow = [(time, n & 1, 0) for n, time in enumerate(range(3_000, 2_000_000, 20_000))]
    assert sum(run(150, (fast, slow), (), True)[1]) == 0
    assert sum(run(500, (fast, slow), (), True)[1]) > 0


def test_an_edge_comes_before_a_frame_of_the_same_time_and_the_first_line_before_the_second():
    notes = run(10, ([(700_000, 1, 0)], [(700_000, 1, 1)]), (700_000,), True)[0]
    assert [note[0] for note in notes if note[1] in range(700_000, 712_000)] == [0, 1, "frame"]


def test_a_chip_with_edges_waiting_is_due_and_one_without_is_not():
    bench = Bench(150)
    buffer = EdgeBuffer()
    bench.chip.connect_edges(buffer, *PINS[0])
    bench.chip.advance(400_000)
    assert bench.chip.note_edges() == NEVER
    assert not bench.chip.due(450_000)
    buffer.push(440_000, 1, 0)
    assert bench.chip.note_edges() == 440_000
    assert bench.chip.due(450_000)


def test_edges_for_a_pin_that_is_not_claimed_are_refused():
    with pytest.raises(UserError, match="TEST: no peripheral has claimed pin 5"):
        Microcontroller("TEST").connect_edges(EdgeBuffer(), 5, 6)


def test_a_third_encoder_on_one_chip_is_refused():
    bench = Bench(150)
    bench.timer.use_channel(2, 9)
    for pin in (22, 16):
        bench.chip.connect_edges(EdgeBuffer(), pin, 27)
    with pytest.raises(UserError, match="TEST: pin 9 would be the third with the edges of an encoder"):
        bench.chip.connect_edges(EdgeBuffer(), 9, 27)


@pytest.mark.parametrize(("kind", "index"), [(32, 0), (-1, 0), (3, 16), (3, -1)])
def test_a_claim_outside_the_tables_is_refused(kind, index):
    chip = Microcontroller("TEST")
    with pytest.raises(UserError, match=f"TEST: kind {kind} is not 0 ... 31 or index {index} not 0 ... 15"):
        chip.claim(kind, index, Peripheral(chip))
