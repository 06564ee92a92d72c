cimport cython

from ranger_sim.firmware_sim.activity cimport INTERRUPT_RAN, MAIN_LOOP_RAN, TASK_RAN, WAIT_RAN, ActivityLog
from ranger_sim.firmware_sim.alarm cimport Alarm, SlotTimer
from ranger_sim.firmware_sim.chip cimport ALARMS, PINS, Chip
from ranger_sim.firmware_sim.edge_line cimport EdgeLine
from ranger_sim.firmware_sim.peripheral cimport Peripheral, Unclaimed
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer
from ranger_sim.foundation.events cimport CAN_TX_DONE, NEVER, PIN_EDGE, EventQueue
from ranger_sim.firmware_sim.clock cimport Crystal, TickTrain
from ranger_sim.firmware_sim.scheduler cimport ENTRY, ENTRY_CALLS, ENTRY_NS, OCCASIONAL_TASK, WAIT_TASK, Occasional, Schedule, SlotScheduler, Task, Wait, call, run
from ranger_sim.firmware_sim.vic cimport FIRST_FIQ, InterruptController, InterruptSource, handle

cpdef enum:
    MESSAGE_KINDS = 32
    INDICES_PER_KIND = 16

# Fields that nearly every event touches come first, close together; then those of messages and edges.
cdef class Microcontroller(Chip):
    cdef public long long extra_cycles
    cdef public long long irq_free, fiq_free, stolen_cycles
    cdef public bint background_wanted
    cdef public SlotScheduler scheduler
    cdef public object background
    cdef public list alarms
    cdef public list message_table
    cdef public Peripheral others
    cdef public SlotTimer slot_timer
    cdef public object on_timer_tick
    cdef public Wait wait_task
    cdef public long long wait_start, wait_stolen
    cdef public EdgeLine first_line, second_line
    cdef public long long[PINS] pin_channels
    cdef public list pin_owners, pin_sources
    cdef public object on_overrun, on_limit, on_near_limit
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
    cdef long long _log_service(self, InterruptSource source, long long items, long long time, long long requested) except? <long long>-1
    @cython.final
    cdef long long _log_end_of_code(self) except? <long long>-1
    @cython.final
    cdef long long _log_task(self, Task task, long long cycles, long long items) except? <long long>-1
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
    cdef long long _charge(self, Task task, long long cycles, long long items) except? <long long>-1
    @cython.final
    cdef long long _close_slot(self, long long since) except? <long long>-1
