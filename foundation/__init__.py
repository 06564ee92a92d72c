"""The ground every room stands on: numbers, stamped events, seeded randomness, and the one wall clock.

Importing any package of this project imports `foundation` first. Here it is decided, for all packages at once,
whether compiled modules may be used: not when the environment variable ``RANGER_SIM_INTERPRETED`` is set to anything
but an empty string or ``0``, and not when the last build failed (setup.py leaves a record of it). A finder then loads
the plain Python sources of our packages even where a compiled module lies beside them.
"""

import importlib.machinery
import json
import os
import sys
from collections.abc import Sequence
from types import ModuleType
from typing import Any

OUR_PACKAGES = (
    "foundation",
    "datatable",
    "can_bus",
    "plant",
    "firmware_sim",
    "boards",
    "harness",
    "tools",
)
BUILD_RECORD = os.path.join(os.path.dirname(os.path.abspath(__file__)), "build_record.json")


def interpreted_is_forced() -> bool:
    """True when the user asked for the interpreted run by RANGER_SIM_INTERPRETED."""
    return os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0")


def why_not_compiled() -> str:
    """Why the plain sources run, in one line; empty when the last build compiled everything."""
    if interpreted_is_forced():
        return "RANGER_SIM_INTERPRETED is set"
    try:
        with open(BUILD_RECORD, encoding="utf-8") as file:
            record = json.load(file)
        return "" if record["compiled"] else f"not compiled when it was built: {record['reason']}"
    except FileNotFoundError:
        return "nothing was built here"
    except (OSError, ValueError, KeyError, TypeError) as error:
        return f"{BUILD_RECORD} is not readable ({error!r}): build again"


class SourceOnlyFinder:
    """Meta-path finder: the modules of our packages from their .py files, never from built ones."""

    @staticmethod
    def find_spec(
        fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The spec of a module inside one of our packages; None for everything else."""
        if path is None or fullname.partition(".")[0] not in OUR_PACKAGES:
            return None
        sources = (importlib.machinery.SourceFileLoader, importlib.machinery.SOURCE_SUFFIXES)
        for folder in path:
            spec = importlib.machinery.FileFinder(folder, sources).find_spec(fullname)
            if spec is not None:
                return spec
        return None


def plain_cast(_: object, value: Any) -> Any:
    """`cython.cast` for the interpreted run: what the compiler is told about a class needs no test at each use."""
    return value


RUNS_INTERPRETED_BECAUSE = why_not_compiled()  # decided once: modules are not exchanged while a process runs
if RUNS_INTERPRETED_BECAUSE and SourceOnlyFinder not in sys.meta_path:
    sys.meta_path.insert(0, SourceOnlyFinder)
    import cython

    cython.cast = plain_cast
