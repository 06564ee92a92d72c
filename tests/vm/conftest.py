"""Fixtures of the tests on real SocketCAN. They run by `make test-vm`, and there none is skipped."""

import contextlib
import pathlib
import signal
import subprocess
import sys

import pytest

from ranger_sim.can_bus.edge.candump import read_candump
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.events import FLAG_EXTENDED

from . import places

ROOT = pathlib.Path(__file__).resolve().parents[2]
FIGURES = []
LAST = "1FFFFFFF#E0F0"  # closes a recording: nobody else sends this
SMALLER_BUFFER = "receive buffer size was adjusted"  # to what others than root may have: no fault
LAST_FRAME = (0x1FFFFFFF, 2 | FLAG_EXTENDED, 0xF0E0, 0)


def pytest_configure(config):
    config.addinivalue_line("markers", "machine: boots virtual machines, so it runs on the host")
    config.addinivalue_line("markers", "adapters: needs two CAN adapters that may be reconfigured")


def pytest_collection_modifyitems(items):
    """An ordinary run of the suite has neither the interfaces nor the time."""
    if places.run_by_make_test_vm():
        return
    here = pathlib.Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker(pytest.mark.skip(reason="on real SocketCAN: `make test-vm` runs it"))


@pytest.fixture
def figure():
    """figure(text): a line of the summary."""
    return FIGURES.append


def pytest_terminal_summary(terminalreporter):
    if FIGURES:
        terminalreporter.section("figures")
        for line in FIGURES:
            terminalreporter.write_line(line)


class Candump:
    """`candump -L` on some interfaces, writing to a file. `frames()` after `stop()`."""

    def __init__(self, path, interfaces):
        self.path = path
        self.interfaces = interfaces
        self.file = path.open("wb")
        # -d: tell dropped frames; -r: 8 MB of frames may wait (as root, beyond the kernel's limit)
        self.process = subprocess.Popen(
            ["candump", "-L", "-d", "-r", "8000000", *interfaces], stdout=self.file, stderr=subprocess.PIPE, text=True
        )

    def stop(self):
        """End it when it has written everything that was sent before; what it wrote to standard error."""
        for interface in self.interfaces:
            subprocess.run(["cansend", interface, LAST], check=True)

        def has_seen_the_last_frames():
            lines = self.path.read_text().splitlines()
            return {line.split()[1] for line in lines if line.endswith(LAST)} == set(self.interfaces)

        await_condition(has_seen_the_last_frames)
        self.process.send_signal(signal.SIGINT)
        _, told = self.process.communicate(timeout=60)
        self.file.close()
        return "".join(line for line in told.splitlines(True) if SMALLER_BUFFER not in line)

    def frames(self):
        """{interface: [(identifier, flags, lo, hi), ...]} in the order of arrival."""
        found = {interface: [] for interface in self.interfaces}
        for interface, _, *frame in read_candump(self.path):
            if tuple(frame) != LAST_FRAME:  # two of them, where two interfaces are on one wire
                found[interface].append(tuple(frame))
        return found

    def data(self):
        """{interface: ["00E#0102", ...]}: the same as text."""
        lines = [line.split() for line in self.path.read_text().splitlines()]
        return {name: [text for _, where, text in lines if where == name and text != LAST] for name in self.interfaces}


def await_condition(condition, seconds=60.0):
    """Look until it holds; AssertionError when it does not in time."""
    end = wallclock.monotonic_s() + seconds
    while not condition():
        assert wallclock.monotonic_s() < end, f"not within {seconds:g} s: {condition.__name__}"
        wallclock.sleep_s(0.02)


def receivers(interface):
    """How many receivers of all frames the kernel knows on an interface."""
    lines = pathlib.Path("/proc/net/can/rcvlist_all").read_text().splitlines()
    return sum(line.split()[:1] == [interface] for line in lines)


@contextlib.contextmanager
def recording(path, *interfaces):
    """A Candump that listens already."""
    before = [receivers(interface) for interface in interfaces]
    watcher = Candump(path, interfaces)

    def candump_listens():
        return all(receivers(interface) > had for interface, had in zip(interfaces, before, strict=True))

    try:
        await_condition(candump_listens)
        yield watcher
    finally:
        watcher.process.kill()
        watcher.process.communicate()
        watcher.file.close()


@pytest.fixture
def candump(tmp_path):
    """candump(interface, ...): started, and listening already; ended with the test."""
    with contextlib.ExitStack() as stack:

        def start(*interfaces):
            number = len(list(tmp_path.glob("candump*")))
            return stack.enter_context(recording(tmp_path / f"candump{number}.log", *interfaces))

        yield start


@pytest.fixture
def command():
    """command("walk", ...) -> CompletedProcess of ranger-sim."""

    def run(*arguments, timeout=600):
        return subprocess.run(
            [sys.executable, "-m", "ranger_sim", *map(str, arguments)],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=timeout,
        )

    return run
