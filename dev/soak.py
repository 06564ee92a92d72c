"""python -m dev.soak walk, python -m dev.soak up: hours of a robot, with its memory, descriptors and processes counted.

`walk` walks `--distance` (default 10 km). `up` runs the robot as processes for `--minutes` of its time (default 60)
with every interface open and a panel, while clients come, go, flood and are killed, one round after the other; none of
them changes the run. A robot that a busy machine slows down is interrupted after `--wall-minutes`. The digest of `up`
has to be that of the same walk alone; that of `walk`, the digest given with `--digest`, or what the walk has without
being counted and stopped now and then (`--twice`).

Counted are the processes, their open descriptors and their memory (proportional set size), after each round when the
clients are gone. Flat: from the second quarter of the run to its last one neither processes nor descriptors grow, and
memory by no more than the limits below. The panel keeps an hour of what it shows, so its memory has a bound instead.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import pathlib
import re
import signal
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from dev.floods import flooders
from dev.kills import Command, Finding, digest_in
from dev.load import Deadline
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.interrupts import EXIT_INTERRUPTED
from ranger_sim.tools.command_line.units import number, whole_number
from ranger_sim.tools.run.folder import SUMMARY

COMMAND = "python -m dev.soak"
DISTANCE, MINUTES = "10km", 60.0
SEED = 3  # of the robot
ROUND_S = 4.0  # of each client
SETTLE_S = 10.0  # from the last interface that opens to the count that the others are compared with
PAUSE_S = 2.0  # at least, without clients, before a count
GONE_S = 30.0  # until a client that is gone has left nothing: the panel disconnects pages after 30 s of silence
WALK_COUNT_S = 5.0
STOPPED_S, STOP_EVERY = 0.3, 20  # a walk is stopped after every so many counts
PATIENCE_S = 120.0
LEAST = 8  # counts, two for each quarter
# Chosen by us: what allocators and a summary's rows of steps need, an order below what a leak of a few bytes in each
# frame (7,000 a second) would take.
MEMORY_SHARE, MEMORY_MB = 0.10, 8.0
PANEL_MB = 400.0

# Clients that do not change the run: those that put no frame on a bus, press no key and set no value.
CLIENTS = (
    "attach HELLO for channels",
    "attach connections",
    "attach CONTROL listen",
    "socketcand nonsense",
    "socketcand connections",
    "control status",
    "control nonsense",
    "control no line",
    "control connections",
    "xcp GET_STATUS",
    "xcp SHORT_UPLOAD",
    "xcp nonsense",
    "xcp strangers",
    "feed, 64 viewers that never read",
    "feed connections",
    "feed nonsense",
    flooders.READ,
    "panel connections",
    "panel, requests with a wrong token",
    "panel, a head without end",
    "panel, pages with a wrong token",
    "panel, 100 pages that never read",
    "panel, broken messages",
    "panel, shown without end",
    flooders.DRAWN,
)


class Count(NamedTuple):
    """What the processes of a command have: how many, open descriptors, memory in MB."""

    processes: int
    descriptors: int
    memory_mb: float


def count(command: Command) -> Count:
    """Count now. A process that ends meanwhile has nothing."""
    descriptors, memory_kb, processes = 0, 0, command.processes()
    for process in processes:
        with contextlib.suppress(OSError):
            descriptors += len(os.listdir(f"/proc/{process}/fd"))
            text = pathlib.Path(f"/proc/{process}/smaps_rollup").read_text(encoding="ascii")
            memory_kb += sum(map(int, re.findall(r"^Pss:\s+(\d+) kB", text, re.MULTILINE)))
    return Count(len(processes), descriptors, memory_kb / 1024.0)


def opened(command: Command) -> set[tuple[int, str]]:
    """(process, what the descriptor is) of all that its processes have open."""
    found = set()
    for process in command.processes():
        for descriptor in pathlib.Path(f"/proc/{process}/fd").glob("*"):
            with contextlib.suppress(OSError):
                found.add((process, os.readlink(descriptor)))
    return found


def quarters(counts: list[Count]) -> tuple[list[Count], list[Count]]:
    """The second and the last quarter: the first one is the start."""
    size = len(counts) // 4
    return counts[size : 2 * size], counts[-size:]


def growth_of(counts: list[Count]) -> dict[str, float]:
    """From the second quarter to the last: processes and descriptors by their least, which no passing client adds to,
    memory by its median.
    """
    earlier, later = quarters(counts)
    growth: dict[str, float] = {
        name: min(getattr(each, name) for each in later) - min(getattr(each, name) for each in earlier)
        for name in ("processes", "descriptors")
    }
    medians = [statistics.median(each.memory_mb for each in part) for part in (earlier, later)]
    return {**growth, "memory_mb": round(medians[1] - medians[0], 2), "of_mb": round(medians[0], 1)}


def check_flat(counts: list[Count], who: str, bound_mb: float | None = None) -> dict[str, float]:
    """The growth; Finding where there is any beyond the limits, UserError for too few counts."""
    if len(counts) < LEAST:
        raise UserError(f"{who}: {len(counts)} counts, and at least {LEAST} are needed: run it for longer")
    growth = growth_of(counts)
    for name in ("processes", "descriptors"):
        if growth[name] > 0:
            raise Finding(f"{who}: {growth[name]:g} more {name} at the end than in the second quarter")
    if bound_mb is not None:
        if (most := max(each.memory_mb for each in counts)) > bound_mb:
            raise Finding(f"{who}: {most:.0f} MB, more than its bound of {bound_mb:.0f}")
    elif growth["memory_mb"] > MEMORY_MB + MEMORY_SHARE * growth["of_mb"]:
        raise Finding(f"{who}: memory grew by {growth['memory_mb']} MB from {growth['of_mb']}")
    return growth


@contextlib.contextmanager
def started(*words: str) -> Iterator[Command]:
    """A command that is ended with the context."""
    mark = f"soak-{os.getpid()}-{next(NUMBERS)}"
    with contextlib.closing(Command(words, mark)) as command:
        yield command


NUMBERS = iter(range(1 << 30))


def wait_s(command: Command, seconds: float) -> bool:
    """Wait at most this long for its end; True when it has ended."""
    with contextlib.suppress(subprocess.TimeoutExpired):
        command.started.wait(seconds)
    return command.started.poll() is not None


def found_in(command: Command, pattern: str) -> re.Match[str]:
    """Wait for a line that it prints."""
    deadline = Deadline(PATIENCE_S)
    while not (match := re.search(pattern, command.text())):
        if wait_s(command, 0.2) or deadline.left_s() < 0.0:
            raise Finding(f"no {pattern!r} in:\n{command.text()[-2000:]}")
    return match


def ended_well(command: Command, out: pathlib.Path, who: str, was_interrupted: bool = False) -> str:
    """The digest of a run that has ended; Finding where it has not ended with 0, or as an interrupted one does."""
    if (code := command.end()) != (EXIT_INTERRUPTED if was_interrupted else 0):
        raise Finding(f"{who}: code {code}:\n{command.text()[-2000:]}")
    return digest_in(out)


# --- a walk -----------------------------------------------------------------------------------------------


def soak_walk(distance: str, digest: str, twice: bool, folder: pathlib.Path, report: Callable[[str], None]) -> dict:
    """One long walk, counted, and stopped and continued now and then."""
    words = ("walk", "--distance", distance, "--seed", str(SEED), "--quiet", "--out")
    if twice:
        with started(*words, str(folder / "alone")) as command:
            command.end(float("inf"))
            digest = ended_well(command, folder / "alone", "the walk alone")
    counts: list[Count] = []
    began_s = wallclock.monotonic_s()
    with started(*words, str(folder / "counted")) as command:
        while not wait_s(command, WALK_COUNT_S):
            counts.append(count(command))
            if len(counts) % STOP_EVERY == 0:
                command.started.send_signal(signal.SIGSTOP)
                wallclock.sleep_s(STOPPED_S)
                command.started.send_signal(signal.SIGCONT)
                report(f"{len(counts)} counts, {counts[-1]}")
        seen = ended_well(command, folder / "counted", "the walk")
        counts = [each for each in counts if each.processes]
    if digest and seen != digest:
        raise Finding(f"the walk has the digest {seen}, alone {digest}")
    summary = json.loads((folder / "counted" / SUMMARY).read_text(encoding="utf-8"))
    return {
        "steps": summary["steps"],
        "distance_m": summary["distance_m"],
        "wall_s": round(wallclock.monotonic_s() - began_s, 1),
        "counts": len(counts),
        "growth": check_flat(counts, "the walk"),
        "digest": seen,
        "digest_alone": digest,
    }


# --- a robot as processes, with clients -------------------------------------------------------------------


class Robot:
    """`up` with every interface, and a panel."""

    def __init__(self, up: Command, panel: Command, name: str) -> None:
        self.up, self.panel = up, panel
        found = found_in(panel, r":(\d+)/\?token=(\w+)")
        self.endpoints = flooders.Endpoints(
            name,
            found_in(up, r"slcan: can1 is (\S+)")[1],
            int(found_in(up, r"socketcand: [\d.]+:(\d+)")[1]),
            found_in(up, r"data link: ranger-sim daq --port (\S+)")[1],
            int(found_in(up, r"XCP on UDP: [\d.]+:(\d+)")[1]),
            panel=int(found[1]),
            token=found[2],
        )
        self.counts: dict[str, list[Count]] = {"up": [], "panel": []}
        wait_s(up, SETTLE_S)
        self.usual = (count(up), count(panel))
        self.opened = (opened(up), opened(panel))

    def has_ended(self) -> bool:
        """True when the robot has reached its time."""
        return self.up.started.poll() is not None

    def count(self, client: str) -> None:
        """Count once the clients of this name are gone; Finding where they leave descriptors for GONE_S."""
        deadline = Deadline(GONE_S)
        while not wait_s(self.up, PAUSE_S):
            now = (count(self.up), count(self.panel))
            extra = [each.descriptors - usual.descriptors for each, usual in zip(now, self.usual, strict=True)]
            if max(extra) <= 0 or deadline.left_s() < 0.0:
                break
        else:
            return
        if self.has_ended():
            return
        if max(extra) > 0:
            both = zip((self.up, self.panel), self.opened, strict=True)
            more = [sorted(opened(each) - usual) for each, usual in both]
            raise Finding(f"{extra} descriptors more (up, panel) {GONE_S:g} s after {client} is gone: {more}")
        for name, each in zip(self.counts, now, strict=True):
            self.counts[name].append(each)

    def time_s(self) -> float:
        """The robot's time; 0 when it does not answer in time."""
        with contextlib.suppress(UserError):
            return float(control.ask(self.endpoints.name, {"do": "status"})["time_s"])
        return 0.0


def soak_up(
    minutes: float, wall_minutes: float, speed: float, seed: int, folder: pathlib.Path, report: Callable[[str], None]
) -> dict:
    """A robot as processes for so many minutes of its time, in rounds of clients drawn with the seed.

    After `wall_minutes` of the wall clock it is interrupted, and compared with a walk that ends there.
    """
    run = ("--seed", str(SEED), "--out")
    name = f"soak-{os.getpid()}"
    words = ["up", "--time", f"{60.0 * minutes:g}s", *run, str(folder / "up"), "--name", name]
    words += ["--speed", f"{speed:g}", "--no-real-time"]
    words += ["--slcan", "can1", "--socketcand", "0", "--daq-port", "pty", "--xcp-udp", "0"]
    is_over = False
    stream: Any = RandomStream(seed, "soak")
    rounds: dict[str, int] = {}
    with started(*words) as up:
        found_in(up, f"name {name}")
        with started("panel", "--name", name, "--http-port", "0") as panel:
            robot = Robot(up, panel, name)
            began_s = wallclock.monotonic_s()
            while not robot.has_ended():
                if is_over := wallclock.monotonic_s() - began_s > 60.0 * wall_minutes:
                    up.started.send_signal(signal.SIGINT)
                    break
                client = CLIENTS[int(stream.integer(len(CLIENTS)))]
                with flooders.flooded(client, robot.endpoints):  # killed at its end
                    wait_s(up, ROUND_S * (0.5 + stream.uniform()))
                rounds[client] = rounds.get(client, 0) + 1
                robot.count(client)
                if sum(rounds.values()) % STOP_EVERY == 0:
                    counted = robot.counts["up"][-1:]
                    report(f"{sum(rounds.values())} rounds, {robot.time_s():.0f} s of the robot, {counted}")
            seen = ended_well(up, folder / "up", "up", is_over)
            wall_s = wallclock.monotonic_s() - began_s
            panel.started.send_signal(signal.SIGINT)
            if code := panel.end():
                raise Finding(f"the panel ends with {code}:\n{panel.text()[-2000:]}")
    summary = json.loads((folder / "up" / SUMMARY).read_text(encoding="utf-8"))
    with started("walk", "--time", f"{summary['time_s']}s", "--quiet", *run, str(folder / "alone")) as command:
        command.end(float("inf"))
        alone = ended_well(command, folder / "alone", "the walk alone")
    if seen != alone:
        raise Finding(f"with clients the digest is {seen}, alone {alone}")
    return {
        "robot_s": summary["time_s"],
        "wall_s": round(wall_s, 1),
        "speed": speed,
        "rounds": sum(rounds.values()),
        "kinds": len(rounds),
        "of_kinds": len(CLIENTS),
        "counts": len(robot.counts["up"]),
        "growth": check_flat(robot.counts["up"], "up"),
        "panel_growth": check_flat(robot.counts["panel"], "the panel", PANEL_MB),
        "digest": seen,
        "digest_alone": alone,
    }


# --- the command ------------------------------------------------------------------------------------------


def parser() -> argparse.ArgumentParser:
    """The options."""
    command = argparse.ArgumentParser(
        prog=COMMAND, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    command.add_argument("kind", choices=("walk", "up"), help="one process, or one for each board with clients")
    command.add_argument("--distance", default=DISTANCE, help=f"walk: so far (default {DISTANCE})")
    command.add_argument("--digest", default="", help="walk: the digest that it has to have")
    command.add_argument("--twice", action="store_true", help="walk: once without counting, for that digest")
    command.add_argument(
        "--minutes", type=number(above=0.0), default=MINUTES, help=f"up: of the robot's time (default {MINUTES:g})"
    )
    command.add_argument(
        "--wall-minutes",
        type=number(above=0.0),
        default=float("inf"),
        help="up: interrupt it after so many minutes of the wall clock (default: none)",
    )
    command.add_argument(
        "--speed", type=number(above=0.0), default=1.0, help="up: times real time of the robot (default 1)"
    )
    command.add_argument("--seed", type=whole_number(0), default=1, help="up: of the order of the clients (default 1)")
    command.add_argument("--json", metavar="FILE|-", help="the figures as JSON; - prints them and nothing else")
    return command


def main(arguments: list[str] | None = None) -> int:
    """0 when all was flat and the digests agree, 1 with a finding, 2 for a user's mistake."""
    options = parser().parse_args(arguments)
    try:
        target = json_target(options.json)
        with tempfile.TemporaryDirectory(prefix="ranger-sim-soak-") as folder:
            report: Callable[[str], None] = (lambda _text: None) if options.json == "-" else _print
            place = pathlib.Path(folder)
            if options.kind == "walk":
                figures = soak_walk(options.distance, options.digest, options.twice, place, report)
            else:
                figures = soak_up(options.minutes, options.wall_minutes, options.speed, options.seed, place, report)
    except UserError as mistake:
        print(f"{COMMAND}: {mistake}", file=sys.stderr)
        return 2
    except Finding as finding:
        print(f"{COMMAND}: {options.kind}: {finding}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{COMMAND}: interrupted", file=sys.stderr)
        return 130
    text = json.dumps(figures, indent=2)
    if target is not None:
        replace_file(target, (text + "\n").encode())
    if options.json != "-":
        text = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in figures.items())
    print(text)
    return 0


def _print(text: str) -> None:
    print(text, flush=True)


if __name__ == "__main__":
    sys.exit(main())
