"""Calls of the functions in a schedule and at an interrupt.

Interpreted, the functions below are used. Compiled modules use those of the same names in calls.pxd, which call a
method of a compiled class by the address of its C function.
"""

from collections.abc import Callable
from typing import Any


def call(function: Callable[[], Any]) -> Any:
    """The result of `function()`."""
    return function()


def code_of(function: Callable[..., Any], arguments: int) -> Any:
    """The first of the two values by which a function of `arguments` (0 or 1) is called: here the function itself."""
    return function


def owner_of(function: Callable[..., Any], arguments: int) -> Any:
    """The second of them; compiled, the object to which a method belongs."""
    return None


def call_with(code: Any, owner: Any, argument: Any) -> Any:
    """The function's result for one argument."""
    return code(argument)


def run(code: Any, owner: Any) -> Any:
    """The result of the function without arguments, None as 0."""
    return code() or 0
