"""Tells the pytest plugin of ranger-sim which machine the fixture `machine` is."""

from servo import Servo


def pytest_machine(wanted):
    return Servo(**wanted)
