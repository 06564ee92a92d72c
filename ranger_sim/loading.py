"""Decide once, when `ranger_sim` is imported, whether the compiled modules run.

A module that contains `import cython` is compiled where a C compiler is found (setup.py). In an installation its
library lies next to its source, where Python finds it without help. In a checkout the libraries are below
`build/compiled`; they are used while they match the present sources, and not when the environment variable
``RANGER_SIM_INTERPRETED`` is set to anything but an empty string or ``0``. All of them or none: a compiled module reads
the fields of another one's classes at fixed places.

``RANGER_SIM_TABLE`` names a folder with a user's own master table (`datatable/__init__.py`).
"""

import hashlib
import json
import os
import re
import sys
import sysconfig
from collections.abc import Iterator
from importlib.machinery import (
    EXTENSION_SUFFIXES,
    SOURCE_SUFFIXES,
    ExtensionFileLoader,
    FileFinder,
    ModuleSpec,
    SourceFileLoader,
)
from pathlib import Path
from types import ModuleType
from typing import Any

PACKAGE = Path(__file__).parent
# In a checkout the packages are links to the folders next to this one.
CHECKOUT = PACKAGE.resolve().parent if (PACKAGE / "foundation").is_symlink() else None
COMPILED = CHECKOUT / "build" / "compiled" / sysconfig.get_config_var("SOABI") if CHECKOUT is not None else None
RECORD = "build_record.json"
IS_COMPILED = re.compile(rb"^import cython\b", re.MULTILINE)
# a folder with a master table of the user's own and, in `generated`, what was made from it (`ranger-sim table copy`)
OWN_TABLE = Path(os.environ["RANGER_SIM_TABLE"]).resolve() if os.environ.get("RANGER_SIM_TABLE") else None


def packages() -> tuple[str, ...]:
    """Names of the packages of Python code inside `ranger_sim`, sorted."""
    return tuple(sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py")))


def refuse_files_for_links() -> None:
    """Raise ImportError where a checkout or an unpacking program has turned the links to the packages into files."""
    for path in PACKAGE.iterdir():
        if path.is_file() and path.suffix == "" and path.read_bytes() == f"../{path.name}".encode():
            raise ImportError(
                f"{path} is a file and not a link to the folder ../{path.name}: check out again with links "
                "(git config core.symlinks true, on Windows in developer mode), or install a wheel"
            )


def interpreted_is_forced() -> bool:
    """True when the user asked for the interpreted run by RANGER_SIM_INTERPRETED."""
    return os.environ.get("RANGER_SIM_INTERPRETED", "") not in ("", "0")


def declared_modules() -> Iterator[str]:
    """Names of the modules that are compiled where a compiler is found."""
    for place, (_, _, mark) in sources({}).items():
        if mark and place.endswith(".py"):
            yield module_at(place)


def module_at(place: str) -> str:
    """Name of the module whose source is at a place inside the package, as "boards/hip.py"."""
    return f"ranger_sim.{place.removesuffix('.py').replace('/', '.')}"


def sources(known: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """{place inside the package: [time of its change in ns, size, mark of its content]} of all sources, sorted.

    The mark is empty for a module that is not compiled. known: an earlier result; a file whose time and size
    are equal is not read again.
    """
    found, root = {}, str(PACKAGE)
    for package in packages():
        for folder, inside, files in os.walk(PACKAGE / package):
            inside[:] = [each for each in inside if each != "__pycache__"]
            for file in files:
                if file.endswith((".py", ".pxd")):
                    path = os.path.join(folder, file)  # a Path each would take as long as the rest, at every start
                    place = path[len(root) + 1 :].replace(os.sep, "/")
                    status = os.stat(path)
                    before = known.get(place)
                    if before is not None and before[:2] == [status.st_mtime_ns, status.st_size]:
                        found[place] = before
                        continue
                    content = Path(path).read_bytes()
                    mark = ""
                    if file.endswith(".pxd") or IS_COMPILED.search(content):
                        mark = hashlib.blake2b(content, digest_size=6).hexdigest()
                    found[place] = [status.st_mtime_ns, status.st_size, mark]
    return dict(sorted(found.items()))


def read_record(folder: Path | None) -> dict[str, Any]:
    """The record of the build: {"compiled": bool, "reason": why not, "sources": as `sources` gives them}."""
    record: dict[str, Any] = {"compiled": False, "sources": {}}
    if folder is None:
        return record | {"reason": "nothing was built here"}
    try:
        written = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        record |= written | {
            "sources": {place: [*map(int, each[:2]), each[2]] for place, each in written["sources"].items()}
        }
        return record | {"reason": f"not compiled when it was built: {record['reason']}"}
    except FileNotFoundError:
        return record | {"reason": "nothing was built here"}
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        return {
            "compiled": False,
            "sources": {},
            "reason": f"{folder / RECORD} is not readable ({error!r}): build again",
        }


def why_interpreted(record: dict[str, Any]) -> str:
    """Why the sources run, in one line; empty when the compiled modules do."""
    if interpreted_is_forced():
        return "RANGER_SIM_INTERPRETED is set"
    if not record["compiled"]:
        return str(record["reason"])
    if CHECKOUT is None:
        return ""
    built, now = (
        {place: each[2] for place, each in of.items()} for of in (record["sources"], sources(record["sources"]))
    )
    other = sorted(place for place in built.keys() | now.keys() if built.get(place, "") != now.get(place, ""))
    if not other:
        return ""
    more = f" and {len(other) - 1} more" if len(other) > 1 else ""
    return f"{other[0]}{more} changed since the build: `make setup` builds again"


class OneOfTwo(FileFinder):
    """Finds the modules of one folder of the package: the source, or its library in another folder first."""

    def __init__(self, folder: str, libraries: Path | None) -> None:
        super().__init__(folder, (SourceFileLoader, SOURCE_SUFFIXES))
        self.libraries = libraries and FileFinder(str(libraries), (ExtensionFileLoader, EXTENSION_SUFFIXES))

    def find_spec(self, fullname: str, target: ModuleType | None = None) -> ModuleSpec | None:
        """The library's spec where there is one, or else the source's."""
        spec = self.libraries.find_spec(fullname, target) if self.libraries else None
        return spec if spec is not None and spec.loader is not None else super().find_spec(fullname, target)


def choose(libraries: Path | None) -> None:
    """Let every folder of the package have its compiled modules in `libraries`, or none for None."""

    def finder(folder: str) -> OneOfTwo:
        path = Path(folder)
        if path != PACKAGE and PACKAGE not in path.parents:
            raise ImportError  # not ours: the next one in sys.path_hooks
        return OneOfTwo(folder, libraries and libraries / "ranger_sim" / path.relative_to(PACKAGE))

    sys.path_hooks.insert(0, finder)
    sys.path_importer_cache.pop(str(PACKAGE), None)


# decided once: modules are not exchanged while a process runs
refuse_files_for_links()
BUILD = read_record(COMPILED if CHECKOUT is not None else PACKAGE)
RUNS_INTERPRETED_BECAUSE = why_interpreted(BUILD)
RUNS_COMPILED = not RUNS_INTERPRETED_BECAUSE
COMPILED_MODULES = frozenset(
    module_at(place)
    for place, (_, _, mark) in BUILD["sources"].items()
    if RUNS_COMPILED and mark and place.endswith(".py")
)
if (CHECKOUT is not None) == RUNS_COMPILED:  # otherwise Python's default fits: libraries next to sources, or none
    choose(COMPILED if RUNS_COMPILED else None)
