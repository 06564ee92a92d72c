from foundation.events cimport EventQueue
from firmware_sim.analog cimport AnalogPins
from firmware_sim.clock cimport Crystal
from firmware_sim.scheduler cimport Occasional, Schedule, SlotScheduler, Task, Wait, call, call_with
from firmware_sim.vic cimport InterruptController, InterruptSource

cdef class Peripheral:
    cdef public Microcontroller chip
    cpdef void on_message(self, EventQueue queue)
    cpdef long long on_pin(self, long long channel, long long level, long long time)
    cpdef void on_alarm(self, long long alarm, long long time)

cdef class Microcontroller:
    cdef public str name
    cdef public long long hz
    cdef public Crystal crystal
    cdef public EventQueue inbox, outbox
    cdef public long long now, next_time
    cdef public SlotScheduler scheduler
    cdef public InterruptController vic
    cdef public AnalogPins analog
    cdef public long long[::1] words, pins
    cdef public double ns_per_cycle, cycles_per_ns
    cdef public object on_overrun, on_limit, on_near_limit
    cdef public long long extra_cycles
    # pending-event bookkeeping of the loop
    cdef public long long tick_time, tick_number, tick_period_ns, phase_ns
    cdef public InterruptSource tick_source
    cdef public long long code_time, irq_free, fiq_free
    cdef public bint waiting, check_wait
    cdef public Wait wait_task
    cdef public long long wait_start, wait_stolen, stolen_cycles
    cdef public long long alarm_time, alarm_count
    cdef public long long[::1] alarm_times
    cdef public list alarm_owners
    cdef public long long[::1] alarm_numbers
    cdef public long long alarm_first
    cdef public list message_table, pin_owners
    cdef public long long[::1] pin_channels
    cdef public long long unclaimed, match_time, instant
    cdef public object on_timer_tick
    cdef public object background
    cdef public bint background_wanted
    cdef public long long horizon
    cpdef long long advance(self, long long until)
    cpdef bint due(self, long long until)
    cpdef void spend(self, long long cycles) noexcept
    cpdef long long cycles_since_tick(self)
    cpdef long long request(self, InterruptSource source)
    cpdef long long set_alarm(self, long long index, long long time)
    cpdef void start(self, Schedule schedule, long long phase_ns)
    cpdef object on_slot_timer(self, EventQueue queue)
    cdef long long _input(self)
    cdef long long _alarm(self, long long time)
    cdef long long _timer_match(self)
    cdef long long _background(self)
    cdef long long _serve(self, InterruptSource source, long long time)
    cdef long long _code(self, long long until)
    cdef long long _wait_over(self)
    cdef long long _charge(self, Task task, long long cycles)
    cdef long long _close_slot(self, long long since)
