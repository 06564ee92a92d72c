"""Old names that programs may hold: they work for one version, with a warning."""

import sys
import warnings


def renamed(old: str, new: str) -> None:
    """DeprecationWarning at the line that uses `old`, a method or an argument of its class, now called `new`."""
    # a compiled function has no frame: then this one is the caller's
    code = sys._getframe(1).f_code
    interpreted = code.co_qualname in (old, f"{old.rpartition('.')[0]}.__init__")
    message = f"{old} is now {new}; the old name ends with the next version"
    warnings.warn(message, DeprecationWarning, stacklevel=3 if interpreted else 2)
