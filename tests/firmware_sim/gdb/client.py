"""A debugger of a few lines, written from the protocol's description and sharing nothing with ours.

`session` runs one with a machine: the machine and its gdb port in this thread, the debugger in another.
"""

import concurrent.futures
import contextlib
import socket

from ranger_sim.firmware_sim.gdb.server import GdbServer

PATIENCE_S = 20.0  # of the test, with a machine that is busy otherwise


class Client:
    def __init__(self, port):
        self.port = port
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.rest = b""

    def send(self, data):
        self.socket.sendall(data)

    def receive(self):
        """Some bytes; none when the other end is closed."""
        with contextlib.suppress(ConnectionResetError):
            return self.socket.recv(65536)
        return b""

    def put(self, text, check=None):
        payload = text if isinstance(text, bytes) else text.encode()
        total = 0
        for byte in payload:
            total = total + byte & 255
        self.send(b"$" + payload + b"#" + (b"%02x" % total if check is None else check))

    def get(self):
        """The next packet's payload, acknowledgements left out; None when the connection has ended."""
        while True:
            start = self.rest.find(b"$")
            end = self.rest.find(b"#", start)
            if 0 <= start < end and len(self.rest) >= end + 3:
                payload, check = self.rest[start + 1 : end], self.rest[end + 1 : end + 3]
                assert sum(payload) % 256 == int(check, 16)
                self.rest = self.rest[end + 3 :]
                self.send(b"+")
                return payload.decode("latin-1")
            more = self.receive()
            if not more:
                return None
            self.rest += more

    def ask(self, text):
        self.put(text)
        return self.get()

    def word(self, address):
        return int.from_bytes(bytes.fromhex(self.ask(f"m{address:x},4")), "little")

    def register(self, number):
        return int.from_bytes(bytes.fromhex(self.ask(f"p{number:x}")), "little")

    def monitor(self, words):
        return bytes.fromhex(self.ask("qRcmd," + words.encode().hex())).decode()

    def close(self):
        self.socket.close()


def session(machine, until, talk, clients=1, beside=(), run=None, **options):
    """What `talk(client, ...)` returns, with this many clients connected, and the gdb server.

    The machine has run to `until` (None: while the talk takes); `beside`: gdb servers of the same process. `run`
    is how it passes time to a time, in units of `until`.
    """
    run = run or machine.run
    with contextlib.ExitStack() as stack:
        pool = stack.enter_context(concurrent.futures.ThreadPoolExecutor(1))
        server = GdbServer(machine, 0, **options)
        for each in (server, *beside):
            each.begin()
            each.together([server, *beside])
        stack.callback(server.close)  # first of all, so that no client waits for it

        def whole():
            with contextlib.ExitStack() as inner:
                connected = [inner.enter_context(contextlib.closing(Client(server.port))) for _ in range(clients)]
                return talk(*connected)

        future = pool.submit(whole)
        server.ends = options.get("ends", future.done)
        server.wait_for_debugger()
        while until is None and not future.done():
            run(machine.core.cycles + 10_000)
        run(until or 0)
        return future.result(), server
