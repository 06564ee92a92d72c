"""What the commands listen on, from the system's own lists, and what another user gets there.

python -m tests.system.listeners     # the table, as root
"""

import ast
import collections
import concurrent.futures
import contextlib
import dataclasses
import json
import os
import pathlib
import re
import subprocess
import sys
import threading

from ranger_sim.foundation import wallclock
from tests.terminals import Terminal

ROOT = pathlib.Path(__file__).parents[2]
STRANGER = 65534  # the user without rights of every Linux
LISTENS = "0A"  # of /proc/net/tcp
ACCEPTS = 0x10000  # __SO_ACCEPTCON, of /proc/net/unix
WAITS_S = 5.0  # of the stranger, for a byte; a robot that is behind its time polls rarely

# Another user, who connects to each and reports what came. It is root until everything is imported.
STRANGERS_PROGRAM = """\
import encodings.idna, errno, json, os, socket, ssl, sys
wanted, user, waits_s = json.load(sys.stdin)
os.setgroups([])
os.setresgid(user, user, user)
os.setresuid(user, user, user)

def connected(kind, place):
    if kind == "unix":
        link = socket.socket(socket.AF_UNIX)
        link.settimeout(waits_s)
        link.connect("\\0" + place[1:] if place.startswith("@") else place)
    else:
        link = socket.socket(socket.AF_INET)
        link.settimeout(waits_s)
        link.connect(("127.0.0.1", int(place)))
    return link

def answer(kind, place):
    if kind == "terminal":
        os.close(os.open(place, os.O_RDWR | os.O_NOCTTY))
        return "open"
    if kind == "udp":
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.settimeout(waits_s)
        link.sendto(bytes([2, 0, 0, 0, 0xFF, 0]), ("127.0.0.1", int(place)))  # XCP: CONNECT
        return f"{len(link.recv(4096))} bytes"
    link = connected(kind, place)
    try:
        data = link.recv(65536)
    except TimeoutError:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        with connected(kind, place) as plain:
            try:
                with context.wrap_socket(plain) as secret:
                    return "TLS, then " + (f"{len(data)} bytes" if (data := secret.recv(65536)) else "closed")
            except ssl.SSLError as error:
                if "CERTIFICATE_REQUIRED" in str(error) or "HANDSHAKE_FAILURE" in str(error):
                    return "certificate required"
        return "open"
    return f"{len(data)} bytes" if data else "closed"

for kind, place in wanted:
    try:
        found = answer(kind, place)
    except TimeoutError:
        found = "open" if kind != "udp" else "silent"
    except OSError as error:
        found = {"ECONNRESET": "closed", "EACCES": "not permitted"}.get(
            errno.errorcode.get(error.errno), str(error))
    print(json.dumps(found), flush=True)
"""
REFUSALS = ("closed", "not permitted", "silent", "certificate required")


@dataclasses.dataclass(frozen=True)
class Command:
    """words: of the command line; shown: what it prints once it listens; listens: {kind: number of endpoints}; what:
    {kind: which they are}, for the document.
    """

    words: tuple[str, ...]
    shown: str
    listens: dict[str, int]
    what: dict[str, str]
    settles_s: float = 0.5  # after which it has opened the rest; chosen by us
    module: str = "ranger_sim"


COMMANDS = {
    "bus": Command(
        ("bus", "demo", "--name", "listened-bus", "--slcan", "demo", "--socketcand", "0"),
        "Ctrl-C ends",
        {"unix": 1, "tcp": 1, "terminal": 1},
        {"unix": "attach", "tcp": "socketcand", "terminal": "slcan"},
    ),
    "up": Command(
        ("up", "--name", "listened-up", "--speed", "0.1", "--no-real-time", "--slcan", "can1", "--socketcand", "0")
        + ("--xcp-udp", "0", "--daq-port", "pty", "--imu-offer", "pty", "--out", "kept"),
        "steps",
        {"unix": 3, "tcp": 1, "udp": 1, "terminal": 3},
        {
            "unix": "attach, `ctl`, feed",
            "tcp": "socketcand",
            "udp": "XCP",
            "terminal": "slcan, data link, inertial unit",
        },
        3.0,
    ),
    "panel of a recording": Command(
        ("panel", "recording.csv", "--http-port", "0"), "token=", {"tcp": 1}, {"tcp": "HTTP"}
    ),
    "panel --walk": Command(
        ("panel", "--walk", "--http-port", "0"),
        "token=",
        {"unix": 3, "tcp": 1},
        {"unix": "attach, `ctl`, feed", "tcp": "HTTP"},
    ),
    "trace open": Command(("trace", "open", "run.pftrace", "--no-browser"), "http", {"tcp": 1}, {"tcp": "HTTP"}),
    "campaign, of processes": Command(
        ("campaign", str(ROOT / "campaigns" / "sensors.toml"), "--pool", "local", "--out", "kept"), "0/", {}, {}
    ),
    "campaign, of Dask": Command(
        ("campaign", str(ROOT / "campaigns" / "sensors.toml"), "--pool", "dask", "--jobs", "1", "--out", "kept"),
        "0/",
        {"tcp": 3},
        {"tcp": "scheduler, worker, nanny (TLS)"},
        3.0,
    ),
    "a debugger's port": Command(("0",), " at ", {"tcp": 1}, {"tcp": "gdb"}, module="tests.firmware_sim.gdb.machine"),
}

# Modules that open an endpoint, and the entry above that starts them.
OPENED_BY = {
    "can_bus/edge/attach.py": "bus",
    "can_bus/edge/peers.py": "bus",
    "can_bus/edge/socketcand.py": "bus",
    "firmware_sim/gdb/server.py": "a debugger's port",
    "harness/campaigns/dask_cluster.py": "campaign, of Dask",
    "harness/processes/control.py": "up",
    "harness/xcp/udp.py": "up",
    "ranger/feed.py": "up",
    "tools/panel/command.py": "panel of a recording",
    "tools/timing/trace_server.py": "trace open",
}
OPENING = {"openpty", "create_server", "start_server", "start_unix_server", "LocalCluster"}  # and bind(address)


def opens_an_endpoint(source):
    """Whether a module calls one of these, or is a scheduler of Dask."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in OPENING or (name == "bind" and len(node.args) == 1):
                return True
        elif isinstance(node, ast.ClassDef) and "distributed.Scheduler" in map(ast.unparse, node.bases):
            return True
    return False


def processes(session):
    """The processes of a session and all their descendants, in whatever session."""
    parents = {}
    for each in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = each.read_text(errors="replace").rpartition(")")[2].split()
            parents[int(each.parent.name)] = (int(fields[1]), int(fields[3]))
    found = {number for number, (_, of) in parents.items() if of == session}
    while more := {number for number, (parent, _) in parents.items() if parent in found} - found:
        found |= more
    return found


def endpoints(numbers):
    """[(kind, place)] on which these processes listen: sockets of the system's lists, and terminals they made."""
    inodes, terminals = set(), []
    for number in numbers:
        for each in pathlib.Path(f"/proc/{number}/fd").glob("*"):
            with contextlib.suppress(OSError):
                link = os.readlink(each)
                if found := re.fullmatch(r"socket:\[(\d+)\]", link):
                    inodes.add(found[1])
                elif link.endswith("/ptmx"):
                    information = pathlib.Path(f"/proc/{number}/fdinfo/{each.name}").read_text()
                    terminals += re.findall(r"tty-index:\s*(\d+)", information)
    found = [("terminal", f"/dev/pts/{index}") for index in sorted(set(terminals), key=int)]
    for kind, table in (("tcp", "tcp"), ("tcp", "tcp6"), ("udp", "udp"), ("udp", "udp6")):
        for line in pathlib.Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            cells = line.split()
            if cells[9] in inodes and (kind == "udp" or cells[3] == LISTENS):
                found.append((kind, str(int(cells[1].rpartition(":")[2], 16))))
    for line in pathlib.Path("/proc/net/unix").read_text().splitlines()[1:]:
        cells = line.split()
        if cells[6] in inodes and int(cells[3], 16) & ACCEPTS and len(cells) > 7:
            found.append(("unix", cells[7]))
    return found


def prepare(folder):
    """The files that commands open, in this folder."""
    (folder / "recording.csv").write_text("t_s,x_m\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(500)))
    trace = ["walk", "--time", "0.1s", "--out", "walked", "--log", "none", "--trace", "run.pftrace"]
    subprocess.run([sys.executable, "-m", "ranger_sim", *trace], cwd=folder, check=True, capture_output=True)


KINDS = {"unix": "local socket", "tcp": "TCP port", "udp": "UDP port", "terminal": "pseudo-terminal"}
SHOWN = {"silent": "no answer", "certificate required": "a certificate is required, of root as well"}
DOCUMENT = ROOT / "docs" / "interfaces.md"


def rows(title, found, got):
    """The rows of a command in the document: found: its endpoints; got: what another user got at each."""
    command = COMMANDS[title]
    made = []
    for kind, count in kinds(found).items():
        here = sorted({SHOWN.get(answer, answer) for (of, _), answer in zip(found, got, strict=True) if of == kind})
        plural = "s" if count > 1 else ""
        made.append(f"| {title} | {count} {KINDS[kind]}{plural} | {command.what[kind]} | {'; '.join(here)} |")
    return made or [f"| {title} | none | | |"]


def documented(title):
    """The rows that the document has for a command."""
    lines = DOCUMENT.read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line.startswith(f"| {title} | ")]


def kinds(found):
    """{kind: how many}"""
    return dict(collections.Counter(kind for kind, _ in found))


def answers(wanted, user=STRANGER):
    """What this user gets at each of the endpoints."""
    done = subprocess.run(
        [sys.executable, "-c", STRANGERS_PROGRAM],
        input=json.dumps([wanted, user, WAITS_S]),
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=60 + 3 * WAITS_S * len(wanted),
    )
    return [json.loads(line) for line in done.stdout.splitlines()]


@contextlib.contextmanager
def listening(command, folder):
    """The endpoints of a command that runs in this folder."""
    with Terminal(*command.words, folder=folder, module=command.module) as terminal:
        terminal.until(command.shown)
        ends = threading.Event()

        def drain():
            """A terminal that is not read stops the program that writes to it."""
            while not ends.is_set():
                terminal.read(0.1)

        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            pool.submit(drain)
            try:
                wallclock.sleep_s(command.settles_s)
                yield endpoints(processes(terminal.process))
            finally:
                ends.set()


if __name__ == "__main__":
    import tempfile

    with tempfile.TemporaryDirectory() as name:
        prepare(pathlib.Path(name))
        print("| command | listens on | | another user gets |\n|---|---|---|---|")
        for title, command in COMMANDS.items():
            with listening(command, pathlib.Path(name)) as found:
                print("\n".join(rows(title, found, answers(found))), flush=True)
                if refused := [where for where, got in zip(found, answers(found, 0), strict=True) if got in REFUSALS]:
                    print(f"(root is refused at {refused})", file=sys.stderr)
