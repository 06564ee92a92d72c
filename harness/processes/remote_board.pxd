from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.firmware_sim.edge_line cimport EdgeLine
from ranger_sim.foundation.edge_buffer cimport EdgeBuffer
from ranger_sim.foundation.events cimport NEVER, ORDER_PINS, PIN_EDGE, ROW, ROW_KIND, EventQueue
from ranger_sim.harness.processes.channel cimport FIRST_OWN_KIND, LONGEST, Bell, Mailbox, load
from ranger_sim.harness.processes.places cimport (
    ALIVE,
    ANSWERED,
    ANSWER_USED,
    ASKED,
    ASK_USED,
    BOARD_SLEEPS,
    COMMAND,
    COMMAND_ADVANCE,
    COMMAND_MORE,
    COMMAND_COUNTERS,
    COMMAND_STOP,
    FATE,
    NEXT_OUTPUT,
    NEXT_TIME,
    PLANT_SLEEPS,
    RESULT,
    RESULT_MORE,
    RING,
    RING_ROW,
    RING_ROWS,
    ROWS,
    SLOTS,
    SLOT_TIME,
    UNTIL,
    URGENT,
    WATCHED,
)
from ranger_sim.harness.processes.stage cimport Stage

cpdef enum:
    MOST_WAITING = 200

cdef class RemoteBoard(Board):
    cdef public long long[::1] block
    cdef public Bell ask, answer
    cdef public Mailbox to_board, from_board
    cdef public Stage stage
    cdef public list lines
    cdef public object counted, uncounted, log
    cdef public bint posted, gone, follows_steps
    cdef public long long ring_first, place, silent_until, urgent, turns, reached, watched_number, slot_time
    cdef bint _urgent(self, long long until) noexcept
    cdef void _post(self, long long command, long long until)
    cdef int _ring(self, long long command, long long until) except -1
    cdef bint _collect(self) except? -1
