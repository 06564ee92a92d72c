cimport cython

from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer
from ranger_sim.foundation.events cimport CAN_TX_DONE, NEVER, PIN_EDGE, EventQueue
from ranger_sim.firmware_sim.clock cimport Crystal, TickTrain
from ranger_sim.firmware_sim.scheduler cimport ENTRY, ENTRY_CALLS, ENTRY_NS, OCCASIONAL_TASK, WAIT_TASK, Occasional, Schedule, SlotScheduler, Task, Wait, call, run
from ranger_sim.firmware_sim.vic cimport FIRST_FIQ, InterruptController, InterruptSource, handle

cpdef enum:
    PINS = 64
    ALARMS = 16
    ALARM_PLACES = 18
    MESSAGE_KINDS = 32
    INDICES_PER_KIND = 16

cdef class Peripheral:
    cdef public Microcontroller chip
    cpdef InterruptSource on_message(self, EventQueue queue)
    cpdef long long on_pin(self, long long channel, long long level, long long time) except? <long long>-1
    cpdef InterruptSource on_alarm(self, long long alarm, long long time)
    cpdef object transmit_ends(self)

@cython.final
cdef class Unclaimed(Peripheral):
    pass

@cython.final
cdef class Alarm:
    cdef public Microcontroller chip
    cdef public Peripheral owner
    cdef public long long number, place, time
    cpdef long long set(self, long long time) noexcept
    @cython.final
    cdef long long _set_again(self, long long time) noexcept
    @cython.final
    cdef void _move(self, long long a, long long b) noexcept
    @cython.final
    cdef InterruptSource _ring(self, long long time)

@cython.final
cdef class SlotTimer(Peripheral):
    cdef public Alarm alarm

@cython.final
cdef class EdgeLine:
    cdef public long long next_time, levels
    cdef public EdgeBuffer buffer
    cdef public long long pin, partner_pin, channel
    cdef public Peripheral peripheral
    cdef public InterruptSource source
    @cython.final
    cdef long long find_next(self) noexcept

# Fields that nearly every event touches come first, close together; then those of alarms, edges and messages.
cdef class Microcontroller(Board):
    cdef public long long now, instant, code_time, stop_time, extra_cycles
    cdef public long long alarm_time
    cdef public long long irq_free, fiq_free, stolen_cycles
    cdef public bint waiting, check_wait, background_wanted
    cdef public double ns_per_cycle
    cdef public InterruptController vic
    cdef public SlotScheduler scheduler
    cdef public object background
    cdef public list alarms
    cdef public long long alarms_set
    cdef public long long[ALARM_PLACES] alarm_times
    cdef public long long[ALARM_PLACES] alarm_places
    cdef public list message_table
    cdef public Peripheral others
    cdef public TickTrain ticks
    cdef public InterruptSource tick_source
    cdef public SlotTimer slot_timer
    cdef public long long tick_time, match_time
    cdef public object on_timer_tick
    cdef public double cycles_per_ns
    cdef public Wait wait_task
    cdef public long long wait_start, wait_stolen
    cdef public long long[PINS] pin_channels
    cdef public list pin_owners, pin_sources
    cdef public EdgeLine first_line, second_line
    cdef public long long[::1] pins
    cdef public long long hz
    cdef public Crystal crystal
    cdef public object on_overrun, on_limit, on_near_limit
    cdef public long long unclaimed
    cpdef long long main_loop(self) except? <long long>-1
    cpdef bint due(self, long long until) except? -1
    cpdef void spend(self, long long cycles) noexcept
    cpdef long long cycles_since_tick(self) except? -1
    cpdef long long request(self, InterruptSource source) except? -1
    @cython.final
    cdef long long _edges(self) except? <long long>-1
    cpdef int start(self, Schedule schedule, long long phase_ns) except -1
    cpdef object on_slot_timer(self, EventQueue queue)
    @cython.final
    cdef InterruptSource _input(self, EventQueue queue)
    @cython.final
    cdef InterruptSource _pin_edge(self, EventQueue queue)
    @cython.final
    cdef long long _background(self) except? <long long>-1
    @cython.final
    cdef int _serve(self, InterruptSource source, EventQueue queue, long long time) except -1
    @cython.final
    cdef long long _note_service(self, InterruptSource source, long long items) except? <long long>-1
    @cython.final
    cdef bint _resume(self) except? -1
    @cython.final
    cdef long long _end_row(self) except? <long long>-1
    @cython.final
    cdef long long _spent(self, Task task, long long items) except? <long long>-1
    @cython.final
    cdef bint _special_task(self, Task task) except? -1
    @cython.final
    cdef bint _begin_wait(self, Wait task) except? -1
    @cython.final
    cdef long long _wait_over(self) except? <long long>-1
    @cython.final
    cdef long long _charge(self, Task task, long long cycles) except? <long long>-1
    @cython.final
    cdef long long _close_slot(self, long long since) except? <long long>-1
