"""`ranger-sim panel`: choose the source and serve it to the browser."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import importlib
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

from ranger_sim.can_bus.edge.peers import listening_address
from ranger_sim.foundation import systems, wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes import kernel
from ranger_sim.tools.command_line import terminal
from ranger_sim.tools.command_line.units import number, whole_number, word
from ranger_sim.tools.recordings import datasets

PORT = 8311  # chosen by us: among the ports that IANA has not assigned
HERE = "127.0.0.1"
START_S = 60.0  # an interpreted robot takes this long to start
POLL_S = 0.05
END_S = 10.0
GIVES_WAY = 5  # steps of nice(2) below the robot's processes; chosen by us: a third of their weight


def register(commands: Any) -> None:
    """Add the subcommand."""
    command = commands.add_parser(
        "panel",
        description="Without RECORDING: the robot that `up` runs (--name), a new one (--walk), or a serial port "
        "with the data link (--port). A second RECORDING is laid over the first.",
    )
    command.add_argument(
        "recordings", nargs="*", metavar="RECORDING", help="a walk's folder, MF4, CSV, RoboDAQ's text, candump"
    )
    datasets.add_options(command)
    command.add_argument(
        "--shift", type=number(), default=0.0, metavar="S", help="seconds by which the second one is later"
    )
    command.add_argument(
        "--align",
        type=word("an event"),
        metavar="EVENT",
        help="lay the second over the first so that this happens at the same time, e.g. 'FSM_HIP = 3'",
    )
    command.add_argument(
        "--name", type=word("a name"), default="ranger", help="the robot that `up` runs (default ranger)"
    )
    command.add_argument("--walk", action="store_true", help="start a robot for the panel; it ends with the panel")
    command.add_argument("--port", metavar="PORT", help="a serial port with the data link, real or of `up --daq-port`")
    command.add_argument("--host", default=HERE, help=f"address to listen on (default {HERE})")
    command.add_argument(
        "--http-port", type=whole_number(0, 65535), default=PORT, metavar="N", help=f"default {PORT}; 0: a free one"
    )
    command.add_argument(
        "--allow-network", action="store_true", help="let --host be beyond this machine; who has the token may then act"
    )
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    console = terminal.console(stderr=True)

    def report(text: str) -> None:
        console.print(text, highlight=False, soft_wrap=True)

    wanted = bool(options.recordings) + bool(options.walk) + bool(options.port)
    if wanted > 1:
        raise UserError("panel: RECORDING, --walk and --port exclude each other")
    if len(options.recordings) > 2:
        raise UserError(f"panel: {len(options.recordings)} recordings; one, or two over each other, are possible")
    if options.align and len(options.recordings) != 2:
        raise UserError("panel: --align lays two recordings over each other")
    for library in ("uvicorn", "h11", "websockets", "ranger_sim.tools.panel.server"):
        importlib.import_module(library)  # before any process starts, and before a robot takes the processors
    address = listening_address(options.host, f"panel on {options.host}", options.allow_network)
    with contextlib.ExitStack() as stack:
        listener = stack.enter_context(listening(address, options.http_port))
        source = stack.enter_context(source_of(options, report))
        return serve(source, listener, options.host, report)


@contextlib.contextmanager
def source_of(options: argparse.Namespace, report: Any) -> Iterator[Any]:
    """The source that the options select."""
    if options.recordings:
        from ranger_sim.tools.panel.recording import Event, RecordingSource

        align = Event.typed(options.align) if options.align else None
        how = datasets.how_of(options)
        words = datasets.again(options)
        with contextlib.closing(RecordingSource(options.recordings, how, options.shift, align, words)) as recording:
            yield recording
    elif options.port:
        from ranger_sim.tools.panel.link import LinkSource

        with contextlib.closing(LinkSource(options.port)) as link:
            yield link
    elif options.walk:
        systems.require_linux(
            "panel: boards as processes", "eventfd, abstract sockets", "it opens recordings everywhere"
        )
        with own_robot(report) as source:
            os.nice(GIVES_WAY)
            yield source
    else:
        from ranger_sim.tools.panel.robot import RobotSource

        source = RobotSource(options.name)
        os.nice(GIVES_WAY)
        yield source


@contextlib.contextmanager
def own_robot(report: Any) -> Iterator[Any]:
    """A robot that walks in real time until the panel ends, for any reason."""
    from ranger_sim.tools.panel.robot import RobotSource

    name, parent = f"panel-{os.getpid()}", os.getpid()
    command = [sys.executable, "-m", "ranger_sim", "up", "--name", name]
    with tempfile.TemporaryFile("w+", prefix="ranger-sim-") as errors:
        robot = subprocess.Popen(
            command,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            start_new_session=True,  # this process handles Ctrl-C
            preexec_fn=lambda: kernel.die_with_parent(parent),
        )
        try:
            end_s = wallclock.monotonic_s() + START_S
            while True:
                try:
                    source = RobotSource(name)
                    break
                except UserError:
                    if robot.poll() is not None:
                        errors.seek(0)
                        lines = errors.read().strip().splitlines()
                        raise UserError(
                            f"panel: the robot did not start: {lines[-1] if lines else 'no word'}"
                        ) from None
                    if wallclock.monotonic_s() > end_s:
                        raise UserError(f"panel: the robot was not there after {START_S:.0f} s") from None
                    wallclock.sleep_s(POLL_S)
            report(f"a robot walks in real time, name {name}")
            yield source
        finally:
            robot.terminate()
            try:
                robot.wait(timeout=END_S)
            except subprocess.TimeoutExpired:
                robot.kill()
                robot.wait()


@contextlib.contextmanager
def listening(address: str, port: int) -> Iterator[socket.socket]:
    """A socket for the browser's requests. UserError if unavailable."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    # TCP is named because asyncio sends small messages at once (TCP_NODELAY) only then; else each picture waits 40 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    with contextlib.closing(listener):
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((address, port))
        except OSError as error:
            raise UserError(f"panel on {address}:{port}: {error.strerror} (--http-port chooses another)") from None
        listener.listen()
        yield listener


def serve(source: Any, listener: socket.socket, host: str, report: Any) -> int:
    """Serve until Ctrl-C, or until the robot has ended and all pages have disconnected."""
    from ranger_sim.tools.panel.server import PanelServer, new_token

    address, port = listener.getsockname()[:2]
    token = new_token()
    names = (
        (HERE, "localhost", host, address)
        if address in (HERE, "::1")
        else (HERE, "localhost", host, address, socket.gethostname())
    )
    panel = PanelServer(source, token, names, report)
    shown = HERE if address in ("0.0.0.0", "::") else address
    with contextlib.suppress(KeyboardInterrupt):
        report(f"{source.title}: http://{shown}:{port}/?token={token}   (Ctrl-C ends it)")
        asyncio.run(http_server(panel).serve(sockets=[listener]))
    if panel.refused:
        report("panel: refused: " + ", ".join(f"{count} {why}" for why, count in panel.refused.items()))
    return 0


def http_server(panel: Any) -> Any:
    """The HTTP server (uvicorn.Server)."""
    import uvicorn

    from ranger_sim.tools.panel.server import LONGEST_REQUEST

    config = uvicorn.Config(
        panel.app,
        http=panel.connections.protocol,
        log_level="critical",
        access_log=False,
        ws="websockets-sansio",
        ws_max_size=LONGEST_REQUEST,
        ws_per_message_deflate=False,  # it would cost both sides more than it saves on the kilobytes of a picture
        ws_ping_interval=10.0,
        ws_ping_timeout=20.0,
        timeout_graceful_shutdown=1,
        h11_max_incomplete_event_size=16384,
    )
    return uvicorn.Server(config)
