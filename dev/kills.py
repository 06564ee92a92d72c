"""python -m dev.kills --kills 200: runs whose processes are killed, or stopped and continued, at random times.

Commands are `walk`, `walk` with a board in C, `up` at full speed and `campaign`, in turn; the victim is the command's
own process in every second kill, otherwise any that it has started. After a kill: no process of it is left, no
shared memory, no local socket; what the command reported as kept is whole; a folder with a summary belongs to a command
that had ended its run, and every file without `.partial` in its name is whole. A campaign keeps every result that it
had, and, killed again and again in one folder, ends with the results of one that was not. Every eighth case stops each
process of a command in turn for a while: it ends as an undisturbed one, with the same digest. A board or the body's
process alone may be lost: the command then ends by itself, and says so.

Victims and times come from the seed, the times as shares of what the undisturbed command took (and a little longer);
what a process does at a time depends on the machine. A command has five minutes to end, longer only while processes
wait for a processor. Ends with 1 at the first finding. `--first N` goes on with case N of the same seed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from typing import Any

from dev.load import Deadline
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.tools.command_line.units import whole_number
from ranger_sim.tools.run.folder import OPEN, SUMMARY

COMMAND = "python -m dev.kills"
ROOT = pathlib.Path(__file__).resolve().parents[1]
KILLS = 200
LATEST = 1.2  # from the start of a command, as a share of what an undisturbed one took. Chosen by us
LEFT_S = 5.0  # for the kernel to end what hangs on a killed process. Chosen by us
PATIENCE_S = 300.0
STOP_EVERY = 8
STOPPED_S = 0.1
MARK = "RANGER_SIM_KILLS"
WHOLE_MDF, KEPT = b"MDF     ", "report: "
PLAN = """
title = "killed"
[watch]
after = "0.8 s"
[healthy]
seeds = [1, 2]
[vary]
seed = [1, 2]
fault = ["MCH.absolute_encoder:stuck@{start}", "UI.imu:gyro_bias@{start}"]
start = ["step 1"]
"""


def in_use() -> set[str]:
    """Names of the shared memory that a process has mapped: of other programs of this machine, or of a run."""
    found = set()
    for maps in pathlib.Path("/proc").glob("[0-9]*/maps"):
        with contextlib.suppress(OSError):  # of another user, or ended meanwhile
            found |= {line.rpartition("/dev/shm/")[2] for line in maps.read_text().splitlines() if "/dev/shm/" in line}
    return found


class Finding(Exception):  # noqa: N818  (not an error of this program)
    """What a killed command lost or left."""


class Command:
    """One started command, with its own mark in the environment of every process that it starts."""

    def __init__(self, words: Sequence[str], mark: str) -> None:
        self.mark = f"{MARK}={mark}".encode()
        self.output = tempfile.TemporaryFile()  # noqa: SIM115
        self.started = subprocess.Popen(
            [sys.executable, "-m", "ranger_sim", *words],
            cwd=ROOT,
            env={**os.environ, MARK: mark},
            stdin=subprocess.DEVNULL,
            stdout=self.output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def text(self) -> str:
        """What it has printed."""
        return os.pread(self.output.fileno(), 1 << 24, 0).decode(errors="replace")

    def processes(self) -> list[int]:
        """Its processes, zombies left out, its own first."""
        found = []
        for name in filter(str.isdecimal, os.listdir("/proc")):
            with contextlib.suppress(OSError):
                if self.mark in pathlib.Path("/proc", name, "environ").read_bytes().split(b"\0"):
                    found.append(int(name))
        return sorted(found, key=lambda process: (process != self.started.pid, process))

    def end(self, patience_s: float = PATIENCE_S) -> int:
        """Wait for its end; returns the exit code."""
        deadline = Deadline(patience_s)
        while (left_s := deadline.left_s()) > 0.0:
            with contextlib.suppress(subprocess.TimeoutExpired):
                return self.started.wait(left_s)
        raise Finding(f"it has not ended after {patience_s:g} s:\n{self.text()[-2000:]}")

    def close(self) -> None:
        """End whatever is left."""
        for process in self.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self.started.wait()
        self.output.close()


class Kills:
    """`case(number)` is one case; Finding as soon as a check fails."""

    def __init__(self, seed: int, folder: pathlib.Path) -> None:
        self.seed = seed
        self.folder = folder
        self.counts = {"cases": 0, "stopped": 0, "before_its_end": 0, "of_others": 0, "campaigns_completed": 0}
        plan = folder / "plan.toml"
        plan.write_text(PLAN, encoding="utf-8")
        in_c = str(ROOT / "examples" / "hip_in_c")
        run = ("--time", "4s", "--seed", "3")
        self.commands: dict[str, tuple[str, ...]] = {
            "walk": ("walk", *run),
            "walk with a board in C": ("walk", "--time", "2s", "--firmware", f"MCH={in_c}"),
            "up": ("up", "--time", "1s", "--speed", "max", "--no-real-time", "--name", f"kills-{os.getpid()}"),
            "campaign": ("campaign", str(plan), "--jobs", "2", "--pool", "local"),
        }
        self.shared = set(os.listdir("/dev/shm"))
        self.wanted: dict[str, Any] = {}  # of an undisturbed command: its digest, or its results
        self.took_s: dict[str, float] = {}

    def prepare(self) -> None:
        """Each command once, undisturbed."""
        for name, words in self.commands.items():
            out = self.folder / "undisturbed" / name.replace(" ", "-")
            began_s = wallclock.monotonic_s()
            with contextlib.closing(Command((*words, "--out", str(out)), "undisturbed")) as command:
                if command.end():
                    raise Finding(f"{name}, undisturbed: code {command.started.returncode}:\n{command.text()[-2000:]}")
            self.took_s[name] = wallclock.monotonic_s() - began_s
            self.wanted[name] = results_in(out) if name == "campaign" else digest_in(out)

    def case(self, number: int) -> None:
        """Start a command, kill or stop one of its processes, check what is left."""
        stream: Any = RandomStream(self.seed, f"kill {number}")
        name = list(self.commands)[number % len(self.commands)]
        out = self.folder / (name if name == "campaign" else str(number))
        before = results_in(out) if name == "campaign" else {}
        stops = number // len(self.commands) % STOP_EVERY == STOP_EVERY - 1
        command = Command((*self.commands[name], "--out", str(out)), str(number))
        try:
            where = f"case {number}: {name}"
            if stops:
                self.stop_each(command, self.took_s[name] / 2 * stream.uniform())
                self.counts["stopped"] += 1
                if command.end():
                    raise Finding(f"{where}, stopped and continued: code {command.started.returncode}")
            else:
                where += f", {self.kill(command, LATEST * self.took_s[name], stream)}"
            self.check(name, command, out, before, where)
        except Finding as finding:
            text = str(finding)
            raise Finding(text if text.startswith("case") else f"{where}: {text}") from None
        finally:
            command.close()
        self.counts["cases"] += 1

    def stop_each(self, command: Command, after_s: float) -> None:
        """Stop each process for a while, one after the other."""
        wallclock.sleep_s(after_s)
        for process in command.processes():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGSTOP)
                wallclock.sleep_s(STOPPED_S)
                os.kill(process, signal.SIGCONT)

    def kill(self, command: Command, latest_s: float, stream: Any) -> str:
        """Kill one process at a random time; returns which, and when."""
        after_s = latest_s * stream.uniform()
        own, choice = stream.integer(2) == 0, stream.uniform()
        with contextlib.suppress(subprocess.TimeoutExpired):
            command.started.wait(after_s)
        running = command.processes()
        if command.started.poll() is not None or not running:
            return f"ended before {after_s:.3f} s"
        self.counts["before_its_end"] += 1
        victim = running[0] if own else running[int(choice * len(running))]
        self.counts["of_others"] += victim != command.started.pid
        with contextlib.suppress(ProcessLookupError):
            os.kill(victim, signal.SIGKILL)
        return f"process {running.index(victim)} of {len(running)} killed after {after_s:.3f} s"

    def left_by(self, command: Command) -> str:
        """What is left of a command that has ended; empty for nothing."""
        if processes := command.processes():
            return f"processes are left: {processes}"
        if (shared := set(os.listdir("/dev/shm")) - self.shared) and (shared := shared - in_use()):
            return f"shared memory is left: {sorted(shared)}"
        sockets = pathlib.Path("/proc/net/unix").read_text(encoding="utf-8")
        return "a local socket is left" if f"kills-{os.getpid()}" in sockets else ""

    def check(self, name: str, command: Command, out: pathlib.Path, before: dict[str, Any], where: str) -> None:
        """Nothing is lost that was reported as kept, and nothing is left."""
        code = command.end()
        deadline = Deadline(LEFT_S)
        while left := self.left_by(command):
            if deadline.left_s() < 0.0:
                raise Finding(f"{where}: {left}")
            wallclock.sleep_s(0.01)
        text = command.text()
        if "Traceback" in text:
            raise Finding(f"{where}: {text[-3000:]}")
        if name == "campaign":
            after = results_in(out)
            if lost := [key for key in before if after.get(key) != before[key]]:
                raise Finding(f"{where}: results are lost or changed: {lost}")
            if code == 0:
                if after != self.wanted[name]:
                    raise Finding(f"{where}: its results are not those of an undisturbed one")
                self.counts["campaigns_completed"] += 1
                remove(out)
            return
        self.check_run(name, out, code, text, where)
        remove(out)

    def check_run(self, name: str, out: pathlib.Path, code: int, text: str, where: str) -> None:
        """The folder of a run."""
        names = set(os.listdir(out)) if out.is_dir() else set()
        if code in (0, 1) and SUMMARY not in names:
            raise Finding(f"{where}: code {code} without a summary: {sorted(names)}\n{text[-2000:]}")
        if SUMMARY in names and OPEN in names:
            raise Finding(f"{where}: both {SUMMARY} and {OPEN}")
        if names and not names & {SUMMARY, OPEN}:
            raise Finding(f"{where}: neither {SUMMARY} nor {OPEN}: {sorted(names)}")
        if SUMMARY in names and any(".partial" in each for each in names):
            raise Finding(f"{where}: a summary, and partial files: {sorted(names)}")
        for line in text.splitlines():
            if line.startswith(KEPT) and not (ROOT / line.removeprefix(KEPT)).is_file():
                raise Finding(f"{where}: reported, but not there: {line}")
        if names == {OPEN} and not (out / OPEN).stat().st_size:
            return  # killed before the first word of its record, and before any other file
        for each in names & {SUMMARY, OPEN}:
            json.loads((out / each).read_text(encoding="utf-8"))
        for each in names:
            data = (out / each).read_bytes() if each.endswith((".log", ".mf4", ".html")) else b""
            if ".partial" in each:
                continue
            if each.endswith(".mf4") and not data.startswith(WHOLE_MDF):
                raise Finding(f"{where}: {each} has its own name, but is not whole")
            if each.endswith(".log") and data and not data.endswith(b"\n"):
                raise Finding(f"{where}: {each} has its own name, but ends within a line")
            if each.endswith(".html") and b"</html>" not in data[-100:]:
                raise Finding(f"{where}: {each} has its own name, but is not whole")
        if code == 0 and digest_in(out) != self.wanted[name]:
            raise Finding(f"{where}: its digest is not that of an undisturbed run")


def digest_in(folder: pathlib.Path) -> str:
    """The digest in a run's summary."""
    return str(json.loads((folder / SUMMARY).read_text(encoding="utf-8"))["trace_digest"])


def results_in(folder: pathlib.Path) -> dict[str, Any]:
    """{key: result} of a campaign, without its cost; a line that was being written is not a result."""
    path = folder / "results.jsonl"
    lines = path.read_bytes().split(b"\n")[:-1] if path.is_file() else []
    found = [json.loads(line) for line in lines]
    return {each["key"]: {name: value for name, value in each.items() if name != "spent"} for each in found}


def remove(folder: pathlib.Path) -> None:
    """Remove a folder and what is in it, if it is there."""
    if folder.is_dir():
        shutil.rmtree(folder)


def run(kills: int, seed: int, first: int = 0) -> dict[str, int]:
    """The cases from `first` to below `kills`; the counts."""
    with tempfile.TemporaryDirectory(prefix="ranger-sim-kills-") as folder:
        made = Kills(seed, pathlib.Path(folder))
        made.prepare()
        for number in range(first, kills):
            made.case(number)
        return made.counts


def main(arguments: list[str] | None = None) -> int:
    """0 when all held, 1 with the first finding."""
    command = argparse.ArgumentParser(prog=COMMAND, description=(__doc__ or "").partition("\n")[0])
    command.add_argument("--kills", type=whole_number(1), default=KILLS, metavar="N", help=f"cases (default {KILLS})")
    command.add_argument("--seed", type=whole_number(0), default=1, metavar="S", help="of victims and times")
    command.add_argument("--first", type=whole_number(0), default=0, metavar="N", help="case to begin with (0)")
    options = command.parse_args(arguments)
    try:
        counts = run(options.kills, options.seed, options.first)
    except Finding as finding:
        print(f"{COMMAND}: seed {options.seed}: {finding}", file=sys.stderr)
        return 1
    print(", ".join(f"{name.replace('_', ' ')} {count}" for name, count in counts.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
