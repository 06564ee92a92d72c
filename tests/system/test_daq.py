"""`ranger-sim daq` and a whole robot, over a pseudo-terminal, on virtual time that the test drives.

The command looks at its port; each poll lets the robot pass some milliseconds first, and the robot's time is the
clock. So nothing sleeps and nothing depends on how fast the machine is.
"""

import contextlib
import json
import os
import pathlib
import re
import select
import signal
import subprocess
import sys

import pytest

from ranger_sim.boards.quirks import Quirks
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation.numbers import float_of_word
from ranger_sim.harness.outside import serial_ports
from ranger_sim.ranger import serial_ports as robot_ports
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario
from ranger_sim.tools import cli
from ranger_sim.tools.robodaq import command as daq
from ranger_sim.tools.robodaq.codec import write_packet

ROOT = pathlib.Path(__file__).resolve().parents[2]
ID = all_variables.ID_OF
POLL_S = 0.005


class Robot:
    """A robot with its data link on a pseudo-terminal; `daq(...)` runs the command against it."""

    def __init__(self, monkeypatch, capsys, quirks=None, dropouts=None):
        self.ranger = Ranger(Scenario(), quirks=quirks)
        self.line = robot_ports.connect_daq(self.ranger, serial_ports.PtyPort(), dropouts)
        self.board = self.ranger.board("MB")
        self.board.computer.rate_sum = 40_960  # not ten seconds of ramp
        self.capsys = capsys
        self.before_look = []
        robot = self

        class Port(daq.RealPort):
            """Lets the robot pass some time before each poll, and waits for what the kernel carries meanwhile."""

            def __init__(self, *options):
                super().__init__(*options)
                self.read_bytes, self.written_bytes = robot.line.bytes_out, robot.line.bytes_in

            def read(self, limit):
                for action in robot.before_look:
                    action()
                if self.written_bytes > robot.line.bytes_in:
                    select.select(robot.line.filenos(), [], [], 10.0)
                robot.ranger.run_for(POLL_S)
                # its time is the clock: once it stands still, nothing that waits for a time would ever end
                assert not robot.ranger.ended, f"the robot {robot.ranger.ended} at {robot.ranger.time_s:.3f} s"
                data = b""
                while self.read_bytes + len(data) < robot.line.bytes_out:
                    select.select([self.number], [], [], 10.0)
                    more = super().read(limit)
                    if not more:
                        break
                    data += more
                self.read_bytes += len(data)
                return data if data else super().read(limit)

            def write(self, data):
                taken = super().write(data)
                self.written_bytes += taken
                return taken

        monkeypatch.setattr(daq, "RealPort", Port)
        monkeypatch.setattr(daq, "POLL_S", 0.0)
        monkeypatch.setattr(daq.wallclock, "monotonic_s", lambda: self.ranger.time_s)

    def daq(self, *arguments):
        """(exit code, its output, its errors)."""
        code = cli.main(["daq", "--port", self.line.port.path, *map(str, arguments)])
        reported = self.capsys.readouterr()
        return code, reported.out, reported.err


@pytest.fixture
def robot(monkeypatch, capsys):
    made = Robot(monkeypatch, capsys)
    with contextlib.closing(made.ranger):
        yield made


def test_a_parameter_is_written_and_read_back(robot):
    code, out, err = robot.daq("--write", "C_F_ST_F_ANG=4.5", "--read", "C_F_ST_F_ANG", "P_H_PM_TIME")
    assert (code, out) == (0, "C_F_ST_F_ANG = 4.5 A/rad\nP_H_PM_TIME = 300 ms\n"), err
    assert robot.board.store.get_float(ID["C_F_ST_F_ANG"]) == 4.5


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--write", "MCH_ANGLE=1"], "MCH_ANGLE: not a parameter, it is published by MCH; the robot would refuse it"),
        (["--write", "C_F_ST_F_ANG=1e6"], "C_F_ST_F_ANG = 1e+06 is outside 0 to 100 A/rad"),
        (["--write", "C_F_ST_F_ANG"], "--write 'C_F_ST_F_ANG': NAME=VALUE with a number is expected"),
        (["--fast", "MCH_ANGEL"], "did you mean 'MCH_ANGLE'"),
        (["--fast", "XX*"], "'XX*': fits no variable"),
        (["--fast", "*"], "the link has 48"),
        (["--load", "no-such-file.txt"], "no-such-file.txt: No such file or directory"),
        (["--save", "set.csv"], "must end in .txt"),
        (["--save", "/no/such/folder/set.txt"], "there is no such folder"),
        (["--log", "log.csv"], "must end in .txt"),
    ],
)
def test_a_mistake_gets_one_line_and_the_robot_receives_nothing(robot, arguments, words):
    code, out, err = robot.daq(*arguments)
    assert (code, out) == (2, "")
    assert words in err and len(err.splitlines()) == 1
    robot.ranger.run_for(0.05)
    assert robot.line.bytes_in == 0


def test_a_packet_for_a_variable_that_is_not_a_parameter_raises_an_error_that_daq_shows(robot):
    bad = write_packet(ID["MCH_ANGLE"], 0)

    def another_program():
        if robot.ranger.time_s > 0.5 and not isinstance(robot.line.port, Whisper):
            robot.line.port = Whisper(robot.line.port, bad)

    robot.before_look.append(another_program)
    code, _, err = robot.daq("--time", "1.5s")
    assert code == 0
    assert "error of MB: MB_UNKNOWN_PARAMETER x 1 (in all 1): main brain: a parameter was set that" in err
    assert robot.board.computer.refused == 1


class Whisper:
    """A port that brings some bytes of its own first."""

    def __init__(self, port, data):
        self.port = port
        self.data = data
        self.path = port.path

    def read(self, limit):
        data, self.data = self.data[:limit], self.data[limit:]
        return data or self.port.read(limit)

    def write(self, data):
        return self.port.write(data)

    def filenos(self):
        return self.port.filenos()

    def close(self):
        self.port.close()


def test_chosen_channels_come_as_fast_as_the_lists_promise_and_the_log_has_them(robot, tmp_path):
    log = tmp_path / "log.txt"
    robot.daq("--fast", "MCH_ANGLE", "--medium", "UI_ANG_RATE_X", "--time", "0.8s")  # channels set
    code, out, _ = robot.daq(
        "--fast", "MCH_ANGLE", "--medium", "UI_ANG_RATE_X", "--time", "2s", "--log", log, "--json", "-"
    )  # fmt: skip
    assert code == 0
    result = json.loads(out)
    assert (result["bad_checksums"], result["gaps"], result["unknown_points"]) == (0, 0, 0)
    rows = [line.split("\t") for line in log.read_text(encoding="utf-8").splitlines()]
    names, points = rows[: all_variables.TABLE_SIZE], rows[all_variables.TABLE_SIZE :]
    assert {name: int(number) for name, number, _ in names} == ID
    assert len(points) == result["points"]
    stamps = [int(stamp) for number, _, stamp in points if int(number) == ID["MCH_ANGLE"]]
    # sent in every slot that brought a new one: the hip board sends it every 2 ms
    assert len(stamps) >= 0.9 * 500 * 2
    rate = [int(stamp) for number, _, stamp in points if int(number) == ID["UI_ANG_RATE_X"]]
    assert 0.3 * 500 * 2 <= len(rate) <= 500 * 2  # every second of two medium channels
    last = [value for number, value, stamp in points if int(number) == ID["MCH_ANGLE"]][-1]
    assert float(last) == pytest.approx(robot.ranger.variable("MCH_ANGLE"), abs=0.05)


def test_parameters_are_saved_loaded_and_walk_again(robot, tmp_path):
    robot.daq("--write", "C_F_ST_F_ANG=4.5", "P_H_PM_H_TRATE=2.1")
    for name in ("set.txt", "set.toml"):
        code, _, err = robot.daq("--save", tmp_path / name)
        assert code == 0, err
    assert Scenario(controller=str(tmp_path / "set.toml"))
    robot.daq("--load", "robust")
    assert robot.board.store.get_float(ID["C_F_ST_F_ANG"]) == 4.0
    for name in ("set.txt", "set.toml"):
        robot.daq("--write", "C_F_ST_F_ANG=3.0")
        code, _, err = robot.daq("--load", tmp_path / name)
        assert code == 0, err
        assert robot.board.store.get_float(ID["C_F_ST_F_ANG"]) == 4.5
        assert float_of_word(robot.board.store.get_word(ID["P_H_PM_H_TRATE"])) == pytest.approx(2.1)


def test_drop_outs_leave_gaps_in_the_log_that_are_counted_and_no_bad_checksum(monkeypatch, capsys):
    dropouts = serial_ports.Dropouts(1)  # two in the first five seconds
    robot = Robot(monkeypatch, capsys, Quirks(computer_link="bluetooth"), dropouts)
    with contextlib.closing(robot.ranger):
        fast = ["MCH_ANGLE", "MCFO_*_ANGLE", "MCFI_*_ANGLE", "UI_ROLL", "UI_ANG_RATE_X", "MCH_ANG_RATE", "FSM_*"]
        code, out, _ = robot.daq("--link", "bluetooth", "--fast", *fast, "--time", "5s", "--json", "-")
    result = json.loads(out)
    assert code == 0 and dropouts.count == 2
    assert 1 <= result["gaps"] <= dropouts.count
    assert 50 <= result["longest_gap_ms"] <= 180
    assert (result["bad_checksums"], result["lost"]) == (0, None)


def test_a_robot_that_does_not_answer_is_reported(robot):
    robot.board.computer.rate_sum = -(1 << 40)  # it never sends
    robot.before_look.append(lambda: setattr(robot.board.computer, "rate_sum", -(1 << 40)))
    robot.board.computer.calls_to_wait = 1 << 40
    code, out, err = robot.daq("--read", "MCH_ANGLE", "--timeout", "0.5s")
    assert (code, out) == (1, "")
    assert "no answer for MCH_ANGLE" in err


def test_a_port_that_goes_away_is_named(robot):
    def pull():
        if robot.ranger.time_s > 0.3:
            robot.line.close()

    robot.before_look.append(pull)
    code, _, err = robot.daq("--time", "5s")
    assert code == 1
    assert "the port is gone: Input/output error" in err
    robot.ranger.run_for(0.1)  # and the robot walks on
    assert not robot.ranger.ended


def test_a_port_that_is_not_there_gets_one_line(capsys):
    assert cli.main(["daq", "--port", "/dev/no-such-port"]) == 2
    assert capsys.readouterr().err == (
        "ranger-sim: serial port /dev/no-such-port: No such file or directory\n"
    )  # fmt: skip


def test_daq_in_its_own_process_writes_to_a_robot_in_processes():
    """`up` as fast as it goes, and `daq`; both are real, and only what was written is looked at."""
    up = subprocess.Popen(
        [sys.executable, "-m", "ranger_sim", "up", "--speed", "max", "--daq-port", "pty", "--json", "-"]
        + ["--name", f"daq-test-{os.getpid()}"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        place = re.search(r"--port (\S+)", up.stderr.readline()).group(1)
        asked = ["--write", "C_F_ST_F_ANG=4.25", "--read", "C_F_ST_F_ANG", "--timeout", "60s", "--json", "-"]
        reported = subprocess.run(
            [sys.executable, "-m", "ranger_sim", "daq", "--port", place, *asked],
            cwd=ROOT,
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        result = json.loads(reported.stdout)
        assert (reported.returncode, result["read"]) == (0, {"C_F_ST_F_ANG": 4.25}), reported.stderr
        assert result["bad_checksums"] == 0
    finally:
        up.send_signal(signal.SIGINT)
        out, err = up.communicate(timeout=300)
    assert up.returncode == 130, err
    assert json.loads(out)["slots"]["MB"]["overruns"] == 0
