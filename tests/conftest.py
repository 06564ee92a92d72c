"""What holds for every test."""

import collections
import gc
import os
import signal

import pytest

from tests.examples import register_profiles

register_profiles()

OURS = ("anon_inode", "pipe", "socket")  # kinds of descriptors that a test may leave open only by mistake


def descriptors_of_this_process():
    """How many of each kind in OURS are open."""
    found = collections.Counter()
    for number in os.listdir("/proc/self/fd"):
        try:
            found[os.readlink(f"/proc/self/fd/{number}").partition(":")[0]] += 1
        except OSError:
            continue  # the listing's own
    return {kind: found[kind] for kind in OURS}


@pytest.fixture(autouse=True, scope="module")
def nothing_stays_open():
    """A module's tests close what they open: in a suite of thousands a few each soon are more than `select` knows."""
    if not os.path.isdir("/proc/self/fd"):
        yield
        return
    before = descriptors_of_this_process()
    yield
    if (after := descriptors_of_this_process()) != before:
        gc.collect()
        after = descriptors_of_this_process()
    more = {kind: after[kind] - before[kind] for kind in OURS if after[kind] > before[kind]}
    assert not more, f"left open by this module's tests: {more}"


def pytest_configure(config):
    """Programs that a test interrupts inherit how this process takes SIGINT; a background job of a shell ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
