"""Libraries that a checkout gets later than the rest: a first `make walk` does without them (set_up.py)."""

import importlib
from types import ModuleType

from ranger_sim.foundation.user_error import UserError

# where a library is not called as the package that brings it
PACKAGES = {"elftools": "pyelftools", "vcd": "pyvcd"}


def imported(module: str) -> ModuleType:
    """The library `module`. UserError that says how to get it, when it is not installed."""
    top = module.partition(".")[0]
    try:
        importlib.import_module(top)
    except ModuleNotFoundError as error:
        if error.name != top:
            raise
        package = PACKAGES.get(top, top)
        raise UserError(
            f"this needs {package}, which is missing: in a checkout `make setup`, else pip install {package}"
        ) from None
    return importlib.import_module(module)
