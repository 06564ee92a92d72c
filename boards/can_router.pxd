from ranger_sim.boards.firmware_board cimport FirmwareBoard
from ranger_sim.boards.modules.can_load cimport CanLoad
from ranger_sim.boards.modules.can_link cimport FIRST_BUFFER, SECOND_BUFFER
from ranger_sim.boards.modules.mcu_led cimport Heartbeat
from ranger_sim.boards.modules.network_clock cimport NetworkClock
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.routing cimport TO_SEND, TRANSMIT_MASK, TRANSMIT_RING, Router, RoutingTable
from ranger_sim.boards.modules.sender cimport Sender
from ranger_sim.boards.modules.ssp_link cimport SEGMENT_HALF_WORDS, RouterSspLink
from ranger_sim.firmware_sim.peripherals.adc_internal cimport AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller cimport EIGHT_BYTES, MOD_RESET, RFS_EIGHT_BYTES, CanController
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio
from ranger_sim.firmware_sim.peripherals.ssp cimport SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.timer_capture cimport IR_MR0, TimerCapture
from ranger_sim.foundation.numbers cimport float32

cimport cython

cpdef enum:
    BUSES = 4
    LED_OFF = 0
    LED_TRAFFIC = 1
    LED_WARNING = 2
    LED_FULL = 3
    WARNING_FRAMES_PER_MS = 20
    FULL_FRAMES_PER_MS = 30

@cython.final
cdef class BusReceiver:
    cdef public CanController controller
    cdef public Router router

@cython.final
cdef class OwnFrames(Sender):
    cdef public Router router
    cdef public object report
    cdef public bint report_full
    cdef public long long lost

@cython.final
cdef class CanRouterBoard(FirmwareBoard):
    # what the main loop and the interrupts touch
    cdef public Router router
    cdef public RouterSspLink link
    cdef public list controllers
    cdef public CanLoad load
    cdef public long long idle_since, flush_next, pair_ns
    cdef public bint idle
    cdef public long long[4] route_ns
    cdef public long long[3] flush_ns
    cdef public SspPort ssp
    cdef public TimerCapture timer1
    cdef public NetworkClock clock
    # tasks
    cdef public OwnFrames own
    cdef public AdcInternal adc
    cdef public long long lost_before, sync_cycles
    cdef public long long[5] can_leds
    # the rest
    cdef public Gpio gpio
    cdef public Heartbeat heartbeat
    cdef public CanController can1, can2, can3, can4
    cdef public list can_errors
    cpdef long long flush(self, CanController controller, long long began) except? <long long>-1
    cpdef bint nothing_waits(self) noexcept
    cpdef bint can_flush(self, long long at) except? -1
    cpdef double current_A(self) except? -1
    cpdef double voltage_V(self) except? -1
    cpdef double power_W(self) except? -1
