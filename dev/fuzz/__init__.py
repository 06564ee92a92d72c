"""Fuzzers: hostile input by the thousand against one part of the robot each, everything checked after every case.

A fuzzer is a module with `run(cases, seed)`: it returns what it counted, and raises `Finding` as soon as something is
not as it must be. The same seed gives the same cases. `command` is `python -m dev.fuzz`.
"""

import socket


class Finding(Exception):  # noqa: N818  (no error of the fuzzer)
    """What a fuzzer looks for: the program did not stand the case that the text names."""


class Connection:
    """One end of a connection that hostile programs use, and what it has heard. reads: it takes what comes."""

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        self.socket.setblocking(False)
        self.heard = bytearray()
        self.reads = True
        self.gone = False

    def say(self, data: bytes) -> None:
        """As much as goes."""
        try:
            self.socket.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def hear(self) -> None:
        """What has come."""
        try:
            while data := self.socket.recv(1 << 18):
                self.heard += data
            self.gone = True
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def close(self) -> None:
        """Leave."""
        self.socket.close()
