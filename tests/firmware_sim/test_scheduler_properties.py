"""The scheduler under random tables, loads and interrupts: what must hold whatever happens."""

from hypothesis import given, settings
from hypothesis import strategies as st

from ranger_sim.firmware_sim.clock import Crystal
from ranger_sim.firmware_sim.scheduler import Schedule, Task
from ranger_sim.firmware_sim.vic import FIQ
from ranger_sim.foundation.events import PIN_EDGE
from tests.examples import examples
from tests.firmware_sim.board import Log

COSTS = st.integers(0, 40_000)
LIST = st.lists(COSTS, max_size=4)


@st.composite
def tables(draw):
    return {
        "every": draw(LIST),
        "rows": draw(st.lists(LIST, min_size=1, max_size=4)),
        "last": draw(LIST),
        "edges": sorted(draw(st.lists(st.integers(0, 4_999_999), max_size=60))),
        "edge_cost": draw(st.integers(0, 2_000)),
        "slot": draw(st.sampled_from([FIQ, 0, 9])),
        "ppb": draw(st.integers(-100_000, 100_000)),
    }


class Run:
    """A random table run for 5 ms; each task notes the slot in which it ran."""

    def __init__(self, table, stops=()):
        self.log = Log(Crystal(10_000_000, table["ppb"]))
        chip = self.log.chip
        self.ran = []
        self.listed = []

        def tasks(group, costs):
            return tuple(
                Task(self.note(f"{group}.{place}"), cost=cost, name=f"{group}.{place}")
                for place, cost in enumerate(costs)
            )

        rows = tuple(tasks(f"row{row}", costs) for row, costs in enumerate(table["rows"]))
        self.schedule = Schedule(every=tasks("every", table["every"]), rows=rows, last=tasks("last", table["last"]))
        chip.start(self.schedule, 0)
        self.edge = chip.vic.attach(PIN_EDGE, 3, self.log.function("edge"), cost=table["edge_cost"], slot=table["slot"])
        for time in table["edges"]:
            chip.inbox.push(time, 0, PIN_EDGE, 3, 1, -1)
        for stop in stops:
            chip.advance(stop)
        chip.advance(5_000_000)

    def note(self, name):
        def run():
            scheduler = self.log.chip.scheduler
            self.ran.append((scheduler.slot_count, scheduler.row, name, self.log.chip.now))

        return run


@given(tables())
@settings(max_examples=examples(150))
def test_no_task_runs_twice_in_a_slot_and_the_order_of_the_table_is_kept(table):
    run = Run(table)
    by_slot: dict = {}
    for slot, row, name, _ in run.ran:
        by_slot.setdefault((slot, row), []).append(name)
    for (_, row), names in by_slot.items():
        listed = [task.name for task in run.schedule.row_tasks(row)]
        assert names == listed[: len(names)]


@given(tables())
@settings(max_examples=examples(150))
def test_tasks_run_and_dropped_and_still_to_come_are_those_listed(table):
    run = Run(table)
    scheduler = run.log.chip.scheduler
    to_come = 0 if scheduler.done else scheduler.end - scheduler.position
    assert scheduler.run_tasks == len(run.ran)
    assert scheduler.run_tasks + scheduler.dropped_tasks + to_come == scheduler.listed_tasks
    rows = [(scheduler.row_count - 1 + slot) % scheduler.row_count for slot in range(1, scheduler.slot_count + 1)]
    assert scheduler.listed_tasks == sum(len(run.schedule.row_tasks(row)) for row in rows)


@given(tables())
@settings(max_examples=examples(150))
def test_cycles_are_conserved_between_tasks_interrupts_and_time(table):
    run = Run(table)
    chip = run.log.chip
    tasks = sum(task.total_cycles for task in run.schedule.all_tasks())
    stolen = sum(source.total_cycles for source in chip.vic.sources.values())
    events = len(run.ran) + sum(source.served for source in chip.vic.sources.values())
    assert stolen == chip.stolen_cycles
    assert tasks == sum(
        next(task.cost for task in run.schedule.all_tasks() if task.name == name) for _, _, name, _ in run.ran
    )
    # whatever was charged by the time the processor is free lies between power-up and that time
    busy_ns = (tasks + stolen) * chip.ns_per_cycle
    free = max(chip.code_time, chip.irq_free, chip.fiq_free)
    assert busy_ns <= free + events + 1


@given(tables())
@settings(max_examples=examples(100))
def test_tasks_never_overlap_and_never_start_before_what_they_wait_for(table):
    run = Run(table)
    ends = 0
    costs = {task.name: task.cost for task in run.schedule.all_tasks()}
    for _, _, name, time in run.ran:
        assert time >= ends - 1
        ends = time + int(costs[name] * run.log.chip.ns_per_cycle)


@given(tables(), st.lists(st.integers(0, 5_000_000), max_size=40))
@settings(max_examples=examples(100))
def test_it_does_not_matter_in_how_many_steps_time_is_advanced(table, stops):
    whole = Run(table)
    pieces = Run(table, sorted(stops))
    assert pieces.ran == whole.ran
    assert pieces.log.entries == whole.log.entries
    assert pieces.log.chip.next_time == whole.log.chip.next_time


@given(tables())
@settings(max_examples=examples(60))
def test_nothing_happens_before_next_time_and_something_does_at_it(table):
    run = Run(table)
    chip = run.log.chip
    before = (len(run.ran), len(run.log.entries), chip.tick_source.requests, chip.scheduler.slot_count)
    then = chip.next_time
    assert then >= 5_000_000
    assert not chip.due(then)
    assert chip.advance(then) == then
    assert before == (len(run.ran), len(run.log.entries), chip.tick_source.requests, chip.scheduler.slot_count)
    assert chip.due(then + 1)
    instant = chip.input_time
    assert chip.advance(then + 1) > then
    assert chip.input_time == then > instant
