"""Other projects' test suites on our CAN interface: python -m dev.suites."""
