"""Requests to a running robot: one line of JSON each, over an abstract unix socket, from this user's programs only."""

import json
import socket
from collections.abc import Callable
from typing import Any

from ranger_sim.can_bus.edge.peers import LIMITS, PATIENCE_S, REASONS, Peer, PeerServer, SocketStream, connected
from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.user_error import RequestError, UserError

ANSWER_S = 10.0  # a client waits so long
LONGEST_ANSWER = 1 << 20  # bytes; a status has below 10,000


def address(name: str) -> str:
    """The abstract address of robot `name`; it has no file, so nothing of it remains."""
    systems.require_linux(f"robot {name}: robots under a name", "abstract sockets", "`walk` runs everywhere")
    return f"\0ranger-sim-ctl/{name}"


class Client(Peer):
    """A connection. It has one request in progress at a time, so that answers are in the order of requests."""

    def __init__(self, connection: socket.socket, number: int) -> None:
        super().__init__(SocketStream(connection))
        self.number = number


class ControlServer(PeerServer[Client]):
    """The supervisor's endpoint: `obey(number of the client, request)` receives every admitted request.

    `admitted(line)` returns the request of a line, or raises UserError.

    The answer to a request that is not admitted is its fault; it goes no further. A client that leaves while answers
    wait for it has asked without waiting: what a socket still holds of its requests, 10,000 of them, is not carried out
    on and on.
    """

    lost_s = PATIENCE_S

    def __init__(self, name: str, admitted: Callable[[bytes], Any], obey: Callable[[int, Any], None]) -> None:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            listener.bind(address(name))
        except OSError:
            listener.close()
            raise RequestError(f"a robot named {name} is already running: give this one another --name") from None
        listener.listen(LIMITS["control"].peers)
        listener.setblocking(False)
        super().__init__("control", listener)
        self.admitted = admitted
        self.obey = obey
        self.clients: dict[int, Client] = {}
        self.seen = 0
        self.not_admitted = 0

    def _welcome(self, connection: socket.socket) -> Client:
        self.seen += 1
        client = self.clients[self.seen] = Client(connection, self.seen)
        return client

    def _takes_part(self, peer: Client) -> bool:
        """A client that waits for an answer keeps its place."""
        return peer.waits

    def _last_bytes(self, reason: str) -> bytes:
        return line_of({"error": f"this client {REASONS[reason]}"})

    def _take(self, peer: Client) -> bool:
        """Take the next request, if its line has ended."""
        end = peer.incoming.find(b"\n")
        if end < 0:
            return False
        line = bytes(peer.incoming[:end])
        del peer.incoming[: end + 1]
        peer.waits = True
        try:
            request = self.admitted(line)
        except UserError as fault:
            self.not_admitted += 1
            self.answer(peer.number, {"error": str(fault)})
        else:
            self.obey(peer.number, request)
        return True

    def _closed(self, peer: Client) -> None:
        self.clients.pop(peer.number, None)

    def poll(self) -> None:
        """Read what has arrived, as far as the limits allow; send waiting answers."""
        self.receive(0)
        self.write()

    def answer(self, number: int, content: dict) -> None:
        """Send one line to a client, which may have left."""
        client = self.clients.get(number)
        if client is not None:
            client.waits = False
            client.answer(line_of(content))

    def counters(self) -> dict[str, int]:
        """Whole numbers by name: requests carried out and not admitted, clients sent away by reason."""
        away = {f"sent_away_{reason}": self.sent_away[reason] for reason in REASONS}
        return {"requests": self.worked, "not_admitted": self.not_admitted, **away}


def line_of(content: dict) -> bytes:
    """An answer as sent."""
    return (json.dumps(content) + "\n").encode()


def ask(name: str, request: dict) -> Any:
    """Send a request to robot `name` and return its answer; UserError when it does not answer or refuses."""
    try:
        link = connected(address(name), f"the robot named {name}", ANSWER_S)
    except OSError:
        raise RequestError(f"no robot named {name} is running here (ranger-sim up --name {name})") from None
    end = wallclock.monotonic_s() + ANSWER_S
    with link:
        try:
            link.sendall(line_of(request))
            data = b""
            while not data.endswith(b"\n"):
                part = link.recv(65536)
                if not part:
                    raise RequestError(f"robot {name} has ended without an answer")
                data += part
                if len(data) > LONGEST_ANSWER or wallclock.monotonic_s() > end:
                    raise TimeoutError
        except TimeoutError:
            raise RequestError(f"robot {name} has not answered for {ANSWER_S:.0f} s") from None
        except OSError as error:
            raise RequestError(f"robot {name}: {error.strerror}") from None
    try:
        answer = json.loads(data)
        refused = answer.get("error")
    except (ValueError, AttributeError, RecursionError):
        raise RequestError(f"robot {name}: its answer is not understood") from None
    if refused is not None:
        raise RequestError(str(refused))
    return answer
