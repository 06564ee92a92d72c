"""A library that a command needs and that is not installed: its name, and how to install it here."""

import importlib.metadata
import os
import pathlib
import re
import sys

from ranger_sim import loading

# libraries whose import name differs from their package
PACKAGES = {"can": "python-can", "elftools": "pyelftools", "google": "protobuf", "serial": "pyserial", "vcd": "pyvcd"}


def missing(error: ModuleNotFoundError, command: str) -> str | None:
    """The message for a failed import, in a line; None if the missing module is not a library."""
    module = (error.name or "").partition(".")[0]
    if not module or module == "ranger_sim" or module in sys.stdlib_module_names:
        return None
    package = PACKAGES.get(module, module)
    return f"{command} needs the library {package}, which is not installed; this installs it: {installs(package)}"


def installs(package: str) -> str:
    """The command that installs a package into this environment, with its whole extra if it belongs to one.

    `make setup` has the whole lock, but does not reinstall.
    """
    requirements, extra = _requirements(package)
    if extra and _made_by_make():
        return "make setup" if pathlib.Path.cwd() == loading.CHECKOUT else f"make -C {loading.CHECKOUT} setup"
    return " ".join([_shown(sys.executable), "-m pip install", *(f'"{each}"' for each in requirements)])


def _requirements(package: str) -> tuple[list[str], str]:
    """(requirements as pip takes them, extra) of a package of ours; for others, the package itself."""
    try:
        listed = importlib.metadata.requires("ranger-sim") or []
    except importlib.metadata.PackageNotFoundError:
        listed = []
    by_extra: dict[str, list[str]] = {}
    own = ""
    for line in listed:
        requirement, _, marker = line.partition(";")
        found = re.search(r"extra == ['\"](.+?)['\"]", marker)
        extra = found[1] if found else ""
        by_extra.setdefault(extra, []).append(requirement.strip())
        if _name(requirement) == _name(package):
            own = own or (extra or requirement.strip())
    if own in by_extra and own:
        return by_extra[own], own
    return [own or package], ""


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
