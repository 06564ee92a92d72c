from ranger_sim.boards.modules.can_link cimport CanLink
from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.execution_timer cimport ExecutionTimer
from ranger_sim.boards.modules.mcu_led cimport Heartbeat
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller cimport CanController
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio

cdef class FirmwareBoard(Microcontroller):
    cdef public ErrorModule errors
    cdef public NetworkTime time
    cdef public bint errors_one_late
    cdef public long long error_before
    cdef public object table, quirks
    cpdef int report(self, long long code) except -1

cdef class SatelliteBoard(FirmwareBoard):
    cdef public CanLink can
    cdef public CanController can_controller
    cdef public ExecutionTimer execution
    cdef public Heartbeat heartbeat
    cdef public Gpio gpio
