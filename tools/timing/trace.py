"""`ranger-sim trace`: view a timeline; and the options `--trace` of the commands that run a robot."""

from __future__ import annotations

import argparse
import contextlib
import math
import pathlib
import shlex
import urllib.parse
import webbrowser
from typing import TYPE_CHECKING, Any

from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.stop_rule import MOST_TIME_S
from ranger_sim.tools.command_line.files import replace_file
from ranger_sim.tools.command_line.options import Option, add_all
from ranger_sim.tools.command_line.units import TIMES, OrAll, quantity, word
from ranger_sim.tools.timing.trace_server import PORT, VIEWER, TraceServer

if TYPE_CHECKING:
    from rich.console import Console

    from ranger_sim.ranger.robot import Ranger
    from ranger_sim.ranger.timeline import Timeline

LONGEST_NAP_S = 1.0  # so that Ctrl-C acts soon; chosen by us
OPENED = (".pftrace", ".perfetto-trace")  # by `trace open`
SHOWN_S = 0.02  # around the time: ten slots of the main brain, chosen by us
DETAIL_S = 10.0  # a viewer in a browser opens 100 MB in seconds; chosen by us
KEPT_S = 1.0  # the part of a long trace in a page for offline use: some 10 MB


OPTIONS = (
    Option(
        "--trace",
        "write slots, interrupts, frames, signals, states and faults into FILE; repeatable, format by suffix: "
        ".pftrace (Perfetto), .vcd (bits), .mcap (body and signals)",
        word("a file"),
        "FILE",
        repeated=True,
        of_run=False,
    ),
    Option(
        "--trace-last",
        "keep only this many last seconds of virtual time",
        quantity(TIMES, "s", above=0.0, most=MOST_TIME_S),
        "10s",
        of_run=False,
    ),
    Option(
        "--trace-detail",
        "what boards, buses and links do: for this long before the end, and around the first faults; all: as long as "
        "the rest, 25 MB of disk a second (default 10s)",
        OrAll(quantity(TIMES, "s", above=0.0, most=MOST_TIME_S)),
        "10s",
        default=DETAIL_S,
        of_run=False,
    ),
)


def add_options(command: Any) -> None:
    """The options of every command that runs a robot and can record its timeline."""
    group = command.add_argument_group("timeline", "what happened, to be looked at with `ranger-sim trace open`")
    add_all(group, OPTIONS)


def paths_of(given: argparse.Namespace) -> list[pathlib.Path]:
    """The requested files."""
    return [pathlib.Path(name) for name in given.trace]


def check(given: argparse.Namespace) -> None:
    """UserError, before anything runs, for an impossible file."""
    if given.trace_last and not given.trace:
        raise UserError("--trace-last needs --trace FILE")
    if given.trace_detail != DETAIL_S and not given.trace:
        raise UserError("--trace-detail needs --trace FILE")
    for path in paths_of(given):
        from ranger_sim.harness.timeline import files

        files.check_target(path)


def attach(robot: Ranger, given: argparse.Namespace) -> Timeline | None:
    """Attach a timeline to `robot` if requested. UserError for an impossible file."""
    check(given)
    if not given.trace:
        return None
    from ranger_sim.ranger.timeline import Timeline

    return Timeline(robot, given.trace_last, None if math.isinf(given.trace_detail) else given.trace_detail)


def write(timeline: Timeline | None, given: argparse.Namespace, console: Console) -> None:
    """Write the requested files."""
    if timeline is None:
        return
    with console.status("writing the timeline ..."):
        for path in paths_of(given):
            timeline.write(path)
    timeline.close()
    for path in paths_of(given):
        how = f" (ranger-sim trace open {shlex.quote(str(path))})" if path.suffix in OPENED else ""
        console.print(f"timeline: {path}{how}", highlight=False, soft_wrap=True)


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser("trace")
    actions = command.add_subparsers(dest="action", required=True, metavar="ACTION")
    opening = actions.add_parser(
        "open",
        help="show it in Perfetto's viewer, or offline in a separate page",
        description="Serves FILE from this machine, to the browser here only, and opens it in Perfetto's viewer, which "
        "reads it there; nothing leaves this machine. --offline: a page that needs no network.",
    )
    opening.add_argument("file", type=pathlib.Path, help="a .pftrace file")
    opening.add_argument(
        "--at",
        type=quantity(TIMES, "s"),
        metavar="12.3s",
        help="the time to show (default: where a fault first acted, else the fall, else the last step)",
    )
    opening.add_argument(
        "--shown",
        type=quantity(TIMES, "s", 0.0),
        default=SHOWN_S,
        metavar="20ms",
        help="length that is shown at first (default 20 ms)",
    )
    opening.add_argument("--offline", action="store_true", help="write a page next to FILE and open that")
    opening.add_argument("--out", type=pathlib.Path, metavar="PAGE.html", help="where the page is written")
    opening.add_argument("--no-browser", action="store_true", help="only print the address")
    opening.set_defaults(run=run_open)


def run_open(given: argparse.Namespace) -> int:
    """Show a timeline; 0 when it was read."""
    from ranger_sim.harness.timeline import moments

    if given.file.suffix not in OPENED:
        raise UserError(f"trace {given.file}: only .pftrace files can be opened; a .vcd opens in GTKWave or Surfer")
    asked_ns = None if given.at is None else round(given.at * 1e9)
    moment = moments.find(given.file, asked_ns)
    if given.offline or given.out:
        return open_page(given, moment)
    half_ns = round(given.shown * 0.5e9)
    return serve(given.file, max(0, moment.time_ns - half_ns), moment.time_ns + half_ns, not given.no_browser)


def open_page(given: argparse.Namespace, moment: Any) -> int:
    """Write the page for offline use and open it."""
    from ranger_sim.harness.timeline import viewer

    page = given.out or given.file.with_suffix(".html")
    if page.is_dir() or not page.parent.is_dir():
        raise UserError(f"page {page}: its folder is missing, or it is one")
    content = viewer.page(given.file, moment, round(KEPT_S * 1e9), round(given.shown * 1e9))
    try:
        replace_file(page, content.encode())
    except OSError as error:
        raise UserError(f"page {page}: cannot be written: {error.strerror}") from None
    print(f"{page}: shows {moment.text}, at {moment.time_ns * 1e-9:.6f} s")
    if not given.no_browser:
        webbrowser.open(page.absolute().as_uri())
    return 0


def address(name: str, begin_ns: int, end_ns: int) -> str:
    """The address for the browser: Perfetto's viewer, with the trace's address and the time range to show."""
    source = urllib.parse.quote(f"http://127.0.0.1:{PORT}/{urllib.parse.quote(name)}", safe="")
    return f"{VIEWER}/#!/?url={source}&visStart={begin_ns}&visEnd={end_ns}"


def serve(file: pathlib.Path, begin_ns: int, end_ns: int, with_browser: bool) -> int:
    """Serve until the viewer has fetched the trace, or Ctrl-C."""
    try:
        server = TraceServer(file)
    except OSError as error:
        raise UserError(
            f"port {PORT} of this machine cannot be used ({error.strerror}), and Perfetto's viewer reads from no "
            "other: end what holds it (trace_processor?), or use --offline"
        ) from None
    with contextlib.closing(server):
        shown = address(file.name, begin_ns, end_ns)
        print(
            f"{shown}\nserving {file} until it has been fetched; Ctrl-C ends it; without a network: --offline",
            flush=True,
        )
        if with_browser:
            webbrowser.open(shown)
        while not server.served:
            server.turn(LONGEST_NAP_S)
    return 0
