"""A host of private buses in a thread of the test, and programs that run against it."""

import contextlib
import itertools
import os
import pty
import re
import signal
import subprocess
import sys
import threading

from ranger_sim.can_bus.edge.attach import AttachServer
from ranger_sim.can_bus.edge.host import BusHost
from ranger_sim.can_bus.edge.paced import PacedBus
from ranger_sim.foundation import descriptors

NUMBERS = itertools.count()
PATIENCE_S = 60.0  # a guard against waiting for ever; nothing asserts on it


def fresh_name():
    """A name that no other test and no other test run uses."""
    return f"test-{os.getpid()}-{next(NUMBERS)}"


@contextlib.contextmanager
def hosted(*channels, name=None, speed=1.0, servers=(), **options):
    """Buses that pass their time in a thread. Yields (name, the host); `servers`: functions of {channel: Taps}."""
    name = name or fresh_name()
    buses = [PacedBus(channel, speed=speed, **options) for channel in channels]
    host = BusHost(buses)
    taps = {bus.channel: bus.taps for bus in buses}
    host.serve(AttachServer(name, taps, buses[0].epoch_ns))
    for make in servers:
        host.serve(make(taps))
    ending = threading.Event()
    faults = []

    def turns():
        try:
            while not ending.is_set():
                host.turn(0.05)
        except Exception as fault:  # shown by the test, not by the thread
            faults.append(fault)

    thread = threading.Thread(target=turns, daemon=True)
    thread.start()
    try:
        yield name, host
    finally:
        ending.set()
        thread.join(PATIENCE_S)
        assert not thread.is_alive(), f"a turn of the host of {', '.join(taps)} does not end"
        host.close()
        assert not faults, faults


class Program:
    """A program in a separate process, on pipes or (terminal=True) on a pseudo-terminal of 120 x 40.

    together: standard error comes with the output.
    """

    def __init__(self, *arguments, terminal=False, together=False):
        environment = {**os.environ, "PYTHONUNBUFFERED": "1", "TERM": "xterm", "COLUMNS": "120", "LINES": "40"}
        self.master = None
        self.text = ""
        if terminal:
            self.master, slave = pty.openpty()
            self.process = subprocess.Popen(
                [sys.executable, *arguments], stdin=slave, stdout=slave, stderr=subprocess.PIPE, env=environment
            )
            os.close(slave)
            self.output = self.master
        else:
            self.process = subprocess.Popen(
                [sys.executable, *arguments],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT if together else subprocess.PIPE,
                env=environment,
            )
            self.output = self.process.stdout.fileno()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait(PATIENCE_S)
        if self.process.stderr is not None:
            self.process.stderr.close()
        if self.process.stdout is not None:
            self.process.stdout.close()
        if self.master is not None:
            os.close(self.master)

    def until(self, pattern):
        """Read until the output matches; returns the match. What comes after it stays for the next call."""
        while True:
            found = re.search(pattern, self.text)
            if found:
                self.text = self.text[found.end() :]
                return found
            try:
                data = os.read(self.output, 65536) if self._comes() else b""
            except OSError:  # the program's end of the terminal is closed
                data = b""
            assert data, f"{pattern!r} never came; output {self.text!r}, errors {self.errors()!r}"
            self.text += data.decode("utf-8", "replace")

    def errors(self):
        """What the program has written to standard error; it must be about to end."""
        if self.process.poll() is None:
            self.process.kill()
        return self._said()

    def type(self, keys):
        os.write(self.master, keys.encode())

    def interrupt(self):
        self.process.send_signal(signal.SIGINT)

    def ended(self):
        """(exit code, standard error) once it has ended by itself."""
        if self.master is not None:
            with contextlib.suppress(OSError):
                while self._comes() and os.read(self.master, 65536):
                    pass
        elif self.process.stderr is None:
            while self._comes() and os.read(self.output, 65536):  # or it would wait for a reader
                pass
        code = self.process.wait(PATIENCE_S)
        return code, self._said()

    def _comes(self):
        """Wait for output or its end; False when neither comes."""
        return bool(descriptors.wait([self.output], [], PATIENCE_S)[0])

    def _said(self):
        return self.process.stderr.read().decode("utf-8", "replace") if self.process.stderr is not None else ""
