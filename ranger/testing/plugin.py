"""The pytest plugin of Ranger: fixtures `ranger`, `board`, `can_bus` and their marks; see docs/testing.md.

The mechanism is that of any machine, harness/testing/plugin.py, which this plugin registers. Every pytest run imports
this module, so it imports nothing of the robot before a fixture needs it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import pytest

from ranger_sim.harness.testing import options
from ranger_sim.harness.testing import plugin as mechanism
from ranger_sim.harness.testing.marks import Subject, add_subject

if TYPE_CHECKING:
    from ranger_sim.harness.testing.health import Expected
    from ranger_sim.harness.testing.making import Order
    from ranger_sim.ranger.robot import Ranger
    from ranger_sim.ranger.testing.bench import BoardAlone, BusAlone

MARKERS = (
    "ranger(seed=1, controller=..., body=..., warmed_up='step 3', backend=..., quirks=..., profile=...): "
    "the robot of the fixture `ranger`; also any other field of Scenario",
    "board(name, quirks=..., network_time=True): the board of the fixture `board`",
    "can_bus(bit_rate=...): the bus of the fixture `can_bus`",
)


class RangerUnderTest(Subject):
    """The robot, on the backend of its mark or of the option."""

    name, noun = "ranger", "robot"
    marks = ("ranger", "board", "can_bus")
    marks_with_firmware = ("ranger", "board")
    has_backends = True

    def settings(self, config: pytest.Config) -> dict[str, Any]:
        return {
            "backend": options.option(config, "backend"),
            "profile": options.option(config, "profile") or None,
            "speed": float(options.option(config, "speed")),
            "sanitize": options.option(config, "sanitize") == "yes",
            "counts": os.environ.get(options.COUNTS, ""),
        }

    def order(self, node: Any, wanted: dict[str, Any]) -> Order:
        from ranger_sim.ranger.testing.robots import order_of

        return order_of(wanted)

    def check(self, expected: Expected) -> None:
        from ranger_sim.ranger import names, wiring

        expected.check(names.RANGER, wiring.BOARDS)


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    """Register the mechanism, where `-p` has not done that."""
    if not pluginmanager.has_plugin(mechanism.__name__):
        pluginmanager.register(mechanism, mechanism.__name__)


def pytest_configure(config: pytest.Config) -> None:
    """Register the marks, and Ranger as a machine under test."""
    for marker in MARKERS:
        config.addinivalue_line("markers", marker)
    add_subject(config, RangerUnderTest())


@pytest.fixture(scope=options.scope_of)  # type: ignore[arg-type]
def ranger(request: pytest.FixtureRequest) -> Iterator[Ranger]:
    """A robot by the mark `ranger`: new, or warmed up. Its health is checked after each test."""
    yield from mechanism.watched_machine(request, "ranger")


@pytest.fixture(scope=options.scope_of)  # type: ignore[arg-type]
def board(request: pytest.FixtureRequest) -> Iterator[BoardAlone]:
    """A single board, by the mark `board`: `@pytest.mark.board("MCH")`."""
    from ranger_sim.foundation.user_error import UserError

    mark = request.node.get_closest_marker("board")
    wrong = 'fixture board: which one? @pytest.mark.board("MCH")'
    if mark is not None and mark.args:
        try:
            alone, wrong = board_alone(mark, request.config), ""
        except (UserError, TypeError) as mistake:
            wrong = str(mistake)
    if wrong:
        pytest.fail(wrong, pytrace=False)
    request.node.stash[mechanism.ALONE] = alone
    yield alone
    request.node.stash[mechanism.ALONE] = None
    if alone.firmware is not None:
        alone.chip.write_counts()


def board_alone(mark: pytest.Mark, config: pytest.Config) -> BoardAlone:
    """The board of a mark."""
    from ranger_sim.ranger.testing.bench import BoardAlone
    from ranger_sim.ranger.testing.robots import built

    wanted = dict(mark.kwargs)
    if "firmware" in wanted:
        sanitize = options.option(config, "sanitize") == "yes"
        wanted["firmware"] = built(wanted["firmware"], sanitize, os.environ.get(options.COUNTS, ""))
    return BoardAlone(*mark.args, **wanted)


@pytest.fixture(scope=options.scope_of)  # type: ignore[arg-type]
def can_bus(request: pytest.FixtureRequest) -> Iterator[BusAlone]:
    """A single bus with the test's own nodes: `can_bus.node("a")`."""
    from ranger_sim.foundation.user_error import UserError
    from ranger_sim.ranger.testing.bench import BusAlone

    mark = request.node.get_closest_marker("can_bus")
    wrong = ""
    try:
        alone = BusAlone(*(mark.args if mark is not None else ()), **(mark.kwargs if mark is not None else {}))
    except (UserError, TypeError) as mistake:
        wrong = f"mark can_bus: {mistake}"
    if wrong:
        pytest.fail(wrong, pytrace=False)
    yield alone
