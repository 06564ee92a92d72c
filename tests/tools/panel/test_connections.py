"""Connections to the panel: which are kept, which are dropped, and what happens to those that read nothing."""

import asyncio
import socket

import pytest

from dev.fuzz.panel import TOKEN, Fuzz, Program, frame, handshake
from ranger_sim.tools.panel import connections, server
from tests.tools.panel.test_server import Ramp

# Starlette leaves a file that it was sending to the collector when its server is broken off, as these tests do.
pytestmark = pytest.mark.filterwarnings("ignore:.*<_io.FileIO:pytest.PytestUnraisableExceptionWarning")

LOOKS = frame(b'{"do": "look", "plots": [{"channels": [0, 0, 0, 0], "span": 2, "points": 4000}]}')


class Panel(Fuzz):
    """The fuzzer's server and its clock, without hostile programs; `connected` are closed at the end."""

    def __init__(self):
        Fuzz.__init__(self, 1, Ramp())
        self.connected = []

    def program(self, *said):
        made = Program(self.port)
        self.connected.append(made)
        for data in said:
            made.say(data)
        return made

    async def page(self, *said):
        page = self.program(handshake(self.port))
        await self.turns()
        for data in said:
            page.say(data)
        return page

    async def turns(self, count=200):
        for _ in range(count):
            await asyncio.sleep(0)

    async def pass_s(self, seconds):
        for _ in range(round(seconds * 10)):
            self.now_s += 0.1
            await self.turns(4)


def on_a_panel(test):
    """Run `test(panel)` with a server, which must meet no exception."""

    async def run():
        panel = Panel()
        await panel.begin()
        try:
            await test(panel)
            assert panel.faults.found == []
        finally:
            for program in panel.connected:
                program.close()
            await panel.end()

    asyncio.run(run())


def test_a_page_that_says_nothing_loses_its_place_and_is_cut_off():
    async def test(panel):
        panel.good.close()
        page = await panel.page()
        await panel.pass_s(server.PATIENCE_S - 1)
        assert len(panel.panel.sessions) == 1 and not panel.panel.refused
        await panel.pass_s(2)
        assert not panel.panel.sessions and panel.panel.refused == {"silence": 1}
        await panel.pass_s(connections.PATIENCE_S)
        page.hear()
        assert page.gone  # though it never closed

    on_a_panel(test)


def test_a_page_that_goes_on_requesting_and_never_reads_loses_its_place_too():
    async def test(panel):
        panel.good.close()
        page = await panel.page()
        held = panel.panel.connections.transports[page.socket.getsockname()]
        held.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
        page.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        most = 0
        for _ in range(2 * round(server.PATIENCE_S)):  # the kernel takes some pictures first
            page.say(LOOKS)
            page.say(frame(b'{"do": "shown"}'))
            await panel.pass_s(1)
            most = max(most, held.get_write_buffer_size())
        assert not panel.panel.sessions and panel.panel.refused == {"silence": 1}
        assert 0 < most < 1 << 20  # what it never took, and no second picture
        await panel.pass_s(connections.PATIENCE_S + 1)
        assert held.get_extra_info("socket").fileno() < 0

    on_a_panel(test)


def test_of_too_many_connections_the_oldest_that_is_not_a_page_is_closed():
    async def test(panel):
        page = await panel.page()
        await panel.turns()
        idle = [panel.program() for _ in range(connections.MOST + 20)]
        held = panel.panel.connections.transports
        for _ in range(1000):  # the kernel hands connections over when it likes
            await panel.turns()
            if panel.panel.refused[connections.MADE_ROOM] == 22 + len(panel.hostile):
                break
        assert len(held) == connections.MOST
        assert page.socket.getsockname() in held and panel.good.socket.getsockname() in held
        assert panel.panel.refused == {connections.MADE_ROOM: 22 + len(panel.hostile)}
        assert idle[-1].socket.getsockname() in held and idle[0].socket.getsockname() not in held
        last = panel.program(f"GET /panel.css?token={TOKEN} HTTP/1.0\r\nHost: 127.0.0.1:{panel.port}\r\n\r\n".encode())
        await panel.until(last, b"200 OK")

    on_a_panel(test)


def test_a_refused_client_that_never_closes_is_cut_off():
    async def test(panel):
        page = panel.program(handshake(panel.port, "guess"))
        await panel.turns()
        assert panel.panel.refused == {"a wrong token": 1}
        await panel.pass_s(connections.PATIENCE_S + 1)
        page.hear()
        assert page.gone  # though it never closed

    on_a_panel(test)


def test_shown_is_a_request_like_others_where_nothing_was_to_be_shown():
    async def test(panel):
        page = await panel.page(frame(b'{"do": "shown"}') * (int(server.BURST) + 50))
        await panel.turns(2000)
        page.hear()
        assert panel.panel.refused == {"too many requests": 1}

    on_a_panel(test)


def test_what_comes_behind_the_last_request_of_a_connection_ends_it():
    async def test(panel):
        program = panel.program(b"GET / HTTP/1.0\r\n\r\nGET / HTTP/1.0\r\nContent-Length: x\r\n\r\n")
        await panel.turns()
        program.hear()
        assert program.gone or b"HTTP/1.1 4" in program.heard

    on_a_panel(test)
