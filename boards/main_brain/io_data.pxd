from ranger_sim.boards.modules.network_time cimport NetworkTime
from ranger_sim.boards.modules.ssp_link cimport MainBrainSspLink
from ranger_sim.datatable.store cimport DataStore
from ranger_sim.firmware_sim.peripherals.ssp cimport SspSegment

cdef class IoData:
    cdef public DataStore store
    cdef public MainBrainSspLink link
    cdef public NetworkTime time
    cdef public long long subscriber, timestamp, turn, turn_every, slots
    cdef public long long[::1] send_ids
    cdef public long long[::1] dividers, turn_ids
