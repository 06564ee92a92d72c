"""Sets the machine of the pytest plugin's fixture `machine`."""

from servo import new


def pytest_machine(wanted):
    return new(**wanted)
