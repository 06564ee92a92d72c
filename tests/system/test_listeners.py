"""Every command that listens: another user of this machine is refused before the first byte; nothing else listens."""

import contextlib
import os
import socket
import sys
import threading

import pytest

from tests.firmware_sim.gdb.machine import compiler_is_there
from tests.system import listeners
from tests.terminals import alone

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="the system's lists are those of Linux"),
    pytest.mark.skipif(hasattr(os, "getuid") and os.getuid() != 0, reason="only root can be another user"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("listeners")
    listeners.prepare(made)
    return made


@pytest.mark.parametrize("name", listeners.COMMANDS)
def test_another_user_is_refused_before_the_first_byte(name, folder):
    command = listeners.COMMANDS[name]
    if command.module.endswith("gdb.machine") and not compiler_is_there():
        pytest.skip("no cross compiler (apt-get install gcc-arm-none-eabi)")
    with (
        alone("trace-open") if name == "trace open" else contextlib.nullcontext(),
        listeners.listening(command, folder) as found,
    ):
        assert listeners.kinds(found) == command.listens, found
        got = dict(zip(found, listeners.answers(found), strict=True))
        assert not {place: answer for place, answer in got.items() if answer not in listeners.REFUSALS}
        assert listeners.documented(name) == listeners.rows(name, found, got.values())


def test_every_module_that_opens_an_endpoint_is_started_by_a_command_of_the_table():
    links = [each for each in (listeners.ROOT / "ranger_sim").iterdir() if each.is_dir()]
    modules = [path for each in links for path in each.resolve().rglob("*.py") if "build" not in path.parts]
    found = {
        path.relative_to(listeners.ROOT).as_posix()
        for path in modules
        if listeners.opens_an_endpoint(path.read_text(encoding="utf-8"))
    }
    assert found == set(listeners.OPENED_BY)
    assert set(listeners.OPENED_BY.values()) <= set(listeners.COMMANDS)


@pytest.mark.parametrize(
    ("source", "opens"),
    [
        ("listener.bind((host, port))", True),
        ("socket.create_server(('', 1))", True),
        ("class Own(Base, distributed.Scheduler): pass", True),
        ("signature.bind(**settings)", False),
        ("robot.logbook.listen(stream, take)", False),
    ],
)
def test_a_module_that_opens_an_endpoint_is_recognised(source, opens):
    assert listeners.opens_an_endpoint(source) is opens


def test_the_stranger_would_see_data_sent_at_once_and_an_open_connection(tmp_path):
    """The oracle can fail: a server that sends at once, one that waits, and one that closes."""
    kept = []

    def serve(listener, data, keep):
        for _ in range(2 if keep else 1):  # the stranger comes again, with TLS
            connection, _ = listener.accept()
            connection.sendall(data)
            if keep:
                kept.append(connection)
            else:
                connection.close()

    found = {}
    for data, keep, wanted in ((b"hello", False, "5 bytes"), (b"", True, "open"), (b"", False, "closed")):
        with socket.create_server(("127.0.0.1", 0)) as listener:
            thread = threading.Thread(target=serve, args=(listener, data, keep), daemon=True)
            thread.start()
            port = str(listener.getsockname()[1])
            assert ("tcp", port) in listeners.endpoints([os.getpid()])
            found[wanted] = listeners.answers([("tcp", port)])[0]
            thread.join(10.0)
    for connection in kept:
        connection.close()
    assert found == {"5 bytes": "5 bytes", "open": "open", "closed": "closed"}
