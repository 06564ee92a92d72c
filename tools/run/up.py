"""`ranger-sim up`: the robot as processes at the pace of the wall clock; `ranger-sim ctl`: requests to it."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.live import Live
from rich.table import Table

from ranger_sim import loading
from ranger_sim.can_bus.edge.peers import told
from ranger_sim.datatable.addresses import XCP_BUS, XCP_MASTER_ID, XCP_SLAVE_ID
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.faults.ranger_catalogue import CATALOGUE
from ranger_sim.harness.feed.server import FeedServer
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.outside.profile import load as load_profile
from ranger_sim.harness.processes import control, places
from ranger_sim.harness.processes.hardware import HardwareInTheLoop
from ranger_sim.harness.processes.lateness import figures
from ranger_sim.harness.processes.outside import move_bus
from ranger_sim.harness.processes.plant_process import sent_away
from ranger_sim.harness.processes.requests import admitted, can_be_armed
from ranger_sim.harness.processes.settings import FASTEST, NEVER, ON_FAILURE, SLOWEST, Settings, one_processor
from ranger_sim.harness.processes.supervisor import ELSEWHERE, RUNNING, Supervisor, View, check_platform
from ranger_sim.harness.stop_rule import MOST_STEPS, StopRule
from ranger_sim.harness.wiring import ranger as wiring
from ranger_sim.tools import faults
from ranger_sim.tools.buses import server_options
from ranger_sim.tools.command_line import interrupts, terminal
from ranger_sim.tools.command_line.files import json_target, writable_folder
from ranger_sim.tools.command_line.options import add_all
from ranger_sim.tools.command_line.units import number, whole_number, word
from ranger_sim.tools.firmware import gdb_options
from ranger_sim.tools.firmware.command import OPTIONS as FIRMWARE
from ranger_sim.tools.firmware.command import folders_of, run_sanitized, wants_another_process
from ranger_sim.tools.firmware.images import OPTIONS as IMAGES
from ranger_sim.tools.firmware.images import images_of
from ranger_sim.tools.run import serial_options, walk, walk_options
from ranger_sim.tools.run.logs import PrintedFiles
from ranger_sim.tools.timing import trace

if TYPE_CHECKING:
    from ranger_sim.can_bus.edge.external_bus import ExternalBus
    from ranger_sim.harness.processes.plant_process import PlantRun
    from ranger_sim.harness.ranger import Ranger
    from ranger_sim.harness.timeline import Timeline
    from ranger_sim.tools.run.logs import RunLogs

PLAIN_S = 2.0  # between two lines without a terminal
# Fields of a request, as ctl gives them, and the name of each there.
FIELDS = {
    "restart": {"board": "BOARD"},
    "key": {"key": "N"},
    "set": {"name": "NAME", "value": "VALUE"},
    "fault": {"fault": "PLACE:MODE"},
    "clear": {"which": "N"},
    "radio": {"stick": "-1...1"},
}
PACE = number(least=SLOWEST, most=FASTEST)
FOREVER = StopRule(steps=MOST_STEPS)


def speed(text: str) -> float | None:
    """An argparse type: a factor, or max (None)."""
    if text == "max":
        return None
    try:
        return PACE(text)
    except argparse.ArgumentTypeError as wrong:
        raise argparse.ArgumentTypeError(f"{wrong}, or max") from None


def processor(text: str) -> int | None:
    """The processor that --processor means; None for all of them."""
    if text == "one":
        return one_processor() if loading.RUNS_COMPILED else None
    if text == "all":
        return None
    if not text.isdecimal():
        raise UserError(f"--processor {text}: one, all or the number of a processor is expected")
    return int(text)


def register(commands: Any) -> None:
    """Add both subcommands to the command line."""
    up = commands.add_parser(
        "up",
        help="let Ranger walk in real time, each board a process of its own",
        description="One process for each board and one for the body. Without an end it walks until Ctrl-C.",
    )
    walk_options.add_run_options(up)
    group = up.add_argument_group("processes")
    group.add_argument(
        "--speed",
        type=speed,
        default=1.0,
        metavar="FACTOR|max",
        help="virtual seconds per second of the wall clock; max: as fast as it goes (default 1.0)",
    )
    group.add_argument(
        "--restart",
        choices=(NEVER, ON_FAILURE),
        default=NEVER,
        help="whether a board that dies is started again (default never)",
    )
    group.add_argument(
        "--name",
        type=word("a name"),
        default="ranger",
        help="name under which other programs find this robot (default ranger)",
    )
    group.add_argument(
        "--no-real-time", action="store_true", help="do not ask for SCHED_FIFO and locked memory, even if permitted"
    )
    group.add_argument(
        "--processor",
        type=word("one, all or a number"),
        default="one",
        metavar="one|all|N",
        help="processors for body and boards. They take turns, so one is the fastest (default; interpreted: all)",
    )
    server_options.add_options(group)
    group.add_argument(
        "--xcp-udp",
        type=whole_number(0, 65535),
        metavar="PORT",
        help="let a calibration program measure and set parameters by XCP on UDP, on this machine (0: a free port)",
    )
    group.add_argument(
        "--xcp-can",
        nargs="?",
        const=XCP_BUS.lower(),
        choices=[f"can{number}" for number in range(1, 5)],
        metavar="BUS",
        help=f"the same by XCP on CAN, on one of the robot's buses (default {XCP_BUS.lower()}), identifiers "
        f"{XCP_MASTER_ID} and {XCP_SLAVE_ID}",
    )
    group.add_argument(
        "--bus",
        action="append",
        default=[],
        metavar="BUS=INTERFACE:CHANNEL",
        help="put a bus on a python-can interface, e.g. can1=socketcan:vcan0, with python-can's options behind it if "
        "needed ('can1=slcan:/dev/ttyACM0 --bitrate 1000000'); can1= asks python-can's configuration, section can1; "
        "MCH=... gives one board of such a bus a place of its own (repeatable). The run is then asynchronous",
    )
    add_all(up, (faults.FAULT, faults.MODULE, *FIRMWARE, *IMAGES, gdb_options.GDB))
    trace.add_options(up)
    up.set_defaults(run=run)

    ctl = commands.add_parser(
        "ctl",
        help="look at, pause, resume or change a robot that `up` runs",
        description="status, pause, resume; restart BOARD; key N: press a key for 0.2 s (1: walk; 2: stop, and a "
        "walking robot falls); set NAME VALUE: write a parameter, within its limits (ranger-sim table show NAME); "
        "fault PLACE:MODE: arm a fault, as --fault of `up` has it; clear N: end the fault that was armed as number N, "
        "from 0; radio STICK: steer, -1 (left) to 1 (right).",
    )
    ctl.add_argument("request", choices=("status", "pause", "resume", *FIELDS), help="what is asked for")
    ctl.add_argument("values", nargs="*", metavar="VALUE", help="its board, key, or name and value")
    ctl.add_argument("--name", default="ranger", help="name of the robot (default ranger)")
    ctl.set_defaults(run=run_ctl)


def external_buses(
    options: argparse.Namespace, robot: Ranger, profile: Profile | None
) -> tuple[list[ExternalBus], dict[str, Any]]:
    """Buses of the profile and of --bus (which comes first), not opened yet, and {board: what opens its peer}.

    UserError for what is not there or contradicts itself.
    """
    from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener, place_of

    found: dict[str, ExternalBus] = {}
    openers: dict[str, Any] = {}
    bit_rates = {bus.name: bus.bitrate for bus in robot.buses}
    single = {wire.board for wire in wiring.CAN} - {"CSR"}
    for text in options.bus:
        name, keywords = place_of(text)
        if name in found or name in openers:
            raise UserError(f"--bus {text}: {name} is given twice")
        if name in single:
            openers[name] = opener(name, keywords)
        elif name in bit_rates:
            found[name] = ExternalBus(name, int(keywords.get("bitrate", bit_rates[name])), opener(name, keywords))
        else:
            known = ", ".join([*bit_rates, *(each for each in wiring.BOARDS if each in single)])
            raise UserError(f"--bus {text}: there is no bus or board {name}; there are {known}")
    for name, bus_profile in profile.buses.items() if profile is not None else ():
        keywords_of_profile = bus_profile.python_can()
        if keywords_of_profile is not None and name not in found:
            found[name] = ExternalBus(name, bus_profile.bit_rate, opener(name, keywords_of_profile))
    for board in openers:
        bus = next(f"can{wire.bus}" for wire in wiring.CAN if wire.board == board)
        if bus not in found:
            raise UserError(f"--bus {board}=...: its bus {bus} is not outside (--bus {bus}=...)")
    return list(found.values()), openers


def run(options: argparse.Namespace) -> int:
    """Start the processes and look after them; exit codes as for `walk`."""
    from ranger_sim.harness.ranger import Ranger  # the whole robot, and python-can: only when it is to walk
    from ranger_sim.tools.buses import bus

    check_platform()
    if wants_another_process(options):
        return run_sanitized(options, folders_of(options))
    trace.check(options)
    faults.load_modules(options)
    wanted = [can_be_armed(CATALOGUE.typed(text)) for text in options.fault]
    settings = Settings(
        speed=options.speed,
        restart=options.restart,
        real_time=not options.no_real_time,
        name=options.name,
        processor=processor(options.processor),
    )
    if options.out:
        writable_folder(options.out)
    json_file = json_target(options.json)
    console = terminal.console(stderr=True, quiet=options.json == "-")
    scenario, stop = walk_options.scenario_of(options), walk_options.stop_of(options) or FOREVER
    quirks = serial_options.quirks_of(options)
    profile = load_profile(options.profile) if options.profile is not None else None
    if profile is not None:
        settings = dataclasses.replace(settings, boards=profile.emulated())
        for what, boards in (("outside", profile.external()), ("absent", profile.absent())):
            if boards:
                console.print(f"{', '.join(boards)}: {what}", highlight=False)
    log = walk_options.log_of(options)
    firmware = walk.firmware_of(options, console)
    for name in firmware:
        if name not in settings.boards:
            raise UserError(f"--firmware {name}={firmware[name].folder}: {name} is not emulated in this profile")
    images = images_of(options)
    for name in images:
        if name not in settings.boards:
            raise UserError(f"--image {name}={images[name].path}: {name} is not emulated in this profile")
    # in_process: the supervisor gives every board its process
    with (
        walk.printed_by(firmware, console) as printed,
        contextlib.closing(
            Ranger(scenario, log, quirks, profile, firmware, in_process=True, images=images, printed=printed)
        ) as robot,
    ):
        outside, openers = external_buses(options, robot, profile)
        ends, lines = serial_options.connect(robot, options)
        servers, more = bus.open_servers({each.name: each for each in robot.buses}, options)
        if options.xcp_udp is not None:
            from ranger_sim.harness.xcp.udp import XcpUdpServer

            xcp = XcpUdpServer(robot, options.xcp_udp)
            robot.attach(xcp)
            more.append(f"XCP on UDP: {xcp.host}:{xcp.port}, described by ranger.a2l of the generated files")
        for server in (*servers, FeedServer(robot, settings.name)):
            robot.attach(server)
        for line in lines + more:
            console.print(line, highlight=False, soft_wrap=True)
        if not loading.RUNS_COMPILED:
            console.print(
                f"running interpreted, slowly: {loading.RUNS_INTERPRETED_BECAUSE}", highlight=False, soft_wrap=True
            )

        elsewhere: list[HardwareInTheLoop] = []
        timelines: list[Timeline | None] = []
        logs: list[RunLogs | None] = []
        kept: list[PrintedFiles | None] = []

        def finish(robot: Ranger, run: PlantRun, interrupted: bool) -> int:
            summary = {**robot.summary(), "interrupted": interrupted}
            summary["failed_boards"] = [name for name in summary["failed_boards"] if name in settings.boards]
            summary["processes"] = processes_summary(robot, run, servers, ends, outside)
            for each in elsewhere:
                summary["processes"]["external_boards"] = each.watch.report()
                for line in each.watch.lines():
                    console.print(line, highlight=False, soft_wrap=True)
            for line in serial_options.report(ends):
                console.print(line, highlight=False, soft_wrap=True)
            end = StopRule(time_s=robot.time_s) if interrupted else stop
            summary["command"] = walk_options.command_again(options, end)
            walk.finish_printed(printed, kept[0])
            is_complete = walk.finish(robot, summary, options, folder, logs[0], json_file, console)
            print_processes(summary["processes"], console)
            for timeline in timelines:
                trace.write(timeline, options, console)
            if not is_complete:
                return walk.EXIT_INCOMPLETE
            if interrupted:
                return interrupts.EXIT_INTERRUPTED
            if not all(fault["acted"] for fault in summary["faults"]):
                return faults.EXIT_INVALID
            return 1 if summary["fell"] or summary["failed_boards"] else 0

        view = LiveView(console) if console.is_terminal else PlainView(console)

        def begin(robot: Ranger) -> None:
            for each in outside:
                move_bus(robot, each, openers, settings.boards)
            if options.xcp_can is not None:
                from ranger_sim.harness.xcp.can import MOST_LOAD, XcpCanProbe

                there = next((each for each in outside if each.name == options.xcp_can), None)
                probe = XcpCanProbe(robot, options.xcp_can, there)
                robot.attach(probe)
                console.print(
                    f"XCP on CAN: {probe.bus}, commands {XCP_MASTER_ID}, answers {XCP_SLAVE_ID}; the robot needs at "
                    f"most {float(probe.robots_share):.1%} of it, measurements may fill it to {float(MOST_LOAD):.0%}",
                    highlight=False,
                    soft_wrap=True,
                )
            if profile is not None and (profile.external() or profile.absent()):
                elsewhere.append(HardwareInTheLoop(robot, profile, outside))
            for fault in wanted:
                robot.arm(fault)
            logs.append(walk.logs_of(robot, options, folder))
            kept.append(PrintedFiles(printed, folder) if printed is not None and folder is not None else None)
            timelines.append(trace.attach(robot, options))
            for each in outside:
                console.print(
                    f"{each.name} is outside: this run is asynchronous and cannot be repeated", highlight=False
                )
            view.say(f"ranger-sim up, name {settings.name}: {supervisor.describe()}")

        # written and finished in the plant's process; if that is lost, the folder says that the run broke off
        with gdb_options.debuggers(robot, options, gdb_options.never, console) as doors:
            folder = walk.claimed(options, stop, console) if options.out else None
            supervisor = Supervisor(robot, settings, stop, finish, view, begin, doors)
            return supervisor.run()


def processes_summary(
    robot: Ranger, run: PlantRun, servers: list[Any], ends: dict[str, Any], outside: list[ExternalBus]
) -> dict:
    """What `--json` says about the processes: pace, lateness, turns, damage, deaths, what came from outside."""
    boards = {}
    for name, block in run.blocks.items():
        words = block.words
        bins = words[places.LATENESS : places.LATENESS + places.LATENESS_WORDS]
        boards[name] = {
            "lateness": figures(bins, words[places.LATE_MAX] / 1000.0),
            "turns_per_s": run.remotes[name].turns / robot.time_s if robot.time_s > 0.0 else 0.0,
            "damaged_messages": words[places.DAMAGED] + run.remotes[name].from_board.damaged,
        }
    sent = sum(server.counters().get("frames_in", 0) for server in servers)
    return {
        "speed": run.settings.speed if run.settings.speed is not None else "max",
        "wall_s": run.wall_s,
        "paced_factor": robot.time_s / run.wall_s if run.wall_s > 0.0 else None,
        "boards": boards,
        "deaths": run.deaths,
        "asynchronous": bool(outside or sent or any(end.asynchronous for end in ends.values())),
        "frames_from_clients": sent,
        "sent_away": sent_away(servers),
        "outside": {each.name: {**each.counters(), "last_error": each.last_error} for each in outside},
    }


def print_processes(found: dict, console: Console) -> None:
    """The table of lateness."""
    table = lateness_table({name: each["lateness"] for name, each in found["boards"].items()})
    console.print(table)
    console.print(
        f"{found['paced_factor'] or 0.0:.2f} x real time by the wall clock, "
        f"{sum(each['turns_per_s'] for each in found['boards'].values()):.0f} turns per second of the robot's time"
        + ("; frames or bytes came from outside: this run cannot be repeated" if found["asynchronous"] else ""),
        highlight=False,
    )
    for name, counts in found["outside"].items():
        used = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in counts.items() if value)
        console.print(f"{name} outside: {used or 'no traffic'}", highlight=False, soft_wrap=True)
    for door, counts in found["sent_away"].items():
        console.print(f"{door}: sent away {told(counts)}", highlight=False, soft_wrap=True)
    for death in found["deaths"]:
        console.print(walk.loss_text(death), highlight=False, soft_wrap=True)


def micro(value: float | None) -> str:
    """A time in us, or a dash."""
    return "-" if value is None else f"{value:.0f}"


def lateness_table(lateness: dict) -> Table:
    """How late slots were, by board, in us."""
    table = Table(title="lateness of slots, us", box=None, pad_edge=False)
    for heading in ("board", "slots", "p50", "p99", "p99.9", "max"):
        table.add_column(heading, justify="left" if heading == "board" else "right")
    for name, each in lateness.items():
        table.add_row(
            name, str(each["slots"]), *(micro(each[key]) for key in ("p50_us", "p99_us", "p999_us", "max_us"))
        )
    return table


class PlainView(View):
    """Lines for where there is no terminal."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self.next_s = 0.0

    def show(self, state: dict) -> None:
        """A line now and then."""
        now = wallclock.monotonic_s()
        if now < self.next_s or "time_s" not in state:
            return
        self.next_s = now + PLAIN_S
        loads = " ".join(f"{100.0 * each['load']:.0f}" for each in state["buses"].values())
        late = max((each["lateness"]["p99_us"] or 0.0) for each in state["boards"].values())
        expected = (RUNNING, ELSEWHERE)
        wrong = [f"{name} {each['state']}" for name, each in state["boards"].items() if each["state"] not in expected]
        self.say(
            f"{state['time_s']:.1f} s, {state['steps']} steps, {state['distance_m']:.2f} m, loads {loads} %, "
            f"late p99 {late:.0f} us" + (", paused" if state["paused"] else "") + "".join(f", {each}" for each in wrong)
        )

    def say(self, text: str) -> None:
        self.console.print(text, highlight=False, soft_wrap=True)


class LiveView(View):
    """A table that is redrawn in place; what happens is printed above it."""

    def __init__(self, console: Console) -> None:
        self.console = console
        # no thread of its own: the supervisor forks
        self.live: Live | None = Live(console=console, auto_refresh=False, transient=True)
        self.started = False

    def show(self, state: dict) -> None:
        """Draw it."""
        if self.live is None or "time_s" not in state:
            return
        if not self.started:
            self.started = True
            self.live.start()
        self.live.update(self.picture(state), refresh=True)

    def picture(self, state: dict) -> Table:
        """The whole view: the robot in two lines, then its boards."""
        loads = "  ".join(
            f"{name} {100.0 * each['load']:.0f} %" + (f" ({each['errors']} errors)" if each["errors"] else "")
            for name, each in state["buses"].items()
        )
        pace = "as fast as it goes" if state["speed"] is None else f"speed {state['speed']:g}"
        late = state["behind_s"]
        caption = f"{loads}\n{state['scheduling']}" + "".join(f"\n{text}" for text in state["damage"])
        for counters in state["ends"]:
            used = ", ".join(f"{key.replace('_', ' ')} {value}" for key, value in counters.items() if value)
            caption += f"\n{used}" if used else ""
        table = Table(
            title=f"{state['time_s']:.1f} s ({pace}{', paused' if state['paused'] else ''}"
            f"{f', {late:.1f} s behind' if late > 0.1 and state['speed'] is not None else ''}), "
            f"{state['steps']} steps, {state['distance_m']:.2f} m, {state['speed_m_per_s']:.2f} m/s",
            caption=caption,
            caption_justify="left",
            title_justify="left",
        )
        for heading in ("board", "process", "state", "slots", "longest us", "overruns", "errors"):
            table.add_column(heading, justify="left" if heading in ("board", "state") else "right")
        for heading in ("late p50", "p99", "p99.9", "max us"):
            table.add_column(heading, justify="right")
        for name, each in state["boards"].items():
            lateness = each["lateness"]
            table.add_row(
                name,
                str(each["process"]),
                each["state"],
                str(each["slots"]),
                f"{each['max_slot_us']:.0f}",
                str(each["overruns"]),
                str(each["errors"]),
                *(micro(lateness[key]) for key in ("p50_us", "p99_us", "p999_us", "max_us")),
            )
        return table

    def say(self, text: str) -> None:
        self.console.print(text, highlight=False, soft_wrap=True)

    def close(self) -> None:
        if self.live is not None and self.started:
            self.live.stop()
        self.live = None


def run_ctl(options: argparse.Namespace) -> int:
    """Send the request and print the answer."""
    what, values = options.request, options.values
    wanted = FIELDS.get(what, {})
    if len(values) != len(wanted):
        raise UserError(f"ctl {what} takes {' '.join(wanted.values()) or 'no value'}, got {' '.join(values) or 'none'}")
    request: dict = {"do": what, **dict(zip(wanted, values, strict=True))}
    for name in ("key", "which", "value", "stick"):
        with contextlib.suppress(KeyError, ValueError):  # what is no number is told so by the model of requests
            request[name] = int(request[name]) if name in ("key", "which") else float(request[name])
    try:
        admitted(json.dumps(request).encode())  # what the robot would refuse is told without one
    except UserError as fault:
        raise UserError(f"ctl {fault}") from None
    answer = control.ask(options.name, request)
    if what == "status":
        print(json.dumps(answer, indent=2))
    elif what == "restart":
        print(f"{answer['restarting']} is being restarted")
    else:
        print(f"{what}: at {answer['time_s']:.4f} s of the robot's time")
    return 0
