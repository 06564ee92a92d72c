from ranger_sim.boards.modules.can_load cimport CanLoad
from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.mcu_led cimport Heartbeat, McuLed
from ranger_sim.boards.modules.network_clock cimport NetworkClock
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.routing cimport Router, RoutingTable
from ranger_sim.boards.modules.ssp_link cimport RouterSspLink
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.adc_internal cimport AdcInternal
from ranger_sim.firmware_sim.peripherals.can_controller cimport CanController
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio
from ranger_sim.firmware_sim.peripherals.ssp cimport SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.foundation.numbers cimport float32, word_of_float

cimport cython

@cython.final
cdef class BusReceiver:
    cdef public CanController controller
    cdef public Router router

@cython.final
cdef class CanRouterBoard(Microcontroller):
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
    cdef public NetworkTime time
    cdef public ErrorModule errors
    cdef public AdcInternal adc
    cdef public bint errors_one_late, report_full
    cdef public long long error_before, lost_before, own_lost, sync_cycles
    cdef public long long[5] can_leds
    # the rest
    cdef public object quirks
    cdef public Gpio gpio
    cdef public McuLed leds
    cdef public Heartbeat heartbeat
    cdef public CanController can1, can2, can3, can4
    cdef public list error_codes
    cdef public long long code_dnf, code_near_limit, code_task_limit, code_queue_full
    cpdef int report(self, long long code) except -1
    cpdef long long flush(self, CanController controller, long long began) except? <long long>-1
    cpdef bint nothing_waits(self) noexcept
    cpdef bint can_flush(self, long long at) except? -1
    cpdef int send_float(self, long long identifier, double value) except -1
    cpdef double current_A(self) except? -1
    cpdef double voltage_V(self) except? -1
