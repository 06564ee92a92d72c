from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.scheduler cimport SlotScheduler
from ranger_sim.foundation.events cimport EventQueue
from ranger_sim.harness.processes.channel cimport LONGEST, Bell, Mailbox
from ranger_sim.harness.processes.places cimport (
    ANSWERED,
    ANSWER_USED,
    ASKED,
    ASK_USED,
    BOARD_SLEEPS,
    COMMAND,
    COMMAND_ACTIVITY,
    COMMAND_ADVANCE,
    COMMAND_COUNTERS,
    COMMAND_STOP,
    DAMAGED,
    ERRORS,
    LATENESS,
    LATE_COUNT,
    LATE_MAX,
    MAX_SLOT_CYCLES,
    NEXT_OUTPUT,
    NEXT_TIME,
    OVERRUNS,
    PACED,
    PACE_TIME_NS,
    PACE_WALL_NS,
    PACE_WALL_PER_TIME,
    PLANT_SLEEPS,
    REACHED,
    RESULT,
    RESULT_DONE,
    RESULT_MORE,
    RING,
    RING_CYCLES,
    RING_LATE,
    RING_ROW,
    RING_ROWS,
    RING_START,
    ROWS,
    SLOTS,
    SLOT_COUNT,
    SLOT_TIME,
    STAGE_RING,
    TURNS,
    UNTIL,
    URGENT,
    WATCHED,
)
from ranger_sim.harness.processes.stage cimport Audience

cdef class Endpoint:
    cdef public Microcontroller board
    cdef public bint counts_errors, runs_c
    cdef public object clock, shared, activity
    cdef public long long[::1] block, stage
    cdef public double[::1] stage_doubles
    cdef public Bell ask, answer
    cdef public Mailbox to_board, from_board
    cdef public Audience audience
    cdef public EventQueue pending, out
    cdef public long long slots_seen, cycles_seen, ring_first, turns, reached, can_wait, promised
    cpdef void serve(self)
    cdef void _advance(self)
    cdef int _run_to(self, long long until) except -1
    cdef long long _late(self) except? -2
    cdef void _keep_slots(self)
    cdef bint _put_out(self)
    cdef int _show(self) except -1
