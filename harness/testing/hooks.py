"""The hooks by which a project's conftest.py configures the plugin."""

from typing import Any

import pytest


@pytest.hookspec(firstresult=True)
def pytest_machine(wanted: dict[str, Any]) -> Any:
    """The machine of the fixture `machine`, newly made: a `harness.machine.Machine`.

    wanted: the keywords of the mark `machine`, and the seed.

        def pytest_machine(wanted):
            return Servo(**wanted)
    """
