# cython: boundscheck=False, wraparound=False
# (indices are those of pins, alarms, tasks and edge lines, checked when they are made)
"""One microcontroller: its inputs, its interrupts and its slots, run to any point in virtual time.

Interface of a board: advance to a time with stamped messages in `inbox`, find stamped messages in `outbox`, and
`next_time`, the time at which it must run again if no input arrives.

How time passes inside:
- A task or handler takes effect at its start, at time `now`; then the CPU is busy for its cycles.
- Input that arrives meanwhile is handled at its stamp: by hardware (peripherals, capture registers) at once, by
  handlers as soon as FIQ, then IRQ, is free. Their cycles lengthen whatever they interrupt.
- Order at equal times: edges, messages, alarms (the slot timer's last), handlers (FIQ before IRQ, then by slot), tasks.
- A handler's `now` is its start plus the latency of its source.
Each busy time is rounded down to whole ns; cycle counts are exact integers.
"""

from typing import Final

import cython

from ranger_sim.firmware_sim.activity import INTERRUPT_RAN, MAIN_LOOP_RAN, TASK_RAN, WAIT_RAN, ActivityLog
from ranger_sim.firmware_sim.alarm import Alarm, SlotTimer
from ranger_sim.firmware_sim.calls import call, call_with, run
from ranger_sim.firmware_sim.chip import ALARMS, PINS, Chip
from ranger_sim.firmware_sim.clock import Crystal, TickTrain
from ranger_sim.firmware_sim.counters import BoardCounters
from ranger_sim.firmware_sim.edge_line import EdgeLine
from ranger_sim.firmware_sim.legend import InterruptLegend, Legend, TaskLegend
from ranger_sim.firmware_sim.peripheral import Peripheral, Unclaimed
from ranger_sim.firmware_sim.scheduler import (
    NORMAL_TASK,
    OCCASIONAL_TASK,
    WAIT_TASK,
    Occasional,
    Schedule,
    SlotScheduler,
    Task,
    Wait,
)
from ranger_sim.firmware_sim.vic import FIQ, FIRST_FIQ, SLOT_TIMER, InterruptController, InterruptSource
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.events import CAN_RX, CAN_TX_DONE, NEVER, PIN_EDGE, EventQueue
from ranger_sim.foundation.user_error import FirmwareError

MESSAGE_KINDS: Final = 32  # to a board
INDICES_PER_KIND: Final = 16


@cython.cclass
class Microcontroller(Chip):
    """A chip of `hz` core clock on `crystal`, and the work of its processor: messages, interrupts, the schedule.

    Hooks (None or a callable): `on_overrun()` when a tick finds the row unfinished, `on_limit(task)` when a
    task exceeds its limit, `on_near_limit()` when a finished slot took more than 90 % of its length,
    `on_timer_tick()` in every interrupt of the slot timer.
    `background()`: the main loop's work outside the scheduler, called while no slot runs; it returns the time (ns) at
    which it is done, or 0 when it found nothing to do: it is then called again after the next input, interrupt or slot.
    It may move `now` forward for its effects, and must return once it is past `horizon`, the next input, alarm or slot,
    so that steps of any size give the same run.
    """

    # Fields that nearly every event touches come first, close together; then those of messages and edges.
    extra_cycles: cython.longlong
    irq_free: cython.longlong
    fiq_free: cython.longlong
    stolen_cycles: cython.longlong
    background_wanted: cython.bint
    scheduler: SlotScheduler
    background: object
    alarms: list
    message_table: list
    others: Peripheral
    slot_timer: SlotTimer
    on_timer_tick: object
    wait_task: Wait
    wait_start: cython.longlong
    wait_stolen: cython.longlong
    first_line: EdgeLine
    second_line: EdgeLine
    pin_channels: cython.longlong[PINS]
    pin_owners: list
    pin_sources: list
    on_overrun: object
    on_limit: object
    on_near_limit: object

    def __init__(self, name="chip", hz=60_000_000, crystal=None) -> None:
        Chip.__init__(self, name, hz, crystal)
        self.scheduler = SlotScheduler(Schedule(), 1)
        self.on_overrun = None
        self.on_limit = None
        self.on_near_limit = None
        self.on_timer_tick = None
        self.background = None
        self.background_wanted = True
        self.extra_cycles = 0
        self.irq_free = 0  # earliest time at which an IRQ may be served
        self.fiq_free = 0  # the same for a FIQ
        self.wait_task = None
        self.wait_start = 0
        self.wait_stolen = 0
        self.stolen_cycles = 0
        self.slot_timer = SlotTimer(self)
        self.alarms = [None] * ALARMS + [self.slot_timer.alarm]
        self.others = Unclaimed(self)
        self.message_table = [self.others] * (MESSAGE_KINDS * INDICES_PER_KIND)
        self.pin_owners = [None] * PINS
        self.pin_channels = [-1] * 64  # PINS
        self.pin_sources = [None] * PINS
        self.first_line = EdgeLine(EdgeBuffer(1))  # no encoder: never an edge
        self.second_line = self.first_line

    # --- set-up -------------------------------------------------------------------------------------------

    def _check_peripheral(self, peripheral) -> None:
        """The compiled loop assumes that what is claimed is a Peripheral and does not check again."""
        if not isinstance(peripheral, Peripheral):
            raise FirmwareError(f"{self.name}: {peripheral!r} is not a Peripheral, so nothing can be delivered to it")

    def claim(self, kind, index, peripheral) -> None:
        """Route messages of `kind` whose field a is `index` (0 ... 15) to `peripheral.on_message`."""
        self._check_peripheral(peripheral)
        if not (0 <= kind < MESSAGE_KINDS and 0 <= index < INDICES_PER_KIND):
            raise FirmwareError(
                f"{self.name}: kind {kind} is not 0 ... {MESSAGE_KINDS - 1}"
                f" or index {index} not 0 ... {INDICES_PER_KIND - 1}"
            )
        place = index * MESSAGE_KINDS + kind
        if self.message_table[place] is not self.others:
            raise FirmwareError(f"{self.name}: messages of kind {kind}, index {index} are claimed twice")
        self.message_table[place] = peripheral

    def claim_pin(self, pin, channel, peripheral, source=None) -> InterruptSource:
        """Route edges of `pin` to `peripheral.on_pin(channel, level, time)`.

        `source`: the interrupt that it may request, (PIN_EDGE, pin) unless given. Returns that source.
        """
        self._check_peripheral(peripheral)
        if not 0 <= pin < PINS:
            raise FirmwareError(f"{self.name}: pin {pin} is not 0 ... {PINS - 1}")
        if self.pin_owners[pin] is not None:
            raise FirmwareError(f"{self.name}: pin {pin} is claimed twice")
        self.pin_owners[pin] = peripheral
        self.pin_channels[pin] = channel
        self.pin_sources[pin] = source if source is not None else self.vic.source(PIN_EDGE, pin)
        return self.pin_sources[pin]

    def connect_edges(self, buffer: EdgeBuffer, pin: cython.longlong, partner_pin: cython.longlong) -> None:
        """Take edges of `buffer` on `pin`, claimed before, with the level of `partner_pin`; `note_edges` announces
        them.

        Two encoders can be connected this way; the edges of further ones must arrive as messages.
        """
        if not 0 <= pin < PINS or self.pin_owners[pin] is None:
            raise FirmwareError(f"{self.name}: no peripheral has claimed pin {pin}, so edges there would be lost")
        line = EdgeLine(buffer, pin, partner_pin, self.pin_owners[pin], self.pin_channels[pin], self.pin_sources[pin])
        if self.first_line.peripheral is None:
            self.first_line = line
        elif self.second_line.peripheral is None:
            self.second_line = line
        else:
            raise FirmwareError(f"{self.name}: pin {pin} would be the third with the edges of an encoder")

    def note_edges(self) -> cython.longlong:
        """Note that the buffers of the edge lines may hold new edges; returns the first edge's time.

        Edges of two lines at the same time come in the order in which the lines were connected, and before messages.
        """
        self.edge_time = min(self.first_line.find_next(), self.second_line.find_next())
        return self.edge_time

    def transmit_ends(self, controller: cython.longlong) -> object:
        """The buffer in which this CAN controller finds its transmissions' ends; None: it needs messages."""
        owner: Peripheral = self.message_table[controller * MESSAGE_KINDS + CAN_TX_DONE]
        return owner.transmit_ends()

    def filter_of(self, controller) -> bytes | None:
        """The acceptance filter of this CAN controller; None: every frame, or no such controller."""
        return self.message_table[controller * MESSAGE_KINDS + CAN_RX].filter_bytes()

    def can_rates(self, controller) -> tuple[int, int] | None:
        """Both bit rates of this CAN FD controller, bit/s; None: a classic one, or no such controller."""
        return self.message_table[controller * MESSAGE_KINDS + CAN_RX].can_rates()

    def latest_slot(self) -> cython.longlong:
        """Start of its latest slot (ns); 0 before the first."""
        return self.scheduler.slot_time

    def counters(self) -> object:
        """The board's counters, by name."""
        return BoardCounters(hz=self.hz, unclaimed=self.unclaimed, slots=self.scheduler.counters())

    def keep_activity(self, log: ActivityLog | None) -> None:
        """Write the processor's activity into `log` from now on; None: stop. This does not change the simulation."""
        self.scheduler.attach_log(log)

    def break_off(self, now) -> None:
        """Stop the processor at `now` (ns), up to which it has run: its current activity ends there in its activity
        log.

        The cycles of such rows are those that the full activity would have taken.
        """
        log = self.scheduler.log
        if log is not None:
            log.end_irq(min(self.irq_free, now))
            log.end_code(min(self.code_time, now))

    def activity(self) -> ActivityLog:
        """The activity log, made on first use. Several readers can share it by its sinks."""
        if self.scheduler.log is None:
            self.keep_activity(ActivityLog())
        return self.scheduler.log

    def legend(self) -> object:
        """The meanings of the numbers in the activity log."""
        scheduler = self.scheduler
        return Legend(
            board=self.name,
            hz=self.hz,
            cycles_per_ns=self.cycles_per_ns,
            slot_ns=scheduler.slot_ns,
            slot_cycles=scheduler.slot_cycles,
            tasks=tuple(
                TaskLegend(
                    name=task.name,
                    cost=task.cost,
                    limit=task.limit,
                    per_item=task.per_item,
                    item=task.item,
                    spins=isinstance(task, Wait),
                    entries=tuple(e.number for e in task.tasks) if isinstance(task, Occasional) else (),
                )
                for task in scheduler.tasks
            ),
            interrupts=tuple(
                InterruptLegend(source.name, source.cost, source.per_item, source.latency, source.slot == FIQ)
                for source in self.vic.sources.values()
            ),
            rows=tuple(
                tuple(task.number for task in scheduler.schedule.row_tasks(row)) for row in range(scheduler.row_count)
            ),
        )

    def new_alarm(self, peripheral, number) -> Alarm:
        """A new alarm; when due, it calls `peripheral.on_alarm(number, time)`."""
        self._check_peripheral(peripheral)
        if None not in self.alarms:
            raise FirmwareError(f"{self.name}: more than {ALARMS} peripheral alarms")
        place = self.alarms.index(None)
        self.alarms[place] = Alarm(self, peripheral, number, place)
        return self.alarms[place]

    @cython.ccall
    def start(self, schedule: Schedule, phase_ns: cython.longlong) -> None:
        """Run `schedule`: the first slot begins at `phase_ns`, the later ones by this chip's crystal."""
        cycles: cython.longlong = schedule.slot_ns * self.hz // 1000000000
        self.scheduler = SlotScheduler(schedule, cycles, self.ns_per_cycle)
        self.ticks = TickTrain(self.crystal, schedule.slot_ns // schedule.divider, phase_ns)
        self.tick_time = phase_ns
        self.slot_timer.alarm.set(phase_ns)
        self.waiting = False
        self.tick_source = self.vic.attach(
            SLOT_TIMER,
            0,
            self.on_slot_timer,
            schedule.tick_cost,
            slot=schedule.tick_slot,
            latency=None if schedule.tick_latency < 0 else schedule.tick_latency,
            name="slot timer",
        )

    def retune(self, ppb, now) -> None:
        """Let the crystal run `ppb` parts per billion fast from `now` (ns), up to which the chip has run.

        Everything clocked by it continues from its present state at the new rate: slots, timers, PWM, serial lines,
        processor cycles.
        """
        before: Crystal = self.crystal
        self.crystal = Crystal(before.nominal_hz, ppb)
        self.ns_per_cycle = self.crystal.ns_per_cycle(self.hz)
        self.cycles_per_ns = self.crystal.cycles_per_ns(self.hz)
        self.vic.retune(self.ns_per_cycle)
        self.scheduler.retune(self.ns_per_cycle)
        if self.tick_time < NEVER:
            self.match_time = now - self.crystal.in_its_time(now - self.match_time, before)
            self.tick_time = now + self.crystal.in_its_time(self.tick_time - now, before)
            self.ticks = self.ticks.moved(self.crystal, self.tick_time)
            self.slot_timer.alarm.set(self.tick_time)
        for peripheral in self.peripherals:
            peripheral.retune(now, before)

    # --- what firmware calls ------------------------------------------------------------------------------

    @cython.ccall
    def spend(self, cycles: cython.longlong) -> cython.void:
        """Add modelled cycles to the task or handler that runs now."""
        self.extra_cycles += cycles

    @cython.ccall
    def cycles_since_tick(self) -> cython.longlong:
        """Core cycles at `now` since the slot timer's last match (its count register)."""
        return int((self.now - self.match_time) * self.cycles_per_ns)

    @cython.ccall
    def request(self, source: InterruptSource) -> cython.longlong:
        """Raise an interrupt line; it is served as soon as its priority allows. 1 if newly pending."""
        if self.now > self.input_time:  # a task requests it, and it began after others of its row
            self.input_time = self.now
        self.next_time = self.input_time
        return self.vic.raise_source(source, self.now)

    def stop_at(self, time: cython.longlong) -> cython.longlong:
        """Limit a running chip to `time` (ns), which is later than now.

        Returns the time at which it stops.
        """
        if time < self.horizon:
            self.horizon = time
            if time < self.stop_time:
                self.stop_time = time
        return self.horizon

    @cython.ccall
    def main_loop(self) -> cython.longlong:
        """Run one turn of `background`; a board may override this instead of naming a function."""
        return call(self.background)

    # --- the event loop -----------------------------------------------------------------------------------

    @cython.ccall
    def due(self, until: cython.longlong) -> cython.bint:
        """True when something happens here before `until`, waiting inputs included."""
        return self.next_time < until or self.inbox.head_time < until or self.edge_time < until

    def advance(self, until: cython.longlong) -> cython.longlong:
        """Run everything due before `until` (ns), or before `horizon` where an output brought that nearer.

        Returns `next_time`.
        """
        inbox: EventQueue = self.inbox
        vic: InterruptController = self.vic
        scheduler: SlotScheduler = self.scheduler
        task: Task
        first: cython.longlong
        own: cython.longlong
        usual_ns: cython.longlong
        items: cython.longlong
        self.horizon = until
        while True:
            # input, or an event that is due
            first = self.alarm_time
            if inbox.head_time < first:
                first = inbox.head_time
            if self.edge_time < first:
                first = self.edge_time
            # the processor's work before that: a handler, tasks, or the main loop between them
            own = NEVER
            if vic.pending != 0:
                own = self.fiq_free if vic.pending >= FIRST_FIQ else self.irq_free
                own = own if own > self.input_time else self.input_time
            elif not scheduler.done:
                if not self.waiting or self.check_wait:
                    own = self.code_time
            elif self.background_wanted and self.background is not None:
                own = self.code_time if self.code_time > self.input_time else self.input_time
            if own < first:
                if own >= self.horizon:
                    break
                self.input_time = own
                if vic.pending != 0:
                    self._serve(vic.take_first(), inbox, own)
                    continue
                if scheduler.done:
                    self._background()
                    continue
                # tasks, one after another; their effects can only bring an alarm or an interrupt nearer
                self.stop_time = self.horizon if self.horizon < first else first
                self.extra_cycles = 0
                if (self.waiting or scheduler.late) and not self._resume():
                    continue
                while scheduler.position < scheduler.end:
                    task = cython.cast(Task, scheduler.placed[scheduler.position])
                    scheduler.position += 1
                    usual_ns = task.usual_ns
                    self.now = self.code_time
                    if usual_ns >= 0:
                        items = run(task.code, task.owner)
                        if items == 0 and self.extra_cycles == 0:
                            self.code_time += usual_ns
                            task.usual_calls += 1
                        else:
                            self._spent(task, items)
                    elif not self._special_task(task):
                        break
                    if self.code_time >= self.stop_time or vic.pending != 0:
                        break
                else:
                    self._end_row()
                continue
            if first >= self.horizon:
                break
            # at equal times: edges, messages, alarms
            if self.edge_time == first:
                self._edges()
                continue
            self.input_time = first
            if inbox.head_time == first:
                inbox.take()
                asking = self._input(inbox)
            else:
                asking = cython.cast(Alarm, self.alarms[self.alarm_places[self.alarms_set - 1]]).ring(first)
            if asking is not None:
                # mostly the processor is free for it, and nothing else is due at this time
                if (
                    vic.pending == 0
                    and self.irq_free <= first
                    and self.alarm_time > first
                    and inbox.head_time > first
                    and asking.bit != 0
                ):
                    asking.requested = first
                    self._serve(asking, inbox, first)
                else:
                    vic.raise_source(asking, first)
        if self.alarm_time < own:
            own = self.alarm_time
        self.next_time = own
        return own

    def earliest_transmit_ns(self) -> cython.longlong:
        """Earliest time (ns) at which the board can send on a bus, unless an urgent message arrives.

        That is its next event, or later where its schedule names the tasks that send (`Schedule.transmitters`).
        """
        time: cython.longlong = self.code_time
        if not self.scheduler.names_transmitters or self.vic.pending != 0 or self.background is not None:
            return self.next_time
        if self.waiting and self.horizon > time:  # the condition that the task spins for is not met before that
            time = self.horizon
        return self.scheduler.earliest_transmit_ns(time, self.tick_time)

    def quiet_until(self) -> cython.longlong:
        """Earliest time (ns) at which the board can output anything, whatever non-urgent input arrives."""
        if not self.scheduler.done or self.vic.pending != 0 or (self.background is not None and self.background_wanted):
            return 0
        return self.alarm_time  # the slot timer's match is an alarm, too

    @cython.cfunc
    @cython.final
    def _edges(self) -> cython.longlong:
        """Handle edges from the first one on, each with its fast interrupt, until something else comes first.

        Hardware first: the capture happens at the edge's stamp whatever the processor does. Returns the last edge's
        time.
        """
        inbox: EventQueue = self.inbox
        vic: InterruptController = self.vic
        line: EdgeLine
        level: cython.longlong
        time: cython.longlong
        # the first other event; a handler may set an alarm before it
        self.stop_time = min(self.horizon, self.alarm_time, inbox.head_time)
        self.background_wanted = True
        while True:
            time = self.edge_time
            line = self.first_line if self.first_line.next_time == time else self.second_line
            level = line.levels >> 1
            self.input_time = time
            self.now = time
            self.pins[line.pin] = level
            self.pins[line.partner_pin] = line.levels & 1
            line.buffer.read += 1
            line.find_next()
            self.edge_time = min(self.first_line.next_time, self.second_line.next_time)
            if line.peripheral.on_pin(line.channel, level, time):
                if (
                    self.fiq_free > time
                    or vic.pending >= FIRST_FIQ
                    or line.source.bit < FIRST_FIQ
                    or time >= self.edge_time
                    or time >= self.stop_time
                ):
                    vic.raise_source(line.source, time)
                    return time
                # at once: the fast interrupt is free and no other source waits for it
                line.source.requested = time
                self._serve(line.source, inbox, time)
            if vic.pending != 0 or self.edge_time >= self.stop_time:
                return time
            if self.code_time < self.edge_time and (self.background is not None or not self.scheduler.done):
                if not self.waiting or self.check_wait:
                    return time

    @cython.cfunc
    @cython.final
    def _input(self, queue: EventQueue) -> InterruptSource | None:
        """Handle the message just taken: hardware first. Returns the interrupt source that it makes pending."""
        self.now = self.input_time
        self.background_wanted = True
        if queue.kind == PIN_EDGE:
            return self._pin_edge(queue)
        if 0 <= queue.kind < MESSAGE_KINDS and 0 <= queue.a < INDICES_PER_KIND:
            return cython.cast(Peripheral, self.message_table[queue.a * MESSAGE_KINDS + queue.kind]).on_message(queue)
        return self.others.on_message(queue)

    @cython.cfunc
    @cython.final
    def _pin_edge(self, queue: EventQueue) -> InterruptSource | None:
        """Handle an edge that arrived as a message."""
        pin: cython.longlong = queue.a
        channel: cython.longlong = self.pin_channels[pin]
        self.pins[pin] = queue.b
        if queue.c >= 0:
            self.pins[queue.c] = queue.d
        if self.followers[pin] is not None:
            cython.cast(Peripheral, self.followers[pin]).on_level(pin, queue.b)
        if channel < 0:
            return self.others.on_message(queue)
        if cython.cast(Peripheral, self.pin_owners[pin]).on_pin(channel, queue.b, queue.time):
            return cython.cast(InterruptSource, self.pin_sources[pin])
        return None

    @cython.ccall
    def on_slot_timer(self, queue: EventQueue) -> object:
        """Handler of the slot timer: publish the next row."""
        if self.on_timer_tick is not None:
            call(self.on_timer_tick)
        if self.scheduler.tick(self.match_time) and self.scheduler.schedule.completion_flag:
            if self.on_overrun is not None:
                self.on_overrun()
        return None

    @cython.cfunc
    @cython.final
    def _background(self) -> cython.longlong:
        """Run one turn of the main loop outside the scheduler."""
        if self.code_time < self.input_time:
            if self.scheduler.recording:
                self._log_end_of_code()
            self.code_time = self.input_time
        self.now = self.code_time
        done: cython.longlong = self.main_loop()
        cycles: cython.longlong
        if done <= self.code_time:
            self.background_wanted = False
            return done
        if self.scheduler.recording:
            cycles = int((done - self.code_time) * self.cycles_per_ns)
            if self.scheduler.log.code_open and self.scheduler.log.code_kind == MAIN_LOOP_RAN:
                self.scheduler.log.code_cycles += cycles
            else:
                self._log_end_of_code()
                self.scheduler.log.begin_code(MAIN_LOOP_RAN, 0, self.code_time, cycles, self.scheduler.row, 0)
        self.code_time = done
        return done

    @cython.cfunc
    @cython.final
    def _serve(self, source: InterruptSource, queue: EventQueue, time: cython.longlong) -> None:
        """Run the handler of `source`, which waits no longer, at `time` and let its cycles pass."""
        busy: cython.longlong
        count: cython.longlong
        requested: cython.longlong = source.requested  # the handler may request the next service
        source.served += 1
        self.background_wanted = True
        self.now = time + source.latency_ns
        self.extra_cycles = 0
        items = call_with(source.code, source.owner, queue)
        if items is None and self.extra_cycles == 0 and not self.scheduler.recording:
            self.stolen_cycles += source.base_cycles
            busy = source.base_ns
        else:
            count = 0 if items is None else items
            busy = self._note_service(source, count)
            if self.scheduler.recording:
                self._log_service(source, count, time, requested, busy)
        if source.bit >= FIRST_FIQ:
            self.fiq_free = time + busy
        self.irq_free = (self.irq_free if self.irq_free > time else time) + busy
        self.code_time = (self.code_time if self.code_time > time else time) + busy
        self.check_wait = True

    @cython.cfunc
    @cython.final
    def _note_service(self, source: InterruptSource, items: cython.longlong) -> cython.longlong:
        """Note a service that handled `items`, took extra cycles or is recorded; returns how long it took (ns)."""
        cycles: cython.longlong = source.base_cycles + source.per_item * items + self.extra_cycles
        busy: cython.longlong = int(cycles * self.ns_per_cycle)
        self.stolen_cycles += cycles
        source.note(cycles)
        return busy

    @cython.cfunc
    @cython.final
    def _log_service(
        self,
        source: InterruptSource,
        items: cython.longlong,
        time: cython.longlong,
        requested: cython.longlong,
        busy: cython.longlong,
    ) -> cython.longlong:
        """Write a service of `source` that takes `busy` ns from `time` on into the log; returns its latency (ns)."""
        log: ActivityLog = self.scheduler.log
        cycles: cython.longlong = source.base_cycles + source.per_item * items + self.extra_cycles
        latency: cython.longlong = time + source.latency_ns - requested
        row: cython.longlong = self.scheduler.row
        if self.irq_free <= time:
            log.end_irq(self.irq_free)
        if self.code_time <= time:  # nothing is interrupted: the code before it is complete
            log.end_code(self.code_time)
        if source.bit >= FIRST_FIQ:
            log.put(INTERRUPT_RAN, source.number, time, time + busy, cycles, latency, row, items)
        else:
            log.begin_irq(source.number, time, cycles, latency, row, items)
        return latency

    @cython.cfunc
    @cython.final
    def _log_end_of_code(self) -> cython.longlong:
        """Log that the code that ran until now, and the interrupts in it, are complete; returns `code_time`."""
        self.scheduler.log.end_irq(self.irq_free)
        self.scheduler.log.end_code(self.code_time)
        return self.code_time

    @cython.cfunc
    @cython.final
    def _resume(self) -> cython.bint:
        """Continue tasks after one that spins, or after one that was completed behind its slot's end.

        False when something else comes first.
        """
        scheduler: SlotScheduler = self.scheduler
        if self.waiting:
            self.now = self.code_time
            self.check_wait = False
            if not call(self.wait_task.routine):
                return False
            self._wait_over()
            if self.code_time >= self.stop_time or self.vic.pending != 0:
                return False
        if scheduler.late:
            scheduler.late = False
            scheduler.finished_time = self.code_time  # as far as it may run; a hanging program does not reach this
            self._close_slot(scheduler.late_time)
        return True

    @cython.cfunc
    @cython.final
    def _end_row(self) -> cython.longlong:
        """End the row after its last task; returns the cycles of its slot."""
        self.now = self.code_time
        self.scheduler.done = True
        self.background_wanted = True
        self.scheduler.finished_time = self.code_time
        return self._close_slot(self.scheduler.slot_time)

    @cython.cfunc
    @cython.final
    def _spent(self, task: Task, items: cython.longlong) -> cython.longlong:
        """Count the `items` of a task that has just run; returns the cycles it took."""
        cycles: cython.longlong = task.base_cycles + task.per_item * items + self.extra_cycles
        self.extra_cycles = 0
        return self._charge(task, cycles, items)

    @cython.cfunc
    @cython.final
    def _special_task(self, task: Task) -> cython.bint:
        """Run a task whose calls differ, or whose calls are recorded. False when it has to spin."""
        entry: Task
        items: cython.longlong = 0
        if self.scheduler.recording:
            self._log_end_of_code()
        if task.kind == NORMAL_TASK:
            self._spent(task, run(task.code, task.owner))
            return True
        if task.kind == WAIT_TASK:
            return self._begin_wait(task)
        if task.kind == OCCASIONAL_TASK:
            entry = cython.cast(Occasional, task).next_task()
            if entry is None:
                self._charge(task, task.base_cycles, 0)
                return True
            result = call(entry.routine)
            self._charge(task, task.base_cycles, 0)
            task = entry
        else:
            result = call(task.routine)
        if result is not None:
            items = result
        self._spent(task, items)
        return True

    @cython.cfunc
    @cython.final
    def _begin_wait(self, task: Wait) -> cython.bint:
        """Begin a task that spins; False when it has to."""
        self.wait_task = task
        self.wait_start = self.code_time
        self.wait_stolen = self.stolen_cycles
        if call(task.routine):
            self._wait_over()
            return True
        task.waits += 1
        self.waiting = True
        self.check_wait = False
        return False

    @cython.cfunc
    @cython.final
    def _wait_over(self) -> cython.longlong:
        """End the spinning after its condition became true: its cycles are the spinning, less the stolen ones."""
        task: Wait = self.wait_task
        spun: cython.longlong = int((self.code_time - self.wait_start) * self.cycles_per_ns)
        before: cython.longlong = self.code_time
        cost: cython.longlong = task.base_cycles + self.extra_cycles
        spun -= self.stolen_cycles - self.wait_stolen
        if spun < 0:
            spun = 0
        self.waiting = False
        self.extra_cycles = 0
        self._charge(task, spun + cost, spun)
        spun = int(cost * self.ns_per_cycle)
        self.code_time = before + spun
        return spun

    @cython.cfunc
    @cython.final
    def _charge(self, task: Task, cycles: cython.longlong, items: cython.longlong) -> cython.longlong:
        """Let the cycles of a task that handled `items` pass and compare them with its limit."""
        busy: cython.longlong = int(cycles * self.ns_per_cycle)
        if self.scheduler.recording:
            self._log_task(task, cycles, items)
        self.code_time += busy
        task.note(cycles)
        if cycles > task.most_cycles > 0:
            task.hits += 1
            if self.on_limit is not None:
                self.on_limit(task)
        return cycles

    @cython.cfunc
    @cython.final
    def _log_task(self, task: Task, cycles: cython.longlong, items: cython.longlong) -> cython.longlong:
        """Log that a task has the processor; returns since when (ns)."""
        scheduler: SlotScheduler = self.scheduler
        kind: cython.longlong = TASK_RAN
        since: cython.longlong = self.code_time
        if task.kind == WAIT_TASK:
            kind = WAIT_RAN
            since = self.wait_start
        row: cython.longlong = scheduler.late_row if scheduler.late else scheduler.row
        scheduler.log.begin_code(kind, task.number, since, cycles, row, items)
        return since

    @cython.cfunc
    @cython.final
    def _close_slot(self, since: cython.longlong) -> cython.longlong:
        """Record the slot that began at `since` and ends now."""
        scheduler: SlotScheduler = self.scheduler
        cycles: cython.longlong = int((self.code_time - since) * self.cycles_per_ns)
        if scheduler.recording:
            self._log_end_of_code()
            scheduler.log_end(since, self.code_time, cycles)
        if scheduler.close(cycles) and self.on_near_limit is not None:
            self.on_near_limit()
        return cycles
