# cython: boundscheck=False, wraparound=False
# (every index below is a place, a row or a task's number, all set by `layout`)
"""The cooperative slot scheduler: what runs when, what it costs, and what an overrun drops.

A timer tick starts a slot and steps to the next row of the table. A slot runs the every-slot tasks, the
row's own tasks and the closing tasks, one after another, each to its end. A tick that finds the row
unfinished is an overrun: the task that was running is completed, what remained of its row is skipped,
and the new row follows immediately. Before the first tick the processor has nothing to do.

Cost and limit are two things: a task spends `cost + per_item * items` modelled cycles, and is held
against `limit`. The event loop that spends the time is in microcontroller.py; here is the book-keeping.
"""

from typing import Annotated, Final

import cython

from ranger_sim.firmware_sim.activity import SLOT_BEGAN, SLOT_ENDED, SLOT_OVERRAN, TASK_DROPPED, ActivityLog
from ranger_sim.firmware_sim.calls import code_of, owner_of
from ranger_sim.firmware_sim.counters import SlotCounters
from ranger_sim.foundation.events import NEVER
from ranger_sim.foundation.numbers import integers
from ranger_sim.foundation.renamed import renamed
from ranger_sim.foundation.user_error import FirmwareError

NORMAL_TASK: Final = 0
OCCASIONAL_TASK: Final = 1
WAIT_TASK: Final = 2
HISTOGRAM_BINS: Final = 21  # twenty of 5 % of a slot, the last for overruns


@cython.cclass
class Task:
    """One line of a schedule: `function()` returns None or the number of items it handled (an int).

    Cycles of a call: cost + per_item * items + what the function spends itself by `chip.spend`. `item` names
    what is counted ("frame", "edge"). limit 0: not held against anything. Ground truth: `calls`, `hits`
    (calls over the limit), `last_cycles`, `max_cycles`, `total_cycles` (interrupts not included).
    """

    # the fields that the event loop reads come first
    usual_ns: cython.longlong
    code: cython.p_void
    owner: cython.p_void
    usual_calls: cython.longlong
    kind: cython.longlong
    base_cycles: cython.longlong
    per_item: cython.longlong
    most_cycles: cython.longlong
    noted_calls: cython.longlong
    noted_cycles: cython.longlong
    noted_most: cython.longlong
    noted_last: cython.longlong
    noted_when: cython.longlong
    number: cython.longlong
    scheduler: "SlotScheduler"
    routine: object
    transmits: cython.bint
    hits: cython.longlong
    name: str
    item: str

    def __init__(self, function, cost=0, limit=0, per_item=0, item="", name=None) -> None:
        title = name if name is not None else getattr(function, "__name__", type(function).__name__)
        if not callable(function):
            raise FirmwareError(f"task {title}: function {function!r} cannot be called")
        for what, value in (("cost", cost), ("limit", limit), ("per_item", per_item)):
            if not isinstance(value, int) or value < 0:
                raise FirmwareError(f"task {title}: {what} {value!r} must be a whole number of cycles, 0 or more")
        self.set_routine(function)
        self.usual_ns = -1  # duration of a call without items; -1: every call is checked (SlotScheduler.set_duration)
        self.usual_calls = 0  # calls that took exactly `cost`, since that was last changed
        self.base_cycles = cost
        self.most_cycles = limit
        self.per_item = per_item
        self.kind = NORMAL_TASK
        self.name = title
        self.item = item
        self.transmits = True  # may send on a bus; a Schedule may exclude it, but not for a user's function
        self.hits = 0
        # these count all other calls
        self.noted_calls = 0
        self.noted_cycles = 0
        self.noted_most = 0
        self.noted_last = 0
        self.noted_when = 0  # usual calls before the latest noted one
        self.scheduler = None
        self.number = -1

    def set_routine(self, function) -> None:
        """Call `function` from now on."""
        self.routine = function
        self.code = code_of(function, 0)
        self.owner = owner_of(function, 0)

    @cython.cfunc
    @cython.final
    def note(self, cycles: cython.longlong) -> cython.void:
        """Count a call that took `cycles`."""
        self.noted_calls += 1
        self.noted_cycles += cycles
        if cycles > self.noted_most:
            self.noted_most = cycles
        self.noted_last = cycles
        self.noted_when = self.usual_calls

    def settle(self) -> None:
        """Note the usual calls so far: their cost or their scheduler is about to change."""
        calls, total, most, last = self.calls, self.total_cycles, self.max_cycles, self.last_cycles
        self.noted_calls, self.noted_cycles, self.noted_most = calls, total, most
        self.noted_last, self.noted_when = last, 0
        self.usual_calls = 0

    @property
    def function(self):
        """What is called; another one may be put here at any time, and is taken at the next call."""
        return self.routine

    @function.setter
    def function(self, function) -> None:
        self.set_routine(function)
        self.transmits = True
        if self.scheduler is not None:
            self.scheduler.set_duration(self)

    @property
    def cost(self) -> int:
        """Modelled cycles of a call without items."""
        return self.base_cycles

    @cost.setter
    def cost(self, cycles) -> None:
        self.settle()
        self.base_cycles = cycles
        if self.scheduler is not None:
            self.scheduler.set_duration(self)

    @property
    def limit(self) -> int:
        """Cycles against which a call is held; 0: none."""
        return self.most_cycles

    @limit.setter
    def limit(self, cycles) -> None:
        self.most_cycles = cycles
        if self.scheduler is not None:
            self.scheduler.set_duration(self)

    @property
    def calls(self) -> int:
        """Calls since power-up."""
        return self.noted_calls + self.usual_calls

    @property
    def total_cycles(self) -> int:
        """Cycles of all calls, interrupts not included."""
        return self.noted_cycles + self.usual_calls * self.base_cycles

    @property
    def max_cycles(self) -> int:
        """Cycles of the longest call."""
        return max(self.noted_most, self.base_cycles if self.usual_calls else 0)

    @property
    def last_cycles(self) -> int:
        """Cycles of the latest call."""
        return self.noted_last if self.noted_when == self.usual_calls else self.base_cycles

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name}, cost={self.cost}, limit={self.limit})"


@cython.final
@cython.cclass
class Wait(Task):
    """A task that spins until `function()` is true, as `while (!done);` does in C.

    The condition is checked when the task starts and after every interrupt or peripheral event; the
    spinning time counts as cycles of the task. `waits` counts the calls that had to spin. A slot tick does
    not end the spinning (the task in progress always finishes).
    """

    waits: cython.longlong

    def __init__(self, function, cost=0, limit=0, name=None) -> None:
        Task.__init__(self, function, cost=cost, limit=limit, name=name)
        self.kind = WAIT_TASK
        self.waits = 0


@cython.final
@cython.cclass
class Occasional(Task):
    """A task that runs one task of its list per call. `cost` is that of choosing (the static counter).

    After the last entry one extra idle call resets the counter, so n entries come round every n + 1 calls,
    as the robot's code does; `extra_idle_call=False` leaves that call out.
    """

    tasks: list
    position: cython.longlong
    extra_idle_call: cython.bint

    def __init__(self, tasks, cost=20, limit=0, name="occasional", extra_idle_call=True) -> None:
        # cost 20: a counter, a comparison and an indirect call (chosen by us, no measurement is known)
        Task.__init__(self, self.next_task, cost=cost, limit=limit, name=name)
        self.kind = OCCASIONAL_TASK
        self.tasks = list(tasks)
        self.position = 0
        self.extra_idle_call = extra_idle_call
        for task in self.tasks:
            if not isinstance(task, Task) or task.kind != NORMAL_TASK:
                raise FirmwareError(f"occasional list {name}: {task!r} is not a plain Task")

    @cython.ccall
    def next_task(self) -> Task:
        """The entry whose turn it is, or None in the idle call."""
        count: cython.longlong = len(self.tasks)
        if self.position >= count:
            self.position = 0
            if self.extra_idle_call or count == 0:
                return None
        task: Task = cython.cast(Task, self.tasks[self.position])
        self.position += 1
        return task


@cython.final
@cython.cclass
class Schedule:
    """The table of one board.

    slot_us: length of a slot (whole us; `slot_ns` for anything finer). `every`: tasks of every slot;
    `rows`: a tuple of task tuples, one per row; `last`: tasks that close every slot. `occasional`: a tuple
    of tasks (or an Occasional) called once per pass, at the end of row `occasional_row`.
    `divider`: timer ticks per slot (the timer then runs at slot/divider). `completion_flag=False`: the
    runner keeps no DONE flag, so an overrun drops tasks without a report (main-brain scheduler).
    `transmitters`: names of those tasks in `every` and `last` that may put something on a bus (None: any of them);
    tasks of rows and of the occasional list always may. To be named only where no interrupt handler and no main loop
    sends. It lets the rest of the robot run ahead of a board that sends nothing, and changes no result.
    `tick_slot`: VIC slot of the timer interrupt (or FIQ); `tick_cost`: its cycles.
    """

    slot_ns: cython.longlong
    divider: cython.longlong
    tick_cost: cython.longlong
    tick_slot: cython.longlong
    tick_latency: cython.longlong
    every: list
    rows: list
    last: list
    completion_flag: cython.bint
    names_transmitters: cython.bint

    def __init__(
        self,
        slot_us=500,
        every=(),
        rows=((),),
        last=(),
        occasional=None,
        occasional_row=0,
        divider=1,
        completion_flag=True,
        tick_cost=60,  # finds the row's end and steps to the next one (chosen by us: about 40 instructions)
        tick_slot=4,
        tick_latency=None,
        slot_ns=None,
        extra_idle_call=True,
        transmitters=None,
        speakers=None,
    ) -> None:
        if speakers is not None:
            renamed("Schedule.speakers", "transmitters")
            transmitters = speakers
        self.slot_ns = slot_ns if slot_ns is not None else slot_us * 1000
        self.every = list(every)
        self.rows = [list(row) for row in rows]
        self.last = list(last)
        self.divider = divider
        self.completion_flag = completion_flag
        self.tick_cost = tick_cost
        self.tick_slot = tick_slot
        self.tick_latency = -1 if tick_latency is None else tick_latency
        if self.slot_ns <= 0 or divider <= 0 or self.slot_ns % divider:
            raise FirmwareError(f"schedule: slot of {self.slot_ns} ns does not divide into {divider} timer ticks")
        if not self.rows:
            raise FirmwareError("schedule: at least one row is needed (it may be empty)")
        if occasional is not None:
            if not 0 <= occasional_row < len(self.rows):
                raise FirmwareError(
                    f"schedule: occasional_row {occasional_row} is not one of the {len(self.rows)} rows"
                )
            if not isinstance(occasional, Occasional):
                occasional = Occasional(occasional, extra_idle_call=extra_idle_call)
            self.rows[occasional_row].append(occasional)
        for task in self.every + self.last + [task for row in self.rows for task in row]:
            if not isinstance(task, Task):
                raise FirmwareError(f"schedule: {task!r} is not a Task")
        self.names_transmitters = transmitters is not None
        if transmitters is not None:
            names = [task.name for task in self.every + self.last]
            for name in transmitters:
                if name not in names:
                    there = ", ".join(names)
                    raise FirmwareError(
                        f"schedule: transmitter {name!r} is not a task of every slot (available: {there})"
                    )
            for task in self.every + self.last:
                task.transmits = task.name in transmitters

    def row_tasks(self, row: cython.longlong) -> list:
        """Everything that a slot of this row runs, in order."""
        return self.every + self.rows[row] + self.last

    def all_tasks(self) -> list:
        """Every distinct task of the table, those inside occasional lists too, in order of the table."""
        found = []
        for row in range(len(self.rows)):
            for task in self.row_tasks(row):
                if task not in found:
                    found.append(task)
                if isinstance(task, Occasional):
                    for entry in task.tasks:
                        if entry not in found:
                            found.append(entry)
        return found


@cython.final
@cython.cclass
class SlotScheduler:
    """Row and position of a running schedule, and its records.

    `slot_count` ticks that began a slot, `overruns`, `dropped_tasks`, `max_slot_cycles` (from the tick to the
    end of the row, interrupts included), `histogram` of that in 21 bins of 5 % of a slot (the last: more
    than the slot), `near_limits` (more than 90 % but finished). `listed_tasks` = run_tasks + dropped_tasks +
    what the present row still has to run. More than 40 fields, because a task's end touches position and records alike:
    in two objects they would cost every task a second look-up.
    """

    # fields that a slot touches come first, close together
    position: cython.longlong
    end: cython.longlong
    done: cython.bint
    late: cython.bint
    recording: cython.bint
    started: cython.bint
    row: cython.longlong
    row_count: cython.longlong
    names_transmitters: cython.bint
    tasks: list
    placed: list
    divider_count: cython.longlong
    divider: cython.longlong
    row_start: cython.longlong
    run_before: cython.longlong
    slot_count: cython.longlong
    listed_tasks: cython.longlong
    slot_time: cython.longlong
    tick_time: cython.longlong
    finished_time: cython.longlong
    slot_cycles: cython.longlong
    near_limit_cycles: cython.longlong
    histogram_step: cython.longlong
    last_slot_cycles: cython.longlong
    total_slot_cycles: cython.longlong
    max_slot_cycles: cython.longlong
    row_starts: cython.longlong[::1]
    histogram: cython.longlong[21]
    leads: Annotated[cython.longlong[::1], "readonly"]
    row_leads: cython.longlong[::1]
    schedule: Schedule
    ns_per_cycle: cython.double
    slot_ns: cython.longlong
    overruns: cython.longlong
    dropped_tasks: cython.longlong
    near_limits: cython.longlong
    late_time: cython.longlong
    late_count: cython.longlong
    late_row: cython.longlong
    log: ActivityLog

    def __init__(self, schedule, slot_cycles, ns_per_cycle=0.0) -> None:
        self.schedule = schedule
        self.ns_per_cycle = ns_per_cycle
        self.slot_ns = schedule.slot_ns
        self.slot_cycles = slot_cycles
        self.divider = schedule.divider
        self.names_transmitters = schedule.names_transmitters
        self.near_limit_cycles = slot_cycles * 9 // 10  # "approaching" is 90 % (chosen by us)
        self.histogram_step = max(1, slot_cycles // 20)
        self.histogram = [0] * 21  # HISTOGRAM_BINS
        self.recording = False
        self.layout()
        self.row = self.row_count - 1  # so that the first tick starts row 0
        self.row_start = 0
        self.position = 0
        self.end = 0
        self.divider_count = schedule.divider - 1  # the first timer tick starts a slot
        self.done = True
        self.started = False
        self.slot_time = 0
        self.tick_time = 0
        self.finished_time = 0
        self.slot_count = 0
        self.overruns = 0
        self.dropped_tasks = 0
        self.listed_tasks = 0
        self.run_before = 0  # tasks run in the rows before this one
        self.last_slot_cycles = 0
        self.max_slot_cycles = 0
        self.total_slot_cycles = 0
        self.near_limits = 0
        self.late = False
        self.late_time = 0  # of the slot whose last task still runs: its start, number and row
        self.late_count = 0
        self.late_row = 0
        self.log = None

    def layout(self) -> None:
        """The schedule as flat lists; row r has the places from row_starts[r] on, and one more that is its end.

        `placed`: the task at each place, None at the end of a row.
        `leads`: ns from the start of the task at a place to that of the first one from there that may send, at least;
        NEVER where none follows in its row. `row_leads`: the same from the start of a row, over the rows after it.
        """
        schedule = self.schedule
        self.row_count = len(schedule.rows)
        self.tasks = schedule.all_tasks()
        self.row_starts = integers(self.row_count + 1)
        self.placed = []
        for row in range(self.row_count):
            self.placed += [*schedule.row_tasks(row), None]
            self.row_starts[row + 1] = len(self.placed)
        self.leads = integers(len(self.placed), NEVER)
        self.row_leads = integers(self.row_count, NEVER)
        for number, task in enumerate(self.tasks):
            task.settle()
            task.scheduler = self
            task.number = number
            self.set_duration(task)

    def retune(self, ns_per_cycle) -> None:
        """The processor's cycles last so long from now on."""
        self.ns_per_cycle = ns_per_cycle
        for task in self.tasks:
            self.set_duration(task)

    def set_duration(self, task: Task) -> None:
        """Work out how long a call of `task` usually takes, or that every call of it must be checked."""
        within = task.base_cycles <= task.most_cycles or task.most_cycles == 0
        plain = task.kind == NORMAL_TASK and within and not self.recording
        task.usual_ns = int(task.base_cycles * self.ns_per_cycle) if plain else -1
        self.set_leads()

    def set_leads(self) -> None:
        """From each row's end back to its start: how far each place is ahead of the next task that may send."""
        for row in range(self.row_count):
            lead = NEVER
            for place in range(self.row_starts[row + 1] - 2, self.row_starts[row] - 1, -1):
                task = self.placed[place]
                if task.transmits:
                    lead = 0
                elif lead < NEVER:
                    lead += int(task.base_cycles * self.ns_per_cycle)
                self.leads[place] = lead
        slot = max(0, int(self.slot_cycles * self.ns_per_cycle) - 1)  # ns at least, whatever its ticks are rounded to
        for row in range(self.row_count):
            self.row_leads[row] = NEVER
            for after in range(self.row_count):
                lead = self.leads[self.row_starts[(row + after) % self.row_count]]
                if lead < NEVER:
                    self.row_leads[row] = after * slot + lead
                    break

    @cython.ccall
    def earliest_transmit_ns(self, code_time: cython.longlong, tick_time: cython.longlong) -> cython.longlong:
        """Earliest time (ns) at which a task sends on a bus.

        `code_time`: no task of the row that runs starts earlier; `tick_time`: no slot.
        """
        next_row: cython.longlong = self.row + 1 if self.row + 1 < self.row_count else 0
        # a time and a lead are at most NEVER, so their sum fits
        first: cython.longlong = tick_time + self.row_leads[next_row]
        if not self.done and code_time + self.leads[self.position] < first:
            first = code_time + self.leads[self.position]
        return first

    def counters(self) -> SlotCounters:
        """How the slots were kept."""
        return SlotCounters(
            count=self.slot_count,
            latest_ns=self.slot_time,
            finished_ns=self.finished_time,
            overruns=self.overruns,
            dropped_tasks=self.dropped_tasks,
            near_limits=self.near_limits,
            max_cycles=self.max_slot_cycles,
            total_cycles=self.total_slot_cycles,
            histogram=list(self.histogram),
            slot_ns=self.schedule.slot_ns,
        )

    @property
    def run_tasks(self) -> int:
        """Tasks that were begun since power-up."""
        return self.run_before + self.position - self.row_start

    @cython.ccall
    def tick(self, timer_time: cython.longlong) -> cython.bint:
        """Timer tick (its hardware time, ns): step to the next row. True: the old row was unfinished."""
        overrun: cython.bint = False
        self.tick_time = timer_time
        self.divider_count += 1
        if self.divider_count < self.divider:
            return False
        self.divider_count = 0
        if not self.done:
            overrun = True
            self.overruns += 1
            if self.recording:
                self.log_overrun(timer_time)
            self.dropped_tasks += self.end - self.position
            if not self.late:
                self.late = True
                self.late_time = self.slot_time
                self.late_count = self.slot_count
                self.late_row = self.row
        self.row += 1
        if self.row >= self.row_count:
            self.row = 0
        self.run_before += self.position - self.row_start
        self.row_start = self.row_starts[self.row]
        self.position = self.row_start
        self.end = self.row_starts[self.row + 1] - 1
        self.done = False
        self.started = True
        self.slot_time = timer_time
        self.slot_count += 1
        self.listed_tasks += self.end - self.position
        if self.recording:
            self.log_begin()
        # ROBOT PARITY: the robot's runner compares start indices of rows, so in a table of one row it
        # would not notice the tick and would finish the old pass instead. Its tables all have several rows.
        return overrun

    @cython.ccall
    def close(self, cycles: cython.longlong) -> cython.bint:
        """A row (or the last task of an overrun one) ended `cycles` after its tick. True: near the limit."""
        index: cython.longlong = cycles // self.histogram_step
        near: cython.bint = False
        if cycles > self.slot_cycles or index >= HISTOGRAM_BINS:
            index = HISTOGRAM_BINS - 1
        elif index == HISTOGRAM_BINS - 1:
            index = HISTOGRAM_BINS - 2
        self.histogram[index] += 1
        self.last_slot_cycles = cycles
        self.total_slot_cycles += cycles
        if cycles > self.max_slot_cycles:
            self.max_slot_cycles = cycles
        if self.near_limit_cycles < cycles <= self.slot_cycles:
            near = True
            self.near_limits += 1
        return near

    @cython.ccall
    def attach_log(self, log: ActivityLog | None) -> None:
        """Every slot from the next one on is written into `log`; None: into none."""
        self.log = log
        self.recording = log is not None
        for task in self.schedule.all_tasks():
            self.set_duration(task)

    @cython.ccall
    def log_begin(self) -> None:
        """Write that the slot of the present row began."""
        log: ActivityLog = self.log
        listed: cython.longlong = self.end - self.position
        log.put(SLOT_BEGAN, self.slot_count, self.slot_time, self.slot_time, 0, 0, self.row, listed)

    @cython.ccall
    def log_overrun(self, time: cython.longlong) -> None:
        """Write what the tick of `time` (ns) found unfinished, before it steps on."""
        log: ActivityLog = self.log
        place: cython.longlong
        for place in range(self.position, self.end):
            log.put(TASK_DROPPED, cython.cast(Task, self.placed[place]).number, time, time, 0, 0, self.row, 0)
        place = self.end - self.position
        log.put(SLOT_OVERRAN, self.slot_count, self.slot_time, time, 0, 0, self.row, place)

    @cython.ccall
    def log_end(self, since: cython.longlong, time: cython.longlong, cycles: cython.longlong) -> None:
        """Write that the slot that began at `since` ended at `time` (ns): the present one, or one that overran."""
        log: ActivityLog = self.log
        if since < self.slot_time:
            log.put(SLOT_ENDED, self.late_count, since, time, cycles, 0, self.late_row, 1)
        else:
            log.put(SLOT_ENDED, self.slot_count, since, time, cycles, 0, self.row, 0)

    def find(self, name):
        """The one task of this name (or the Task itself), wherever it is in the table."""
        tasks = self.schedule.all_tasks()
        found = [task for task in tasks if task is name or task.name == name]
        if not found:
            names = ", ".join(sorted({task.name for task in tasks}))
            raise FirmwareError(f"schedule: no task named {name!r}; there are {names}")
        if len(found) > 1:
            raise FirmwareError(f"schedule: {len(found)} tasks are named {name!r}; give the Task itself")
        return found[0]

    def replace(self, name, function, cost=None, limit=None, per_item=None):
        """Put a user's `function` into the entry `name`; it declares its own cost (kept when None).

        Works while running, at the next call. Returns the Task, whose old function is the caller's to keep.
        """
        task = self.find(name)
        if not callable(function):
            raise FirmwareError(f"task {name}: function {function!r} cannot be called")
        if task.kind == OCCASIONAL_TASK:
            raise FirmwareError(f"task {task.name}: an occasional list has entries, replace one of those")
        checked = Task(
            function,
            cost=task.cost if cost is None else cost,
            limit=task.limit if limit is None else limit,
            per_item=task.per_item if per_item is None else per_item,
            name=task.name,
        )
        task.function = checked.function
        task.cost = checked.cost
        task.limit = checked.limit
        task.per_item = checked.per_item
        return task

    def task_cycles(self) -> dict:
        """Total cycles by task name since power-up."""
        totals: dict = {}
        for task in self.schedule.all_tasks():
            totals[task.name] = totals.get(task.name, 0) + task.total_cycles
        return totals
