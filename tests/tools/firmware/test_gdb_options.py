"""`walk --gdb`, `up --gdb`: the run waits, a debugger that looks leaves its digest, and what is wrong is one line."""

import contextlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys

import pytest

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.firmware.debuggers import open_doors
from tests.firmware_sim.gdb.client import Client
from tests.firmware_sim.gdb.machine import Machine
from tests.firmware_sim.lpc2194.programs import content, words_of

ROOT = pathlib.Path(__file__).resolve().parents[3]
PATIENCE_S = 240.0  # a guard; nothing asserts on it
IRQ_VECTOR = 0x18


@pytest.fixture(scope="module")
def image(tmp_path_factory):
    """A small program as an Intel HEX file: a timer's interrupt, and a frame for each."""
    lines = []
    data = content(words_of("ticker"))
    for place in range(0, len(data), 16):
        part = data[place : place + 16]
        record = bytes((len(part), place >> 8, place & 0xFF, 0)) + part
        lines.append(f":{record.hex()}{-sum(record) & 0xFF:02x}")
    path = tmp_path_factory.mktemp("image") / "ticker.hex"
    path.write_text("\n".join([*lines, ":00000001ff", ""]))
    return path


def started(command, *words):
    """The command line in a process of its own; a robot of processes under a name of its own."""
    words = (*words, "--name", f"gdb-{os.getpid()}") if command == "up" else words
    return subprocess.Popen(
        [sys.executable, "-m", "ranger_sim", command, *words],
        cwd=ROOT,
        env={**os.environ, "COLUMNS": "200"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def ended(run):
    """What it printed since, when it has ended."""
    said, _ = run.communicate(timeout=PATIENCE_S)
    return said


def port_of(run):
    """The port that a line of it tells."""
    for line in run.stdout:
        if found := re.search(r"target remote :(\d+)", line):
            return int(found[1])
    raise AssertionError("it never told a port")


def connected(port):
    """A debugger; `up` takes the port when it starts and opens it when the board's process is there."""
    while True:
        with contextlib.suppress(ConnectionRefusedError):
            return Client(port)


def looks(client):
    assert client.ask("?") == "T05thread:1;"
    assert client.ask(f"Z1,{IRQ_VECTOR:x},4") == "OK"
    for _ in range(4):
        assert client.ask("c") == "T05thread:1;"
        assert client.register(15) == IRQ_VECTOR
        client.ask("s")
    told = client.monitor("time")
    assert client.ask("D") == "OK"
    return told


@pytest.fixture(scope="module")
def digest(image):
    """Of the same walk without a debugger."""
    run = started("walk", "--image", f"MCH={image}", "--time", "20ms")
    return re.search(r"trace ([0-9a-f]{16})", ended(run))[1]


@pytest.mark.parametrize("command", ["walk", "up"])
def test_a_debugger_that_looks_at_a_board_of_the_robot_leaves_the_digest(image, digest, command):
    run = started(command, "--image", f"MCH={image}", "--gdb", "MCH=0", "--time", "20ms", "--seed", "1")
    with contextlib.closing(connected(port_of(run))) as client:
        told = looks(client)
    said = ended(run)
    assert run.returncode == 0, said
    assert re.fullmatch(r"MCH: 0\.00\d{7} s, \d+ cycles, \d+ instructions\n", told)
    assert re.search(r"trace ([0-9a-f]{16})", said)[1] == digest


@pytest.mark.parametrize("command", ["walk", "up"])
def test_ctrl_c_at_the_robots_terminal_ends_a_run_that_a_debugger_holds_and_finishes_its_files(
    image, tmp_path, command
):
    run = started(command, "--image", f"MCH={image}", "--gdb", "MCH=0", "--time", "60s", "--out", str(tmp_path / "it"))
    with contextlib.closing(connected(port_of(run))) as client:
        assert client.ask("?") == "T05thread:1;"
        run.send_signal(signal.SIGINT)
        said = ended(run)
        assert client.get() is None  # sent home
    assert run.returncode == 130, said
    assert json.loads((tmp_path / "it" / "summary.json").read_text())["interrupted"]


@pytest.mark.parametrize(
    ("wanted", "line"),
    [
        (("UI=3333",), "gdb UI=3333: UI runs no machine code, so give it an --image"),
        (("HIP=3333",), "gdb HIP=3333: unknown board 'HIP' (available: MCH, UI"),
        (("MCH=here",), "gdb 'MCH=here': BOARD=PORT or BOARD=HOST:PORT is expected, as in MCH=3333"),
        (("3333",), "gdb '3333': BOARD=PORT or BOARD=HOST:PORT is expected, as in MCH=3333"),
        (("MCH=0", "MCH=0"), "gdb MCH=0: MCH has a door already"),
        (("MCH=70000",), "gdb for TINY on 127.0.0.1:70000: a port is 0 ... 65535"),
        (("MCH=0.0.0.0:0",), "gdb for TINY on 0.0.0.0:0: 0.0.0.0 is reached from beyond this machine, by anybody"),
    ],
)
def test_what_is_wrong_with_a_door_is_told_and_no_door_stays_open(wanted, line):
    machine = Machine()
    with pytest.raises(UserError, match=re.escape(line)):
        open_doors({"MCH": machine, "UI": object()}, wanted)
    assert machine.core.debugger is None


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("walk", "--gdb", "MCH=3333"), "gdb MCH=3333: MCH runs no machine code, so give it an --image"),
        (("up", "--gdb", "MCH=3333"), "gdb MCH=3333: MCH runs no machine code, so give it an --image"),
        (("walk", "--allow-network"), "--allow-network: nothing would listen there"),
    ],
)
def test_the_command_line_tells_it_before_anything_walks(tmp_path, words, line):
    run = started(*words, "--time", "10ms", "--out", str(tmp_path / "it"))
    said = ended(run)
    assert run.returncode == 2, said
    assert line in said
    assert "Traceback" not in said
    assert not (tmp_path / "it").exists() or not list((tmp_path / "it").iterdir())
