"""Old names of modules that have moved: what the new ones have, with a DeprecationWarning, for one version."""

import importlib
import warnings
from collections.abc import Callable
from typing import Any


def attributes(old: str, new: str, *names: str) -> Callable[[str], Any]:
    """A module's `__getattr__` that finds `names`, or every name, in the module `new`; AttributeError for another."""

    def find(name: str) -> Any:
        if name.startswith("__") or (names and name not in names):
            raise AttributeError(f"module {old!r} has no attribute {name!r}")
        value = getattr(importlib.import_module(new), name)
        warnings.warn(f"{old}.{name} has moved to {new}.{name}", DeprecationWarning, stacklevel=2)
        return value

    return find
