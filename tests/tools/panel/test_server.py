"""The panel's server: which clients are served, what a page may send, and that no page stops the others."""

import asyncio
import contextlib
import json
import socket
import threading

import numpy as np
import pytest
import uvicorn
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.panel import messages, server
from ranger_sim.tools.panel.channels import Channel, Trace, between
from ranger_sim.tools.panel.command import listening
from ranger_sim.tools.panel.server import AHEAD, BURST, COOKIE, MOST_CHANNELS, PLACES, PanelServer
from ranger_sim.tools.panel.source import Source
from ranger_sim.tools.recordings.datasets import open_recording

TOKEN = "a-word"
PATIENCE_S = 20


class Ramp(Source):
    """A recording of one channel, value = time; it notes what it is asked to do."""

    title = "a ramp"
    can = frozenset({"live", "keys"})

    def __init__(self):
        super().__init__()
        self.channels = [Channel("RAMP", "s", "a ramp", "test")]
        self.pose_names = ("EST_STATE_TH0",)
        self.asked = []
        self.wants = []

    def span(self):
        return (0.0, 10.0)

    def trace(self, channel, begin, end, points):
        x = np.linspace(begin, end, points)
        return Trace(x, x.astype(np.float32), None)

    def samples(self, channel, begin, end):
        x = np.arange(0.0, 10.0, 0.25)
        return between(x, x.astype(np.float32), begin, end)

    def values(self, wanted, at):
        return [at for _ in wanted]

    def want(self, channels):
        self.wants.append(channels)

    def pose(self, at):
        return (10.0 if at is None else at, [0.25])

    def state(self, at):
        return {"time_s": 10.0}

    async def request(self, wish):
        if wish.get("do") != "key":
            raise UserError(f"{wish.get('do')!r} is not a request")
        self.asked.append(wish)
        return {"time_s": 1.5}


@pytest.fixture
def panel():
    """(server, its address, what it printed)."""
    reported = []
    with listening("127.0.0.1", 0) as listener:
        port = listener.getsockname()[1]
        it = PanelServer(Ramp(), TOKEN, ("127.0.0.1", "localhost"), reported.append)
        config = uvicorn.Config(it.app, log_level="critical", ws="websockets-sansio", timeout_graceful_shutdown=1)
        served = uvicorn.Server(config)
        served.install_signal_handlers = lambda: None
        thread = threading.Thread(target=lambda: asyncio.run(served.serve(sockets=[listener])))
        thread.start()
        try:
            yield it, f"127.0.0.1:{port}", reported
        finally:
            served.should_exit = True
            thread.join(PATIENCE_S)
            assert not thread.is_alive()


@contextlib.contextmanager
def page(address, token=TOKEN, **settings):
    with connect(f"ws://{address}/socket?token={token}", max_size=None, open_timeout=PATIENCE_S, **settings) as socket:
        yield socket


def parts(message):
    """The messages in a picture, read by hand; of another message, itself."""
    if message[1] != 4:
        return [message]
    found, at = [], 16
    for _ in range(int.from_bytes(message[8:12], "little")):
        length = int.from_bytes(message[at : at + 4], "little")
        found.append(message[at + 8 : at + 8 + length])
        at = (at + 8 + length + 7) // 8 * 8
    assert at == len(message)
    return found


def received(socket, wanted):
    """The first message for which wanted(kind, body) is true, also of those in a picture; pictures are taken."""
    while True:
        message = socket.recv(PATIENCE_S)
        if message[1] == messages.PICTURE:
            socket.send('{"do": "shown"}')
        for data in parts(message):
            kind = data[1]
            body = json.loads(data[16:]) if kind == messages.TEXT else data
            if wanted(kind, body):
                return body


def answer(socket, **wish):
    """What the server answers to a request."""
    socket.send(json.dumps({**wish, "number": 7}))
    return received(socket, lambda kind, body: kind == messages.TEXT and body.get("answer") == 7)


def get(address, path, **headers):
    """(status, headers, body) of a request, as written by hand."""
    import http.client

    host, port = address.split(":")
    link = http.client.HTTPConnection(host, int(port), timeout=PATIENCE_S)
    link.request("GET", path, headers=headers)
    response = link.getresponse()
    found = response.status, dict(response.getheaders()), response.read()
    link.close()
    return found


def test_a_small_message_does_not_wait_for_the_one_before_to_be_acknowledged():
    async def delays():
        found = asyncio.get_running_loop().create_future()

        def came(_, writer):
            accepted = writer.get_extra_info("socket")
            found.set_result(accepted.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))
            writer.close()

        with listening("127.0.0.1", 0) as listener:
            async with await asyncio.start_server(came, sock=listener):
                _, writer = await asyncio.open_connection(*listener.getsockname())
                reported = await asyncio.wait_for(found, PATIENCE_S)
                writer.close()
                await writer.wait_closed()
        return reported

    assert asyncio.run(delays()) != 0


def cookie(address):
    return f"{COOKIE}-{address.rpartition(':')[2]}"


def test_the_page_is_served_to_clients_with_the_token_and_leaves_it_in_a_cookie(panel):
    _, address, _ = panel
    status, headers, body = get(address, f"/?token={TOKEN}")
    assert status == 200 and b"<title>" in body
    assert headers["set-cookie"].startswith(f"{cookie(address)}={TOKEN}; HttpOnly")
    for name in server.FILES:
        status, headers, body = get(address, f"/{name}", Cookie=f"{cookie(address)}={TOKEN}")
        assert status == 200 and body, name
    status, _, body = get(address, "/panel.py", Cookie=f"{cookie(address)}={TOKEN}")
    assert status == 404 and b"there is no such file" in body


@pytest.mark.parametrize(
    ("path", "headers", "reason"),
    [
        ("/", {}, "a wrong token"),
        ("/?token=another", {}, "a wrong token"),
        (f"/?token={TOKEN}", {"Host": "evil.example:80"}, "another host's name"),
        (f"/?token={TOKEN}", {"Origin": "http://evil.example"}, "a page of another site"),
        (f"/?token={TOKEN}", {"Origin": "http://[::1"}, "a page of another site"),
    ],
)
def test_clients_without_the_token_or_from_elsewhere_are_refused_with_a_reason(panel, path, headers, reason):
    it, address, reported = panel
    status, _, body = get(address, path, **headers)
    assert status == 403 and body.startswith(reason.encode())
    assert it.refused == {reason: 1} and reason in reported[0]


def test_a_page_with_a_wrong_token_gets_the_reason(panel):
    _, address, _ = panel
    with pytest.raises(ConnectionClosed) as closed, page(address, "wrong") as socket:
        socket.recv(PATIENCE_S)
    assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (1008, "a wrong token")


def test_a_page_sees_its_plots_the_robot_and_the_state(panel):
    _, address, _ = panel
    with page(address) as socket:
        hello = received(socket, lambda kind, body: kind == messages.TEXT and "hello" in body)["hello"]
        assert hello["channels"][0]["name"] == "RAMP" and hello["title"] == "a ramp"
        socket.send('{"do": "look", "plots": [{"channels": [0], "span": 2, "points": 5}]}')
        data = received(socket, lambda kind, body: kind == messages.TRACES)
        assert messages.HEAD.unpack_from(data) == (3, messages.TRACES, 0, 1, messages.FOLLOWS | messages.ANEW, 5, 0)
        assert messages.WINDOW.unpack_from(data, 16) == (10.0, 2.0)
        assert messages.TRACE_HEAD.unpack_from(data, 32) == (0, 0, 5, 0)
        assert np.frombuffer(data, "<f8", 5, 48).tolist() == [8.0, 8.5, 9.0, 9.5, 10.0]
        assert np.frombuffer(data, "<f4", 5, 88).tolist() == [8.0, 8.5, 9.0, 9.5, 10.0]
        pose = received(socket, lambda kind, body: kind == messages.POSE)
        assert np.frombuffer(pose, "<f8", 1, 16)[0] == 10.0 and np.frombuffer(pose, "<f4", 1, 24)[0] == 0.25
        assert received(socket, lambda kind, body: kind == messages.TEXT and "state" in body)["state"]["time_s"] == 10.0


def test_a_picture_is_one_message_of_parts_that_begin_at_multiples_of_8():
    assert messages.picture([b"12345678", b"abc"]).hex(" ", 8) == (
        "0304000000000000 0200000000000000"  # version 3, kind 4; two parts
        " 0800000000000000 3132333435363738 0300000000000000 6162630000000000"
    )


def test_of_what_goes_on_a_page_gets_what_is_new_and_a_little_of_what_it_has():
    whole, new = messages.FOLLOWS | messages.ANEW, messages.FOLLOWS
    plot = server.Plot([0], None, None, 10.0, 1000)  # points 10 ms wide
    assert plot.next(20.0, 0.25) == (10.0, 1000, messages.Window(20.0, 10.0, 1000, whole))
    begin, points, window = plot.next(20.04, 0.25)  # 0.29 s: 29 points and the one that was not full
    assert (points, window) == (30, messages.Window(20.04, 10.0, 1000, new)) and begin == pytest.approx(19.74)
    assert plot.next(20.04, 0.25)[1:] == (26, messages.Window(20.04, 10.0, 1000, new))  # it is paused
    assert plot.next(29.7, 0.25)[1] == 992
    assert plot.next(39.5, 0.25) == (29.5, 1000, messages.Window(39.5, 10.0, 1000, whole))  # too much of it is new
    assert plot.next(3.0, 0.25)[2].flags == whole  # it was started anew
    held = server.Plot([0], 2.0, 5.0, 10.0, 100)
    assert held.next(20.0, 0.25) == held.next(20.0, 0.25) == (2.0, 100, messages.Window(5.0, 3.0, 100, 0))


def test_a_page_that_requests_the_same_again_keeps_what_it_has(panel):
    _, address, _ = panel
    looks = '{"do": "look", "plots": [{"channels": [0], "span": %s, "points": 5}], "at": %s}'
    with page(address) as socket:
        flags = []
        for span, at in ((2, "null"), (2, 9.5), (2, 9.0), (3, 9.0), (2, 9.0)):
            socket.send(looks % (span, at))
            data = received(
                socket,
                lambda kind, body, span=span: (
                    kind == messages.TRACES and messages.WINDOW.unpack_from(body, 16)[1] == span
                ),
            )
            flags.append(messages.HEAD.unpack_from(data)[4])
        assert flags[0] == flags[3] == flags[4] == messages.FOLLOWS | messages.ANEW
        assert flags[1] == flags[2]


def test_requests_reach_the_robot_and_what_it_refuses_is_answered(panel):
    it, address, _ = panel
    with page(address) as socket:
        assert answer(socket, do="key", key=1) == {"answer": 7, "time_s": 1.5}
        assert it.source.asked == [{"do": "key", "key": 1}]
        assert "is not a request" in answer(socket, do="jump")["error"]
        assert answer(socket, do="values", channels=[0], at=3)["values"] == [3.0]


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        ({"do": "look"}, "a list of up to"),
        ({"do": "look", "plots": [1]}, "plot 0 is not an object"),
        ({"do": "look", "plots": [{"channels": [1], "points": 5}]}, "1 is not 0 to 0"),
        ({"do": "look", "plots": [{"channels": [True], "points": 5}]}, "True is not 0 to 0"),
        ({"do": "look", "plots": [{"channels": [0], "points": 0}]}, "points: 0 is not 1 to"),
        ({"do": "look", "plots": [{"channels": [0], "points": 5, "begin": "x"}]}, "begin: x is not a time"),
        ({"do": "look", "plots": [{"channels": [0], "points": 5, "end": 1e300}]}, "is not a time"),
        ({"do": "look", "plots": [{"channels": [0] * (MOST_CHANNELS + 1), "points": 5}]}, "channels at a time"),
        ({"do": "look", "plots": [], "hidden": [0] * (MOST_CHANNELS + 1)}, "channels at a time"),
        ({"do": "look", "plots": [], "hidden": [1]}, "1 is not 0 to 0"),
        ({"do": "values", "channels": "RAMP"}, "a list of numbers"),
        ({"do": None}, "is not a request"),
    ],
)
def test_an_impossible_request_is_answered_with_its_fault(panel, wish, words):
    _, address, _ = panel
    with page(address) as socket:
        assert words in answer(socket, **wish)["error"]
        assert answer(socket, do="key", key=1)["time_s"] == 1.5  # and the page goes on


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "a message that is not JSON"),
        ("[" * 50_000, "a message that is not JSON"),
        ('{"do": "values", "channels": [], "at": 1e400, "number": 1}', "a message that is not JSON"),
        ("[]", "not a JSON object"),
    ],
)
def test_a_client_that_does_not_send_json_is_sent_away_with_a_reason(panel, text, reason):
    it, address, _ = panel
    with pytest.raises(ConnectionClosed) as closed, page(address) as socket:
        socket.send(text)
        received(socket, lambda kind, body: False)
    assert closed.value.rcvd.code == 1008 and reason in closed.value.rcvd.reason
    assert sum(it.refused.values()) == 1


def test_a_client_with_endless_requests_is_sent_away(panel):
    _, address, _ = panel
    with pytest.raises(ConnectionClosed) as closed, page(address) as socket:
        for _ in range(int(BURST) + 100):
            socket.send('{"do": "key", "key": 1}')
        received(socket, lambda kind, body: False)
    assert closed.value.rcvd.reason == "too many requests"


def test_when_all_places_are_taken_one_more_gets_the_reason_and_pages_that_never_read_delay_no_other(panel):
    it, address, _ = panel
    with contextlib.ExitStack() as stack:
        pages = [stack.enter_context(page(address)) for _ in range(PLACES)]
        for each in pages[:-1]:  # they ask for much and never read
            each.send('{"do": "look", "plots": [{"channels": [0], "span": 2, "points": 4000}]}')
        assert answer(pages[-1], do="key", key=1)["time_s"] == 1.5
        with pytest.raises(ConnectionClosed) as closed:
            stack.enter_context(page(address)).recv(PATIENCE_S)
        assert closed.value.rcvd.code == 1013 and "no place free" in closed.value.rcvd.reason
        assert len(it.sessions) == PLACES


def test_a_page_gets_two_pictures_ahead_of_what_it_has_shown_and_no_third(panel):
    """The bound of what a dead page costs: two pictures. Another page shows how many there are meanwhile."""
    _, address, _ = panel

    def seen_beside():
        """The dead page's pictures, while the other one is shown ten."""
        for _ in range(10):
            received(lively, lambda kind, body: kind == messages.TEXT and "picture" in body)
        dead.send('{"do": "look", "plots": [], "number": 7}')
        pictures, answered = 0, False
        while not answered:
            data = dead.recv(PATIENCE_S)
            pictures += data[1] == messages.PICTURE
            answered = b'"answer"' in data[:40]
        return pictures

    with page(address) as lively, page(address) as dead:
        assert seen_beside() == AHEAD == 2
        assert seen_beside() == 0
        dead.send('{"do": "shown"}')
        assert seen_beside() == 1
        for _ in range(AHEAD):
            dead.send('{"do": "shown"}')
        assert seen_beside() == AHEAD


def exported(address, query, kind="csv"):
    return get(address, f"/export/{kind}?{query}", Cookie=f"{cookie(address)}={TOKEN}")


def test_what_the_plots_show_stays_wanted_while_another_view_hides_them(panel):
    """A data link would send it rarely otherwise."""
    it, address, _ = panel
    with page(address) as socket:
        for wish in ({"plots": [{"channels": [0], "points": 5}]}, {"plots": [], "hidden": [0]}, {"plots": []}):
            assert "error" not in answer(socket, do="look", **wish)
        assert it.source.wants == [[0], []]


def test_a_selection_is_saved_as_it_arrived(panel, tmp_path):
    _, address, _ = panel
    status, headers, body = exported(address, "channels=0&begin=1&end=1.5")
    assert status == 200 and 'filename="selection.csv"' in headers["content-disposition"]
    assert body.decode().splitlines() == [
        "time_s,channel,unit,value",
        *(f"{time:.6f},RAMP,s,{time:g}" for time in (1.0, 1.25, 1.5)),
    ]
    status, _, body = exported(address, "channels=0&begin=1&end=1.5", "mf4")
    assert status == 200
    (tmp_path / "selection.mf4").write_bytes(body)
    dataset = open_recording(tmp_path / "selection.mf4")
    assert dataset.channels["RAMP"].time_s.tolist() == [1.0, 1.25, 1.5]
    assert dataset.channels["RAMP"].value.tolist() == [1.0, 1.25, 1.5] and dataset.channels["RAMP"].unit == "s"


@pytest.mark.parametrize(
    ("query", "kind", "words"),
    [
        ("channels=0&begin=0&end=1", "exe", "'exe' is not a kind of file (available: csv, mf4"),
        ("channels=1&begin=0&end=1", "csv", "1 is not 0 to 0"),
        ("channels=x&begin=0&end=1", "csv", "channels, begin and end are numbers"),
        ("channels=0&end=1", "csv", "begin: nan is not a time"),
        ("channels=0&begin=0&end=1e400", "csv", "end: inf is not a time"),
        ("channels=0&begin=50&end=60", "mf4", "there are no samples"),
    ],
)
def test_an_impossible_selection_is_reported(panel, query, kind, words):
    _, address, _ = panel
    status, _, body = exported(address, query, kind)
    assert status == 400 and words in body.decode()


def test_a_selection_is_for_clients_with_the_token(panel):
    _, address, _ = panel
    status, _, body = get(address, "/export/csv?channels=0&begin=0&end=1")
    assert status == 403 and b"a wrong token" in body
