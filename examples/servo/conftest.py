"""Tells the pytest plugin of ranger-sim which machine the fixture `machine` is."""

from servo import new


def pytest_machine(wanted):
    return new(**wanted)
