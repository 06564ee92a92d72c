"""Calls of what stands in a schedule or at an interrupt, when the robot runs interpreted.

Compiled, the functions of the same names in scheduler.pxd and vic.pxd are used: they call methods of compiled classes
by the addresses of their C functions.
"""

from collections.abc import Callable
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
