"""Libraries that not every user needs: they come with an extra of the package, and are imported when they are used."""

import importlib
from types import ModuleType

from ranger_sim.foundation.user_error import UserError


def imported(module: str, extra: str) -> ModuleType:
    """The library `module`. UserError that names the extra it comes with, when it is not installed."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name != module.partition(".")[0]:
            raise
        raise UserError(
            f"this needs {error.name}, which comes with the extra {extra!r}: "
            f"pip install 'ranger-sim[{extra}]', in a checkout `make setup`"
        ) from None
