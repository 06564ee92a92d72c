"""`ranger-sim bench floods`: the robot in real time while a client writes as fast as it can and reads nothing.

A flood is one way of using one door (attach, slcan, socketcand, control, the data link) without end. Measured are the
robot's pace by the wall clock, the processor time of the body's process for a second of the robot, and how much memory
grew; beside them the same robot left in peace, and beside a program that touches no door and only keeps a processor
busy, as every flood does too.

A pace says something only where the undisturbed robot keeps it. A machine with few processors cannot hold ten busy
programs at real time, so there the robot runs slower (`speed_for`), and each flood is given as a share of the
undisturbed pace at the same speed.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import multiprocessing
import os
import re
import signal
import socket
import statistics
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from ranger_sim.can_bus.edge import attach_records as wire
from ranger_sim.foundation import descriptors, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import control
from ranger_sim.tools.robodaq.codec import write_packet

PEACE, BUSY, ALL = "nobody", "a busy program, no door", "attach, slcan and socketcand at once"
FRAMES_IN_WINDOW = "attach SEND, answers read"
HELD = 0.99  # share of the undisturbed pace that a flood leaves: issue 16
PROGRAMS = 10  # boards, body, supervisor, and who floods; chosen by us: with a processor for each, real time is held
CHUNK = 1 << 16  # bytes offered at once: what a socket takes
SETTLE_S = 1.0  # from the first bytes of a flood to the first look, and from its end to the next; chosen by us
PATIENCE_S = 60.0  # for a robot that starts, or ends, on a busy machine
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
PAGE_KB = os.sysconf("SC_PAGE_SIZE") // 1024


@dataclasses.dataclass(frozen=True)
class Doors:
    """Where the robot under test can be reached."""

    name: str
    terminal: str
    port: int
    data_link: str
    xcp: int


# --- ways in: each gives something with a file number that bytes can be written to -----------------------


def attached(doors: Doors) -> socket.socket:
    """A client of the attach protocol on can1."""
    hello = wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0) + b"can1")
    return _local(wire.SOCKET_PREFIX + doors.name, hello)


def unknown(doors: Doors) -> socket.socket:
    """A connection to the attach protocol that has not said who it is."""
    return _local(wire.SOCKET_PREFIX + doors.name, b"")


def daemon(doors: Doors) -> socket.socket:
    """A client of socketcand on can1."""
    client = socket.create_connection(("127.0.0.1", doors.port))
    client.sendall(b"< open can1 >< rawmode >")
    return client


def asking(doors: Doors) -> socket.socket:
    """A client of the supervisor."""
    return _local(control.address(doors.name), b"")


def _local(address: str, greeting: bytes) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.connect(address)
    client.sendall(greeting)
    return client


def calibrating(doors: Doors) -> socket.socket:
    """The XCP master that has the place."""
    client = stranger(doors)
    client.send(xcp_packets(b"\xff\x00"))
    return client


def stranger(doors: Doors) -> socket.socket:
    """Somebody who sends datagrams to the XCP slave."""
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.connect(("127.0.0.1", doors.xcp))
    return client


def xcp_packets(*packets: bytes) -> bytes:
    """A datagram of them."""
    return b"".join(struct.pack("<HH", len(each), 0) + each for each in packets)


def line(doors: Doors) -> int:
    """The pseudo-terminal of slcan, its channel open."""
    return _terminal(doors.terminal, b"O\r")


def computer(doors: Doors) -> int:
    """The pseudo-terminal of the data link."""
    return _terminal(doors.data_link, b"")


def _terminal(path: str, greeting: bytes) -> int:
    number = os.open(path, os.O_RDWR | os.O_NOCTTY)
    os.write(number, greeting)
    return number


# --- floods ----------------------------------------------------------------------------------------------

Way = Callable[[Doors], "socket.socket | int"]


@dataclasses.dataclass(frozen=True)
class Flood:
    """`piece` over and over through `way`; an empty one: connections, opened and kept. clients: as many at once.

    whole: a piece is one datagram.
    """

    way: Way
    piece: bytes
    clients: int = 1
    whole: bool = False


def asked(**request: object) -> bytes:
    """A line of the supervisor's."""
    return json.dumps(request).encode() + b"\n"


FLOODS = {
    "attach CONTROL take part": Flood(attached, wire.record(wire.CONTROL, bytes([wire.ACTIVATE]))),
    "attach CONTROL listen": Flood(attached, wire.record(wire.CONTROL, bytes([wire.LISTEN]))),
    "attach CONTROL both": Flood(attached, b"".join(wire.record(wire.CONTROL, bytes([wish])) for wish in (2, 1))),
    "attach CONTROL flush": Flood(attached, wire.record(wire.CONTROL, bytes([wire.FLUSH]))),
    "attach SEND": Flood(attached, wire.send_record(0x7FF, 8, 1, 2)),
    "attach HELLO for channels": Flood(
        unknown, wire.record(wire.HELLO, wire.HELLO_BODY.pack(wire.MAGIC, wire.VERSION, 0))
    ),
    "attach connections": Flood(unknown, b""),
    "attach CONTROL, 64 clients": Flood(attached, wire.record(wire.CONTROL, bytes([wire.ACTIVATE])), 64),
    "slcan V": Flood(line, b"V\r"),
    "slcan F": Flood(line, b"F\r"),
    "slcan O and C": Flood(line, b"C\rO\r"),
    "slcan t": Flood(line, b"t7FF81122334455667788\r"),
    "slcan nonsense": Flood(line, b"?" * 40 + b"\r"),
    "socketcand echo": Flood(daemon, b"< echo >"),
    "socketcand send": Flood(daemon, b"< send 7ff 8 1 2 3 4 5 6 7 8 >"),
    "socketcand nonsense": Flood(daemon, b"< x >"),
    "socketcand connections": Flood(daemon, b""),
    "control status": Flood(asking, asked(do="status")),
    "control set": Flood(asking, asked(do="set", name="P_UI_LCD_TIME", value=500)),
    "control key": Flood(asking, asked(do="key", key=0)),
    "control resume": Flood(asking, asked(do="resume")),
    "control nonsense": Flood(asking, b"{}\n"),
    "control no line": Flood(asking, b"x"),
    "control connections": Flood(asking, b""),
    "xcp GET_STATUS": Flood(calibrating, xcp_packets(*[b"\xfd"] * 200), whole=True),
    "xcp SHORT_UPLOAD": Flood(calibrating, xcp_packets(*[b"\xf4\x04\0\0" + bytes(4)] * 100), whole=True),
    "xcp nonsense": Flood(calibrating, b"?" * 1000, whole=True),
    "xcp strangers": Flood(stranger, xcp_packets(b"\xfd"), 8, whole=True),
    "data link noise": Flood(computer, bytes(range(256))),
    "data link packets": Flood(computer, write_packet(388, 0x43FA0000)),  # P_UI_LCD_TIME = 500
}


TOGETHER = (FRAMES_IN_WINDOW, "slcan t", "socketcand send")  # the dearest of each door


def burn() -> None:
    """Keep a processor busy until killed."""
    while True:
        pass


def send_in_window(doors: Doors) -> None:
    """Frames as fast as the attach protocol lets them go, every answer read: until killed."""
    client, window, waiting, heard = attached(doors), 64, 0, bytearray()
    while True:
        client.sendall(wire.send_record(0x7FF, 8, 1, 2) * (window - waiting))
        waiting = window
        while waiting == window:
            heard += client.recv(CHUNK)
            while (record := wire.next_record(heard)) is not None:
                waiting -= record[0] in (wire.SENT, wire.DROPPED)


def pour(flood: Flood, doors: Doors) -> None:
    """Flood until killed. Where a connection is ended or refused, over a new one."""
    data = flood.piece if flood.whole else flood.piece * (CHUNK // max(1, len(flood.piece)))
    ends: list[socket.socket | int] = []
    while True:
        try:
            while len(ends) < flood.clients or not data:
                ends.append(flood.way(doors))
                os.set_blocking(_number(ends[-1]), False)
        except OSError:
            if not ends:
                continue
            if not data:
                _close(ends.pop(0))
        descriptors.wait([], [_number(each) for each in ends], 1.0)
        for place, each in enumerate(ends):
            try:
                os.write(_number(each), data)
            except BlockingIOError:
                continue
            except OSError:
                _close(ends.pop(place))
                break


def _number(end: socket.socket | int) -> int:
    return end if isinstance(end, int) else end.fileno()


def _close(end: socket.socket | int) -> None:
    if isinstance(end, int):
        os.close(end)
    else:
        end.close()


# --- the robot -------------------------------------------------------------------------------------------


class Robot:
    """A running `ranger-sim up` with every door open."""

    def __init__(self, speed: float) -> None:
        self.name = f"flood-{os.getpid()}"
        call = [sys.executable, "-m", "ranger_sim", "up", "--name", self.name, "--slcan", "can1", "--socketcand", "0"]
        self.process = subprocess.Popen(
            [*call, "--daq-port", "pty", "--xcp-udp", "0", "--speed", str(speed)],
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        self.said = ""
        self.doors = Doors(
            self.name,
            self._told(r"slcan: can1 is (\S+)"),
            int(self._told(r"socketcand: [\d.]+:(\d+)")),
            self._told(r"data link: ranger-sim daq --port (\S+)"),
            int(self._told(r"XCP on UDP: [\d.]+:(\d+)")),
        )
        self.status: dict = {}
        end = wallclock.monotonic_s() + PATIENCE_S
        while "time_s" not in self.status:
            if wallclock.monotonic_s() > end:
                raise RuntimeError(f"the robot does not start:\n{self.said}")
            with contextlib.suppress(UserError):
                self.status = control.ask(self.name, {"do": "status"})
            self._hear(0.05)

    def _hear(self, seconds: float) -> None:
        assert self.process.stderr is not None
        number = self.process.stderr.fileno()
        if descriptors.wait([number], [], seconds)[0]:
            self.said += os.read(number, 1 << 16).decode()

    def _told(self, pattern: str) -> str:
        end = wallclock.monotonic_s() + PATIENCE_S
        while not (match := re.search(pattern, self.said)):
            if self.process.poll() is not None or wallclock.monotonic_s() > end:
                raise RuntimeError(f"no {pattern!r} in:\n{self.said}")
            self._hear(0.1)
        return match.group(1)

    def moment(self) -> tuple[float, float]:
        """(wall clock, virtual time) at one instant, s, as the body's process tells it.

        (0, 0) when the robot has ended, or does not answer for PATIENCE_S: a flood may keep the supervisor busy.
        """
        end = wallclock.monotonic_s() + PATIENCE_S
        while wallclock.monotonic_s() < end and self.process.poll() is None:
            with contextlib.suppress(UserError):
                status = control.ask(self.name, {"do": "status"})
                return status["at_s"], status["time_s"]
            self._hear(0.1)
        return 0.0, 0.0

    def memory_kb(self) -> int:
        """Resident memory of the body's process and the supervisor."""
        return sum(_statm(number) for number in (self.status["plant"], self.process.pid))

    def body_cpu_s(self) -> float:
        """Processor time of the body's process so far."""
        with contextlib.suppress(OSError):
            fields = Path(f"/proc/{self.status['plant']}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / TICKS_PER_S
        return 0.0

    def wait(self, seconds: float) -> None:
        """Let it run, and read what it says."""
        end = wallclock.monotonic_s() + seconds
        while (left := end - wallclock.monotonic_s()) > 0.0:
            self._hear(left)
            if self.process.poll() is not None:
                return

    def close(self) -> None:
        """End it as Ctrl-C does, or by force."""
        with contextlib.suppress(ProcessLookupError):
            self.process.send_signal(signal.SIGINT)
        end = wallclock.monotonic_s() + PATIENCE_S
        while self.process.poll() is None and wallclock.monotonic_s() < end:
            self._hear(0.1)
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()


def _statm(process: int) -> int:
    with contextlib.suppress(OSError):
        return int(Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]) * PAGE_KB
    return 0


def programs(name: str, doors: Doors) -> list[tuple[Callable[..., None], tuple]]:
    """Who disturbs the robot by that name: what each program runs, and on what."""
    if name == PEACE:
        return []
    if name == BUSY:
        return [(burn, ())]
    if name == ALL:
        return [program for each in TOGETHER for program in programs(each, doors)]
    if name == FRAMES_IN_WINDOW:
        return [(send_in_window, (doors,))]
    return [(pour, (FLOODS[name], doors))]


NAMES = (PEACE, BUSY, *FLOODS, FRAMES_IN_WINDOW, ALL)


@contextlib.contextmanager
def flooded(name: str, doors: Doors) -> Iterator[None]:
    """While it lasts the programs of that name run."""
    context = multiprocessing.get_context("fork")
    running = [context.Process(target=what, args=on, daemon=True) for what, on in programs(name, doors)]
    for each in running:
        each.start()
    try:
        yield
    finally:
        for each in running:
            each.kill()
            each.join()


def speed_for(processors: int) -> float:
    """Times real time that a machine with so many processors holds beside a flood: 1 with one for each program.

    Two processors of an AMD EPYC held 0.76 of real time undisturbed (23 November 2026); with a quarter of real time
    the robot leaves two thirds of its processor free.
    """
    return 1.0 if processors >= PROGRAMS else 0.5 if processors >= PROGRAMS // 2 else 0.25


def measured(name: str, seconds: float, robot: Robot) -> dict:
    """One flood of so many seconds: pace, processor time per second of the robot, memory."""
    memory = robot.memory_kb()
    with flooded(name, robot.doors):
        robot.wait(SETTLE_S)
        (wall, virtual), cpu = robot.moment(), robot.body_cpu_s()
        robot.wait(seconds)
        (end_wall, end_virtual), end_cpu = robot.moment(), robot.body_cpu_s()
        end_memory = robot.memory_kb()
    passed, waited = end_virtual - virtual, end_wall - wall
    robot.wait(SETTLE_S)
    return {
        "flood": name,
        "seconds": waited,
        "pace": passed / waited if passed > 0.0 else 0.0,
        "cpu_per_s": (end_cpu - cpu) / passed if passed > 0.0 else None,
        "memory_mb": end_memory / 1024.0,
        "memory_growth_mb": (end_memory - memory) / 1024.0,
        "ended": robot.process.poll() is not None,
    }


def text_of(row: dict, undisturbed: float) -> str:
    """A line of the table; `undisturbed`: the pace of the robot left in peace."""
    cpu = "-" if row["cpu_per_s"] is None else f"{row['cpu_per_s']:.3f}"
    share = row["pace"] / undisturbed if undisturbed > 0.0 else 0.0
    return (
        f"{row['flood']:36} pace {row['pace']:.4f}, {100 * share:6.2f} % of undisturbed, "
        f"{cpu} s of processor per s of the robot, memory {row['memory_mb']:.0f} MB ({row['memory_growth_mb']:+.1f})"
        + (", ENDED" if row["ended"] else "")
    )


def verdict(rows: list[dict]) -> str:
    """How many floods left the robot its pace, and the one that took most of it."""
    undisturbed = statistics.mean(row["pace"] for row in rows if row["flood"] == PEACE)
    floods = [row for row in rows if row["flood"] not in (PEACE, BUSY)]
    if not floods or undisturbed <= 0.0:
        return "nothing to compare"
    held = sum(row["pace"] >= HELD * undisturbed for row in floods)
    worst = min(floods, key=lambda row: row["pace"])
    return (
        f"{held} of {len(floods)} floods leave at least {100 * HELD:.0f} % of the undisturbed pace; "
        f"the least is {100 * worst['pace'] / undisturbed:.2f} % ({worst['flood']})"
    )


def run(
    seconds: float,
    say: Callable[[str], None],
    names: tuple[str, ...] = (),
    speed: float | None = None,
    kept: Path | None = None,
) -> list[dict]:
    """Nobody, a busy program, then every flood (or those named), on one robot one after the other; a line each.

    speed: times real time; None: what `speed_for` says. kept: a file that gets each row when it is measured, and whose
    rows of an earlier, interrupted measurement are not measured again.
    """
    speed = speed_for(os.cpu_count() or 1) if speed is None else speed
    before = {row["flood"]: row for row in _rows(kept) if (row["speed"], row["asked_s"]) == (speed, seconds)}
    say(f"the robot at {speed:g} of real time, {seconds:g} s each")
    rows: list[dict] = []
    robot = None
    try:
        for name in names or NAMES:
            row = before.get(name)
            if row is None:
                robot = Robot(speed) if robot is None or robot.process.poll() is not None else robot
                row = {**measured(name, seconds, robot), "speed": speed, "asked_s": seconds}
                if kept is not None:
                    with kept.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(row) + "\n")
            rows.append(row)
            say(text_of(row, rows[0]["pace"] if rows[0]["flood"] == PEACE else 0.0))
    finally:
        if robot is not None:
            robot.close()
    if rows[0]["flood"] == PEACE:
        say(verdict(rows))
    return rows


def _rows(kept: Path | None) -> list[dict]:
    if kept is None or not kept.exists():
        return []
    return [json.loads(line) for line in kept.read_text(encoding="utf-8").splitlines()]
