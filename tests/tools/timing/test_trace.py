"""`walk --trace` and `ranger-sim trace open`: what they write, serve and refuse."""

import contextlib
import http.client
import itertools
import json
import os
import re
import socket
import sys
import threading

import pytest

from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.harness.timeline import moments, perfetto_reader, viewer
from ranger_sim.tools import cli
from ranger_sim.tools.timing import trace

pytest.importorskip("perfetto")

RUN = ("walk", "--time", "50ms", "--json", "-")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A trace of a short run with a fault, as the command writes it."""
    path = tmp_path_factory.mktemp("trace") / "run.pftrace"
    fault = "MCH.joint_encoder:stuck@20 ms"
    cli.main([*RUN, "--trace", str(path), "--fault", fault])
    return path


def reported(capsys, *arguments):
    """(exit code, standard error) of a command."""
    code = cli.main(list(arguments))
    return code, capsys.readouterr().err


# --- walk --trace -----------------------------------------------------------------------------------------


def test_a_walk_writes_its_timeline_in_every_format_asked_for_and_walks_as_without(tmp_path, capsys):
    pytest.importorskip("vcd")
    paths = [tmp_path / "a.pftrace", tmp_path / "a.perfetto-trace", tmp_path / "a.vcd"]
    assert cli.main([*RUN, *(each for path in paths for each in ("--trace", str(path)))]) == 0
    digest = json.loads(capsys.readouterr().out)["trace_digest"]
    assert cli.main(list(RUN)) == 0
    assert json.loads(capsys.readouterr().out)["trace_digest"] == digest
    assert paths[0].read_bytes() == paths[1].read_bytes()
    assert sorted(tmp_path.iterdir()) == sorted(paths)  # and nothing beside


def test_a_file_that_trace_opens_is_printed_with_the_command_for_it(tmp_path, capsys):
    pytest.importorskip("vcd")
    one, other = tmp_path / "a.pftrace", tmp_path / "a.vcd"
    assert cli.main(["walk", "--time", "5ms", "--trace", str(one), "--trace", str(other)]) == 0
    shown = capsys.readouterr().err
    assert f"timeline: {one} (ranger-sim trace open {one})\n" in shown and f"timeline: {other}\n" in shown


def test_only_the_last_part_is_written_where_that_is_asked_for(tmp_path, capsys):
    path = tmp_path / "last.pftrace"
    assert cli.main([*RUN, "--trace", str(path), "--trace-last", "10ms"]) == 0
    read = perfetto_reader.read(path)
    assert 37_000_000 < read.begin_ns and 49_900_000 < read.end_ns < 50_200_000


def test_boards_are_in_detail_for_ten_seconds_unless_it_is_asked_otherwise(tmp_path, capsys):
    sizes = {}
    for length, more in {"default": (), "all": ("--trace-detail", "all"), "5 ms": ("--trace-detail", "5ms")}.items():
        path = tmp_path / "run.pftrace"
        assert cli.main([*RUN, "--trace", str(path), *more]) == 0
        sizes[length] = path.read_bytes(), len(perfetto_reader.read(path).find("Boards", "MCH", "slots").slices)
    assert sizes["default"] == sizes["all"]  # 50 ms
    assert 0 < sizes["5 ms"][1] < sizes["all"][1] / 5
    with pytest.raises(SystemExit):
        cli.main(["walk", "--trace", "a.pftrace", "--trace-detail", "most"])
    assert "'most' is not a number" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--trace", "run.txt"], "suffix '.txt' is not a format (available: .pftrace"),
        (["--trace", "nowhere/run.pftrace"], "cannot be written"),
        (["--trace", "."], "is not a format"),
        (["--trace-last", "10s"], "--trace-last needs --trace"),
        (["--trace-detail", "all"], "--trace-detail needs --trace"),
    ],
)
def test_a_file_that_cannot_be_written_is_reported_in_one_line_before_anything_runs(
    arguments, reason, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    code, text = reported(capsys, "walk", "--steps", "100000", *arguments)
    assert code == 2 and reason in text and text.count("\n") == 1


def test_a_library_that_is_missing_is_reported_before_anything_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "vcd", None)  # what an environment without it looks like
    code, text = reported(capsys, "walk", "--steps", "100000", "--trace", str(tmp_path / "run.vcd"))
    assert code == 2 and "walk needs the library pyvcd, which is not installed" in text and text.count("\n") == 1


def test_a_time_that_is_none_is_refused(capsys):
    with pytest.raises(SystemExit):
        cli.main(["walk", "--trace", "a.pftrace", "--trace-last", "soon"])
    assert "'soon' is not a number" in capsys.readouterr().err


# --- the instant that matters -----------------------------------------------------------------------------


def test_a_fault_is_on_the_timeline_with_its_stamps(file):
    names = [instant.name for instant in perfetto_reader.read(file).find("Faults").instants]
    assert names[:2] == ["armed: MCH.joint_encoder:stuck@20 ms", "activated: MCH.joint_encoder:stuck@20 ms"]


def test_the_time_shown_is_that_of_the_fault_unless_another_is_requested(file):
    moment = moments.find(file, None)
    assert moment.text.startswith(("acted: MCH", "activated: MCH")) and 19_000_000 < moment.time_ns < 50_000_000
    assert moments.find(file, 30_000_000).time_ns == 30_000_000


def test_a_run_without_a_fault_shows_its_last_step_or_else_its_middle(tmp_path, capsys):
    path = tmp_path / "run.pftrace"
    cli.main([*RUN, "--trace", str(path)])
    moment = moments.find(path, None)
    assert moment.text == "the middle" and moment.time_ns == (moment.begin_ns + moment.end_ns) // 2


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--at", "12.3s"], r"12.3 s is not in it, it is from 0 to 0\.05"),
        (["--offline", "--out", "missing/page.html"], "its folder is missing"),
    ],
)
def test_a_trace_that_cannot_be_shown_is_reported_in_one_line(file, arguments, reason, capsys):
    code, text = reported(capsys, "trace", "open", str(file), "--no-browser", *arguments)
    assert code == 2 and re.search(reason, text) and text.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("run.vcd", b"", "only .pftrace files"),
        ("none.pftrace", None, "cannot be read: No such file"),
        ("run.pftrace", b"\x00 this is something else", "not a Perfetto trace"),
        ("empty.pftrace", b"", "not a Perfetto trace"),
        # a packet with time stamp 5 and an instant on track 7, which no descriptor has told of
        ("foreign.pftrace", b"\x0a\x08\x40\x05\x5a\x04\x48\x03\x58\x07", "none that ranger-sim wrote"),
        # the same with a track event whose last field has no value
        ("damaged.pftrace", b"\x0a\x07\x40\x05\x5a\x03\x48\x03\x58", "or it is damaged"),
    ],
)
def test_a_file_that_is_not_a_trace_is_reported_in_one_line(name, content, reason, tmp_path, capsys):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    code, text = reported(capsys, "trace", "open", str(path), "--no-browser")
    assert code == 2 and reason in text and text.count("\n") == 1


# --- in Perfetto's viewer ---------------------------------------------------------------------------------


def test_the_address_gives_the_viewer_the_place_of_the_trace_and_what_to_show():
    assert trace.address("my run.pftrace", 1_000, 21_000) == (
        "https://ui.perfetto.dev/#!/?url=http%3A%2F%2F127.0.0.1%3A9001%2Fmy%2520run.pftrace&visStart=1000&visEnd=21000"
    )


@contextlib.contextmanager
def served(file):
    """A connection to a server of this file that has not been asked yet."""
    with contextlib.closing(trace.TraceServer(file, port=0)) as server:
        ending = threading.Event()

        def turns():
            while not ending.is_set():
                server.turn(0.01)

        thread = threading.Thread(target=turns)
        thread.start()
        connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
        try:
            yield connection, server
        finally:
            connection.close()
            ending.set()
            thread.join()


def test_the_trace_is_served_to_perfettos_pages_and_to_no_others(file):
    with served(file) as (connection, server):
        connection.request("GET", f"/{file.name}")
        answer = connection.getresponse()
        assert answer.status == 200 and answer.read() == file.read_bytes()
        assert answer.headers["Access-Control-Allow-Origin"] == "https://ui.perfetto.dev"
        assert server.listener.getsockname()[0] == "127.0.0.1"
    # the server's thread has ended: it says so after its answer is out
    assert server.served


def test_a_browser_that_asks_first_is_let_in_from_a_page_of_the_internet(file):
    with served(file) as (connection, server):
        connection.request("OPTIONS", f"/{file.name}", headers={"Access-Control-Request-Private-Network": "true"})
        answer = connection.getresponse()
        assert answer.status == 204 and answer.headers["Access-Control-Allow-Private-Network"] == "true"
        assert not server.served


@pytest.mark.parametrize("path", ["/", "/other.pftrace", "/../run.pftrace", "/%2e%2e/etc/passwd"])
def test_nothing_else_is_served(file, path):
    with served(file) as (connection, server):
        connection.request("GET", path)
        assert connection.getresponse().status == 404 and not server.served


@pytest.mark.parametrize(
    ("method", "headers", "status"),
    [
        ("GET", {"Origin": "https://example.org"}, 403),
        ("GET", {"Host": "example.org:9001"}, 403),  # a name that was made to lead to this machine
        ("POST", {}, 405),
        ("GET", {"Origin": "https://ui.perfetto.dev"}, 200),
    ],
)
def test_only_the_viewers_page_gets_the_trace(file, method, headers, status):
    with served(file) as (connection, _):
        connection.request(method, f"/{file.name}", headers=headers)
        assert connection.getresponse().status == status


def visit(server, said=b""):
    """A connection that has sent this, taken in."""
    client = socket.create_connection(("127.0.0.1", server.port))
    client.setblocking(False)
    client.send(said)
    server.turn(1.0)
    return client


def test_silent_connections_delay_no_other_client_and_floods_are_bounded(tmp_path):
    """A browser opens some in advance; one that sent nothing once kept all others waiting for ever."""
    file = tmp_path / "a.pftrace"
    file.write_bytes(bytes(5_000_000))
    limits = LIMITS["trace"]
    get = b"GET /a.pftrace HTTP/1.1\r\n\r\n"
    with contextlib.closing(trace.TraceServer(file, port=0)) as server, contextlib.ExitStack() as clients:
        now = itertools.count()
        server.clock = lambda: float(next(now))  # time enough for all who knock
        for said in (b"", b"x" * 1000):
            for _ in range(limits.peers):
                clients.callback(visit(server, said).close)
        assert len(server.peers) == limits.peers and server.sent_away == {"idle": limits.peers}
        endless = visit(server, b"y" * limits.longest)
        clients.callback(endless.close)
        while not server.sent_away["too_long"]:
            server.turn(1.0)
        reader = visit(server, get)
        clients.callback(reader.close)
        received = 0
        while not server.served:
            server.turn(1.0)
            assert all(len(peer.outgoing) <= limits.write_bytes + 1000 for peer in server.peers)
            with contextlib.suppress(BlockingIOError):
                received += len(reader.recv(1 << 20))
        while piece := reader.recv(1 << 20):
            received += len(piece)
        assert received > 5_000_000


def test_a_client_that_takes_nothing_of_the_trace_loses_its_place(tmp_path):
    file = tmp_path / "a.pftrace"
    file.touch()
    os.truncate(file, 50_000_000)  # more than the kernel keeps for a connection; no disk
    with contextlib.closing(trace.TraceServer(file, port=0)) as server:
        now = [0.0]
        server.clock = lambda: now[0]
        with visit(server, b"GET /a.pftrace HTTP/1.1\r\n\r\n"):
            before = -1
            while before != (before := server.peers[0].left):
                server.turn(0.0)
            now[0] = 59.0
            server.receive(0)
            assert server.peers
            now[0] = 130.0
            server.receive(0)
            assert not server.peers and not server.served


# --- offline ----------------------------------------------------------------------------------------------


def test_the_page_holds_everything_it_needs_and_what_the_trace_has(file, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert cli.main(["trace", "open", str(file), "--offline", "--no-browser", "--at", "30ms", "--out", str(page)]) == 0
    assert capsys.readouterr().out.startswith(f"{page}: shows 0.03 s")
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"""(?:src|href)\s*=|@import|url\(|\bfetch\(|https?://""", text)
    data = json.loads(re.search(r"^const trace = (.*);$", text, re.MULTILINE)[1])
    assert data["at"] == 30_000_000 and data["begin"] == 0
    [slots] = [each for each in data["tracks"] if each["path"] == ["Boards", "MCH", "slots"]]
    whole = perfetto_reader.read(file).find("Boards", "MCH", "slots").slices
    assert len(slots["slices"]) == 4 * len(whole)
    start, length, name, depth = slots["slices"][:4]
    assert (start, length, data["names"][name], depth) == (
        whole[0].start_ns,
        whole[0].end_ns - whole[0].start_ns,
        "row 0",
        0,
    )
    for from_track, at, to_track, to in data["flows"]:
        ends = data["tracks"][from_track]["slices"][4 * at], data["tracks"][to_track]["slices"][4 * to]
        assert ends[0] <= ends[1]


def test_a_page_of_a_long_trace_holds_a_part_of_it(file):
    moment = moments.find(file, 30_000_000)
    text = viewer.page(file, moment, kept_ns=10_000_000, shown_ns=1_000_000)
    data = json.loads(re.search(r"^const trace = (.*);$", text, re.MULTILINE)[1])
    assert (data["begin"], data["end"]) == (25_000_000, 35_000_000)
    for track in data["tracks"]:
        assert all(0 <= time <= 10_000_000 for time in track["time"])
        ends = zip(track["slices"][::4], track["slices"][1::4], strict=True)
        assert all(start >= 0 and start + length <= 10_000_000 for start, length in ends)
