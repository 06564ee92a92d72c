"""The options of the pytest plugin: each has an environment variable, which the command line overrides."""

from __future__ import annotations

import os

import pytest

SCOPES = ("function", "class", "module", "package", "session")
COUNTS = "RANGER_SIM_COUNTS"  # variable of the environment: the folder of what ran, as long as the tests run

# option: (environment variable, default, help)
OPTIONS = {
    "backend": ("RANGER_SIM_BACKEND", "sim", "sim, processes, vcan or hardware"),
    "profile": ("RANGER_SIM_PROFILE", "", "profile of boards and buses: a name or a .toml file"),
    "seed": ("RANGER_SIM_SEED", "", "seed of every robot, instead of the test's own"),
    "scope": ("RANGER_SIM_SCOPE", "function", f"scope of the fixtures: {', '.join(SCOPES)}"),
    "speed": ("RANGER_SIM_SPEED", "1.0", "virtual seconds per second, on vcan and hardware"),
    "fork": ("RANGER_SIM_FORK", "yes", "no: warmed-up robots are not branched, each test warms up its own"),
    "sanitize": ("RANGER_SIM_SANITIZE", "no", "yes: firmware in C with sanitizers; a test fails with what they find"),
    "coverage": ("RANGER_SIM_COVERAGE", "", "count which lines of firmware in C run, into this file (lcov.info)"),
    "trace": ("RANGER_SIM_TRACE", "", "folder for a timeline of the last 10 s of every robot whose test fails"),
}


def add(parser: pytest.Parser) -> None:
    """Add the options to pytest's."""
    group = parser.getgroup("ranger-sim", "emulated robot or machine")
    for name, (variable, default, text) in OPTIONS.items():
        group.addoption(
            f"--ranger-{name}",
            default=None,
            metavar=name.upper(),
            help=f"{text} (default {default or 'none'}; environment: {variable})",
        )


def option(config: pytest.Config, name: str) -> str:
    """The value on the command line, in the environment, or the default."""
    variable, default, _ = OPTIONS[name]
    given = config.getoption(f"ranger_{name}", None)
    return given if given is not None else os.environ.get(variable) or default


def check(config: pytest.Config) -> None:
    """UsageError for a value that is not allowed."""
    if option(config, "scope") not in SCOPES:
        raise pytest.UsageError(f"--ranger-scope is {option(config, 'scope')!r}, allowed are {', '.join(SCOPES)}")
    for name in ("fork", "sanitize"):
        if option(config, name) not in ("yes", "no"):
            raise pytest.UsageError(f"--ranger-{name} is {option(config, name)!r}, allowed are yes, no")
    for name, kind in (("seed", int), ("speed", float)):
        try:
            kind(option(config, name) or "1")
        except ValueError:
            raise pytest.UsageError(f"--ranger-{name} is {option(config, name)!r}, a number is expected") from None


def scope_of(fixture_name: str, config: pytest.Config) -> str:
    """The scope of the fixtures that make machines and boards."""
    return option(config, "scope")
