"""Calls of what stands in a schedule or at an interrupt, when the robot runs interpreted.

Compiled, the functions of the same names in scheduler.pxd and vic.pxd are used: they call methods of compiled classes
by the addresses of their C functions.
"""

from collections.abc import Callable
from types import FunctionType
from typing import Any


def call(function: Callable[[], Any]) -> Any:
    """What `function()` returns."""
    return function()


def run(scheduler: Any, number: int) -> Any:
    """What the task of this number in a scheduler's table returns, None as 0."""
    return scheduler.functions[number]() or 0


def handle(source: Any, queue: Any) -> Any:
    """What the handler of an interrupt source returns for the message in the fields of `queue`."""
    return source.service(queue)


def code_of(function: Callable[..., Any], arguments: int) -> int:
    """The first of the two addresses by which compiled code calls a function; interpreted there is none."""
    return 0


def owner_of(function: Callable[..., Any], arguments: int) -> int:
    """The second of them."""
    return 0


def own_code(cls: type) -> None:
    """Give a class its own copy of every method it inherits: same code, not the same code object.

    From 3.11 on CPython fits the instructions of a function to the one class of `self` that it meets. Seven kinds of
    board that share a loop would undo that for each other at every turn; with a copy each they run a sixth faster.
    """
    for base in cls.__mro__[1:-1]:
        for name, method in vars(base).items():
            if isinstance(method, FunctionType) and name not in vars(cls) and not name.startswith("__"):
                copy = FunctionType(
                    method.__code__.replace(), method.__globals__, name, method.__defaults__, method.__closure__
                )
                copy.__kwdefaults__ = method.__kwdefaults__
                copy.__qualname__ = method.__qualname__
                setattr(cls, name, copy)
