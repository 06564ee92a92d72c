from ranger_sim.datatable.store cimport DataStore
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.uart_hs cimport HsUart
from ranger_sim.firmware_sim.vic cimport InterruptSource
from ranger_sim.foundation.numbers cimport float_of_word, wrap_i32

cpdef enum:
    POINTS_PER_SEGMENT = 9
    POINT_BYTES = 10
    SEGMENT_BYTES = 92
    SEGMENT_SUM = 90
    RING_SEGMENTS = 20
    MOST_FULL = 18
    HALF_FULL = 10
    PACKET_BYTES = 8
    PACKET_SUM = 6
    RECEIVE_RING = 500
    CHANNELS = 48
    MEDIUM = 65536
    FAST = 131072
    IDENTIFIER = 65535
    LARGEST_SUM = 40960
    STEP_SHIFT = 12
    FAST_LIST = 0
    MEDIUM_LIST = 1
    ALL_VARIABLES = 2
    RETURN = 3
    NEW_FOR_COMPUTER = 1
    COMPUTERS_BITS = 5
    BYTE = 0xFF
    NOT_ITS_OWN = 0
    SINGLE = 1
    SIGNED = 2
    UNSIGNED = 3

cdef class DataLink:
    cdef public Microcontroller chip
    cdef public HsUart uart
    cdef public DataStore store
    cdef public object report
    cdef public bint checked, dma_was_off
    cdef public InterruptSource restart_source
    cdef public long long code_full, code_buffer_full, code_dma_off, code_checksum, code_no_parameter
    cdef public long long code_limit, code_id_out_of_range, last_id, first_channel
    cdef public long long[::1] kinds, fast, medium, ring
    cdef public double[::1] least, most
    cdef public unsigned char[::1] segments
    cdef public long long filling, sending, used, in_segment, checksum
    cdef public long long fast_count, medium_count, phase, fast_place, medium_place, slow_id
    cdef public long long rate_sum, calls_to_wait, points, segments_sent, steps
    cdef public long long ring_write, ring_read, packets, bad_packets, refused, ring_full
    cpdef int build_lists(self) except -1
    cpdef long long allowed_steps(self) except? -1
    cpdef object send_data(self)
    cdef void _step(self)
    cdef int _put(self, long long number) except -1
    cdef int _byte(self, long long at, long long byte) except -1
    cdef int _word(self, long long at, long long word) except -1
    cdef int _start(self) except -1
    cpdef object swap_buffers(self)
    cpdef long long waiting(self) except? -1
    cpdef object parse(self)
    cdef void _write(self, long long number, long long word)
    cdef double _number(self, long long number, long long word) noexcept
