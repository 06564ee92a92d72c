# The C twins of the functions in calls.py.
#
# A function in a schedule is mostly a bound method of a compiled class. Its C function is then called without the
# general machinery of Python calls; anything else is called in the ordinary way. (With always_allow_keywords off, as
# setup.py has it, methods without arguments are METH_NOARGS and methods with one are METH_O.)

cdef extern from "Python.h":
    ctypedef struct PyObject
    ctypedef object (*plain_call "PyCFunction")(PyObject*, PyObject*)
    bint PyCFunction_CheckExact(object)
    plain_call PyCFunction_GET_FUNCTION(object)
    PyObject* PyCFunction_GET_SELF(object)
    int PyCFunction_GET_FLAGS(object)
    int METH_NOARGS
    int METH_O

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

# By these two a function of `arguments` (0 or 1) is called: by the address of a method's C function, and the object that
# it belongs to; or by the address of a call in the ordinary way, and what is called. The reference to `function` keeps both valid.
cdef inline void* code_of(object function, int arguments):
    if is_method(function, arguments):
        return <void*>PyCFunction_GET_FUNCTION(function)
    return <void*>(call_anything_with if arguments else call_anything)

cdef inline void* owner_of(object function, int arguments):
    return <void*>(PyCFunction_GET_SELF(function) if is_method(function, arguments) else <PyObject*>function)

cdef inline object call_with(void* code, void* owner, object argument):
    return (<plain_call>code)(<PyObject*>owner, <PyObject*>argument)

cdef inline long long run(void* code, void* owner) except? -1:
    items = (<plain_call>code)(<PyObject*>owner, NULL)
    return 0 if items is None else items
