cimport cython

from ranger_sim.boards.main_brain.estimator cimport Estimator
from ranger_sim.can_bus.bus cimport Bus
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.foundation.events cimport Outbox
from ranger_sim.foundation.row_stream cimport RowStream
from ranger_sim.harness.processes.remote_board cimport RemoteBoard
from ranger_sim.foundation.edge_buffer cimport ByteBuffer
from ranger_sim.plant.drive cimport Drive
from ranger_sim.plant.imu cimport Imu
from ranger_sim.plant.ranger cimport RangerPlant

@cython.final
cdef class WordWire:
    cdef public long long source, word
    cdef public Microcontroller board

@cython.final
cdef class SspWire:
    cdef public Microcontroller master, slave
    cdef public long long exchange_ns, exchanges
    cdef public object loaded
    cpdef void start(self, long long time_ns, object segment) noexcept
    cpdef void load(self, object segment) noexcept

@cython.final
cdef class BoardWires(Outbox):
    cdef public Microcontroller board
    cdef public Drive drive
    cdef public long long window_ns, silent_until, watchdog_pin, low_side_2_pin, low_side_6_pin
    cdef public bint low_side_2, low_side_6
    cdef public list buses
    cdef public long long[5] nodes
    cdef public SspWire link
    cdef public Imu imu
    cdef public long long imu_uart
    cdef public dict can_lines, serial_lines

@cython.final
cdef class Lockstep:
    cdef public RangerPlant plant
    cdef public list boards, buses, wires, word_wires
    cdef public RowStream samples, words
    cdef public long long time, window_ns, next_sample, sample_count, stop_steps
    cdef public double stop_distance_m
    cdef public Imu imu
    cdef public Microcontroller imu_board, main_brain
    cdef public object imu_tap
    cdef public Estimator estimator
    cdef public long long imu_uart
    cdef public long long swing_leg, strike_seen_ns, strike_count, strikes_unmatched, strikes_missed, steps_noticed
    cdef public double strike_sum_ms, strike_squares_ms2
    cdef public long long[::1] encoder_boards, due, came, prompt, step_times, main_brain_words
    cdef public bint records_words, remote
    cdef public double[::1] sample_row
    cpdef long long run(self, long long until) except? <long long>-1
    cdef long long _walk_is_over(self) except? <long long>-1
    @cython.final
    cdef long long _run_in_turn(self, long long end, bint last) except? <long long>-1
    @cython.final
    cdef long long _run_side_by_side(self, long long end) except? <long long>-1
    @cython.final
    cdef long long _advance(self, long long place, long long until) except? <long long>-1
    cdef long long _decide(self, long long until) except? <long long>-1
    cdef void _notice_strike(self)
    cdef void _sense(self) noexcept
    cdef void _show_words(self) noexcept
    cdef void _deliver_bytes(self) noexcept
    cdef int _sample(self, long long now) except -1
