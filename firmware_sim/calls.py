"""Calls of what stands in a schedule or at an interrupt, when the robot runs interpreted.

Compiled, the functions of the same names in scheduler.pxd are used: they call compiled methods directly.
"""

from collections.abc import Callable
from typing import Any


def call(function: Callable[[], Any]) -> Any:
    """What `function()` returns."""
    return function()
