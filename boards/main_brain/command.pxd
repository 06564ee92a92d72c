from ranger_sim.datatable.store cimport DataStore

cdef class MotorCommand:
    cdef public DataStore store
    cdef public long long current_id, stiffness_id, dampness_id
    cpdef int send(self, double current_A, double stiffness, double dampness) except -1
    cpdef int off(self) except -1
