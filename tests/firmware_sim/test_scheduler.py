"""The slot scheduler: known answers, one per rule of the table's semantics."""

import pytest

from ranger_sim.firmware_sim.activity import INTERRUPT_RAN, SLOT_ENDED, TASK_RAN, ActivityLog
from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.scheduler import Occasional, Schedule, Task, Wait
from ranger_sim.firmware_sim.vic import EXTERNAL_INTERRUPT
from ranger_sim.foundation.user_error import UserError
from tests.firmware_sim.board import TICK_CYCLES, TICK_NS, Log, kept, raise_at, rows_of


def test_before_its_first_tick_a_board_is_idle():
    log = Log()
    log.start(phase_ns=700_000, every=(log.task("a", 60),))
    assert log.chip.advance(700_000) == 700_000
    assert log.entries == []
    log.chip.advance(702_000)
    assert log.entries == [("a", 700_000 + TICK_NS)]


def test_a_slot_runs_the_common_tasks_then_the_row_then_the_closing_tasks():
    log = Log()
    log.start(
        every=(log.task("every", 600),),
        rows=((log.task("row 0", 600),), (log.task("row 1", 600),)),
        last=(log.task("last", 600),),
    )
    log.chip.advance(1_400_000)
    assert log.names() == ["every", "row 0", "last", "every", "row 1", "last", "every", "row 0", "last"]


def test_each_task_starts_when_the_cycles_of_the_one_before_are_over():
    log = Log()
    log.start(every=(log.task("a", 600), log.task("b", 1200), log.task("c", 60)))
    log.chip.advance(500_000)
    assert log.entries == [("a", TICK_NS), ("b", TICK_NS + 10_000), ("c", TICK_NS + 30_000)]
    assert log.chip.scheduler.max_slot_cycles == TICK_CYCLES - 1 + 600 + 1200 + 60  # 1 by rounding down ns


def test_items_and_spent_cycles_lengthen_a_task():
    log = Log()

    def busy():
        log.chip.spend(40)
        return 7

    task = Task(busy, cost=100, per_item=10, limit=500, item="frame")
    log.start(every=(task, log.task("next", 1)))
    log.chip.advance(400_000)
    assert task.last_cycles == task.max_cycles == task.total_cycles == 100 + 70 + 40
    assert log.times("next") == [TICK_NS + 3_500]


def test_an_overrun_lets_the_task_finish_drops_the_rest_and_starts_the_new_row_at_once():
    log = Log()
    scheduler = log.start(
        rows=(
            (log.task("long", 36_000), log.task("dropped 1", 60), log.task("dropped 2", 60)),
            (log.task("next row", 60),),
        ),
    )
    reported = []
    log.chip.on_overrun = lambda: reported.append(log.chip.now)
    log.chip.advance(1_000_000)
    assert log.names() == ["long", "next row"]
    # 600 us of work, prolonged by the tick's own interrupt, begun after the first one
    assert log.times("next row") == [TICK_NS + 600_000 + TICK_NS]
    assert (scheduler.overruns, scheduler.dropped_tasks, scheduler.slot_count) == (1, 2, 2)
    assert len(reported) == 1
    assert 500_000 <= reported[0] < 501_000


def test_an_overrun_is_counted_once_and_the_rows_go_on_in_step():
    log = Log()
    scheduler = log.start(
        rows=((log.task("long", 36_000),), (log.task("one", 60),), (log.task("two", 60),)),
    )
    log.chip.advance(1_500_000)
    assert log.names() == ["long", "one", "two"]
    assert (scheduler.overruns, scheduler.dropped_tasks) == (1, 0)
    assert scheduler.histogram[20] == 1
    assert sum(scheduler.histogram) == 3


def test_a_task_that_lasts_three_slots_overruns_twice_and_drops_whole_rows():
    log = Log()
    scheduler = log.start(
        rows=((log.task("long", 70_000),), (log.task("a", 60), log.task("b", 60)), (log.task("c", 60),)),
    )
    log.chip.advance(1_500_000)
    assert log.names() == ["long", "c"]
    assert (scheduler.overruns, scheduler.dropped_tasks) == (2, 2)


def test_a_row_that_ends_at_the_very_time_of_the_tick_has_overrun():
    for cost, overruns in ((29_939, 0), (29_940, 1)):
        log = Log()
        # latency 25 and cost 35 of the tick are 1 us, 29,940 cycles 499 us
        scheduler = log.start(every=(log.task("a", cost),), tick_cost=35)
        log.chip.advance(600_000)
        assert scheduler.overruns == overruns


def test_without_a_completion_flag_tasks_are_dropped_in_silence():
    log = Log()
    scheduler = log.start(rows=((log.task("long", 36_000), log.task("dropped", 60)), ()), completion_flag=False)
    reported = []
    log.chip.on_overrun = lambda: reported.append(1)
    log.chip.advance(1_000_000)
    assert log.names() == ["long"]
    assert reported == []
    assert scheduler.dropped_tasks == 1


def test_a_divider_of_two_starts_a_slot_at_every_second_timer_tick():
    log = Log()
    log.start(slot_us=2000, every=(log.task("a", 600),), divider=2)
    counts = []
    log.chip.on_timer_tick = lambda: counts.append(log.chip.now // 1_000_000)
    log.chip.advance(6_000_000)
    assert [time // 1_000_000 for time in log.times("a")] == [0, 2, 4]
    assert counts == [0, 1, 2, 3, 4, 5]


def test_with_a_divider_the_cycle_count_folds_at_every_timer_tick():
    log = Log(hz=208_000_000)
    seen = []
    log.start(
        slot_us=2000,
        every=(log.task("long", 1_500 * 208), Task(lambda: seen.append(log.chip.cycles_since_tick()), cost=1)),
        divider=2,
    )
    log.chip.advance(2_000_000)
    # 1.5 ms and two timer interrupts of 85 cycles into the slot, the 1 ms timer shows 0.5 ms and those two
    assert 500 * 208 + 168 <= seen[0] <= 500 * 208 + 170


def test_the_occasional_list_of_three_has_a_period_of_four_calls():
    log = Log()
    log.start(occasional=tuple(log.task(name, 60) for name in "xyz"))
    log.chip.advance(9 * 500_000)
    assert log.names() == ["x", "y", "z", "x", "y", "z", "x"]
    assert [time // 500_000 for time in log.times("x")] == [0, 4, 8]


def test_the_extra_idle_call_can_be_left_out():
    log = Log()
    log.start(occasional=tuple(log.task(name, 60) for name in "xyz"), extra_idle_call=False)
    log.chip.advance(6 * 500_000)
    assert log.names() == ["x", "y", "z", "x", "y", "z"]


def test_an_occasional_task_charges_its_own_cost_and_that_of_choosing():
    log = Log()
    entry = log.task("x", 300, limit=200)
    chooser = Occasional((entry,), cost=20, limit=50)
    log.start(rows=((chooser, log.task("after", 60)),))
    log.chip.advance(400_000)
    assert (entry.last_cycles, chooser.last_cycles) == (300, 20)
    assert (entry.hits, chooser.hits) == (1, 0)
    assert log.times("after")[0] - log.times("x")[0] in (5_333, 5_332)


def test_a_limit_exceeded_is_counted_and_reported_but_cost_alone_decides_the_time():
    log = Log()
    reported = []
    log.chip.on_limit = reported.append
    within = log.task("within", 600, limit=600)
    beyond = log.task("beyond", 601, limit=600)
    log.start(every=(within, beyond))
    log.chip.advance(900_000)
    assert (within.hits, beyond.hits) == (0, 2)
    assert reported == [beyond, beyond]


@pytest.mark.parametrize("cost, near, over", [(26_900, 0, 0), (26_920, 1, 0), (29_900, 1, 0), (29_930, 0, 1)])
def test_a_slot_of_more_than_90_percent_is_near_its_limit_and_beyond_it_an_overrun(cost, near, over):
    log = Log()
    reported = []
    log.chip.on_near_limit = lambda: reported.append("near")
    log.chip.on_overrun = lambda: reported.append("over")
    scheduler = log.start(rows=((log.task("a", cost),), ()))
    log.chip.advance(900_000)
    assert reported == ["near"] * near + ["over"] * over
    assert (scheduler.near_limits, scheduler.overruns) == (near, over)


def test_slots_follow_the_boards_own_crystal():
    log = Log(crystal=Crystal(10_000_000, 100_000))
    log.start(every=(log.task("a", 60),))
    log.chip.advance(1_000_000_000)
    assert len(log.entries) == 2001  # 100 ppm fast: slot 2000 starts 100 us before the second is over


@pytest.mark.parametrize(("limit", "hits"), [(599, 2), (600, 0), (0, 0)])
def test_a_limit_counts_beyond_itself_and_0_is_none_also_while_every_slot_is_recorded(limit, hits):
    log = Log()
    task = log.task("task", 600, limit=limit)
    log.start(every=(task,))
    log.chip.scheduler.attach_log(ActivityLog())
    log.chip.advance(900_000)
    assert (task.last_cycles, task.hits) == (600, hits)


def test_replacing_an_entry_runs_the_users_function_at_its_declared_cost():
    log = Log()
    task = log.task("control", 3900, limit=4200)
    log.start(every=(task, log.task("after", 60)))
    log.chip.advance(500_000)
    log.chip.scheduler.replace("control", log.function("mine"), cost=600, limit=500)
    log.chip.advance(1_000_000)
    assert log.names() == ["control", "after", "mine", "after"]
    assert (task.last_cycles, task.hits) == (600, 1)
    log.chip.scheduler.replace(task, log.function("mine again"))
    assert (task.cost, task.limit) == (600, 500)


def test_a_tasks_counters_hold_for_calls_with_and_without_items_at_any_place():
    log = Log()
    items = iter([None, 0, 3, None, 5, None])
    task = Task(lambda: next(items), cost=100, per_item=10)
    seen = []

    def look():
        seen.append((task.calls, task.last_cycles, task.max_cycles, task.total_cycles))

    log.start(rows=((task, Task(look), task, Task(look)), (Task(look), task, Task(look))))
    assert (task.calls, task.last_cycles, task.max_cycles, task.total_cycles) == (0, 0, 0, 0)
    log.chip.advance(1_900_000)
    assert seen == [
        (1, 100, 100, 100),
        (2, 100, 100, 200),
        (2, 100, 100, 200),
        (3, 130, 130, 330),
        (4, 100, 130, 430),
        (5, 150, 150, 580),
        (5, 150, 150, 580),
        (6, 100, 150, 680),
    ]


def test_what_a_task_took_before_its_cost_changed_or_its_table_was_started_again_stays_counted():
    log = Log()
    task = log.task("a", 600)
    log.start(every=(task,))
    log.chip.advance(1_600_000)
    task.cost = 60
    assert (task.calls, task.total_cycles, task.max_cycles, task.last_cycles) == (4, 2400, 600, 600)
    log.chip.advance(2_600_000)
    assert (task.calls, task.total_cycles, task.max_cycles, task.last_cycles) == (6, 2520, 600, 60)
    again = Log()
    again.start(every=(task,))
    again.chip.advance(600_000)
    assert (task.calls, task.total_cycles, task.max_cycles, task.last_cycles) == (8, 2640, 600, 60)


def test_a_function_put_straight_into_an_entry_is_taken_at_the_next_call():
    log = Log()
    task = log.task("control", 600)
    idle = Task(lambda: None)
    log.start(every=(task,), occasional=(idle,))
    log.chip.advance(500_000)
    task.function = log.function("mine")
    idle.function = log.function("now and then")
    log.chip.advance(1_000_000)
    assert log.names() == ["control", "mine"]
    log.chip.advance(1_500_000)
    assert log.names() == ["control", "mine", "mine", "now and then"]


def test_replacing_an_entry_that_is_not_there_names_those_that_are():
    log = Log()
    scheduler = log.start(every=(log.task("control", 1),), occasional=(log.task("status", 1),))
    with pytest.raises(UserError, match="no task named 'contrl'; there are control, occasional, status"):
        scheduler.replace("contrl", print)
    with pytest.raises(UserError, match="cannot be called"):
        scheduler.replace("control", 7)
    with pytest.raises(UserError, match="occasional list"):
        scheduler.replace("occasional", print)
    assert scheduler.replace("status", print).function is print


def test_a_wait_spins_until_an_interrupt_makes_its_condition_true():
    log = Log()
    ready = []
    wait = Wait(lambda: bool(ready), cost=30, name="wait")
    log.start(every=(log.task("before", 600), wait, log.task("after", 60)))
    source = log.chip.vic.attach(EXTERNAL_INTERRUPT, 1, lambda queue: ready.append(1), cost=35, slot=1)
    raise_at(log.chip, source, 100_000)
    log.chip.advance(400_000)
    # the interrupt takes 60 cycles from 100 us on, then the condition holds, 30 cycles later the task ends
    assert log.times("after") == [100_000 + 1_000 + 500]
    assert wait.waits == 1
    # spinning from 11,416 ns to 101,000 ns is 5375 cycles, less the 60 stolen, and its own 30
    assert wait.last_cycles == 5375 - 60 + 30


def test_a_wait_whose_condition_already_holds_costs_only_itself():
    log = Log()
    wait = Wait(lambda: True, cost=60, limit=100, name="wait")
    log.start(every=(wait, log.task("after", 60)))
    log.chip.advance(400_000)
    assert log.times("after") == [TICK_NS + 1000]
    assert (wait.waits, wait.last_cycles) == (0, 60)


def test_a_wait_for_what_never_comes_hangs_the_row_and_every_slot_overruns():
    log = Log()
    scheduler = log.start(every=(Wait(lambda: False, name="wait"), log.task("never", 60)))
    log.chip.advance(5_000_000)
    assert log.names() == []
    assert scheduler.overruns == 9
    assert scheduler.dropped_tasks == 1 + 8 * 2


def test_records_show_each_slot_with_its_tasks_and_interrupts():
    log = Log()
    scheduler = log.start(
        rows=((log.task("a", 600),), (log.task("b", 36_000), log.task("c", 60)), (log.task("d", 60),))
    )
    activity = kept(log.chip)
    names = [task.name for task in log.chip.legend().tasks]

    def ran(row):
        return [
            (names[each.number], each.cycles) for each in rows_of(activity) if each[0] == TASK_RAN if each[6] == row
        ]

    log.chip.advance(500_000)
    (record,) = (each for each in rows_of(activity) if each.kind == SLOT_ENDED)
    assert (record.start, record.row, record.items) == (0, 0, 0)
    assert ran(0) == [("a", 600)]
    log.chip.advance(1_500_000)
    a, b, d = (each for each in rows_of(activity) if each.kind == SLOT_ENDED)
    assert (b.row, b.items, ran(1)) == (1, 1, [("b", 36_000)])
    assert b.cycles == 2 * TICK_CYCLES + 36_000 - 1
    assert (d.row, d.items, ran(2)) == (2, 0, [("d", 60)])
    interrupts = [each for each in rows_of(activity) if each.kind == INTERRUPT_RAN and each.start >= d.start]
    assert [log.chip.legend().interrupts[each.number].name for each in interrupts] == ["slot timer"]
    assert interrupts[0].cycles == TICK_CYCLES
    assert scheduler.task_cycles() == {"a": 600, "b": 36_000, "c": 0, "d": 60}


def test_the_histogram_has_bins_of_five_percent():
    log = Log()
    scheduler = log.start(rows=((log.task("a", 1600),), (log.task("b", 15_000),), ()))
    log.chip.advance(1_500_000)
    assert [place for place, count in enumerate(scheduler.histogram) if count] == [0, 1, 10]


@pytest.mark.parametrize(
    "table, reported",
    [
        (dict(rows=()), "at least one row"),
        (dict(slot_us=0), "does not divide"),
        (dict(slot_us=500, divider=3), "does not divide"),
        (dict(every=(print,)), "is not a Task"),
        (dict(occasional=(), occasional_row=4), "occasional_row 4"),
    ],
)
def test_a_faulty_table_is_refused(table, reported):
    with pytest.raises(UserError, match=reported):
        Schedule(**table)


def test_a_faulty_task_is_refused():
    with pytest.raises(UserError, match="task f: cost -1"):
        Task(print, cost=-1, name="f")
    with pytest.raises(UserError, match="cannot be called"):
        Task(3, cost=1)
    with pytest.raises(UserError, match="plain Task"):
        Occasional((Wait(bool),))


def transmitting(**table):
    """A log whose board runs a table of tasks "a" ... "f" of 600 cycles (10 us) each."""
    log = Log()
    task = {name: log.task(name, 600) for name in "abcdef"}
    log.start(every=(task["a"], task["b"], task["c"]), rows=((task["d"],), ()), last=(task["e"],), **table)
    return log


def test_a_schedule_that_names_no_transmitters_promises_silence_only_until_the_next_event():
    log = transmitting()
    assert log.chip.earliest_transmit_ns() == log.chip.next_time == 0
    log.chip.advance(505_000)
    assert log.chip.earliest_transmit_ns() == log.chip.next_time > 505_000


def test_a_schedule_that_names_its_transmitters_promises_silence_until_the_next_of_them():
    """The tasks of rows always count: d of row 0; a, c and e are silent. Row 1 is empty."""
    chip = transmitting(transmitters=("b",)).chip
    assert chip.earliest_transmit_ns() == 10_000  # a before the first b of the slot that begins at 0
    chip.advance(TICK_NS + 5_000)
    assert chip.earliest_transmit_ns() == TICK_NS + 10_000  # a runs
    chip.advance(TICK_NS + 15_000)
    assert chip.earliest_transmit_ns() == TICK_NS + 30_000  # b has begun, c follows, then d
    chip.advance(TICK_NS + 35_000)
    assert chip.earliest_transmit_ns() == 510_000  # d has begun, nothing more in this slot
    chip.advance(500_000 + TICK_NS + 15_000)
    assert chip.earliest_transmit_ns() == 1_010_000  # in row 1 nothing follows b


def test_a_row_without_tasks_is_silent_and_the_row_after_it_is_not():
    log = Log()
    log.start(rows=((log.task("a", 600),), (), (log.task("b", 600),)), transmitters=())
    chip = log.chip
    assert chip.earliest_transmit_ns() == 0  # a of row 0
    chip.advance(TICK_NS + 5_000)
    assert 999_990 <= chip.earliest_transmit_ns() <= 1_000_000  # nothing in row 1; b of row 2, to its tick's rounding
    chip.advance(500_000 + TICK_NS)
    assert chip.earliest_transmit_ns() == 1_000_000  # b of row 2
    chip.advance(1_000_000 + TICK_NS + 5_000)
    assert chip.earliest_transmit_ns() == 1_500_000  # a again


def test_a_schedule_of_300_different_tasks_runs_each_in_every_slot():
    log = Log()
    tasks = tuple(log.task(str(number), 1) for number in range(300))
    log.start(every=tasks)
    log.chip.advance(500_000)
    assert log.names() == [str(number) for number in range(300)]


def test_a_replaced_function_may_send_whatever_the_schedule_declared():
    log = transmitting(transmitters=("b",))
    log.chip.advance(TICK_NS + 15_000)
    log.chip.scheduler.replace("c", lambda: None)
    assert log.chip.earliest_transmit_ns() == TICK_NS + 20_000


def test_a_sender_that_is_not_a_task_of_every_slot_is_refused():
    log = Log()
    with pytest.raises(UserError, match=r"transmitter 'x' is not a task of every slot \(available: a, b\)"):
        Schedule(every=(log.task("a", 1),), last=(log.task("b", 1),), transmitters=("x",))


def test_a_chip_ordered_to_stop_while_it_runs_stops_there_and_goes_on_later():
    log = Log()
    stop = Task(lambda: log.chip.stop_at(TICK_NS + 15_000) and None, cost=600, name="b")
    log.start(every=(log.task("a", 600), stop, log.task("c", 600)))
    log.chip.advance(400_000)
    assert log.names() == ["a"] and log.chip.horizon == TICK_NS + 15_000
    log.chip.advance(400_000)
    assert log.entries[-1] == ("c", TICK_NS + 20_000)
