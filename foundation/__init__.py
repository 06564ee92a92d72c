"""The ground every room stands on: numbers, stamped events, seeded randomness, and the one wall clock.

Importing any package of this project imports `foundation` first. When the environment variable
``RANGER_SIM_INTERPRETED`` is set to anything but an empty string or ``0``, a finder is installed here
that loads the plain Python sources of our packages even where a compiled module lies beside them.
"""

import importlib.machinery
import os
import sys

OUR_PACKAGES = (
    "foundation",
    "datatable",
    "can_bus",
    "plant",
    "firmware_sim",
    "boards",
    "harness",
    "sysid",
    "tools",
)


def interpreted_is_forced() -> bool:
    """True when the user asked for the interpreted run by RANGER_SIM_INTERPRETED."""
    return os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0")


class SourceOnlyFinder:
    """Meta-path finder: the modules of our packages from their .py files, never from built ones."""

    @staticmethod
    def find_spec(fullname, path=None, target=None):
        if path is None or fullname.partition(".")[0] not in OUR_PACKAGES:
            return None
        sources = (importlib.machinery.SourceFileLoader, importlib.machinery.SOURCE_SUFFIXES)
        for folder in path:
            spec = importlib.machinery.FileFinder(folder, sources).find_spec(fullname)
            if spec is not None:
                return spec
        return None


if interpreted_is_forced() and SourceOnlyFinder not in sys.meta_path:
    sys.meta_path.insert(0, SourceOnlyFinder)
