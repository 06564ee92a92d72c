"""Fuzzers: each sends thousands of hostile inputs to one part of the robot and checks it after every case.

A fuzzer is a module with `run(cases, seed)`: it returns its counts, and raises `Finding` as soon as a check fails. The
same seed gives the same cases. `command` is `python -m dev.fuzz`.
"""

import socket


class Finding(Exception):  # noqa: N818  (not an error of the fuzzer)
    """A failure found by a fuzzer: the program failed the case named in the text."""


class Connection:
    """One end of a connection of a hostile program, and the bytes received on it. reads: it reads incoming bytes."""

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        self.socket.setblocking(False)
        self.heard = bytearray()
        self.reads = True
        self.gone = False

    def say(self, data: bytes) -> None:
        """Send as much as possible."""
        try:
            self.socket.send(data)
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def hear(self) -> None:
        """Read the bytes that have arrived."""
        try:
            while data := self.socket.recv(1 << 18):
                self.heard += data
            self.gone = True
        except BlockingIOError:
            pass
        except OSError:
            self.gone = True

    def close(self) -> None:
        """Close the connection."""
        self.socket.close()
