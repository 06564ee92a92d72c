"""Which of our modules run compiled."""

import importlib
import importlib.machinery
import pathlib

import foundation


def compiled_modules() -> tuple[list[str], list[str]]:
    """(compiled, interpreted): names of the modules that have a .pxd, by how they were loaded."""
    root = pathlib.Path(foundation.__file__).resolve().parent.parent
    compiled: list[str] = []
    interpreted: list[str] = []
    for package in foundation.OUR_PACKAGES:
        for declaration in sorted((root / package).rglob("*.pxd")):
            name = ".".join(declaration.relative_to(root).with_suffix("").parts)
            module = importlib.import_module(name)
            suffixes = tuple(importlib.machinery.EXTENSION_SUFFIXES)
            (compiled if (module.__file__ or "").endswith(suffixes) else interpreted).append(name)
    return compiled, interpreted


def is_compiled() -> bool:
    """True when the robot runs compiled: all of it or nothing."""
    return not foundation.RUNS_INTERPRETED_BECAUSE


def why_interpreted() -> str:
    """Why the plain sources run, in one line; empty when the robot runs compiled."""
    return foundation.RUNS_INTERPRETED_BECAUSE
