"""Views and assertions on slots: schedules worked out by hand, and both sides of each limit."""

import pytest

from ranger_sim.firmware_sim.scheduler import Wait
from ranger_sim.firmware_sim.vic import EXTERNAL_INTERRUPT
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.timing.recording import Recording
from ranger_sim.harness.timing.slots import SlotView
from tests.firmware_sim.board import TICK_CYCLES, TICK_NS, Log, raise_at

# 60 cycles are 1 us. A tick takes 85 cycles, 1416 ns.


def recorded(until_ns=2_000_000, phase_ns=0, interrupt_at=None, most_rows=1 << 20, origin_ns=0, **table):
    """The view of a chip that ran this table, recorded from the start; one interrupt of 600 cycles at a time."""
    log = Log()
    log.start(phase_ns=phase_ns, **{name: task(log) if callable(task) else task for name, task in table.items()})
    if interrupt_at is not None:
        source = log.chip.vic.attach(
            EXTERNAL_INTERRUPT, 1, log.function("irq"), cost=600, slot=1, latency=0, name="guest"
        )
        raise_at(log.chip, source, interrupt_at)
    view = SlotView(Recording(log.chip, origin_ns=origin_ns, most_rows=most_rows))
    log.chip.advance(until_ns)
    return view


def two_rows(log):
    return ((log.task("a", 600, limit=700), log.task("b", 1200)), (log.task("c", 3000),))


def test_slots_come_with_row_start_end_functions_and_cycles():
    view = recorded(rows=two_rows, phase_ns=10_000)
    assert [(slot.row, slot.start_ns) for slot in view] == [(0, 10_000), (1, 510_000), (0, 1_010_000), (1, 1_510_000)]
    first = view[0]
    assert (first.number, first.end_ns) == (1, 10_000 + TICK_NS + 30_000)
    assert first.cycles == TICK_CYCLES + 1800 - 1  # 1 by rounding down ns
    assert [(ran.name, ran.start_ns, ran.cycles, ran.limit) for ran in first.functions] == [
        ("a", 10_000 + TICK_NS, 600, 700),
        ("b", 10_000 + TICK_NS + 10_000, 1200, 0),
    ]
    assert first.cycles_by_function() == {"a": 600, "b": 1200}
    assert first.cycles_by_interrupt() == {"slot timer": TICK_CYCLES}
    assert [(ran.name, ran.latency_ns) for ran in first.interrupts] == [("slot timer", 416)]
    assert first.margin == pytest.approx(1 - 31_416 / 500_000)
    assert (view.overruns, len(view)) == (0, 4)


def test_the_worst_is_the_one_that_took_longest_and_the_margin_is_its():
    view = recorded(rows=two_rows)
    assert (view.worst().row, view.worst().taken_ns) == (1, TICK_NS + 50_000)
    assert view.margin == pytest.approx(1 - 51_416 / 500_000)
    assert view.of_row(0).worst().taken_ns == TICK_NS + 30_000


def test_a_turn_of_the_main_loop_that_a_tick_finds_at_work_is_part_of_the_slots_picture():
    log = Log()
    log.start(rows=two_rows(log), phase_ns=40_000)
    ends = iter([30_000, 60_000])  # two turns of 30 us; nothing to do behind them

    def turn():
        return next(ends, log.chip.now)

    log.chip.background = turn
    view = SlotView(Recording(log.chip))
    log.chip.advance(500_000)
    [slot] = view
    assert slot.turns == []
    [before] = slot.reached_in
    # two turns without a gap are one stretch
    assert (before.name, before.start_ns, before.end_ns) == ("main loop", 0, 60_000 + TICK_NS)
    # 20 us of the turn and the tick behind the match, and its own two tasks
    assert slot.cycles == 1200 + TICK_CYCLES + 1800 - 1  # 1 by rounding down ns
    drawn = {line.split()[1]: line.split() for line in slot.picture().splitlines() if " 1 " in line}
    assert drawn["main"][2:5] == ["loop", "(before)", "1"] and drawn["main"][5] == "1,200"


def test_the_robots_power_up_is_where_time_is_counted_from():
    view = recorded(rows=two_rows, phase_ns=10_000, origin_ns=10_000)
    assert [slot.start_ns for slot in view] == [0, 500_000, 1_000_000, 1_500_000]


def test_selections_take_slots_by_row_and_by_their_start_and_can_follow_each_other():
    view = recorded(rows=two_rows)
    assert [slot.number for slot in view.of_row(1)] == [2, 4]
    assert [slot.number for slot in view.between("500 us", "1.5 ms")] == [2, 3]
    assert [slot.number for slot in view.between(0.0, 0.001).of_row(1)] == [2]
    assert str(view.between(0.0, 0.001).of_row(1)) == "slots of TEST between 0 ns and 1 ms of row 1"
    assert [slot.number for slot in view.during("late", lambda starts: starts > 900_000)] == [3, 4]


def test_a_view_grows_while_time_passes():
    log = Log()
    log.start(rows=two_rows(log))
    view = SlotView(Recording(log.chip))
    log.chip.advance(500_000)
    first = view.of_row(0)
    assert len(first) == 1
    log.chip.advance(1_600_000)
    assert len(first) == 2


def test_a_slot_that_is_not_through_is_not_there_yet():
    assert len(recorded(rows=two_rows, until_ns=1_010_000)) == 2


def test_statistics_by_function_and_interrupt():
    view = recorded(rows=two_rows, interrupt_at=20_000)
    assert {name: (each.calls, each.total) for name, each in view.functions.items()} == {
        "a": (2, 1200),
        "b": (2, 2400),
        "c": (2, 6000),
    }
    assert (view.functions["a"].limit, view.functions["a"].over_limit) == (700, 0)
    assert view.interrupts["guest"].most == 600
    assert view.of_row(1).interrupts.keys() == {"slot timer"}


# --- both sides of each limit


def test_a_slot_may_take_exactly_the_limit_and_not_a_nanosecond_more():
    view = recorded(rows=two_rows)
    view.assert_within("51.416 us")
    view.of_row(0).assert_within("31.416 us")
    with pytest.raises(AssertionError, match="2 of 4 took longer than 51.415 us; the worst:"):
        view.assert_within("51.415 us")
    cycles = view.worst().cycles
    view.assert_within(cycles)
    with pytest.raises(AssertionError, match=f"took longer than {cycles - 1:,} cycles"):
        view.assert_within(cycles - 1)


def test_a_function_may_cost_exactly_its_limit_and_interrupts_are_not_its_cost():
    view = recorded(rows=two_rows, interrupt_at=20_000)  # in b
    view.assert_function("b", at_most=1200)
    view.assert_function("b", at_most="20 us")
    with pytest.raises(AssertionError, match=r"b cost 1,200 cycles \(20 us\), at most 1,199 cycles are allowed"):
        view.assert_function("b", at_most=1199)
    with pytest.raises(AssertionError, match="at most 19.9 us are allowed"):
        view.assert_function("b", at_most="19.9 us")
    slot = view.between("0 s", "500 us").worst()
    assert slot.cycles == TICK_CYCLES + 1800 + 600 - 1


def test_an_interrupt_may_cost_exactly_its_limit():
    view = recorded(rows=two_rows, interrupt_at=20_000)
    view.assert_interrupt("guest", at_most=600)
    with pytest.raises(AssertionError, match="guest cost 600 cycles"):
        view.assert_interrupt("guest", at_most=599)


def test_a_request_may_wait_exactly_as_long_as_its_limit():
    view = recorded(rows=two_rows, interrupt_at=1_000)  # while the tick is served: 416 ns to wait
    view.assert_latency("guest", at_most="416 ns")
    with pytest.raises(AssertionError, match="guest waited 416 ns for its service, at most 415 ns are allowed"):
        view.assert_latency("guest", at_most="415 ns")


def test_a_row_that_ends_just_before_the_tick_has_not_overrun_and_one_that_ends_with_it_has():
    # latency 25 and cost 35 of the tick are 1 us, 29,940 cycles 499 us
    fits = recorded(every=lambda log: (log.task("a", 29_939),), tick_cost=35, until_ns=600_000)
    fits.assert_no_overrun()
    overran = recorded(every=lambda log: (log.task("a", 29_940),), tick_cost=35, until_ns=1_600_000)
    with pytest.raises(AssertionError, match="overran; dropped: nothing"):
        overran.assert_no_overrun()


# --- overruns


def long_row(log):
    return ((log.task("long", 36_000), log.task("x", 60), log.task("y", 60)), (log.task("next", 60),))


def test_an_overrun_lists_what_was_dropped_and_lasts_until_its_last_task_is_through():
    view = recorded(rows=long_row, until_ns=999_000)
    late, after = view
    assert late.overran and late.dropped == ["x", "y"] and late.end_ns == 600_000 + 2 * TICK_NS
    assert not after.overran and after.dropped == []
    assert (view.overruns, view.dropped) == (1, {"x": 1, "y": 1})
    assert late.margin < -0.2


def test_the_failure_shows_the_offending_slot_to_scale():
    view = recorded(rows=long_row, until_ns=999_000)
    with pytest.raises(AssertionError) as failure:
        view.assert_no_overrun()
    lines = str(failure.value).splitlines()
    assert lines[0] == "slots of TEST: 1 of 2 overran; dropped: x, y; the worst:"
    assert lines[2] == (
        "TEST, slot 1 (row 0), 0.000000 s after power-up: 36,169 cycles, 602.832 us of 500 us; "
        "it overran, dropped: x, y"
    )
    scale, tasks, interrupts, tick = lines[4:8]
    us_per_cell = 602.832 * 1.04 / 96
    assert tasks[12:].count("a") == pytest.approx(600 / us_per_cell, abs=2)  # from 1.4 to 602.8 us
    assert tick.index("^") - 12 == int(500 / us_per_cell) and tick.endswith("^ tick 500 us")
    assert interrupts.index("1", 12) == 12 and interrupts.rindex("1") - 12 == int(500 / us_per_cell)
    assert scale.index("|500") - 12 == pytest.approx(500 / us_per_cell, abs=1)
    assert "slots of TEST" not in tasks and " a long                           1   36,000    600.0     120.0" in lines


def test_a_slot_that_was_dropped_as_a_whole_took_nothing():
    view = recorded(
        rows=lambda log: ((log.task("long", 70_000),), (log.task("a", 60),), (log.task("c", 60),)), until_ns=1_490_000
    )
    assert [(slot.row, slot.overran, slot.cycles > 0) for slot in view] == [
        (0, True, True),
        (1, True, False),
        (2, False, True),
    ]
    assert view[1].dropped == ["a"] and view.worst().number == 1
    assert view[1].picture()  # it is drawn, too


def test_a_slot_that_hangs_counts_until_the_tick_that_found_it():
    view = recorded(every=lambda log: (Wait(lambda: False, name="wait"), log.task("never", 60)), until_ns=1_200_000)
    assert view.overruns == 2 and view.worst().taken_ns == 500_000
    assert view.dropped == {"never": 2, "wait": 1}


def test_an_entry_of_an_occasional_list_is_seen_in_the_picture_and_in_the_statistics():
    view = recorded(
        rows=lambda log: ((log.task("a", 60),),), occasional=lambda log: (log.task("one", 6000),), until_ns=490_000
    )
    assert view.functions["one"].most == 6000 and view.functions["occasional"].most == 20
    assert "b one" not in view[0].picture().splitlines()[4]
    letters = view[0].picture().splitlines()[3]
    assert letters.startswith("tasks") and letters.count("b") + letters.count("c") >= 18


# --- questions without an answer


def test_a_past_that_was_not_recorded_is_reported():
    log = Log()
    log.start(rows=two_rows(log))
    log.chip.advance(1_200_000)
    view = SlotView(Recording(log.chip, begun_ns=1_200_000))
    for question in (view.assert_no_overrun, view.worst, lambda: view.overruns, lambda: view.assert_within("1 s")):
        with pytest.raises(UserError, match="none was recorded; recording began 1.2 ms after power-up"):
            question()


@pytest.mark.parametrize(
    "question, reported",
    [
        (lambda view: view.of_row(2), "row 2 is none of 0 ... 1"),
        (lambda view: view.between("1 ms", "1 ms"), "nothing is between"),
        (lambda view: view.assert_function("d", at_most=1), "no function is named 'd'; there are a, b, c"),
        (lambda view: view.of_row(0).assert_function("c", at_most=1), "c ran in none of the 2"),
        (lambda view: view.assert_latency("x", at_most="1 us"), "no interrupt is named 'x'; there are"),
        (lambda view: view.assert_latency("slot timer", at_most="8"), "a time from 0 on is needed"),
        (lambda view: view.assert_within(-1), "limit -1: a whole number of cycles, or a time"),
        (lambda view: view.assert_within("450"), "a number with one of the units"),
        (lambda view: view.between("5 s", "6 s").overruns, "none was recorded"),
    ],
)
def test_a_wrong_question_is_reported_in_one_line(question, reported):
    with pytest.raises(UserError, match=reported):
        question(recorded(rows=two_rows))


def test_rows_dropped_for_newer_ones_are_reported_and_a_selection_of_the_kept_ones_has_an_answer():
    log = Log()
    log.start(rows=two_rows(log))
    recording = Recording(log.chip, most_rows=40)
    view = SlotView(recording)
    for end in range(1, 41):
        log.chip.advance(end * 500_000)
        recording.update()
    assert recording.lost > 0
    with pytest.raises(UserError, match="the oldest were dropped, the rest begins"):
        view.assert_no_overrun()
    with pytest.raises(UserError, match="the oldest were dropped"):  # a part of it is kept
        view.between("1 ms", "20 ms").assert_within("52 us")
    kept = view.between("18 ms", "20 ms")
    assert len(kept) == 4
    kept.assert_within("52 us")
    view.forget()
    log.chip.advance(22_000_000)
    view.assert_within("52 us")
