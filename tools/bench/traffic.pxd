from ranger_sim.foundation.events cimport CAN_RX, CAN_TX_DONE, EventQueue
from ranger_sim.can_bus.bus cimport Bus

cdef class Load:
    cdef public list buses, inboxes
    cdef public long long per_node, nodes_per_bus, period_ns, quantum_ns, time
    cdef public long long requested, delivered, done, out_of_order, wrong
    cdef public long long[::1] sent, expected, free, word
    cpdef void run(self, long long frames)
    cdef void _drain(self, Bus bus, long long b, long long n, EventQueue inbox)
