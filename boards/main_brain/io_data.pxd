from boards.modules.network_time cimport NetworkTime
from boards.modules.ssp_link cimport MainBrainSspLink
from datatable.store cimport DataStore

cdef class IoData:
    cdef public DataStore store
    cdef public MainBrainSspLink link
    cdef public NetworkTime time
    cdef public long long[::1] send_ids, dividers, turn_ids
    cdef public long long subscriber, timestamp, turn, turn_every, slots
