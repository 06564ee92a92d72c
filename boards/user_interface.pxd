from ranger_sim.boards.firmware_board cimport SatelliteBoard
from ranger_sim.boards.modules.buzzer cimport Buzzer
from ranger_sim.boards.modules.colour_leds cimport ColourLeds
from ranger_sim.boards.modules.imu_parser cimport ImuParser
from ranger_sim.boards.modules.keypad cimport Keypad
from ranger_sim.boards.modules.lcd cimport Lcd
from ranger_sim.boards.modules.rc_receiver cimport RcReceiver
from ranger_sim.boards.modules.sync_light cimport SyncLight
from ranger_sim.firmware_sim.peripherals.timer_capture cimport TimerCapture
from ranger_sim.firmware_sim.peripherals.uart cimport Uart

cimport cython

@cython.final
cdef class UserInterfaceBoard(SatelliteBoard):
    # what the tasks of every slot and the interrupts touch
    cdef public ImuParser imu
    cdef public Uart uart1
    cdef public Lcd lcd
    cdef public SyncLight sync_light
    cdef public Buzzer buzzer
    cdef public long long slots, imu_start_slots
    # the rest
    cdef public TimerCapture timer0
    cdef public RcReceiver rc
    cdef public Keypad keypad
    cdef public ColourLeds leds
    cdef public bytes imu_command
