from ranger_sim.boards.main_brain.data_link cimport DataLink
from ranger_sim.boards.main_brain.estimator cimport Estimator
from ranger_sim.boards.main_brain.io_data cimport IoData
from ranger_sim.boards.main_brain.mode_machine cimport ModeMachine
from ranger_sim.boards.modules.error_module cimport ErrorModule
from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.ssp_link cimport MainBrainSspLink
from ranger_sim.datatable.store cimport DataStore
from ranger_sim.firmware_sim.microcontroller cimport Microcontroller
from ranger_sim.firmware_sim.peripherals.ssp cimport SspPort, SspSegment
from ranger_sim.firmware_sim.peripherals.uart_hs cimport HsUart
from ranger_sim.firmware_sim.scheduler cimport Schedule

cdef class MainBrainBoard(Microcontroller):
    cdef public object quirks, distribution, controller
    cdef public DataStore store
    cdef public NetworkTime time
    cdef public ErrorModule errors
    cdef public SspPort ssp
    cdef public MainBrainSspLink link
    cdef public IoData io
    cdef public HsUart computer_uart
    cdef public DataLink computer
    cdef public Estimator estimator
    cdef public ModeMachine modes
    cdef public bint errors_one_late, heartbeat_on, execution_time_folds
    cdef public long long error_before, heartbeat_bit, heartbeat_until, execution_time_id
    cdef public long long code_dnf, code_near_limit, code_task_limit, code_id_out_of_range
    cpdef object load_controller(self, controller)
    cpdef object schedule(self)
    cpdef int report(self, long long code) except -1
