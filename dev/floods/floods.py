"""`python -m dev.floods`: the robot in real time while a client writes as fast as it can and reads nothing.

A flood is one way of using one interface endlessly (see `flooders.py`). Measured are the robot's pace by the wall
clock, the processor time of the body's process per second of the robot, and the memory growth of the flooded process.
They are compared with the same robot undisturbed, and with one next to a program that uses no interface and only keeps
a processor busy, as every flood does too. For a debugger port the robot has a board that runs an image, whose process
is counted as well; for the panel's interfaces a panel shows the robot.

A pace is meaningful only if the undisturbed robot keeps it. A machine with few processors cannot run ten busy programs
in real time, so there the robot runs slower (`speed_for`), and each flood is given as a share of the undisturbed pace
at the same speed.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from dev.floods.flooders import (
    BUSY,
    DEBUGGED,
    NAMES,
    PEACE_OF,
    SHOWN,
    WHOLE,
    Endpoints,
    debugging,
    flooded,
    robot_of,
)
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control, kernel

HELD = 0.99  # share of the undisturbed pace that a flood leaves: issue 16
PROGRAMS = 10  # boards, body, supervisor, and the flooder; chosen by us: with a processor for each, real time is held
SETTLE_S = 1.0  # from the first bytes of a flood to the first reading, and from its end to the next; chosen by us
PATIENCE_S = 60.0  # for a robot that starts or ends on a busy machine
PAGE_KB = os.sysconf("SC_PAGE_SIZE") // 1024


# --- the robot -------------------------------------------------------------------------------------------


IMAGE_BOARD = "MCSI"
# A program for the chip that waits for ever (`b .` at the reset vector), as Intel HEX.
WAITS = ":04000000FEFFFFEA16\n:00000001FF\n"


class Started:
    """One of our programs and its output."""

    def __init__(self, *words: str) -> None:
        self.output = ""
        self.process = subprocess.Popen(
            [sys.executable, "-m", "ranger_sim", *words],
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )

    def read_output(self, seconds: float) -> None:
        """Append its output, waiting at most this long."""
        assert self.process.stderr is not None
        number = self.process.stderr.fileno()
        if descriptors.wait([number], [], seconds)[0]:
            self.output += os.read(number, 1 << 16).decode()

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Wait for the first line that matches the pattern and return the match."""
        end = wallclock.monotonic_s() + PATIENCE_S
        while not (match := re.search(pattern, self.output)):
            if self.process.poll() is not None or wallclock.monotonic_s() > end:
                raise RuntimeError(f"no {pattern!r} in:\n{self.output}")
            self.read_output(0.1)
        return match

    def close(self) -> None:
        """End it as Ctrl-C does, or by force."""
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGINT)
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.process.poll() is None and wallclock.monotonic_s() < end:
            self.read_output(0.1)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()


class Robot:
    """A running `ranger-sim up` with the interfaces of its kind open, and a panel if that is flooded."""

    def __init__(self, speed: float, kind: str = WHOLE) -> None:
        self.kind = kind
        name = f"flood-{os.getpid()}"
        self.files = contextlib.ExitStack()
        words = ["up", "--name", name, "--speed", str(speed)]
        if kind == WHOLE:
            words += ["--slcan", "can1", "--socketcand", "0", "--daq-port", "pty", "--xcp-udp", "0", "--xcp-can"]
        if kind == DEBUGGED:
            image = Path(self.files.enter_context(tempfile.TemporaryDirectory())) / "waits.hex"
            image.write_text(WAITS, encoding="ascii")
            words += ["--image", f"{IMAGE_BOARD}={image}", "--gdb", f"{IMAGE_BOARD}=0"]
        self.up = self.files.enter_context(contextlib.closing(Started(*words)))
        self.programs = [self.up]
        self.endpoints = Endpoints(name)
        try:
            self._open(name)
        except BaseException:
            self.close()
            raise

    def _open(self, name: str) -> None:
        """Find the interfaces and wait until all are available."""
        if self.kind == WHOLE:
            self.endpoints = Endpoints(
                name,
                self.up.wait_for(r"slcan: can1 is (\S+)")[1],
                int(self.up.wait_for(r"socketcand: [\d.]+:(\d+)")[1]),
                self.up.wait_for(r"data link: ranger-sim daq --port (\S+)")[1],
                int(self.up.wait_for(r"XCP on UDP: [\d.]+:(\d+)")[1]),
            )
        if self.kind == DEBUGGED:
            self.endpoints = Endpoints(name, gdb=int(self.up.wait_for(r"target remote :(\d+)")[1]))
            self.up.wait_for("name " + name)
            with debugging(self.endpoints) as first:  # the run waits for a debugger, which lets it continue
                first.recv(1)
        self.status: dict = {}
        end = wallclock.monotonic_s() + PATIENCE_S
        while "time_s" not in self.status:
            if wallclock.monotonic_s() > end:
                raise RuntimeError(f"the robot does not start:\n{self.up.output}")
            with contextlib.suppress(UserError):
                self.status = control.ask(name, {"do": "status"})
            self.up.read_output(0.05)
        if self.kind == SHOWN:
            panel = self.files.enter_context(contextlib.closing(Started("panel", "--name", name, "--http-port", "0")))
            self.programs.append(panel)
            found = panel.wait_for(r":(\d+)/\?token=(\w+)")
            self.endpoints = Endpoints(name, panel=int(found[1]), token=found[2])

    @property
    def ended(self) -> bool:
        """True when one of its programs has ended."""
        return any(each.process.poll() is not None for each in self.programs)

    def moment(self) -> tuple[float, float]:
        """(wall clock, virtual time) at the same time, s, as reported by the body's process.

        (0, 0) when the robot has ended, or does not answer for PATIENCE_S: a flood may keep the supervisor busy.
        """
        end = wallclock.monotonic_s() + PATIENCE_S
        while wallclock.monotonic_s() < end and not self.ended:
            with contextlib.suppress(UserError):
                status = control.ask(self.endpoints.name, {"do": "status"})
                return status["at_s"], status["time_s"]
            self.wait(0.1)
        return 0.0, 0.0

    def memory_kb(self) -> tuple[int, int]:
        """Resident memory of the robot (body's process, supervisor, a debugged board) and of the panel, kB."""
        robot = sum(map(_statm, (self.up.process.pid, *self._flooded())))
        return robot, sum(_statm(each.process.pid) for each in self.programs[1:])

    def _flooded(self) -> list[int]:
        """Process of the body, and of a debugged board."""
        boards = [IMAGE_BOARD] if self.kind == DEBUGGED else []
        return [self.status["plant"], *(self.status["boards"][board]["process"] for board in boards)]

    def cpu_s(self) -> float:
        """Processor time of these processes so far."""
        return sum(map(kernel.processor_time_s, self._flooded()))

    def wait(self, seconds: float) -> None:
        """Let it run and read its output."""
        end = wallclock.monotonic_s() + seconds
        while (left := end - wallclock.monotonic_s()) > 0.0:
            for each in self.programs:
                each.read_output(min(left, 0.1) / len(self.programs))
            if self.ended:
                return

    def close(self) -> None:
        """End all programs."""
        self.files.close()


def _statm(process: int) -> int:
    with contextlib.suppress(OSError):
        return int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]) * PAGE_KB
    return 0


def speed_for(processors: int) -> float:
    """Times real time that a machine with this many processors holds during a flood: 1 with one for each program.

    Two processors of an AMD EPYC held 0.76 of real time undisturbed (23 November 2026); with a quarter of real time
    the robot leaves two thirds of its processor free.
    """
    return 1.0 if processors >= PROGRAMS else 0.5 if processors >= PROGRAMS // 2 else 0.25


def measured(name: str, seconds: float, robot: Robot) -> dict:
    """One flood of this many seconds: pace, processor time per second of the robot, memory."""
    memory = robot.memory_kb()
    with flooded(name, robot.endpoints):
        robot.wait(SETTLE_S)
        (wall, virtual), cpu = robot.moment(), robot.cpu_s()
        robot.wait(seconds)
        (end_wall, end_virtual), end_cpu = robot.moment(), robot.cpu_s()
        end_memory = robot.memory_kb()
    passed, waited = end_virtual - virtual, end_wall - wall
    robot.wait(SETTLE_S)
    return {
        "flood": name,
        "seconds": waited,
        "pace": passed / waited if passed > 0.0 else 0.0,
        "cpu_per_s": (end_cpu - cpu) / passed if passed > 0.0 else None,
        "memory_mb": end_memory[0] / 1024.0,
        "memory_growth_mb": (end_memory[0] - memory[0]) / 1024.0,
        "panel_mb": end_memory[1] / 1024.0,
        "panel_growth_mb": (end_memory[1] - memory[1]) / 1024.0,
        "ended": robot.ended,
    }


def text_of(row: dict, peace: float) -> str:
    """A line of the table; `peace`: the pace of the undisturbed robot."""
    cpu = "-" if row["cpu_per_s"] is None else f"{row['cpu_per_s']:.3f}"
    panel = f", panel {row['panel_mb']:.0f} MB ({row['panel_growth_mb']:+.1f})" if row["panel_mb"] else ""
    share = row["pace"] / peace if peace > 0.0 else 0.0
    return (
        f"{row['flood']:36} pace {row['pace']:.4f}, {100 * share:6.2f} % of undisturbed, "
        f"{cpu} s of processor per s of the robot, memory {row['memory_mb']:.0f} MB ({row['memory_growth_mb']:+.1f})"
        + panel
        + (", ENDED" if row["ended"] else "")
    )


def undisturbed(rows: list[dict], name: str) -> float:
    """The pace of the undisturbed robot of the same kind; 0 if not measured."""
    paces = {row["flood"]: row["pace"] for row in rows}
    return float(paces.get(PEACE_OF[robot_of(name)], 0.0))


def verdict(rows: list[dict]) -> str:
    """Report how many floods left the robot its pace, and the one that took most of it."""
    floods = [row for row in rows if row["flood"] not in (*PEACE_OF.values(), BUSY)]
    shares = {row["flood"]: row["pace"] / peace for row in floods if (peace := undisturbed(rows, row["flood"])) > 0.0}
    if not shares:
        return "nothing to compare"
    held = sum(share >= HELD for share in shares.values())
    worst = min(shares, key=shares.__getitem__)
    return (
        f"{held} of {len(shares)} floods leave at least {100 * HELD:.0f} % of the undisturbed pace; "
        f"the least is {100 * shares[worst]:.2f} % ({worst})"
    )


def run(
    seconds: float,
    report: Callable[[str], None],
    names: tuple[str, ...] = (),
    speed: float | None = None,
    kept: Path | None = None,
) -> list[dict]:
    """Measure the undisturbed robot, a busy program, then every flood (or those named), one by one; a line each.

    speed: times real time; None: that of `speed_for`. kept: a file that gets each row when it is measured, and whose
    rows of an earlier, interrupted measurement are not measured again.
    """
    speed = speed_for(os.cpu_count() or 1) if speed is None else speed
    before = {row["flood"]: row for row in _rows(kept) if (row["speed"], row["asked_s"]) == (speed, seconds)}
    report(f"the robot at {speed:g} of real time, {seconds:g} s each")
    rows: list[dict] = []
    robot = None
    try:
        for name in names or NAMES:
            row = before.get(name)
            if row is None:
                if robot is not None and (robot.ended or robot.kind != robot_of(name)):
                    robot.close()
                    robot = None
                robot = Robot(speed, robot_of(name)) if robot is None else robot
                row = {**measured(name, seconds, robot), "speed": speed, "asked_s": seconds}
                if kept is not None:
                    with kept.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
            rows.append(row)
            report(text_of(row, undisturbed(rows, name)))
    finally:
        if robot is not None:
            robot.close()
    report(verdict(rows))
    return rows


def _rows(kept: Path | None) -> list[dict]:
    if kept is None or not kept.exists():
        return []
    return [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]
