"""Old names that programs may hold: they work for one version, with a warning."""

import sys
import warnings


def renamed(old: str, new: str) -> None:
    """DeprecationWarning at the line that calls the method `old`, which is now called `new`."""
    interpreted = sys._getframe(1).f_code.co_name == old.rpartition(".")[2]  # a compiled method has no frame
    message = f"{old} is now {new}; the old name ends with the next version"
    warnings.warn(message, DeprecationWarning, stacklevel=3 if interpreted else 2)
