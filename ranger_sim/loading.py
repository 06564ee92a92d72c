"""Where the rooms are, and whether they run compiled: decided once, when `ranger_sim` is imported.

The rooms are folders beside this package in a checkout and inside it when installed. Their compiled modules are all in
one shared library, `ranger_sim._compiled` (setup.py builds it, and says why one). It is not used when the environment
variable ``RANGER_SIM_INTERPRETED`` is set to anything but an empty string or ``0``, not when the last build failed
(setup.py leaves a record of it), and not when the sources of a checkout have changed since they were built: then what
stands there runs. A finder then loads a module of the rooms from the library, or else from its plain Python source, and
from nothing else that may lie beside it. ``RANGER_SIM_TABLE`` names a folder with a user's own master
table: what is generated from the table is then found there.
"""

import importlib
import importlib.machinery
import importlib.util
import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from ranger_sim import rooms
from ranger_sim.declared_fields import DeclaredFieldsLoader
from ranger_sim.rooms import ROOMS

SHARED = "ranger_sim._shared"  # Cython's helpers, which all compiled modules use
PACKAGE = Path(__file__).resolve().parent
# in a checkout the rooms stand beside this package
HOUSE = PACKAGE if (PACKAGE / ROOMS[0]).is_dir() else PACKAGE.parent
BUILD_RECORD = PACKAGE / "build_record.json"
# a folder with a master table of the user's own and, in `generated`, what was made from it (`ranger-sim table copy`)
OWN_TABLE = Path(os.environ["RANGER_SIM_TABLE"]).resolve() if os.environ.get("RANGER_SIM_TABLE") else None
GENERATED = "ranger_sim.datatable.generated"


def interpreted_is_forced() -> bool:
    """True when the user asked for the interpreted run by RANGER_SIM_INTERPRETED."""
    return os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0")


def why_not_compiled() -> str:
    """Why there are no compiled modules to use, in one line; empty when the last build compiled everything."""
    if interpreted_is_forced():
        return "RANGER_SIM_INTERPRETED is set"
    try:
        record = json.loads(BUILD_RECORD.read_text(encoding="utf-8"))
        return "" if record["compiled"] else f"not compiled when it was built: {record['reason']}"
    except FileNotFoundError:
        return "nothing was built here"
    except (OSError, ValueError, KeyError, TypeError) as error:
        return f"{BUILD_RECORD} is not readable ({error!r}): build again"


def load_library() -> tuple[Any, str]:
    """The library of compiled modules, or None; why the plain sources run, or an empty string."""
    reason = why_not_compiled()
    if reason:
        return None, reason
    try:
        library = importlib.import_module("ranger_sim._compiled")
    except ImportError as error:
        return None, f"the compiled modules cannot be loaded ({error}): build again"
    reason = why_out_of_date(library) if HOUSE != PACKAGE else ""
    return (None, reason) if reason else (library, "")


def why_out_of_date(library: Any) -> str:
    """Which sources of a checkout are not those of the library, in one line; empty when all are."""
    built = dict(mark.split("=") for mark in getattr(library, "sources", "").split())
    now = rooms.marks_of_sources(HOUSE)
    other = sorted(path for path in built.keys() | now.keys() if built.get(path) != now.get(path))
    if not other:
        return ""
    more = f" and {len(other) - 1} more" if len(other) > 1 else ""
    return f"{other[0]}{more} changed since the library was built: `make setup` builds it again"


class LibraryLoader(importlib.machinery.ExtensionFileLoader):
    """Loads one module out of the library; CPython's own loader knows only libraries that hold a single module."""

    def create_module(self, spec: importlib.machinery.ModuleSpec) -> ModuleType:
        """The module that the spec names, not yet executed (PEP 489)."""
        return LIBRARY.create(spec)


class RoomFinder:
    """Meta-path finder for the rooms and their modules: from the library if that holds them, or from .py files."""

    @staticmethod
    def find_spec(
        fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        """The spec of a room or of a module inside one; None for everything else."""
        package, _, rest = fullname.partition(".")
        room, _, inside = rest.partition(".")
        if fullname in COMPILED_MODULES or fullname == SHARED:
            loader = LibraryLoader(fullname, LIBRARY.__file__)
            return importlib.util.spec_from_file_location(fullname, LIBRARY.__file__, loader=loader)
        if package != "ranger_sim" or room not in ROOMS:
            return None
        sources = (DeclaredFieldsLoader, importlib.machinery.SOURCE_SUFFIXES)
        if fullname == GENERATED and OWN_TABLE is not None:
            path = (str(OWN_TABLE),)
        for folder in (path or ()) if inside else (str(HOUSE),):
            spec = importlib.machinery.FileFinder(folder, sources).find_spec(fullname)
            if spec is not None:
                return spec
        if fullname == GENERATED and OWN_TABLE is not None:
            from ranger_sim.foundation.user_error import UserError

            raise UserError(
                f"RANGER_SIM_TABLE: nothing was generated in {OWN_TABLE}: unset RANGER_SIM_TABLE, then "
                f"ranger-sim table generate --master {OWN_TABLE}"
            )
        return None


def declared_modules() -> Iterator[str]:
    """Names of the modules that are compiled where a compiler is found."""
    return rooms.declared_modules(HOUSE)


# decided once: modules are not exchanged while a process runs
LIBRARY, RUNS_INTERPRETED_BECAUSE = load_library()
COMPILED_MODULES = frozenset(LIBRARY.names.split() if LIBRARY else ()) - {SHARED}
RUNS_COMPILED = not RUNS_INTERPRETED_BECAUSE
sys.meta_path.insert(0, RoomFinder)
