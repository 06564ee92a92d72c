"""What works where Linux is not: programs in processes that lack what Windows, or macOS, lacks.

other_systems/sitecustomize.py hides it. No test here has run on a real Windows or macOS.
"""

import contextlib
import json
import os
import pathlib
import socket
import subprocess
import sys

import pytest

from ranger_sim import Ranger, Scenario
from ranger_sim.harness.campaigns import engine, plan, pools
from ranger_sim.ranger.walks import REFERENCE
from tests.sysid.test_diagnose import cart_file

ROOT = pathlib.Path(__file__).resolve().parents[2]
HIDING = pathlib.Path(__file__).parent / "other_systems"
LONGEST_S = 120.0
PLATFORMS = {"windows": "win32", "macos": "darwin"}
CAMPAIGN = """
title = "two faults"
[watch]
from = "1 s"
after = "0.2 s"
[healthy]
seeds = [1, 2]
[vary]
seed = [1]
fault = ["UI.imu:gyro_bias@0.2 s", "MCH.absolute_encoder:stuck@0.4 s"]
"""
PROGRAM_OF_CAN = """
import can
with (can.Bus(interface="ranger_sim", channel="a", speed="max") as one,
      can.Bus(interface="ranger_sim", channel="a", speed="max") as other):
    one.send(can.Message(arbitration_id=0x123, data=[1, 2], is_extended_id=False))
    received = other.recv(10.0)
    print(hex(received.arbitration_id), received.data.hex())
"""
TEST_OF_A_USER = """
import pytest

@pytest.mark.ranger(seed=2, warmed_up="0.3 s")
def test_a_robot_is_on_its_feet(ranger):
    ranger.run_for("100 ms")
    assert ranger.steps == 0
"""


@pytest.fixture(params=PLATFORMS)
def system(request):
    return request.param


def start(system, *words, **settings):
    """A Python with these arguments in which names are hidden."""
    environment = {**os.environ, "OTHER_SYSTEM": system, "PYTHONPATH": os.pathsep.join((str(HIDING), str(ROOT)))}
    settings = {"cwd": ROOT, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, **settings}
    return subprocess.Popen([sys.executable, *words], env=environment, **settings)


def run(system, *words, **settings):
    """(exit code, standard output, standard error) of it."""
    with start(system, *words, **settings) as process:
        try:
            out, err = process.communicate(timeout=LONGEST_S)
        finally:
            process.kill()
    return process.returncode, out, err


def command(system, *words, **settings):
    return run(system, "-m", "ranger_sim", *words, **settings)


def test_the_names_are_hidden(system):
    program = "import os, select, sys; print(sys.platform, hasattr(os, 'fork'), hasattr(select, 'epoll'))"
    assert run(system, "-c", program)[1].split() == [PLATFORMS[system], str(system == "macos"), "False"]
    code, _, err = run(system, "-c", "open('/proc/self/stat')")
    assert code == 1 and "FileNotFoundError" in err
    assert (run("windows", "-c", "import fcntl")[0], run("macos", "-c", "import fcntl")[0]) == (1, 0)


def test_a_robot_moves_as_on_linux(system):
    with contextlib.closing(Ranger(Scenario(seed=3))) as robot:
        robot.run_for(0.5)
        wanted = robot.trace_digest()
    program = "from ranger_sim import Ranger, Scenario\nrobot = Ranger(Scenario(seed=3))\nrobot.run_for(0.5)\n"
    code, out, err = run(system, "-c", f"{program}print(robot.trace_digest())")
    assert (code, out.strip(), err) == (0, wanted, "")


def test_a_walk_writes_its_logs_and_its_report_and_its_folder_belongs_to_one_run(system, tmp_path):
    code, out, err = command(
        system, "walk", "--seed", "1", "--steps", "2", "--out", str(tmp_path / "kept"), "--json", "-"
    )
    assert code == 0, err
    summary = json.loads(out)
    assert summary["complete"] and summary["steps"] == 2
    kept = tmp_path / "kept"
    assert json.loads((kept / "summary.json").read_text(encoding="utf-8"))["trace_digest"] == summary["trace_digest"]
    assert {"report.html", "can1.log", "variables.mf4"} <= {path.name for path in kept.iterdir()}
    assert not [path.name for path in kept.iterdir() if "partial" in path.name or path.name == "incomplete.json"]


def test_a_folder_that_is_locked_is_refused(system, tmp_path):
    program = (
        "import sys\nfrom ranger_sim.tools.run.folder import RunFolder\n"
        "with RunFolder(sys.argv[1], '', print):\n    print('locked', flush=True)\n    sys.stdin.read()\n"
    )
    with start(system, "-c", program, str(tmp_path), stdin=subprocess.PIPE) as first:
        assert first.stdout.readline() == "locked\n"
        code, _, err = command(system, "walk", "--steps", "1", "--out", str(tmp_path))
        first.communicate(timeout=LONGEST_S)
    assert (code, "another run is writing there" in err, first.returncode) == (2, True, 0)


@pytest.fixture(scope="module")
def campaign_on_linux(tmp_path_factory):
    """(the plan's file, its results without what they cost) of this system."""
    folder = tmp_path_factory.mktemp("linux")
    (folder / "few.toml").write_text(CAMPAIGN, encoding="utf-8")
    with contextlib.closing(engine.Campaign(plan.load(folder / "few.toml", REFERENCE), folder)) as campaign:
        campaign.run(pools.LocalPool(1), lambda done, outcome: None)
    return folder / "few.toml", results_in(folder)


def results_in(folder):
    lines = (folder / "results.jsonl").read_text(encoding="utf-8").splitlines()
    return {each["key"]: {**each, "spent": None} for each in map(json.loads, lines)}


def test_a_campaign_has_on_windows_the_results_of_linux(campaign_on_linux, tmp_path):
    path, wanted = campaign_on_linux
    assert sum("digest" in each for each in wanted.values()) == 2
    code, _, err = command("windows", "campaign", str(path), "--out", str(tmp_path), "--jobs", "1")
    assert (code, results_in(tmp_path)) == (0, wanted), err


def test_a_recording_is_diagnosed_on_windows(tmp_path):
    (tmp_path / "my_cart.py").write_text("from tests.sysid.test_diagnose import Cart\n", encoding="utf-8")
    recording = cart_file(tmp_path / "run.csv", drag=0.02)
    code, out, err = command(
        "windows", "diagnose", recording, "--experiment", "my_cart:Cart", "--json", "-", cwd=tmp_path
    )
    assert code == 1, err
    assert json.loads(out)["causes"][0]["name"] == "drag"


def test_the_pytest_plugin_runs_a_users_test(system, tmp_path):
    (tmp_path / "test_mine.py").write_text(TEST_OF_A_USER, encoding="utf-8")
    code, out, err = run(system, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py", cwd=tmp_path)
    assert (code, "1 passed" in out) == (0, True), out + err


def test_a_program_uses_a_private_bus_by_python_can(system):
    assert run(system, "-c", PROGRAM_OF_CAN)[:2] == (0, "0x123 0102\n")


def test_a_bus_over_tcp_passes_a_frame_on(system):
    with start(system, "-m", "ranger_sim", "bus", "--socketcand", "0", "--seconds", "60") as host:
        try:
            assert host.stdout.readline().startswith("can1: 1000000 bit/s")
            line = host.stdout.readline()
            assert f"open to every user of this machine: {PLATFORMS[system]} does not report" in line
            port = int(line.partition(",")[0].rpartition(":")[2])
            with connected(port) as one, connected(port) as other:
                one.sendall(b"< send 123 2 11 22 >")
                received = b""
                while not received.endswith(b" 1122 >"):
                    assert (data := other.recv(4096))
                    received += data
            assert received.startswith(b"< frame 123 ")
        finally:
            host.kill()


def connected(port):
    """A client of socketcand in its raw mode."""
    client = socket.create_connection(("127.0.0.1", port), timeout=LONGEST_S)
    for order in (b"", b"< open can1 >", b"< rawmode >"):
        client.sendall(order)
        answer = b""
        while not answer.endswith(b">"):
            answer += client.recv(1)
    return client


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("up",), "up: boards as processes need Linux (eventfd, abstract sockets), this is {}; `walk` runs everywhere"),
        (("ctl", "status"), "robot ranger: robots under a name need Linux (abstract sockets), this is {}"),
        (("bus",), "bus: names to attach by need Linux (abstract sockets), this is {}; give --socketcand PORT"),
    ],
    ids=["up", "ctl", "bus"],
)
def test_what_needs_linux_says_so_in_one_line(system, words, line):
    code, out, err = command(system, *words)
    assert (code, out, len(err.splitlines())) == (2, "", 1), err
    assert err.startswith(f"ranger-sim: {line.format(PLATFORMS[system])}")


def test_a_machine_whose_boards_are_processes_reports_it(system):
    program = (
        "from ranger_sim.harness.processes.forked_boards import ForkedBoards\n"
        "from ranger_sim.foundation.user_error import UserError\n"
        "try:\n    ForkedBoards(None, ('MCH',))\nexcept UserError as error:\n    print(error)\n"
    )
    code, out, err = run(system, "-c", program)
    assert (code, err) == (0, "") and out.startswith("MCH: boards as processes need Linux (eventfd, pidfd), this is")


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (
            ("walk", "--proof", "--fault", "MCH.joint_encoder:stuck@1s"),
            "proof of a fault: its golden run needs a system",
        ),
        (("bus", "--socketcand", "0", "--slcan", "can1"), "pseudo-terminal: win32 does not have them"),
    ],
    ids=["proof", "slcan"],
)
def test_what_needs_forks_or_terminals_says_so_in_one_line_on_windows(words, line):
    code, out, err = command("windows", *words)
    assert (code, out, len(err.splitlines())) == (2, "", 1), err
    assert err.startswith(f"ranger-sim: {line}")
