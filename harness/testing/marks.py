"""What a test asks for by its marks and the options: its machine, its backend, and what must happen.

A `Subject` is a kind of machine under test, with a fixture and a mark of its name. This module has the project's own
machine; another plugin adds others with `add_subject`.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import pytest

from ranger_sim.harness.testing.options import option

if TYPE_CHECKING:
    from ranger_sim.harness.machine import Machine
    from ranger_sim.harness.testing.health import Expected
    from ranger_sim.harness.testing.making import Order


class Subject:
    """A kind of machine under test: the fixture `name` makes it, monitors it, and closes it."""

    name: str
    noun: str  # in messages
    marks: tuple[str, ...]  # of its fixtures, which have the scope of --ranger-scope
    marks_with_firmware: tuple[str, ...] = ()  # with firmware=...: programs in C that belong into the test's process
    has_backends = False  # its mark chooses one

    def settings(self, config: pytest.Config) -> dict[str, Any]:
        """What the options choose; marks override it."""
        return {}

    def order(self, node: Any, wanted: dict[str, Any]) -> Order:
        """The machine in these keywords. UserError for an unknown keyword or value."""
        raise NotImplementedError

    def check(self, expected: Expected) -> None:
        """UserError for something that this machine cannot show."""


class OwnMachine(Subject):
    """The project's own machine, which its conftest.py makes."""

    name = noun = "machine"
    marks = ("machine",)

    def order(self, node: Any, wanted: dict[str, Any]) -> Order:
        from ranger_sim.harness.testing.making import machine_order

        return machine_order(Maker(node.ihook), wanted)


class Maker:
    """Makes machines by a folder's conftest.py. Two that make them by the same functions are equal."""

    def __init__(self, hook: Any) -> None:
        self.hook = hook
        self.functions = tuple(each.function for each in hook.pytest_machine.get_hookimpls())

    def __call__(self, **wanted: Any) -> Machine:
        from ranger_sim.foundation.user_error import UserError

        machine: Machine | None = self.hook.pytest_machine(wanted=wanted)
        if machine is None:
            raise UserError("fixture machine: conftest.py must choose it: def pytest_machine(wanted): return ...")
        return machine

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Maker) and other.functions == self.functions

    def __hash__(self) -> int:
        return hash(self.functions)


SUBJECTS = pytest.StashKey[dict[str, Subject]]()


def add_subject(config: pytest.Config, subject: Subject) -> None:
    """Add a kind of machine under test, by its fixture's name."""
    config.stash.setdefault(SUBJECTS, {})[subject.name] = subject


def subjects(config: pytest.Config) -> list[Subject]:
    """All kinds of machine."""
    return list(config.stash[SUBJECTS].values())


def subjects_of(item: pytest.Item) -> list[Subject]:
    """The kinds of machine whose fixtures a test has."""
    return [each for each in subjects(item.config) if each.name in getattr(item, "fixturenames", ())]


def order_for(node: Any, config: pytest.Config, subject: Subject) -> Order:
    """The machine that a test (module, class) requests by its marks and the options. UserError for a wrong mark."""
    from ranger_sim.foundation.user_error import UserError

    wanted: dict[str, Any] = {"trace": bool(option(config, "trace")), **subject.settings(config)}
    for mark in reversed(list(node.iter_markers(subject.name))):
        if mark.args:
            raise UserError(f"mark {mark.name}: {mark.args[0]!r} has no name; it reads like {mark.name}(seed=3)")
        wanted |= mark.kwargs
    if option(config, "seed"):
        wanted["seed"] = int(option(config, "seed"))
    return subject.order(node, wanted)


def backend_of(item: pytest.Item) -> str:
    """The backend of a test: that of its mark, or the option."""
    for subject in subjects(item.config):
        for mark in item.iter_markers(subject.name) if subject.has_backends else ():
            if "backend" in mark.kwargs:
                return str(mark.kwargs["backend"])
    return option(item.config, "backend")


def expected_of(item: pytest.Item) -> Expected:
    """What must happen by the marks of a test. UserError for a wrong mark."""
    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.harness.testing.health import Expected

    errors = tuple(name for mark in item.iter_markers("expects_errors") for name in mark.args)
    others: dict[str, Any] = {}
    for mark in reversed(list(item.iter_markers("expects"))):
        others |= mark.kwargs
        if mark.args:
            raise UserError(f"mark expects: {mark.args[0]!r} has no name; it reads like expects(fall=True)")
    if any(mark.kwargs for mark in item.iter_markers("expects_errors")):
        raise UserError('mark expects_errors: it takes names only, as expects_errors("MCH:AE_SPIKE")')
    allowed = [field.name for field in dataclasses.fields(Expected) if field.name != "errors"]
    if unknown := [name for name in others if name not in allowed]:
        raise UserError(f"mark expects({unknown[0]}=...): what can be expected is {', '.join(allowed)}")
    return Expected(errors, **others)
