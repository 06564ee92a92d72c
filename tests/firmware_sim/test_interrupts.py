"""Interrupts: who goes first, what waits, whose cycles are stolen."""

import pytest

from ranger_sim.firmware_sim.peripherals.timer_capture import TimerCapture
from ranger_sim.firmware_sim.scheduler import Task
from ranger_sim.firmware_sim.vic import ADC_DONE, EXTERNAL_INTERRUPT, FIQ, SOFTWARE, SPI_DONE, InterruptController
from ranger_sim.foundation.events import CAN_RX, PIN_EDGE, STAGE_BUS, STAGE_PINS, UART_BYTE, EventQueue
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.board import TICK_NS, Log, raise_at

# Sources of these tests steal 60 cycles = 1000 ns unless told otherwise; latency 0 keeps instants round.


def attach(log, kind, index, slot, name, cost=60, latency=0, **more):
    return log.chip.vic.attach(kind, index, log.function(name), cost=cost, slot=slot, latency=latency, **more)


def test_an_interrupt_is_served_after_its_latency_and_lengthens_the_task_it_meets():
    log = Log()
    log.start(every=(log.task("a", 6000), log.task("b", 60)))
    source = attach(log, EXTERNAL_INTERRUPT, 1, 1, "irq", cost=35, latency=25)
    raise_at(log.chip, source, 50_000)
    log.chip.advance(400_000)
    assert log.entries == [("a", TICK_NS), ("irq", 50_416), ("b", TICK_NS + 100_000 + 1000)]
    assert source.total_cycles == 60


def test_an_interrupt_of_an_idle_chip_delays_nothing():
    log = Log()
    log.start(phase_ns=100_000, every=(log.task("a", 60),))
    raise_at(log.chip, attach(log, EXTERNAL_INTERRUPT, 1, 1, "irq"), 50_000)
    log.chip.advance(400_000)
    assert log.entries == [("irq", 50_000), ("a", 100_000 + TICK_NS)]


def test_irqs_do_not_nest_and_the_lowest_slot_goes_first():
    log = Log()
    first = attach(log, ADC_DONE, 0, 3, "slot 3", cost=600)
    low = attach(log, SPI_DONE, 0, 10, "slot 10")
    high = attach(log, EXTERNAL_INTERRUPT, 1, 0, "slot 0")
    raise_at(log.chip, first, 10_000)
    raise_at(log.chip, low, 12_000)
    raise_at(log.chip, high, 15_000)
    log.chip.advance(400_000)
    assert log.entries == [("slot 3", 10_000), ("slot 0", 20_000), ("slot 10", 21_000)]


def test_what_a_task_asks_for_is_served_when_it_asks_and_not_when_its_row_began():
    log = Log()
    source = attach(log, EXTERNAL_INTERRUPT, 1, 1, "irq")

    def ask():
        log.entries.append(("asks", log.chip.now))
        log.chip.request(source)

    log.start(every=(log.task("a", 6000), log.task("b", 600), Task(ask, cost=60), log.task("after", 60)))
    log.chip.advance(400_000)
    asked = TICK_NS + 110_000
    assert log.entries[2:] == [("asks", asked), ("irq", asked), ("after", asked + 2_000)]


def test_requests_of_one_time_are_served_by_priority():
    log = Log()
    attach(log, CAN_RX, 1, 0, "slot 0")
    attach(log, UART_BYTE, 0, 3, "slot 3")
    attach(log, PIN_EDGE, 5, FIQ, "fiq")
    log.chip.inbox.push(1000, STAGE_PINS * 256, UART_BYTE, 0, 65)
    log.chip.inbox.push(1000, STAGE_BUS * 256, CAN_RX, 1, 7)
    log.chip.inbox.push(1000, STAGE_BUS * 256 + 1, PIN_EDGE, 5, 1, -1)
    log.chip.advance(400_000)
    assert log.entries == [("fiq", 1000), ("slot 0", 2000), ("slot 3", 3000)]


def test_the_fiq_pre_empts_an_irq_and_both_lengthen_the_task():
    log = Log()
    log.start(every=(log.task("a", 6000), log.task("b", 60)))
    irq = attach(log, EXTERNAL_INTERRUPT, 1, 1, "irq", cost=600)
    waits = attach(log, ADC_DONE, 0, 3, "waits")
    fiq = attach(log, SPI_DONE, 0, FIQ, "fiq", cost=120)
    raise_at(log.chip, irq, 50_000)
    raise_at(log.chip, waits, 51_000)
    raise_at(log.chip, fiq, 55_000)
    log.chip.advance(400_000)
    assert log.entries == [
        ("a", TICK_NS),
        ("irq", 50_000),
        ("fiq", 55_000),
        ("waits", 62_000),
        ("b", TICK_NS + 100_000 + 13_000),
    ]


def test_fiq_sources_do_not_interrupt_each_other_and_go_in_attaching_order():
    log = Log()
    first = attach(log, SPI_DONE, 0, FIQ, "first", cost=600)
    second = attach(log, ADC_DONE, 0, FIQ, "second")
    third = attach(log, EXTERNAL_INTERRUPT, 1, FIQ, "third")
    raise_at(log.chip, first, 1_000)
    raise_at(log.chip, third, 2_000)
    raise_at(log.chip, second, 3_000)
    log.chip.advance(400_000)
    assert log.entries == [("first", 1_000), ("second", 11_000), ("third", 12_000)]


def test_a_second_request_of_a_waiting_source_merges_with_the_first():
    log = Log()
    fiq = attach(log, SPI_DONE, 0, FIQ, "fiq", cost=6000)
    irq = attach(log, EXTERNAL_INTERRUPT, 1, 1, "irq")
    raise_at(log.chip, fiq, 1_000)
    raise_at(log.chip, irq, 10_000)
    raise_at(log.chip, irq, 20_000)
    log.chip.advance(400_000)
    assert log.names() == ["fiq", "irq"]
    assert (irq.requests, irq.merged, irq.served) == (2, 1, 1)


def test_a_message_that_no_peripheral_stores_waits_one_deep_and_a_newer_one_overwrites_it():
    log = Log()
    seen = []
    fiq = attach(log, SPI_DONE, 0, FIQ, "fiq", cost=6000)
    source = log.chip.vic.attach(
        UART_BYTE, 1, lambda queue: seen.append((queue.time, queue.kind, queue.a, queue.b)), cost=60, slot=3
    )
    raise_at(log.chip, fiq, 1_000)
    for time, byte in ((10_000, 1), (20_000, 2)):
        log.chip.inbox.push(time, 0, UART_BYTE, 1, byte)
    log.chip.advance(400_000)
    log.chip.inbox.push(500_000, 0, UART_BYTE, 1, 3)
    log.chip.advance(600_000)
    assert seen == [(20_000, UART_BYTE, 1, 2), (500_000, UART_BYTE, 1, 3)]
    assert source.merged == 1


def test_messages_without_a_taker_are_counted():
    log = Log()
    log.chip.inbox.push(10, 0, CAN_RX, 2, 5)
    log.chip.inbox.push(10, 0, PIN_EDGE, 9, 1, -1)
    log.chip.advance(1_000)
    assert log.chip.unclaimed == 1  # the edge moved its pin, which is all that an edge must do
    assert log.chip.pins[9] == 1


def test_a_handlers_items_and_spent_cycles_are_stolen_too():
    log = Log()
    log.start(every=(log.task("a", 6000), log.task("b", 60)))

    def handler(queue):
        log.chip.spend(100)
        return 4

    source = log.chip.vic.attach(ADC_DONE, 0, handler, cost=60, per_item=50, slot=3, latency=0)
    raise_at(log.chip, source, 50_000)
    log.chip.advance(400_000)
    assert source.total_cycles == source.max_cycles == 360
    assert log.times("b") == [TICK_NS + 100_000 + 6_000]


def test_a_slot_of_interrupts_beyond_its_length_overruns_although_its_tasks_are_short():
    log = Log()
    scheduler = log.start(every=(log.task("a", 6000), log.task("b", 600)))
    attach(log, PIN_EDGE, 3, FIQ, "edge", cost=540)
    for edge in range(50):
        log.chip.inbox.push(10_000 + edge * 9_500, 0, PIN_EDGE, 3, edge & 1, -1)
    log.chip.advance(501_000)
    assert scheduler.overruns == 1
    assert log.times("b") == []


def test_a_tick_behind_a_long_interrupt_starts_its_slot_late_but_the_count_runs_from_the_match():
    log = Log()
    counts = []
    log.start(phase_ns=100_000, every=(log.task("a", 60),))
    log.chip.scheduler.replace("a", lambda: counts.append(log.chip.cycles_since_tick()))
    raise_at(log.chip, attach(log, ADC_DONE, 0, 0, "long", cost=6000), 90_000)
    log.chip.advance(400_000)
    # 90 us of the handler lie after the match, then come the 85 cycles of the tick
    assert 5400 + 84 <= counts[0] <= 5400 + 85


def test_the_slot_timer_can_be_in_any_slot_and_on_the_fiq():
    for slot in (0, 15, FIQ):
        log = Log()
        log.start(every=(log.task("a", 60),), tick_slot=slot, tick_latency=0)
        log.chip.advance(1_000)
        log.chip.advance(2_000)
        assert log.entries == [("a", 1000)]


@pytest.mark.parametrize(
    "arguments, reported",
    [
        (dict(slot=16, handler=print, cost=1), "slot 16"),
        (dict(slot=0, handler=None, cost=1), "cannot be called"),
        (dict(slot=0, handler=print, cost=-1), "negative"),
        (dict(slot=4, handler=print, cost=1), "is taken by taker"),
    ],
)
def test_a_faulty_attachment_is_refused(arguments, reported):
    vic = InterruptController()
    vic.attach(SOFTWARE, 1, print, cost=1, slot=4, name="taker")
    with pytest.raises(UserError, match=reported):
        vic.attach(SOFTWARE, 2, **arguments)


def test_a_source_can_be_attached_anew_and_taken_out():
    log = Log()
    source = attach(log, ADC_DONE, 0, 3, "old")
    assert attach(log, ADC_DONE, 0, FIQ, "new") is source
    log.chip.request(source)
    log.chip.advance(1_000)
    assert log.names() == ["new"]
    log.chip.request(source)
    log.chip.vic.detach(source)
    log.chip.request(source)
    log.chip.advance(10_000)
    assert log.names() == ["new"]
    assert source.forgotten == 1  # the request that waited
    attach(log, ADC_DONE, 0, FIQ, "again")
    log.chip.vic.detach(source)
    assert source.forgotten == 1  # none did


def test_a_message_that_waits_for_its_service_is_given_back_whole():
    log = Log()
    source = attach(log, ADC_DONE, 0, 3, "handler")
    came, seen = EventQueue(), EventQueue()
    came.push(1_000, 2, ADC_DONE, 3, 4, 5, 6, 7, 8, log)
    assert came.take()
    source.keep_message(came)
    source.give_message(seen)
    assert (seen.time, seen.order, seen.kind) == (1_000, 2, ADC_DONE)
    assert (seen.a, seen.b, seen.c, seen.d, seen.e, seen.f, seen.ref) == (3, 4, 5, 6, 7, 8, log)


# --- the story of the encoder interrupts (appendix 4.6) ----------------------------------------------------

# 6300 turns/min of a 512-line encoder, both edges of channel A: 107,520 edges/s, one every 558 cycles.
MOTOR_EDGES_PER_S = 6300 * 512 * 2 // 60
# The joint behind a 34:1 gearhead turns at 185.3 turns/min; 2048 lines, both edges: 12,650 edges/s.
JOINT_EDGES_PER_S = round(6300 / 34 * 2048 * 2 / 60)


class TwoEncoders:
    """Two counters that share one FIQ, each `handler_cycles` per edge, for a tenth of a second."""

    def __init__(self, handler_cycles, duration_ns=100_000_000):
        self.log = Log()
        chip = self.log.chip
        self.scheduler = self.log.start(every=(self.log.task("work", 6_000),))
        self.timer = TimerCapture(chip, number=0, period=30_000)
        self.counts = [0, 0]
        for which, (channel, pin, partner) in enumerate(((0, 22, 27), (2, 16, 29))):
            self.timer.use_channel(channel, pin)
            chip.vic.attach(
                PIN_EDGE,
                pin,
                self.counter(which, channel),
                cost=handler_cycles - 12,
                slot=FIQ,
                latency=12,  # the appendix counts the cycles of a whole call
            )
            rate = (MOTOR_EDGES_PER_S, JOINT_EDGES_PER_S)[which]
            for edge in range(1, duration_ns * rate // 1_000_000_000):
                chip.inbox.push(edge * 1_000_000_000 // rate, 256, PIN_EDGE, pin, edge & 1, partner, 0)
        self.edges = chip.inbox.count
        chip.advance(duration_ns)

    def counter(self, which, channel):
        def handler(queue):
            self.counts[which] += 1
            self.timer.clear(16 << channel)

        return handler


def test_the_encoder_rates_are_those_of_the_appendix():
    assert MOTOR_EDGES_PER_S == 107_520
    assert 60_000_000 // MOTOR_EDGES_PER_S == 558


def test_a_500_cycle_handler_overruns_and_loses_counts_at_full_motor_speed():
    slow = TwoEncoders(500)
    # 120,170 edges/s of 500 cycles ask for 100.14 % of the processor: the encoder served last loses the rest
    assert list(slow.timer.lost) == [0, 0, 17, 0]
    assert sum(slow.counts) == slow.edges - 17
    assert slow.scheduler.overruns > 0
    assert slow.scheduler.run_tasks == 1  # the first task of the first slot never ends
    assert slow.log.chip.tick_source.merged > 190  # and of 200 ticks hardly one is even noticed


def test_a_150_cycle_handler_keeps_every_count_and_every_slot_in_time():
    fast = TwoEncoders(150)
    assert sum(fast.counts) == fast.edges
    assert list(fast.timer.lost) == [0, 0, 0, 0]
    assert fast.scheduler.overruns == 0
    # 120,170 edges/s of 150 cycles are 30 % of the processor
    stolen = sum(source.total_cycles for source in fast.log.chip.vic.fiq_list)
    assert stolen / 6_000_000 == pytest.approx(0.3004, abs=0.0005)
