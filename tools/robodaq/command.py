"""`ranger-sim daq`: log a robot over its serial line, see its errors, read and write its parameters.

It ends after `--time`; without it when every request (`--read`, `--write`, `--load`, `--save`) is done; without any
request, with Ctrl-C.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import select
from typing import TYPE_CHECKING, Any

from rich.console import Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from ranger_sim.boards.main_brain import controllers
from ranger_sim.datatable import parameters
from ranger_sim.datatable.generated import all_variables
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.outside.serial_ports import BLUETOOTH_BAUD, DAQ_BAUD, RealPort, reason_of
from ranger_sim.tools.command_line import interrupts, streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import TIMES, quantity, whole_number
from ranger_sim.tools.robodaq import catalogue, logs, parameter_files
from ranger_sim.tools.robodaq.session import Session

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ranger_sim.tools.robodaq.codec import Point

POLL_S = 0.02  # between two polls of the port when no data arrive
SHOW_S = 0.25  # between two updates of the picture on a terminal
LINE_S = 5.0  # between two lines without a terminal
TIMEOUT_S = 10.0  # for a request without an answer
SHOWN_CHANNELS, SHOWN_ERRORS = 16, 6  # lines of the picture


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "daq",
        description="The computer's end of the robot's data link. Without --time it ends when every request is "
        "done, or with Ctrl-C.",
    )
    command.add_argument("--port", required=True, help="serial port, pseudo-terminal, or a URL that pyserial knows")
    command.add_argument(
        "--link", choices=("wired", "bluetooth"), default="wired", help="921600 baud (default), or 460800 with RTS/CTS"
    )
    command.add_argument("--baud", type=whole_number(1), help="another baud rate")
    command.add_argument(
        "--fast",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="variables sent in every cycle in which they are new; patterns like 'MCH_*' are allowed",
    )
    command.add_argument(
        "--medium",
        nargs="+",
        action="extend",
        default=[],
        metavar="NAME",
        help="variables of which one is sent per cycle, if new",
    )
    command.add_argument(
        "--log",
        action="append",
        default=[],
        metavar="FILE",
        help="store received values: FILE.txt in RoboDAQ's format, FILE.mf4 as `walk` writes it (repeatable)",
    )
    command.add_argument(
        "--read", nargs="+", action="extend", default=[], metavar="NAME", help="wait for a fresh value and print it"
    )
    command.add_argument(
        "--write", nargs="+", action="extend", default=[], metavar="NAME=VALUE", help="set parameters of the robot"
    )
    command.add_argument(
        "--load", metavar="FILE", help="set all parameters of a file (.txt, .toml) or of a parameter set by name"
    )
    command.add_argument(
        "--save",
        metavar="FILE",
        help="write all parameters of the robot to a file: .txt, or .toml for `walk --controller`",
    )
    command.add_argument(
        "--base",
        default="robust",
        metavar="NAME",
        help="parameter set whose values a saved .toml leaves out (default robust)",
    )
    command.add_argument("--time", type=quantity(TIMES, "s", 0.0), metavar="60s", help="end after this time")
    command.add_argument(
        "--timeout",
        type=quantity(TIMES, "s", 0.0),
        default=TIMEOUT_S,
        metavar="10s",
        help="time to wait for an answer (default 10s)",
    )
    command.add_argument(
        "--json", metavar="FILE|-", help="file for the received values as JSON; - prints them and nothing else"
    )
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Carry out the requests; 0 done, 1 the port was lost or a request was not answered, 130 interrupted."""
    json_file = json_target(options.json)
    session = Session()
    asked = Asked(session, options)  # everything is checked before the port is opened
    with contextlib.ExitStack() as stack:
        port = RealPort(
            options.port,
            options.baud or (BLUETOOTH_BAUD if options.link == "bluetooth" else DAQ_BAUD),
            options.link == "bluetooth",
        )
        stack.callback(port.close)
        kept = [stack.enter_context(contextlib.closing(logs.open_log(name))) for name in options.log]

        def on_point(point: Point) -> None:
            for log in kept:
                log.on_point(point)

        session.on_point = on_point
        view = View(session, asked, options)
        interrupted = stack.enter_context(interrupts.noted())
        with view.shown():
            lost = work(session, asked, port, options, view, interrupted)
    return finish(session, asked, options, json_file, view, lost, bool(interrupted))


class Asked:
    """The requests of the command line. UserError for an invalid name, value or file."""

    def __init__(self, session: Session, options: argparse.Namespace) -> None:
        self.fast = [row for pattern in options.fast for row in catalogue.match(pattern)]
        self.medium = [row for pattern in options.medium for row in catalogue.match(pattern)]
        self.written: dict[str, float] = {}
        if options.load:
            self.written.update(parameter_files.load(options.load))
        for text in options.write:
            name, equals, number = text.partition("=")
            try:
                value = float(number)
            except ValueError:
                equals = ""
            if not equals:
                raise UserError(f"--write {text!r}: NAME=VALUE with a number is expected")
            parameters.checked_word(parameters.parameter(name), value)
            self.written[name] = value
        self.read = list(dict.fromkeys(parameters.find(name).name for name in options.read))
        self.save = parameter_files.check_target(options.save) if options.save else None
        self.saved = [row.name for row in parameters.parameters()] if self.save else []
        if self.save:
            controllers.load(options.base)
        session.select(self.fast, self.medium)
        for name, value in self.written.items():
            session.write(name, value)
        self.asked_to_read = False

    def anything(self) -> bool:
        """True if there is a request that can be completed."""
        return bool(self.written or self.read or self.save)

    def after_writing(self, session: Session) -> bool:
        """When everything is written, request the values to read them back; True when all is done."""
        if session.writes:
            return False
        if not self.asked_to_read:
            self.asked_to_read = True
            for name in (*self.read, *self.saved):
                session.read(name)
        return not session.reads


def work(
    session: Session,
    asked: Asked,
    port: RealPort,
    options: argparse.Namespace,
    view: View,
    interrupted: list[bool],
) -> str:
    """Transfer bytes until the session is over; returns why the port was lost, or nothing."""
    started = now = answered = wallclock.monotonic_s()
    unsent = b""
    left = len(session.writes) + len(session.reads)
    while not interrupted:
        if options.time is not None:
            if now - started >= options.time:
                break
        elif asked.anything() and (asked.after_writing(session) or now - answered > options.timeout):
            break
        try:
            select.select(port.filenos(), [], [], POLL_S)
            data = port.read(1 << 16)
            now = wallclock.monotonic_s()
            session.receive(data, now)
            unsent += session.outgoing(now) if not unsent else b""
            if unsent:
                unsent = unsent[port.write(unsent) :]
        except (OSError, ValueError) as error:
            return reason_of(error)
        if options.time is not None:
            asked.after_writing(session)
        remaining = len(session.writes) + len(session.reads)
        if remaining != left:
            left, answered = remaining, now
        view.update(now)
    return ""


class View:
    """Prints errors as they occur; on a terminal a picture below them, elsewhere a line at intervals."""

    def __init__(self, session: Session, asked: Asked, options: argparse.Namespace) -> None:
        self.session = session
        self.options = options
        self.console = terminal.console(stderr=True, quiet=options.json == "-")
        self.live: Live | None = None
        self.started = self.shown_s = self.line_s = wallclock.monotonic_s()
        self.shown_counts: dict[int, int] = {}
        self.shown_points = 0
        self.rates: dict[int, float] = {}
        self.points_per_s = 0.0
        self.channels = list(dict.fromkeys(row.id for row in (*asked.fast, *asked.medium)))

    @contextlib.contextmanager
    def shown(self) -> Iterator[None]:
        """Show the picture on the terminal inside the context."""
        if self.console.is_terminal and not self.console.quiet:
            with Live(self.picture(self.started), console=self.console, auto_refresh=False, transient=True) as live:
                self.live = live
                yield
        else:
            yield

    def update(self, now: float) -> None:
        """Print new errors, and the picture when it is due."""
        while self.session.new_errors:
            line, count = self.session.new_errors.popleft()
            self.console.print(
                f"{line.stamp / 1000:.3f} s  error of {line.board}: {line.name} x {count} "
                f"(in all {line.count}): {line.text}",
                highlight=False,
                soft_wrap=True,
            )
        if now - self.shown_s >= (SHOW_S if self.live is not None else LINE_S):
            seconds = now - self.shown_s
            self.points_per_s = (self.session.points - self.shown_points) / seconds
            self.rates = {n: (self.session.counts[n] - self.shown_counts.get(n, 0)) / seconds for n in self.channels}
            self.shown_counts = {n: self.session.counts[n] for n in self.channels}
            self.shown_points = self.session.points
            self.shown_s = now
            if self.live is not None:
                self.live.update(self.picture(now), refresh=True)
            else:
                self.console.print(self.line(now), highlight=False, soft_wrap=True)

    def line(self, now: float) -> str:
        """The state in one line."""
        session, count = self.session, self.session.counters()
        clock = "-" if session.clock_ms is None else f"{session.clock_ms / 1000:.1f} s"
        text = (
            f"{session.state(now)}; robot time {clock}; {self.points_per_s:.0f} points/s, {count['points']} in all; "
            f"bad checksums {count['bad_checksums']}, bytes skipped {count['skipped_bytes']}; "
            f"gaps {count['gaps']}, longest {count['longest_gap_ms']} ms"
        )
        waiting = session.pending()
        if waiting:
            text += (
                f"; waiting for {', '.join(waiting[:3])}{f' and {len(waiting) - 3} more' if len(waiting) > 3 else ''}"
            )
        return text

    def picture(self, now: float) -> Group:
        """State, chosen channels, latest errors."""
        parts: list[Any] = [Text(self.line(now))]
        if self.channels:
            table = Table("channel", "value", "unit", "per s")
            for number in self.channels[:SHOWN_CHANNELS]:
                word = self.session.values.get(number)
                table.add_row(
                    all_variables.NAMES[number],
                    "-" if word is None else f"{catalogue.value_of(number, word[0]):.6g}",
                    all_variables.UNITS[number],
                    f"{self.rates.get(number, 0.0):.0f}",
                )
            parts.append(table)
            if len(self.channels) > SHOWN_CHANNELS:
                parts.append(Text(f"and {len(self.channels) - SHOWN_CHANNELS} more channels"))
        if self.session.errors:
            table = Table("board", "error", "count", "last", "text")
            for line in list(self.session.errors.values())[: -SHOWN_ERRORS - 1 : -1]:
                table.add_row(line.board, line.name, str(line.count), f"{line.stamp / 1000:.3f} s", line.text)
            parts.append(table)
        return Group(*parts)


def finish(
    session: Session,
    asked: Asked,
    options: argparse.Namespace,
    json_file: Any,
    view: View,
    lost: str,
    interrupted: bool,
) -> int:
    """Save, print the values read, report unanswered requests."""
    view.update(wallclock.monotonic_s())
    view.points_per_s = session.points / max(1e-9, wallclock.monotonic_s() - view.started)
    words = {name: session.values.get(all_variables.ID_OF[name]) for name in (*asked.read, *asked.saved)}
    answered = {name: word[0] for name, word in words.items() if word is not None} if asked.asked_to_read else {}
    missing = list(dict.fromkeys([*session.pending(), *(n for n in words if n not in answered)]))
    missing = [name for name in missing if name != "channels"]
    if asked.save is not None and not any(name not in answered for name in asked.saved):
        parameter_files.save(asked.save, {name: answered[name] for name in asked.saved}, options.base)
    answered_reads = [name for name in asked.read if name in answered]
    result = {
        "port": options.port,
        **session.counters(),
        "robot_time_s": None if session.clock_ms is None else session.clock_ms / 1000,
        "errors": [
            {"board": e.board, "error": e.name, "text": e.text, "count": e.count, "last_s": e.stamp / 1000}
            for e in reversed(session.errors.values())
        ],
        "read": {name: json_number(name, answered[name]) for name in answered_reads},
        "written": {name: value for name, value in asked.written.items() if name not in session.pending()},
        "not_answered": missing,
        "lost": lost or None,
    }
    text = json.dumps(result, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        for name in answered_reads:
            number = all_variables.ID_OF[name]
            print(f"{name} = {catalogue.text_of(number, answered[name])} {all_variables.UNITS[number]}".rstrip())
        view.console.print(view.line(wallclock.monotonic_s()), highlight=False, soft_wrap=True)
    if lost:
        view.console.print(f"ranger-sim daq: {options.port}: the port is gone: {lost}", highlight=False, soft_wrap=True)
    if missing:
        some = ", ".join(missing[:5]) + (f" and {len(missing) - 5} more" if len(missing) > 5 else "")
        view.console.print(f"ranger-sim daq: {options.port}: no answer for {some}", highlight=False, soft_wrap=True)
    if interrupted:
        return interrupts.EXIT_INTERRUPTED
    return 1 if lost or missing else 0


def json_number(name: str, word: int) -> float | int | None:
    """The value of a word for JSON, which has neither infinity nor NaN."""
    value = catalogue.value_of(all_variables.ID_OF[name], word)
    return value if math.isfinite(value) else None
