"""`ranger-sim up`: the same walk as in lockstep, and what becomes of it when a process dies, hangs or is stopped."""

import contextlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import uuid

import pytest

from ranger_sim.can_bus.edge.peers import connected
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control
from ranger_sim.harness.timeline import perfetto_reader
from ranger_sim.ranger import wiring

ROOT = pathlib.Path(__file__).resolve().parents[2]
TWO_SECONDS = 2.0  # the promise for naming what died or hangs
PATIENCE_S = 60.0  # for everything that promises no time, on a busy machine
FACTORS = {"realtime_factor", "cpu_factor"}  # how fast the machine was


class Up:
    """A running `ranger-sim up` (or a script that does the same) with its own name."""

    def __init__(self, *arguments, script=None, speed="0.05"):
        self.name = f"test-{uuid.uuid4().hex[:12]}"
        self.mark = f"RANGER_SIM_TEST={self.name}"
        command = [sys.executable, "-m", "ranger_sim", "up"] if script is None else [sys.executable, "-c", script]
        self.started = subprocess.Popen(
            [*command, "--name", self.name, "--no-real-time", "--speed", speed, *arguments],
            cwd=ROOT,
            env={**os.environ, "RANGER_SIM_TEST": self.name, "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        os.set_blocking(self.started.stdout.fileno(), False)
        self.text = ""

    def read(self):
        """What was printed so far."""
        with contextlib.suppress(BlockingIOError):
            while part := os.read(self.started.stdout.fileno(), 65536):
                self.text += part.decode()
        return self.text

    def wait_for(self, pattern, seconds=PATIENCE_S):
        """The match of `pattern` in what is printed; fails when it does not come in time."""
        end = wallclock.monotonic_s() + seconds
        while not (match := re.search(pattern, self.read())):
            assert wallclock.monotonic_s() < end, f"no {pattern!r} within {seconds} s in:\n{self.text}"
            wallclock.sleep_s(0.02)
        return match

    def status(self):
        return control.ask(self.name, {"do": "status"})

    def running(self):
        """The status, as soon as virtual time passes; also of a robot that prints nothing."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while True:
            with contextlib.suppress(UserError):  # not there yet
                if "time_s" in (status := self.status()):
                    return status
            assert wallclock.monotonic_s() < end, f"does not run:\n{self.read()}"
            wallclock.sleep_s(0.02)

    def until(self, met, what):
        """The first status for which `met(status)`; fails when none comes, or the robot has ended before."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while not met(status := self.status()):
            assert wallclock.monotonic_s() < end, f"never {what} within {PATIENCE_S} s:\n{self.read()}"
            wallclock.sleep_s(0.02)
        return status

    def processes(self):
        """Process ids by name, as the robot reports them, once it runs."""
        status = self.running()
        found = {name: each["process"] for name, each in status["boards"].items()}
        return {**found, "plant": status["plant"], "supervisor": self.started.pid}

    def alive(self):
        """Processes that carry our mark in their environment, zombies left out."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            if entry.name.isdecimal():
                with contextlib.suppress(OSError):
                    if self.mark.encode() in (entry / "environ").read_bytes().split(b"\0"):
                        found.append(int(entry.name))
        return found

    def interrupt(self):
        self.started.send_signal(signal.SIGINT)
        return self.end()

    def end(self):
        """Wait for the supervisor; nothing may be left. Returns its exit code."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.started.poll() is None:
            self.read()
            assert wallclock.monotonic_s() < end, f"does not end:\n{self.text}"
            wallclock.sleep_s(0.02)
        self.read()
        self.nothing_left()
        return self.started.returncode

    def nothing_left(self):
        """No process (the kernel needs a moment to kill them), no socket, no shared memory with a name."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.alive() or self.name in pathlib.Path("/proc/net/unix").read_text():
            assert wallclock.monotonic_s() < end, f"still there: {self.alive()} or a socket"
            wallclock.sleep_s(0.02)

    def close(self):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.started.pid, signal.SIGKILL)
        self.started.wait(PATIENCE_S)
        self.started.stdout.close()


def until_used_or_gone(names):
    """Wait until each of these names of shared memory is gone, or some process has it.

    Tests side by side have names, too: a semaphore or a browser's buffer has one for a moment before it is mapped.
    """
    end = wallclock.monotonic_s() + PATIENCE_S
    while names := names & set(os.listdir("/dev/shm")):
        mapped = set()
        for entry in pathlib.Path("/proc").glob("[0-9]*/maps"):
            with contextlib.suppress(OSError):
                mapped.update(re.findall(r"/dev/shm/(\S+)", entry.read_text()))
        if not (names := names - mapped):
            return
        assert wallclock.monotonic_s() < end, f"still in /dev/shm: {sorted(names)}"
        wallclock.sleep_s(0.02)


@pytest.fixture
def up():
    started = []
    shared_memory = set(os.listdir("/dev/shm"))

    def start(*arguments, **how):
        started.append(Up(*arguments, **how))
        return started[-1]

    yield start
    for each in started:
        each.close()
    until_used_or_gone(set(os.listdir("/dev/shm")) - shared_memory)


def summary_of(text):
    return json.loads(text[text.index("{") :])


def comparable(summary):
    return {name: value for name, value in summary.items() if name not in FACTORS | {"processes"}}


@pytest.fixture(scope="module")
def walked():
    """The summary of two steps in lockstep."""
    done = subprocess.run(
        [sys.executable, "-m", "ranger_sim", "walk", "--steps", "2", "--json", "-"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
        timeout=600,
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("speed", ["max", "1.0"])
def test_the_robot_as_processes_walks_the_same_walk_at_any_pace(up, walked, speed):
    """Not only the digest: everything a summary counts, of boards, buses and body, is the same."""
    robot = up("--steps", "2", "--json", "-", speed=speed)
    assert robot.end() == 0
    found = summary_of(robot.text)
    assert comparable(found) == comparable(walked)
    slots = [each["lateness"]["slots"] for each in found["processes"]["boards"].values()]
    assert (min(slots) > 1000) == (speed != "max")
    assert all(each["damaged_messages"] == 0 for each in found["processes"]["boards"].values())


def test_real_time_scheduling_is_requested_and_the_one_obtained_is_reported(up):
    robot = up("--time", "0.02s")
    assert "ordinary scheduling, memory not locked (as asked for)" in robot.wait_for("ranger-sim up.*").group()
    assert robot.end() == 0


def test_every_killed_process_is_named_within_two_seconds_and_nothing_is_left(up):
    """Board after board, while the robot is still held up; then the plant, without which the run is lost."""
    robot = up()
    processes = robot.processes()
    for victim in wiring.BOARDS:
        os.kill(processes[victim], signal.SIGKILL)
        robot.wait_for(rf"{victim} \(process \d+\) was killed by signal 9", TWO_SECONDS)
        robot.wait_for(rf"{victim} is off its bus since ")
    os.kill(processes["plant"], signal.SIGKILL)
    robot.wait_for(r"plant \(process \d+\) was killed by signal 9: the run is lost", TWO_SECONDS)
    assert robot.end() == 2


def test_without_the_supervisor_nothing_is_left(up):
    robot = up()
    processes = robot.processes()
    assert set(processes.values()) == set(robot.alive())
    os.kill(processes["supervisor"], signal.SIGKILL)
    assert robot.end() == -signal.SIGKILL


def test_a_stopped_board_stalls_the_run_and_loses_nothing(up, walked):
    robot = up("--steps", "2", "--json", "-", speed="max")
    status = robot.running()
    board = status["boards"]["CSR"]["process"]
    os.kill(board, signal.SIGSTOP)
    status = robot.until(lambda status: status["boards"]["CSR"]["state"] == "stopped", "stopped")
    stalled = status["boards"]["CSR"]["slots"]
    with pytest.raises(UserError, match="CSR is stopped: all wait for it"):
        control.ask(robot.name, {"do": "pause"})
    assert robot.status()["boards"]["CSR"]["slots"] == stalled
    os.kill(board, signal.SIGCONT)
    assert robot.end() == 0
    assert comparable(summary_of(robot.text)) == comparable(walked)


def test_a_stopped_board_is_named(up):
    robot = up()
    os.kill(robot.processes()["MB"], signal.SIGSTOP)
    robot.wait_for(r"MB \(process \d+\) is stopped by signal 19: all wait", TWO_SECONDS)
    assert robot.interrupt() == 130  # it is let go on, so that the files can be finished


def test_a_board_that_stays_stopped_ends_the_run_with_its_cause_and_finished_files(up, tmp_path):
    robot = up("--out", str(tmp_path / "run"), "--restart", "on-failure", speed="max")
    os.kill(robot.processes()["CSR"], signal.SIGSTOP)
    robot.wait_for(r"CSR \(process \d+\) is stopped and has not replied for 10 s: it is killed, and the run ends")
    assert robot.end() == 1
    assert "CSR was lost at" in robot.text and "its process was stopped (SIGSTOP) for 10 s" in robot.text
    summary = json.loads((tmp_path / "run" / "summary.json").read_text(encoding="utf-8"))
    assert "CSR" in summary["failed_boards"] and not summary["interrupted"]
    assert [death["board"] for death in summary["processes"]["deaths"]] == ["CSR"]


def test_a_body_that_stays_stopped_ends_the_run(up):
    robot = up(speed="max")
    os.kill(robot.processes()["plant"], signal.SIGSTOP)
    robot.wait_for(r"plant \(process \d+\) is stopped and has not replied for 10 s")
    assert robot.end() == 2
    assert "the run is lost, no files are finished" in robot.text


SCRIPT = """
import argparse, contextlib, sys
from ranger_sim.harness.processes.settings import Settings
from ranger_sim.harness.processes.supervisor import Supervisor, View
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import StopRule

parser = argparse.ArgumentParser()
parser.add_argument("--name")
parser.add_argument("--speed", type=float)
parser.add_argument("--no-real-time", action="store_true")
parser.add_argument("--hang", action="store_true")
options = parser.parse_args()

class Said(View):
    def say(self, text):
        print(text, flush=True)

with contextlib.closing(Ranger()) as robot:
    board = robot.board("MCH")
    own = board.compliant_control

    def control():
        while board.now > 200_000_000:
            pass
        return own()

    if options.hang:
        robot.replace("MCH", "mc_compliant_control", control, cost=3900)

    def finish(robot, run, interrupted):
        drive = robot.plant.motors[0].drive
        print("hip powered", drive.powered, "losses", drive.power_losses, "at", round(robot.time_s, 3))
        print("P_UI_LCD_TIME is", robot.variable("P_UI_LCD_TIME"))
        return 0

    settings = Settings(options.speed, name=options.name, real_time=False)
    sys.exit(Supervisor(robot, settings, StopRule(time_s=0.25), finish, Said()).run())
"""


def test_a_hanging_board_is_named_and_its_motor_loses_its_power(up):
    """The board's program never returns after 0.2 s; the bridge has power for 10 ms after the last watchdog edge."""
    robot = up("--hang", script=SCRIPT, speed="1000")
    named = robot.wait_for(
        r"MCH \(process \d+\) hangs: no answer for ([\d.]+) s, ([\d.]+) s of them computing; it is killed"
    )
    held_s, computing_s = map(float, named.groups())
    # the promise of 2 s holds where the board has a processor; where others compute as well, naming waits for its share
    assert held_s >= 1.0 and 0.5 <= computing_s < TWO_SECONDS
    robot.wait_for(r"hip powered False losses 1 at 0.25")
    assert robot.end() == 0


BLOCKED = """
import signal, sys
from ranger_sim.tools.cli import main

signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
sys.exit(main(["up", *sys.argv[1:]]))
"""


def test_a_run_started_with_all_signals_blocked_ends_and_can_be_interrupted(up):
    """Blocked signals are inherited from whichever process starts it; the end of a process is one."""
    assert up("--time", "0.02s", script=BLOCKED, speed="max").end() == 0
    robot = up(script=BLOCKED)
    robot.processes()
    assert robot.interrupt() == 130


def test_a_dead_board_is_restarted_where_that_is_the_policy(up):
    robot = up("--restart", "on-failure", speed="0.2")
    before = robot.processes()["UI"]
    os.kill(before, signal.SIGKILL)
    robot.wait_for(r"UI restarted at ")
    slots = robot.until(lambda status: status["boards"]["UI"]["state"] == "running", "running")["boards"]["UI"]["slots"]
    robot.until(lambda status: status["boards"]["UI"]["slots"] >= slots + 5, "five slots later")
    assert robot.status()["boards"]["UI"]["process"] != before
    assert robot.interrupt() == 130


def test_a_board_is_restarted_on_request(up):
    robot = up(speed="0.2")
    before = robot.processes()["MCSI"]
    assert control.ask(robot.name, {"do": "restart", "board": "MCSI"}) == {"restarting": "MCSI"}
    robot.wait_for(r"MCSI restarted at ")
    assert robot.status()["boards"]["MCSI"]["process"] != before
    assert robot.interrupt() == 130


def test_pausing_stops_virtual_time_and_nothing_is_lost(up, walked):
    robot = up("--steps", "2", "--json", "-", speed="0.5")
    robot.running()
    paused = control.ask(robot.name, {"do": "pause"})["time_s"]
    status = robot.until(lambda status: status["paused"], "paused")
    for _ in range(50):
        assert robot.status()["time_s"] == status["time_s"] == paused
    assert control.ask(robot.name, {"do": "resume"})["time_s"] == paused < walked["time_s"]
    assert robot.end() == 0
    assert comparable(summary_of(robot.text)) == comparable(walked)


def test_a_parameter_is_set_within_its_limits_a_key_is_pressed_and_nothing_else_ends_the_run(up, command):
    """What a program that is not `ctl` may send: the review of 22 November 2026, R3."""
    robot = up(script=SCRIPT, speed="0.002")
    robot.running()
    done = command("ctl", "set", "P_UI_LCD_TIME", "142.5", "--name", robot.name)
    assert done.returncode == 0 and done.stdout.startswith("set: at ")
    assert control.ask(robot.name, {"do": "key", "key": 2}).keys() == {"time_s"}
    wrong = command("ctl", "set", "P_UI_LCD_TIME", "5", "--name", robot.name)
    assert wrong.returncode == 2 and "P_UI_LCD_TIME = 5 is outside 100 to 60000 ms" in wrong.stderr
    for request, fault in (
        ({"do": "set", "name": "P_UI_LCD_TIME", "value": {}}, "P_UI_LCD_TIME = {}: a number is expected"),
        ({"do": "set", "name": "P_UI_LCD_TIME", "value": 5}, "is outside 100 to 60000 ms"),
        ({"do": "set", "name": "MCH_ANGLE", "value": 1}, "it is published by MCH"),
        ({"do": "key", "key": "abc"}, "'abc' is not 0 to 5"),
    ):
        with pytest.raises(UserError, match=re.escape(fault)):
            control.ask(robot.name, request)
    with connected(control.address(robot.name), "the robot", PATIENCE_S) as client:
        client.sendall(b"[" * 3000 + b"\n" + b'{"do": "status"}\n' * 2)  # all of it in one packet
        lines = client.makefile("rb")
        assert b"one line with a JSON object" in lines.readline()
        assert b"time_s" in lines.readline() and b"time_s" in lines.readline()
    assert robot.interrupt() == 0 and "P_UI_LCD_TIME is 142.5" in robot.text


def test_a_bus_outside_carries_the_robots_frames_and_the_run_says_that_it_is_asynchronous(up):
    """python-can's `virtual` exists within one process, which is where all peers are."""
    robot = up("--bus", "can1=virtual:outside", "--time", "0.3s", "--json", "-", speed="0.5")
    assert robot.end() == 0
    found = summary_of(robot.text)
    outside = found["processes"]["outside"]["can1"]
    assert found["processes"]["asynchronous"] and found["failed_boards"] == []
    # 2 ms slots: the hip's four frames and, from the router, commands; both ways through the interface
    assert outside["frames_in"] > 300 and outside["frames_out"] > outside["frames_in"]
    assert outside["not_taken"] == outside["overflow"] == outside["refused"] == 0
    assert found["can"]["can1"]["frames"] > 600


def test_boards_that_a_profile_has_elsewhere_get_no_process(up, tmp_path):
    profile = tmp_path / "without.toml"
    profile.write_text('title = "no steering"\n[boards]\nMCSI = "absent"\n')
    robot = up("--profile", str(profile), "--time", "0.1s", "--json", "-", speed="max")
    assert robot.end() == 0
    found = summary_of(robot.text)
    assert (
        found["failed_boards"] == [] and found["slots"]["MCSI"]["count"] == 0 and found["slots"]["MCFI"]["count"] > 150
    )


@pytest.mark.parametrize(
    ("places", "complaint"),
    [
        (["can9=virtual:a"], "unknown bus or board 'can9' (available: can1, can2, can3, can4, MCH"),
        (["can1=virtual:a", "can1=virtual:b"], "can1 is given twice"),
        (["MCH=virtual:a"], "its bus can1 is not outside"),
        (["can1=socketcan:no-such-interface"], "bus can1 on socketcan:no-such-interface: "),
    ],
)
def test_a_bus_that_cannot_be_put_outside_is_one_line(command, places, complaint):
    options = [word for place in places for word in ("--bus", place)]
    done = command("up", "--time", "0.01s", "--name", f"test-{uuid.uuid4().hex[:12]}", *options)
    assert done.returncode == 2 and complaint in done.stderr and "Traceback" not in done.stderr


def test_a_request_to_no_robot_is_one_line(command):
    done = command("ctl", "status", "--name", "nobody-runs-this")
    assert done.returncode == 2
    assert done.stderr.startswith("ranger-sim: no robot named nobody-runs-this is running here")


def test_two_robots_cannot_have_one_name(up, command):
    robot = up()
    robot.processes()
    done = command("up", "--name", robot.name, "--steps", "1")
    assert done.returncode == 2
    assert f"the name '{robot.name}' is taken by another running robot or bus host" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert robot.interrupt() == 130


def test_ctrl_c_finishes_the_files_as_walk_does(up, tmp_path):
    robot = up("--out", str(tmp_path))
    robot.processes()
    assert robot.interrupt() == 130
    assert json.loads((tmp_path / "summary.json").read_text())["fell"] is False
    assert (tmp_path / "can1.log").exists() and (tmp_path / "report.html").exists()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--speed", "0"], "'0' must be at least 0.0001 and at most 1000, or max"),
        (["--speed", "fast"], "'fast' is not a number, or max"),
        (["--processor", "99"], "processor is 99, allowed are"),
        (["--name", "a b"], "name is 'a b', allowed are"),
        (["--xcp-can", "can5"], "did you mean 'can4'"),
        (["--xcp-udp", "65536"], "65535"),
    ],
)
def test_a_mistake_in_an_option_is_one_line(command, arguments, complaint):
    done = command("up", "--time", "0.01s", *arguments)
    assert done.returncode == 2 and complaint in done.stderr and "Traceback" not in done.stderr


def test_an_unused_probe_for_calibration_leaves_the_run_as_it_is(command):
    run = ("up", "--time", "0.1s", "--speed", "max", "--json", "-", "--name", f"test-{uuid.uuid4().hex[:12]}")
    digests = []
    for more in ((), ("--xcp-can", "--xcp-udp", "0")):
        done = command(*run, *more)
        assert done.returncode == 0, done.stderr
        digests.append(summary_of(done.stdout)["trace_digest"])
    assert digests[0] == digests[1]


def test_the_timeline_of_a_run_has_the_slots_of_every_board_in_its_process(command, tmp_path):
    pytest.importorskip("perfetto.protos.perfetto.trace.perfetto_trace_pb2")
    file = tmp_path / "run.pftrace"
    name = f"test-{uuid.uuid4().hex[:12]}"
    done = command("up", "--time", "0.1s", "--speed", "max", "--name", name, "--trace", str(file))
    assert done.returncode == 0 and "timeline: " in done.stderr, done.stderr
    trace = perfetto_reader.read(file)
    for board, slot_ms in (("MCH", 0.5), ("CSR", 1.0), ("MB", 2.0)):
        slots = [each for each in trace.find("Boards", board, "slots").slices if each.depth == 0]
        # boards begin within 2.5 ms; a run is over at the end of a turn of 5 ms
        assert 97 / slot_ms <= len(slots) <= 105 / slot_ms, board


def test_a_timeline_that_cannot_be_is_refused_before_any_process_begins(command, tmp_path):
    done = command("up", "--time", "0.1s", "--trace", str(tmp_path / "run.txt"))
    assert done.returncode == 2 and "is not a format" in done.stderr and done.stderr.count("\n") == 1


def test_a_fault_whose_place_is_taken_when_it_is_to_begin_is_reported_by_status_and_by_the_robot(up):
    robot = up(speed="0.05")
    robot.running()
    first = control.ask(robot.name, {"do": "fault", "fault": "MCH.absolute_encoder:offset"})
    start = f"{first['time_s'] + 0.05:.3f}"  # later than the next request can come: a second by the wall clock
    late = f"MCH.absolute_encoder:stuck@{start} s"
    assert control.ask(robot.name, {"do": "fault", "fault": late})["time_s"] < float(start)
    [reported] = robot.until(lambda status: status["gave_way"], "told")["gave_way"]
    assert reported == (
        f"fault 1, {late}, gave way at {start} s: MCH.absolute_encoder:offset still works at MCH.absolute_encoder"
    )
    robot.wait_for(re.escape(reported))


def test_a_fault_at_a_sensor_acts_with_boards_in_processes_and_one_inside_a_board_is_refused(command):
    run = ("up", "--time", "0.06s", "--speed", "max", "--json", "-", "--name", f"test-{uuid.uuid4().hex[:12]}")
    done = command(*run, "--fault", "MCH.absolute_encoder:offset@0.03 s")
    [fault] = json.loads(done.stdout)["faults"]
    assert done.returncode == 0 and fault["acted"] and fault["activated_s"] == pytest.approx(0.03, abs=3e-4)
    refused = command(*run, "--fault", "MCH.processor:stall")
    assert refused.returncode == 2 and "MCH is not emulated in this process" in refused.stderr
    late = command(*run, "--fault", "MCH.absolute_encoder:offset@error MC_TCURR_OOB from MCH")
    assert late.returncode == 2 and "is counted in the process of its board" in late.stderr
