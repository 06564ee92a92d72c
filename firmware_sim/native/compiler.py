"""The C compiler of this computer."""

import os
import shutil
import sys

from ranger_sim.foundation import systems
from ranger_sim.foundation.user_error import FirmwareError

COMPILERS = ("cc", "gcc", "clang")


def compiler() -> str:
    """The C compiler: $CC, or the first of the usual ones; UserError when none is found."""
    if systems.is_windows():
        raise FirmwareError(f"firmware in C needs Linux or macOS (signals of POSIX), this is {sys.platform}")
    asked = os.environ.get("CC")
    for name in (asked.split()[-1],) if asked and asked.split() else COMPILERS:
        found = shutil.which(name)
        if found:
            return found
    looked = f"CC={asked}" if asked else ", ".join(COMPILERS)
    raise FirmwareError(f"no C compiler is installed here (looked for {looked}); firmware in C needs one")
