from ranger_sim.boards.modules.buzzer cimport Buzzer
from ranger_sim.boards.modules.can_link cimport CanLink
from ranger_sim.boards.modules.colour_leds cimport ColourLeds
from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.execution_timer cimport ExecutionTimer
from ranger_sim.boards.modules.imu_parser cimport ImuParser
from ranger_sim.boards.modules.keypad cimport Keypad
from ranger_sim.boards.modules.lcd cimport Lcd
from ranger_sim.boards.modules.mcu_led cimport Heartbeat, McuLed
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.rc_receiver cimport RcReceiver
from ranger_sim.boards.modules.sync_light cimport SyncLight
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.can_controller cimport CanController
from ranger_sim.firmware_sim.peripherals.gpio cimport Gpio
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.firmware_sim.peripherals.uart cimport Uart

cimport cython

@cython.final
cdef class UserInterfaceBoard(Microcontroller):
    # what the tasks of every slot and the interrupts touch
    cdef public ImuParser imu
    cdef public Uart uart1
    cdef public Lcd lcd
    cdef public CanLink can
    cdef public ErrorModule errors
    cdef public SyncLight sync_light
    cdef public Buzzer buzzer
    cdef public long long slots, imu_start_slots
    # the rest
    cdef public object quirks
    cdef public NetworkTime time
    cdef public Gpio gpio
    cdef public McuLed mcu_leds
    cdef public Heartbeat heartbeat
    cdef public ExecutionTimer execution
    cdef public CanController can2
    cdef public TimerCapture timer0
    cdef public RcReceiver rc
    cdef public Keypad keypad
    cdef public ColourLeds leds
    cdef public bytes imu_command
    cpdef int report(self, long long code) except -1
