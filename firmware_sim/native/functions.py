"""Functions of a program in C, as tasks, handlers and hooks of a board."""

from typing import Any

import cython

from ranger_sim.firmware_sim.native.library import address
from ranger_sim.firmware_sim.native.program import call_hook, call_turn, call_work, pointer


@cython.final
@cython.cclass
class Function:
    """A function of the program, `given` by the library. It is called by its address: no lock is released meanwhile."""

    code: cython.p_void
    given: object

    def __init__(self, given) -> None:
        self.given = given
        self.code = pointer(address(given))

    @cython.ccall
    def work(self) -> object:
        """Run a task; returns the number of items that it handled, None for 0."""
        items: cython.longlong = call_work(self.code)
        return items if items else None

    @cython.ccall
    def serve(self, queue: object) -> object:
        """Run a handler; returns as `work` does."""
        items: cython.longlong = call_work(self.code)
        return items if items else None

    @cython.ccall
    def hook(self) -> object:
        """Run a function without a result."""
        call_hook(self.code)
        return None

    @cython.ccall
    def notice(self, task: object) -> object:
        """Run such a function because of `task`."""
        call_hook(self.code)
        return None

    @cython.ccall
    def turn(self) -> cython.longlong:
        """Run a function with a result of 64 bits: a turn of a main loop, or the address of a structure."""
        return call_turn(self.code)


def function(given: Any) -> Any:
    """A `Function` for tables of tasks and handlers.

    Its class is hidden from the callers' C, where a method of a known class is not bound to its object but wrapped,
    which calls.pxd does not see through.
    """
    return Function(given)
