"""Calls of what stands in a schedule or at an interrupt, when the robot runs interpreted.

Compiled, the functions of the same names in scheduler.pxd are used: they call compiled methods directly.
"""


def call(function):
    """What `function()` returns."""
    return function()


def call_with(function, argument):
    """What `function(argument)` returns."""
    return function(argument)
