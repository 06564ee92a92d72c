"""Requests to a running robot: one line of JSON each, over an abstract unix socket, from the same user only."""

import contextlib
import json
import os
import socket
import struct
from collections.abc import Callable
from typing import Any

from ranger_sim.foundation.user_error import UserError

LONGEST_LINE = 65536
ANSWER_S = 10.0  # a client waits so long


def address(name: str) -> str:
    """The abstract address of robot `name`; it has no file, so nothing remains of it."""
    return f"\0ranger-sim-ctl/{name}"


class ControlServer:
    """The supervisor's end. Never blocks: `poll` handles what is there."""

    def __init__(self, name: str) -> None:
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self.listener.bind(address(name))
        except OSError:
            self.listener.close()
            raise UserError(f"a robot named {name} is already running: give this one another --name") from None
        self.listener.listen(8)
        self.listener.setblocking(False)
        self.clients: dict[int, socket.socket] = {}
        self.received: dict[int, bytes] = {}

    def filenos(self) -> list[int]:
        """What to select on."""
        return [self.listener.fileno(), *(each.fileno() for each in self.clients.values())]

    def poll(self, obey: Callable[[int, dict], None]) -> None:
        """Take new clients, read what they sent, hand whole requests to `obey(number of the client, request)`."""
        with contextlib.suppress(BlockingIOError):
            while True:
                client, _ = self.listener.accept()
                user = struct.unpack("3i", client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1]
                if user not in (os.getuid(), 0):  # abstract sockets have no permissions of their own
                    client.close()
                    continue
                client.setblocking(False)
                self.clients[client.fileno()] = client
                self.received[client.fileno()] = b""
        for number in list(self.clients):
            try:
                data = self.clients[number].recv(4096)
            except BlockingIOError:
                continue
            except OSError:
                data = b""
            self.received[number] += data
            if not data or len(self.received[number]) > LONGEST_LINE:
                self.drop(number)
                continue
            line, newline, rest = self.received[number].partition(b"\n")
            if newline:
                self.received[number] = rest
                try:
                    request = json.loads(line)
                    if not isinstance(request, dict):
                        raise ValueError
                except ValueError:
                    self.answer(number, {"error": "a request is one line with a JSON object"})
                    continue
                obey(number, request)

    def answer(self, number: int, content: dict) -> None:
        """One line to a client, which may have left."""
        client = self.clients.get(number)
        if client is not None:
            try:
                client.sendall((json.dumps(content) + "\n").encode())
            except OSError:
                self.drop(number)

    def drop(self, number: int) -> None:
        """A client has left."""
        self.received.pop(number, None)
        client = self.clients.pop(number, None)
        if client is not None:
            client.close()

    def close(self) -> None:
        """Give the address back."""
        for number in list(self.clients):
            self.drop(number)
        self.listener.close()


def ask(name: str, request: dict) -> Any:
    """Send a request to robot `name` and return its answer; UserError when there is none or it says no."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(ANSWER_S)
        try:
            link.connect(address(name))
        except OSError:
            raise UserError(f"no robot named {name} is running here (ranger-sim up --name {name})") from None
        try:
            link.sendall((json.dumps(request) + "\n").encode())
            data = b""
            while not data.endswith(b"\n"):
                part = link.recv(65536)
                if not part:
                    raise UserError(f"robot {name} has ended without an answer")
                data += part
        except TimeoutError:
            raise UserError(f"robot {name} has not answered for {ANSWER_S:.0f} s") from None
        except OSError as error:
            raise UserError(f"robot {name}: {error.strerror}") from None
    answer = json.loads(data)
    if "error" in answer:
        raise UserError(answer["error"])
    return answer
