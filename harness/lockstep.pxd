cimport cython

from ranger_sim.can_bus.bus cimport Bus
from ranger_sim.firmware_sim.board cimport Board
from ranger_sim.foundation.events cimport NEVER
from ranger_sim.harness.wiring.board_wires cimport BoardWires, WordWire
from ranger_sim.harness.records.sampler cimport Sampler
from ranger_sim.harness.step_watch cimport SerialDevice, StepEnd, StepWatch
from ranger_sim.plant.plant cimport Plant

cpdef enum:
    REACHED_TIME = 0
    REACHED_STEPS = 1
    REACHED_DISTANCE = 2
    FELL = 3
    A_WATCHER_STOPPED = 4

@cython.final
cdef class Lockstep:
    cdef public Plant plant
    cdef public list boards, buses, wires, word_wires, encoder_wires
    cdef public long long time, window_ns, stop_steps
    cdef public double stop_distance_m
    cdef public Sampler sampler
    cdef public StepEnd strikes
    cdef public list watchers
    cdef public SerialDevice serial_device
    cdef public long long[::1] encoder_boards, due, came, prompt, step_times
    cdef public bint side_by_side, stop_wanted
    cpdef long long run(self, long long until) except? <long long>-1
    cdef long long _walk_is_over(self) except? <long long>-1
    @cython.final
    cdef long long _run_in_turn(self, long long end, bint last) except? <long long>-1
    @cython.final
    cdef long long _run_side_by_side(self, long long end) except? <long long>-1
    @cython.final
    cdef long long _advance(self, long long place, long long until) except? <long long>-1
    cdef long long _decide(self, long long until) except? <long long>-1
    cdef int _sense(self) except -1
    cdef bint _watch_before(self, long long now) except? -1
    cdef int _watch_after(self, long long start, long long end) except -1
    cdef void _show_words(self) noexcept
