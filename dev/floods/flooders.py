"""Flooding programs: for each interface of a robot and its panel, programs that use it endlessly and read nothing.

A way in returns a connected descriptor, its handshake done; a `Flood` defines what is sent, over how many of them.
"""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import os
import select
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.datatable.addresses import XCP_BUS, XCP_MASTER_ID
from ranger_sim.firmware_sim.gdb.packets import framed
from ranger_sim.foundation import descriptors
from ranger_sim.harness.feed import records
from ranger_sim.harness.processes import control
from ranger_sim.tools.robodaq.codec import write_packet

CHUNK = 1 << 16  # bytes offered at once: what a socket takes
LET_IN_S = 5.0  # how long a page waits for its place
POLL_S = 0.1  # between two checks by programs that only stay connected

# The robot that is flooded: one of Python boards with every interface open; one with a board that runs machine code and
# a debugger port; one with a panel connected.
WHOLE, DEBUGGED, SHOWN = "whole", "debugged", "shown"


@dataclasses.dataclass(frozen=True)
class Endpoints:
    """Addresses of the robot under test. gdb, panel: ports, 0 if not open."""

    name: str
    terminal: str = ""
    port: int = 0
    data_link: str = ""
    xcp: int = 0
    gdb: int = 0
    panel: int = 0
    token: str = ""


# --- ways in ---------------------------------------------------------------------------------------------

Way = Callable[[Endpoints], "socket.socket | int"]


def attached(endpoints: Endpoints, channel: str = "can1") -> socket.socket:
    """A client of the attach protocol on a bus."""
    hello = wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0) + channel.encode())
    return _local(wire.SOCKET_PREFIX + endpoints.name, hello)


def unknown(endpoints: Endpoints) -> socket.socket:
    """A connection to the attach protocol that has not identified itself."""
    return _local(wire.SOCKET_PREFIX + endpoints.name, b"")


def daemon(endpoints: Endpoints) -> socket.socket:
    """A client of socketcand on can1."""
    return _distant(endpoints.port, b"< open can1 >< rawmode >")


def asking(endpoints: Endpoints) -> socket.socket:
    """A client of the supervisor."""
    return _local(control.address(endpoints.name), b"")


def viewing(endpoints: Endpoints) -> socket.socket:
    """A viewer of the feed."""
    return _local(records.address(endpoints.name), b"")


def calibrating(endpoints: Endpoints) -> socket.socket:
    """The XCP master on UDP that holds the connection."""
    client = stranger(endpoints)
    client.send(xcp_packets(b"\xff\x00"))
    return client


def stranger(endpoints: Endpoints) -> socket.socket:
    """A client that sends datagrams to the XCP slave."""
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.connect(("127.0.0.1", endpoints.xcp))
    return client


def probing(endpoints: Endpoints) -> socket.socket:
    """An XCP master on the bus, connected."""
    client = attached(endpoints, XCP_BUS.lower())
    client.sendall(xcp_frame(b"\xff\x00"))
    return client


def debugging(endpoints: Endpoints) -> socket.socket:
    """A debugger that has let its board run."""
    return _distant(endpoints.gdb, framed(b"c"))


def debugger(endpoints: Endpoints) -> socket.socket:
    """A debugger that sends nothing."""
    return _distant(endpoints.gdb, b"")


def visiting(endpoints: Endpoints) -> socket.socket:
    """A connection to the panel that sends nothing."""
    return _distant(endpoints.panel, b"")


def page(endpoints: Endpoints) -> socket.socket:
    """A page of the panel that has been admitted."""
    client = _distant(endpoints.panel, handshake(endpoints, endpoints.token))
    client.settimeout(LET_IN_S)
    received = b""
    while b"\r\n\r\n" not in received:
        if not (data := client.recv(1)):
            client.close()
            raise ConnectionResetError
        received += data
    client.settimeout(None)
    return client


def page_of_another_site(endpoints: Endpoints) -> socket.socket:
    """A page that was loaded from another site and knows the token."""
    return _distant(endpoints.panel, handshake(endpoints, endpoints.token, "http://elsewhere.example"))


def page_with_a_wrong_token(endpoints: Endpoints) -> socket.socket:
    """A page that guesses the token."""
    return _distant(endpoints.panel, handshake(endpoints, "guess"))


def line(endpoints: Endpoints) -> int:
    """The pseudo-terminal of slcan, its channel open."""
    return _terminal(endpoints.terminal, b"O\r")


def computer(endpoints: Endpoints) -> int:
    """The pseudo-terminal of the data link."""
    return _terminal(endpoints.data_link, b"")


def _local(address: str, greeting: bytes) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.connect(address)
    client.sendall(greeting)
    return client


def _distant(port: int, greeting: bytes) -> socket.socket:
    client = socket.create_connection(("127.0.0.1", port))
    client.sendall(greeting)
    return client


def _terminal(path: str, greeting: bytes) -> int:
    number = os.open(path, os.O_RDWR | os.O_NOCTTY)
    os.write(number, greeting)
    return number


# --- what they send --------------------------------------------------------------------------------------


def asked(**request: object) -> bytes:
    """A request line to the supervisor."""
    return json.dumps(request).encode() + b"\n"


def xcp_packets(*packets: bytes) -> bytes:
    """A datagram of these packets."""
    return b"".join(struct.pack("<HH", len(each), 0) + each for each in packets)


def xcp_frame(packet: bytes) -> bytes:
    """A frame to the slave on the bus, in the attach protocol's format."""
    low, high = struct.unpack("<II", packet.ljust(8, b"\0"))
    return wire.send_record(XCP_MASTER_ID, len(packet), low, high)


def handshake(endpoints: Endpoints, token: str, origin: str = "") -> bytes:
    """A browser's opening handshake for a WebSocket (RFC 6455, section 4.1)."""
    return (
        f"GET /socket?token={token} HTTP/1.1\r\nHost: 127.0.0.1:{endpoints.panel}\r\nUpgrade: websocket\r\n"
        "Connection: Upgrade\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        + (f"Origin: {origin}\r\n" if origin else "")
        + "\r\n"
    ).encode()


def message(text: str) -> bytes:
    """A text frame of a client (RFC 6455, section 5.2), masked with zeros."""
    data = text.encode()
    length = bytes([0x80 | len(data)]) if len(data) < 126 else b"\xfe" + struct.pack(">H", len(data))
    return b"\x81" + length + bytes(4) + data


def page_request(**content: object) -> bytes:
    """A request of a page."""
    return message(json.dumps(content))


# Everything that a page may request at once: 48 channels, each with the most points.
ALL_PLOTS = page_request(do="look", plots=[{"channels": list(range(48)), "span": 60, "points": 4000}])
REQUEST = b"GET /panel.js?token=guess HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"

# --- floods ----------------------------------------------------------------------------------------------


@dataclasses.dataclass(frozen=True)
class Flood:
    """`piece` sent repeatedly through `way`; an empty one: connections, opened and kept. clients: how many at once.

    once: sent first on each connection. whole: a piece is one datagram. stays: `clients` send `once` and then nothing;
    a client that is disconnected reconnects. robot: which one is flooded.
    """

    way: Way
    piece: bytes
    clients: int = 1
    once: bytes = b""
    whole: bool = False
    stays: bool = False
    robot: str = WHOLE


PAGES, PLACES = 100, 16  # of a panel: this many ask for a place (issue 18), and this many get one

FLOODS = {
    "attach CONTROL take part": Flood(attached, wire.record(wire.CONTROL, bytes([wire.ACTIVATE]))),
    "attach CONTROL listen": Flood(attached, wire.record(wire.CONTROL, bytes([wire.LISTEN]))),
    "attach CONTROL both": Flood(attached, b"".join(wire.record(wire.CONTROL, bytes([each])) for each in (2, 1))),
    "attach CONTROL flush": Flood(attached, wire.record(wire.CONTROL, bytes([wire.FLUSH]))),
    "attach SEND": Flood(attached, wire.send_record(0x7FF, 8, 1, 2)),
    "attach HELLO for channels": Flood(
        unknown, wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0))
    ),
    "attach connections": Flood(unknown, b""),
    "attach CONTROL, 64 clients": Flood(attached, wire.record(wire.CONTROL, bytes([wire.ACTIVATE])), 64),
    "slcan V": Flood(line, b"V\r"),
    "slcan F": Flood(line, b"F\r"),
    "slcan O and C": Flood(line, b"C\rO\r"),
    "slcan t": Flood(line, b"t7FF81122334455667788\r"),
    "slcan nonsense": Flood(line, b"?" * 40 + b"\r"),
    "socketcand echo": Flood(daemon, b"< echo >"),
    "socketcand send": Flood(daemon, b"< send 7ff 8 1 2 3 4 5 6 7 8 >"),
    "socketcand nonsense": Flood(daemon, b"< x >"),
    "socketcand connections": Flood(daemon, b""),
    "control status": Flood(asking, asked(do="status")),
    "control set": Flood(asking, asked(do="set", name="P_UI_LCD_TIME", value=500)),
    "control key": Flood(asking, asked(do="key", key=0)),
    "control resume": Flood(asking, asked(do="resume")),
    "control nonsense": Flood(asking, b"{}\n"),
    "control no line": Flood(asking, b"x"),
    "control connections": Flood(asking, b""),
    "xcp GET_STATUS": Flood(calibrating, xcp_packets(*[b"\xfd"] * 200), whole=True),
    "xcp SHORT_UPLOAD": Flood(calibrating, xcp_packets(*[b"\xf4\x04\0\0" + bytes(4)] * 100), whole=True),
    "xcp nonsense": Flood(calibrating, b"?" * 1000, whole=True),
    "xcp strangers": Flood(stranger, xcp_packets(b"\xfd"), 8, whole=True),
    "xcp CONNECT, 8 strangers": Flood(stranger, xcp_packets(b"\xff\x00"), 8, whole=True),
    "xcp on CAN SHORT_UPLOAD": Flood(probing, xcp_frame(b"\xf4\x04\0\0" + bytes(4))),
    "xcp on CAN nonsense": Flood(probing, xcp_frame(b"?" * 8)),
    "feed, 4 viewers that never read": Flood(viewing, b"", 4, stays=True),
    "feed, 64 viewers that never read": Flood(viewing, b"", 64, stays=True),
    "feed connections": Flood(viewing, b""),
    "feed nonsense": Flood(viewing, b"x"),
    "data link noise": Flood(computer, bytes(range(256))),
    "data link packets": Flood(computer, write_packet(388, 0x43FA0000)),  # P_UI_LCD_TIME = 500
    "gdb requests, the board runs": Flood(debugging, framed(b"m0,4"), robot=DEBUGGED),
    "gdb connections": Flood(debugger, b"", once=framed(b"c"), robot=DEBUGGED),
    "gdb nonsense": Flood(debugging, b"x", robot=DEBUGGED),
    "panel connections": Flood(visiting, b"", robot=SHOWN),
    "panel, requests with a wrong token": Flood(visiting, REQUEST, robot=SHOWN),
    "panel, a head without end": Flood(visiting, b"GET / HTTP/1.1\r\nX: " + b"x" * 1000, robot=SHOWN),
    "panel, pages with a wrong token": Flood(page_with_a_wrong_token, b"", robot=SHOWN),
    "panel, pages of another site": Flood(page_of_another_site, b"", robot=SHOWN),
    "panel, 100 pages that never read": Flood(page, b"", PAGES, ALL_PLOTS, stays=True, robot=SHOWN),
    "panel, 100 pages that never show": Flood(page, b"", PAGES, stays=True, robot=SHOWN),
    "panel, broken messages": Flood(page, message("{"), robot=SHOWN),
    "panel, shown without end": Flood(page, page_request(do="shown"), PLACES, robot=SHOWN),
    "panel, requests without end": Flood(page, page_request(do="values", channels=[0], number=1), robot=SHOWN),
}

PEACE, BUSY = "no client", "a busy program, no port"
PEACE_OF = {WHOLE: PEACE, DEBUGGED: "no client, a board runs an image", SHOWN: "no client, a panel polls"}
FRAMES_IN_WINDOW = "attach SEND, answers read"
READ = "feed, 4 viewers that read"
DRAWN = "panel, 16 pages that show all"
ALL = "attach, slcan and socketcand at once"
TOGETHER = (FRAMES_IN_WINDOW, "slcan t", "socketcand send")  # the most expensive of each interface
OF_WHOLE = tuple(name for name, flood in FLOODS.items() if flood.robot == WHOLE)
# Grouped by robot, because each change of robot starts a new one.
NAMES = (
    *(PEACE, BUSY, *OF_WHOLE, FRAMES_IN_WINDOW, READ, ALL),
    *(PEACE_OF[DEBUGGED], *(name for name, flood in FLOODS.items() if flood.robot == DEBUGGED)),
    *(PEACE_OF[SHOWN], *(name for name, flood in FLOODS.items() if flood.robot == SHOWN), DRAWN),
)


def robot_of(name: str) -> str:
    """The robot that the flood or measurement of this name uses."""
    if name == DRAWN:
        return SHOWN
    if name in FLOODS:
        return FLOODS[name].robot
    return next((robot for robot, peace in PEACE_OF.items() if peace == name), WHOLE)


# --- programs --------------------------------------------------------------------------------------------


def burn() -> None:
    """Keep a processor busy until killed."""
    while True:
        pass


def send_in_window(endpoints: Endpoints) -> None:
    """Send frames as fast as the attach protocol allows and read every answer, until killed."""
    client, window, waiting, received = attached(endpoints), 64, 0, bytearray()
    while True:
        client.sendall(wire.send_record(0x7FF, 8, 1, 2) * (window - waiting))
        waiting = window
        while waiting == window:
            received += client.recv(CHUNK)
            while (record := wire.next_record(received)) is not None:
                waiting -= record[0] in (wire.SENT, wire.DROPPED)


def read(endpoints: Endpoints) -> None:
    """Run viewers that read everything in the feed, until killed."""
    clients = [viewing(endpoints) for _ in range(4)]
    while True:
        for number in descriptors.wait([each.fileno() for each in clients], [], 1.0)[0]:
            os.read(number, 1 << 20)


def draw(endpoints: Endpoints) -> None:
    """Open as many pages as have a place; each requests everything and confirms it at once. Runs until killed."""
    clients = {client.fileno(): client for client in (page(endpoints) for _ in range(PLACES))}
    for client in clients.values():
        client.sendall(ALL_PLOTS)
    while clients:
        for number in descriptors.wait(list(clients), [], 1.0)[0]:
            data = clients[number].recv(1 << 20)
            if not data:
                clients.pop(number).close()
            elif b'"picture"' in data:
                clients[number].sendall(page_request(do="shown"))


def stay(flood: Flood, endpoints: Endpoints) -> None:
    """Keep clients connected that send `once` and then nothing, until killed. A disconnected client reconnects."""
    ends: list[socket.socket | int] = []
    watch = select.poll()
    while True:
        with suppress(OSError):
            while len(ends) < flood.clients:
                ends.append(_connected(flood, endpoints))
                watch.register(_number(ends[-1]), select.POLLRDHUP)  # reports a disconnection, not incoming data
        lost = {number for number, _ in watch.poll(POLL_S * 1000)}
        for each in [each for each in ends if _number(each) in lost]:
            watch.unregister(_number(each))
            _close(each)
            ends.remove(each)


def pour(flood: Flood, endpoints: Endpoints) -> None:
    """Flood until killed. Reconnect where a connection is ended or refused."""
    data = flood.piece if flood.whole else flood.piece * (CHUNK // max(1, len(flood.piece)))
    ends: list[socket.socket | int] = []
    while True:
        try:
            while len(ends) < flood.clients or not data:
                ends.append(_connected(flood, endpoints))
                os.set_blocking(_number(ends[-1]), False)
        except OSError:
            if not ends:
                continue
            if not data:
                _close(ends.pop(0))
        descriptors.wait([], [_number(each) for each in ends], 1.0)
        for place, each in enumerate(ends):
            try:
                os.write(_number(each), data)
            except BlockingIOError:
                continue
            except OSError:
                _close(ends.pop(place))
                break


def _connected(flood: Flood, endpoints: Endpoints) -> socket.socket | int:
    end = flood.way(endpoints)
    if flood.once:
        os.write(_number(end), flood.once)
    return end


def _number(end: socket.socket | int) -> int:
    return end if isinstance(end, int) else end.fileno()


def _close(end: socket.socket | int) -> None:
    if isinstance(end, int):
        os.close(end)
    else:
        end.close()


Run = tuple[Callable[..., None], tuple]  # function that a program runs, and its arguments


def programs(name: str, endpoints: Endpoints) -> list[Run]:
    """The programs that disturb the robot under this name."""
    alone: dict[str, Run] = {
        BUSY: (burn, ()),
        FRAMES_IN_WINDOW: (send_in_window, (endpoints,)),
        READ: (read, (endpoints,)),
        DRAWN: (draw, (endpoints,)),
    }
    if name in PEACE_OF.values():
        return []
    if name == ALL:
        return [program for each in TOGETHER for program in programs(each, endpoints)]
    if name in alone:
        return [alone[name]]
    return [(stay if FLOODS[name].stays else pour, (FLOODS[name], endpoints))]


@contextmanager
def flooded(name: str, endpoints: Endpoints) -> Iterator[None]:
    """Run the programs of this name inside the context."""
    context = multiprocessing.get_context("fork")
    running = [context.Process(target=what, args=on, daemon=True) for what, on in programs(name, endpoints)]
    for each in running:
        each.start()
    try:
        yield
    finally:
        for each in running:
            each.kill()
            each.join()
