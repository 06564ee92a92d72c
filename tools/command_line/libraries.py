"""A library that a command needs and that is not installed: its name, and how to install it here."""

import os
import pathlib
import re
import sys

from ranger_sim import loading

# libraries whose import name differs from their package
PACKAGES = {"can": "python-can", "elftools": "pyelftools", "google": "protobuf", "serial": "pyserial", "vcd": "pyvcd"}


def missing(error: ModuleNotFoundError, command: str) -> str | None:
    """The message for a failed import, in a line; None if the missing module is not a library."""
    package = package_of(error)
    if package is None:
        return None
    return f"{command} needs the library {package}, which is not installed; this installs it: " + installs(
        package, command
    )


def package_of(error: ModuleNotFoundError) -> str | None:
    """The package of the library that an import did not find; None if the module is not a library's."""
    module = (error.name or "").partition(".")[0]
    if not module or module == "ranger_sim" or module in sys.stdlib_module_names:
        return None
    return PACKAGES.get(module, module)


def installs(package: str, command: str = "") -> str:
    """The command that installs a package into this environment, as part of an extra of ours if it belongs to one.

    command: of several extras, the one of this command's name is meant. `make setup` has the whole lock, but does not
    reinstall.
    """
    requirement, extras = _requirement(package)
    if extras and _made_by_make():
        return "make setup" if pathlib.Path.cwd() == loading.CHECKOUT else f"make -C {loading.CHECKOUT} setup"
    if extras:
        requirement = f"ranger-sim[{command if command in extras else extras[0]}]"
    return f'{_shown(sys.executable)} -m pip install "{requirement}"'


def _requirement(package: str) -> tuple[str, list[str]]:
    """(requirement as pip takes it, our extras that have it) of a package. An extra in an extra counts as its own."""
    base: list[str] = []
    by_extra: dict[str, list[str]] = {}
    for line in _listed():
        requirement, _, marker = line.partition(";")
        found = re.search(r"extra == ['\"](.+?)['\"]", marker)
        (by_extra.setdefault(found[1], []) if found else base).append(requirement.strip())

    def has(extra: str) -> bool:
        own = "".join(by_extra[extra])
        parts = [part for found in re.findall(r"ranger-sim\[(.+?)\]", own) for part in found.split(",")]
        return any(_name(each) == _name(package) for each in by_extra[extra]) or any(map(has, parts))

    needed = [each for each in base if _name(each) == _name(package)]
    return (needed or [package])[0], [] if needed else [each for each in by_extra if has(each)]


def _listed() -> list[str]:
    """The requirements of this package, with their extras, in the order of pyproject.toml."""
    import importlib.metadata  # takes as long as the rest of a command's start, and few commands lack a library

    try:
        return importlib.metadata.requires("ranger-sim") or []
    except importlib.metadata.PackageNotFoundError:
        return []


def _name(requirement: str) -> str:
    """The normalised name of a requirement such as `python-can>=4.6`."""
    found = re.match(r"[\w.-]+", requirement)
    return re.sub(r"[-_.]+", "-", found[0] if found else requirement).lower()


def _made_by_make() -> bool:
    """True for the environment that `make walk` or `make setup` made in this checkout (set_up.py)."""
    return loading.CHECKOUT is not None and any(pathlib.Path(sys.prefix).glob("installed-*.txt"))


def _shown(path: str) -> str:
    """A path relative to this folder if it is below it."""
    return os.path.relpath(path) if pathlib.Path(path).is_relative_to(pathlib.Path.cwd()) else path
