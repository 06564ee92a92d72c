"""What holds for every test."""

import signal


def pytest_configure(config):
    """Programs that a test interrupts inherit how this process takes SIGINT; a background job of a shell ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
