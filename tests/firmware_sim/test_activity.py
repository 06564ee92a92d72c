"""The activity log: schedules worked out by hand, and the same robot with a log and without."""

import array

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.firmware_sim.activity import (
    ACTIVITY_COLUMNS,
    INTERRUPT_RAN,
    MAIN_LOOP_RAN,
    SLOT_BEGAN,
    SLOT_ENDED,
    SLOT_OVERRAN,
    TASK_DROPPED,
    TASK_RAN,
    WAIT_RAN,
    ActivityLog,
)
from ranger_sim.firmware_sim.scheduler import Task, Wait
from ranger_sim.firmware_sim.vic import ADC_DONE, EXTERNAL_INTERRUPT, FIQ, SPI_DONE
from tests.examples import examples
from tests.firmware_sim.board import TICK_CYCLES, TICK_NS, Log, kept, raise_at, rows_of
from tests.firmware_sim.workload import run

# 60 cycles are 1000 ns; sources of these tests have latency 0 unless told otherwise, so instants stay round


def attach(log, kind, slot, name, cost, latency=0):
    return log.chip.vic.attach(kind, 1, log.function(name), cost=cost, slot=slot, latency=latency)


def of_kind(log, kind):
    return [row for row in rows_of(log) if row.kind == kind]


def test_a_quiet_slot_has_its_begin_its_tick_its_tasks_and_its_end():
    log = Log()
    log.start(rows=((log.task("a", 600), log.task("b", 1200, item="edge")), ()), phase_ns=10_000)
    activity = kept(log.chip)
    log.chip.advance(500_000)
    a = 10_000 + TICK_NS
    assert rows_of(activity) == [
        (SLOT_BEGAN, 1, 10_000, 10_000, 0, 0, 0, 2),
        (INTERRUPT_RAN, log.chip.tick_source.number, 10_000, a, TICK_CYCLES, 416, 0, 0),  # latency of 25 cycles
        (TASK_RAN, 0, a, a + 10_000, 600, 0, 0, 0),
        (TASK_RAN, 1, a + 10_000, a + 30_000, 1200, 0, 0, 0),
        (SLOT_ENDED, 1, 10_000, a + 30_000, TICK_CYCLES + 1800 - 1, 0, 0, 0),  # 1 by rounding down ns
    ]
    assert [task.name for task in log.chip.legend().tasks] == ["a", "b"]
    assert log.chip.legend().interrupts[log.chip.tick_source.number].name == "slot timer"


def test_an_interrupt_at_the_end_of_a_task_is_behind_it_and_not_in_it():
    log = Log()
    log.start(rows=((log.task("a", 600),), ()), phase_ns=10_000)
    activity = kept(log.chip)
    source = attach(log, ADC_DONE, 0, "handler", cost=60)
    end = 10_000 + TICK_NS + 10_000
    raise_at(log.chip, source, end)
    log.chip.advance(500_000)
    [task] = [row for row in rows_of(activity) if row.kind == TASK_RAN]
    assert (task.start, task.end) == (10_000 + TICK_NS, end)
    [service] = [row for row in rows_of(activity) if row.kind == INTERRUPT_RAN and row.number == source.number]
    assert service.start == end


def test_items_and_spent_cycles_are_in_a_tasks_row():
    log = Log()

    def busy():
        log.chip.spend(40)
        return 7

    log.start(every=(Task(busy, cost=100, per_item=10, item="frame"),))
    activity = kept(log.chip)
    log.chip.advance(100_000)
    (row,) = of_kind(activity, TASK_RAN)
    assert (row.cycles, row.items) == (100 + 70 + 40, 7)
    assert row.end - row.start == 3_500


def test_a_task_lasts_as_long_as_what_interrupts_it_and_costs_only_its_own():
    log = Log()
    log.start(every=(log.task("a", 6000), log.task("b", 60)))
    source = attach(log, EXTERNAL_INTERRUPT, 1, "irq", cost=35, latency=25)
    raise_at(log.chip, source, 50_000)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    a, b = of_kind(activity, TASK_RAN)
    irq = of_kind(activity, INTERRUPT_RAN)[-1]
    assert (a.start, a.end, a.cycles) == (TICK_NS, TICK_NS + 101_000, 6000)
    assert (irq.start, irq.end, irq.cycles, irq.latency) == (50_000, 51_000, 60, 416)
    assert b.start == a.end


def test_an_irq_lasts_as_long_as_the_fiq_in_it_and_the_waiting_one_has_the_latency():
    log = Log()
    log.start(every=(log.task("a", 6000),))
    irq = attach(log, EXTERNAL_INTERRUPT, 1, "irq", cost=600)
    waits = attach(log, ADC_DONE, 3, "waits", cost=60)
    fiq = attach(log, SPI_DONE, FIQ, "fiq", cost=120)
    for source, time in ((irq, 50_000), (waits, 51_000), (fiq, 55_000)):
        raise_at(log.chip, source, time)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    rows = {row.number: row for row in of_kind(activity, INTERRUPT_RAN)}
    assert rows[fiq.number][2:6] == (55_000, 57_000, 120, 0)
    assert rows[irq.number][2:6] == (50_000, 62_000, 600, 0)
    assert rows[waits.number][2:6] == (62_000, 63_000, 60, 11_000)
    (a,) = of_kind(activity, TASK_RAN)
    assert a.end - a.start == 100_000 + 13_000


def test_a_request_that_merges_keeps_the_latency_of_the_first():
    log = Log()
    log.start(phase_ns=300_000)
    fiq = attach(log, SPI_DONE, FIQ, "fiq", cost=6000)
    irq = attach(log, EXTERNAL_INTERRUPT, 1, "irq", cost=60)
    for source, time in ((fiq, 1_000), (irq, 10_000), (irq, 20_000)):
        raise_at(log.chip, source, time)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    assert [row.latency for row in of_kind(activity, INTERRUPT_RAN) if row.number == irq.number] == [91_000]


def test_a_handler_that_asks_for_itself_again_has_its_own_latency_each_time():
    log = Log()
    log.start(phase_ns=300_000)

    def again(queue):
        if len(log.entries) < 2:
            log.entries.append(("again", log.chip.now))
            log.chip.request(source)

    source = log.chip.vic.attach(EXTERNAL_INTERRUPT, 1, again, cost=575, slot=1, latency=25)
    raise_at(log.chip, source, 1_000)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    rows = [row for row in of_kind(activity, INTERRUPT_RAN) if row.number == source.number]
    # served one after another: asked for at the handler's start, 416 ns in; served when that one is over
    assert [(row.start, row.latency) for row in rows] == [(1_000, 416), (11_000, 10_000), (21_000, 10_000)]


def test_a_wait_that_spins_counts_its_spinning_and_not_what_interrupted_it():
    log = Log()
    done = []
    log.start(every=(Wait(lambda: bool(done), cost=60, name="wait"), log.task("after", 60)))
    source = log.chip.vic.attach(
        EXTERNAL_INTERRUPT, 1, lambda queue: done.append(1), cost=600, slot=1, latency=0, name="done"
    )
    raise_at(log.chip, source, 50_000)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    (wait,) = of_kind(activity, WAIT_RAN)
    assert (wait.start, wait.end) == (TICK_NS, 61_000)  # 50 us, the interrupt's 10, its own 1
    span = (50_000 - TICK_NS) * 60 // 1000
    assert wait.items == pytest.approx(span, abs=1)
    assert wait.cycles == wait.items + 60
    (after,) = of_kind(activity, TASK_RAN)
    assert after.start == wait.end


def test_an_overrun_shows_the_slot_what_it_dropped_and_when_it_ended():
    log = Log()
    log.start(rows=((log.task("long", 36_000), log.task("x", 60), log.task("y", 60)), (log.task("next", 60),)))
    activity = kept(log.chip)
    log.chip.advance(1_000_000)
    rows = rows_of(activity)
    assert [(row.kind, row.number) for row in rows if row.kind != INTERRUPT_RAN] == [
        (SLOT_BEGAN, 1),
        (TASK_DROPPED, 1),
        (TASK_DROPPED, 2),
        (SLOT_OVERRAN, 1),
        (SLOT_BEGAN, 2),
        (TASK_RAN, 0),
        (SLOT_ENDED, 1),
        (TASK_RAN, 3),
        (SLOT_ENDED, 2),
    ]
    (overran,) = of_kind(activity, SLOT_OVERRAN)
    assert overran[2:] == (0, 500_000, 0, 0, 0, 2)
    first, second = of_kind(activity, SLOT_ENDED)
    assert (first.start, first.end, first.row, first.items) == (0, 600_000 + 2 * TICK_NS, 0, 1)
    assert (second.start, second.row, second.items) == (500_000, 1, 0)


def test_a_slot_that_was_dropped_as_a_whole_has_no_end():
    log = Log()
    log.start(rows=((log.task("long", 70_000),), (log.task("a", 60),), (log.task("c", 60),)))
    activity = kept(log.chip)
    log.chip.advance(1_500_000)
    assert [(row.number, row.row, row.items) for row in of_kind(activity, SLOT_OVERRAN)] == [(1, 0, 0), (2, 1, 1)]
    assert [(row.number, row.row) for row in of_kind(activity, SLOT_ENDED)] == [(1, 0), (3, 2)]
    assert [row.number for row in of_kind(activity, TASK_DROPPED)] == [1]


def test_a_wait_over_a_tick_belongs_to_the_row_that_it_began_in():
    log = Log()
    done = []
    log.start(rows=((Wait(lambda: bool(done), name="wait"),), (log.task("next", 60),)))
    source = log.chip.vic.attach(EXTERNAL_INTERRUPT, 1, lambda queue: done.append(1), cost=60, slot=1, latency=0)
    raise_at(log.chip, source, 600_000)
    activity = kept(log.chip)
    log.chip.advance(900_000)
    assert [row.row for row in of_kind(activity, WAIT_RAN)] == [0]
    assert [(row.number, row.items) for row in of_kind(activity, SLOT_ENDED)] == [(1, 1), (2, 0)]


def test_an_entry_of_an_occasional_list_lies_in_its_lists_row():
    log = Log()
    log.start(rows=((log.task("a", 60),),), occasional=(log.task("one", 600),))
    activity = kept(log.chip)
    log.chip.advance(900_000)  # two slots: the entry, then the idle call
    names = [task.name for task in log.chip.legend().tasks]
    ran = [(names[row.number], row.cycles) for row in of_kind(activity, TASK_RAN)]
    assert ran == [("a", 60), ("one", 600), ("occasional", 20), ("a", 60), ("occasional", 20)]
    _, one, chooser, _, idle = of_kind(activity, TASK_RAN)
    assert (one.start, one.end) == (chooser.start, chooser.end) and one.end - one.start == 10_333
    assert idle.end - idle.start == 333


def test_turns_of_the_main_loop_are_there_and_end_where_the_processor_became_idle():
    log = Log()
    log.start(phase_ns=100_000)
    turns = [30_000]

    def main_loop():
        return log.chip.now + turns.pop() if turns else 0

    log.chip.background = main_loop
    raise_at(log.chip, attach(log, EXTERNAL_INTERRUPT, 1, "irq", cost=600), 10_000)
    raise_at(log.chip, attach(log, ADC_DONE, 2, "later", cost=60), 80_000)
    activity = kept(log.chip)
    log.chip.advance(400_000)
    (turn,) = of_kind(activity, MAIN_LOOP_RAN)
    assert (turn.start, turn.end, turn.cycles) == (0, 40_000, 1800)


def test_the_ring_keeps_the_newest_rows_and_sinks_get_all():
    log = ActivityLog(4)
    blocks = []
    for number in range(3):
        log.put(TASK_RAN, number, 0, number, 0, 0, 0, 0)
    log.add_sink(lambda time, rows: blocks.append((time, array.array("q", rows)[1::ACTIVITY_COLUMNS].tolist())))
    for number in range(3, 10):
        log.put(TASK_RAN, number, 0, number, 0, 0, 0, 0)
    assert [row.number for row in rows_of(log)] == [6, 7, 8, 9]
    log.flush()
    log.flush()
    assert blocks == [(3, [3]), (7, [4, 5, 6, 7]), (9, [8, 9])]
    assert log.written == 10


def test_before_a_slot_of_which_nothing_was_written_the_ring_is_empty():
    assert rows_of(ActivityLog(4)) == []


def test_a_log_that_is_taken_off_gets_no_more_rows():
    log = Log()
    log.start(every=(log.task("a", 60),))
    activity = kept(log.chip)
    log.chip.advance(400_000)
    before = activity.written
    log.chip.keep_activity(None)
    log.chip.advance(3_000_000)
    assert before > 0 and activity.written == before


@pytest.mark.parametrize("seed", [1, 2])
def test_a_busy_board_does_the_same_with_a_log_and_without(seed):
    """Every time of every task and handler, every message, and the final records."""
    log = ActivityLog()
    assert run(seed, 20_000_000, log)[0] == run(seed, 20_000_000)[0]
    assert log.written > 1000


@settings(max_examples=examples(10))
@given(st.integers(1, 1000))
def test_rows_nest_and_account_for_every_cycle_of_a_busy_board(seed):
    """An oracle that shares no code: sweep over the rows with a stack, and add up who had the processor."""
    log = ActivityLog()
    board = run(seed, 20_000_000, log)[1]
    kinds = (TASK_RAN, WAIT_RAN, INTERRUPT_RAN)
    rows = sorted((row for row in rows_of(log) if row.kind in kinds), key=lambda row: (row.start, -row.end))
    stack, inside_ns = [], {}
    for at, row in enumerate(rows):
        while stack and rows[stack[-1]].end <= row.start:
            stack.pop()
        inside_ns[at] = 0
        if stack:
            outer = rows[stack[-1]]
            assert row.end <= outer.end, "two rows overlap by halves"
            if (row.start, row.end) != (outer.start, outer.end):  # not an entry in its list
                inside_ns[stack[-1]] += row.end - row.start
        stack.append(at)
    same_interval = {}
    for at, row in enumerate(rows):
        if row.kind != INTERRUPT_RAN:
            same_interval.setdefault((row.start, row.end), []).append(at)
    for at, row in enumerate(rows):
        if row.kind == INTERRUPT_RAN:
            own = row.end - row.start - inside_ns[at]
            assert own == int(row.cycles * board.ns_per_cycle)
            assert row.latency >= 0
    for (start, end), places in same_interval.items():
        own = end - start - sum(inside_ns[at] for at in places)
        # each task's time is rounded down, and a wait's cycles once more
        assert own * board.cycles_per_ns == pytest.approx(sum(rows[at].cycles for at in places), abs=3)
    # and what the board itself counted: the same sums
    for number, task in enumerate(board.scheduler.tasks):
        mine = [row for row in rows if row.kind in (TASK_RAN, WAIT_RAN) and row.number == number]
        assert len(mine) - task.calls in (0, -1)  # one may not be through
