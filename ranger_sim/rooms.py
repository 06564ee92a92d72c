"""The rooms, and what of them is compiled. setup.py builds by it, loading.py loads by it."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

ROOMS = (
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


def declared_modules(house: Path) -> Iterator[str]:
    """Names of the modules that have a .pxd beside them: those that are compiled where a compiler is found."""
    for room in ROOMS:
        for declaration in sorted((house / room).rglob("*.pxd")):
            yield ".".join(("ranger_sim", *declaration.relative_to(house).with_suffix("").parts))


def marks_of_sources(house: Path) -> dict[str, str]:
    """{place in the house: mark of what stands there} of all sources and declarations of compiled modules."""
    marks = {}
    for name in declared_modules(house):
        declaration = house.joinpath(*name.split(".")[1:]).with_suffix(".pxd")
        for path in (declaration.with_suffix(".py"), declaration):
            content = path.read_bytes() if path.exists() else b""
            marks[path.relative_to(house).as_posix()] = hashlib.blake2b(content, digest_size=6).hexdigest()
    return marks
