"""Hooks of the plugin that other plugins, or a conftest.py, may implement."""

from typing import Any

import pytest


@pytest.hookspec
def pytest_ranger_trace(item: Any, robot: Any, folder: str) -> str:  # type: ignore[empty-body]
    """Write a trace of `robot`, whose test `item` has failed, into `folder`; the path of what was written."""
