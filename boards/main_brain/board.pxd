from ranger_sim.boards.firmware_board cimport FirmwareBoard
from ranger_sim.boards.main_brain.data_link cimport DataLink
from ranger_sim.boards.main_brain.estimator cimport Estimator
from ranger_sim.boards.main_brain.io_data cimport IoData
from ranger_sim.boards.main_brain.mode_machine cimport ModeMachine
from ranger_sim.boards.modules.ssp_link cimport MainBrainSspLink
from ranger_sim.datatable.store cimport DataStore
from ranger_sim.firmware_sim.peripherals.ssp cimport SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.uart_hs cimport HsUart
from ranger_sim.firmware_sim.scheduler cimport Schedule

cpdef enum:
    EXECUTION_TIMER_HZ = 13000000
    EXECUTION_TIMER_MHZ = 13
    HEARTBEAT_BIT = 8
    HEARTBEAT_MS = 50

cdef class MainBrainBoard(FirmwareBoard):
    cdef public object distribution, controller
    cdef public str program
    cdef public DataStore store
    cdef public SspPort ssp
    cdef public MainBrainSspLink link
    cdef public IoData io
    cdef public HsUart computer_uart
    cdef public DataLink computer
    cdef public Estimator estimator
    cdef public ModeMachine modes
    cdef public bint heartbeat_on, execution_time_folds
    cdef public long long heartbeat_bit, heartbeat_until, execution_time_id
    cpdef object load_controller(self, controller)
