cimport cython
from ranger_sim.firmware_sim.activity cimport SLOT_BEGAN, SLOT_ENDED, SLOT_OVERRAN, TASK_DROPPED, ActivityLog
from ranger_sim.foundation.events cimport NEVER



cdef extern from "Python.h":
    ctypedef struct PyObject
    ctypedef object (*plain_call "PyCFunction")(PyObject*, PyObject*)
    bint PyCFunction_CheckExact(object)
    plain_call PyCFunction_GET_FUNCTION(object)
    PyObject* PyCFunction_GET_SELF(object)
    int PyCFunction_GET_FLAGS(object)
    int METH_NOARGS
    int METH_O

cpdef enum:
    NORMAL_TASK = 0
    OCCASIONAL_TASK = 1
    WAIT_TASK = 2
    HISTOGRAM_BINS = 21
    ENTRY = 4
    ENTRY_CODE = 0
    ENTRY_OWNER = 1
    ENTRY_NS = 2
    ENTRY_CALLS = 3

# What stands in a schedule is mostly a bound method of a compiled class. Its C function is then called without the
# general machinery of Python calls; anything else is called in the ordinary way. (With always_allow_keywords off, as
# setup.py has it, methods without arguments are METH_NOARGS and methods with one are METH_O.)
cdef inline object call(object function):
    if PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == METH_NOARGS:
        return PyCFunction_GET_FUNCTION(function)(PyCFunction_GET_SELF(function), NULL)
    return function()

cdef inline bint is_method(object function, int arguments):
    return PyCFunction_CheckExact(function) and PyCFunction_GET_FLAGS(function) == (METH_O if arguments else METH_NOARGS)

cdef inline object call_anything(PyObject* function, PyObject* nothing):
    return (<object>function)()

cdef inline object call_anything_with(PyObject* function, PyObject* argument):
    return (<object>function)(<object>argument)

# By these two addresses a function of `arguments` (0 or 1) is called: of a method's C function, and of the object that
# it belongs to; or of a call in the ordinary way, and of what is called. Who keeps them must keep `function` alive.
cdef inline long long code_of(object function, int arguments):
    if is_method(function, arguments):
        return <long long><void*>PyCFunction_GET_FUNCTION(function)
    return <long long><void*>(call_anything_with if arguments else call_anything)

cdef inline long long owner_of(object function, int arguments):
    return <long long><void*>(PyCFunction_GET_SELF(function) if is_method(function, arguments) else <PyObject*>function)

cdef inline object call_with(long long code, long long owner, object argument):
    return (<plain_call><void*>code)(<PyObject*><void*>owner, <PyObject*>argument)

# What the task of this number in a scheduler's table returns, None as 0.
cdef inline long long run(SlotScheduler scheduler, long long number) except? -1:
    items = (<plain_call><void*>scheduler.table[ENTRY * number + ENTRY_CODE])(
        <PyObject*><void*>scheduler.table[ENTRY * number + ENTRY_OWNER], NULL
    )
    return 0 if items is None else items

cdef class Task:
    cdef public long long kind, base_cycles, per_item, most_cycles
    cdef public long long noted_calls, noted_cycles, noted_most, noted_last, noted_when
    cdef public long long number
    cdef public SlotScheduler scheduler
    cdef public object routine
    cdef public bint speaks
    cdef public long long hits
    cdef public str name, item
    @cython.final
    cdef void note(self, long long cycles) noexcept
    cpdef long long usual_calls(self) except? -1

@cython.final
cdef class Wait(Task):
    cdef public long long waits

@cython.final
cdef class Occasional(Task):
    cdef public list tasks
    cdef public long long position
    cdef public bint extra_idle_call
    cpdef Task next_task(self)

@cython.final
cdef class Schedule:
    cdef public long long slot_ns, divider, tick_cost, tick_slot, tick_latency
    cdef public list every, rows, last
    cdef public bint completion_flag, announces

# Fields that a slot touches come first, close together; a memoryview has its address in its first bytes.
@cython.final
cdef class SlotScheduler:
    cdef public long long position, end
    cdef public bint done, late, recording, started
    cdef long long* table
    cdef long long* leads
    cdef public long long row, row_count
    cdef public bint announces
    cdef public list tasks, functions
    cdef readonly unsigned char[::1] numbers
    cdef public long long divider_count, divider
    cdef public long long row_start, run_before, slot_count, listed_tasks, slot_time, tick_time, finished_time
    cdef public long long slot_cycles, near_limit_cycles, histogram_step
    cdef public long long last_slot_cycles, total_slot_cycles, max_slot_cycles
    cdef public long long[::1] row_starts
    cdef public long long[21] histogram
    cdef readonly long long[::1] table_kept, leads_kept  # what the two addresses lead into
    cdef public Schedule schedule
    cdef public double ns_per_cycle
    cdef public long long slot_ns, overruns, dropped_tasks, near_limits
    cdef public long long late_time, late_count, late_row
    cdef public ActivityLog log
    cpdef bint tick(self, long long timer_time) except? -1
    cpdef bint close(self, long long cycles) except? -1
    cpdef int attach_log(self, ActivityLog log) except -1
    cpdef int log_begin(self) except -1
    cpdef int log_overrun(self, long long time) except -1
    cpdef int log_end(self, long long since, long long time, long long cycles) except -1
    cpdef long long speaks_from(self, long long code_time, long long tick_time) except? <long long>-1
