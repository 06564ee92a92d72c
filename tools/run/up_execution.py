"""Carries out the plan of `ranger-sim up`: opens what it names, starts the processes, and finishes the files."""

from __future__ import annotations

import argparse
import contextlib
import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rich.console import Console

from ranger_sim import loading
from ranger_sim.datatable.addresses import XCP_MASTER_ID, XCP_SLAVE_ID
from ranger_sim.harness.firmware.printed import Printed
from ranger_sim.harness.processes import places
from ranger_sim.harness.processes.hardware import HardwareInTheLoop
from ranger_sim.harness.processes.lateness import figures
from ranger_sim.harness.processes.modes import InProcess
from ranger_sim.harness.processes.outside import move_bus
from ranger_sim.harness.processes.plant_process import PlantRun, sent_away
from ranger_sim.harness.processes.supervisor import Supervisor
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.ranger.feed import FeedServer
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.timeline import Timeline
from ranger_sim.tools import faults
from ranger_sim.tools.buses import bus
from ranger_sim.tools.command_line import interrupts, terminal
from ranger_sim.tools.firmware import gdb_options
from ranger_sim.tools.firmware.images import images_of
from ranger_sim.tools.run import serial_options, walk, walk_options
from ranger_sim.tools.run.folder import RunFolder
from ranger_sim.tools.run.logs import PrintedFiles, RunLogs
from ranger_sim.tools.run.up_plan import OutsideBus, Plan
from ranger_sim.tools.run.up_view import PLAIN_S, LiveView, PlainView, print_processes
from ranger_sim.tools.timing import trace

if TYPE_CHECKING:
    from ranger_sim.can_bus.edge.external_bus import ExternalBus


class Execution:
    """One run. options: those of the command, which name its files, ports and servers; json_file: None without."""

    def __init__(
        self, plan: Plan, options: argparse.Namespace, json_file: pathlib.Path | None, console: Console
    ) -> None:
        self.plan = plan
        self.options = options
        self.json_file = json_file
        self.console = console
        every_s = terminal.progress_every_s(options, PLAIN_S)
        is_drawn = console.is_terminal and not console.quiet
        self.view = LiveView(console) if is_drawn else PlainView(console, every_s)
        # opened before the processes start
        self.printed: Printed | None = None
        self.folder: RunFolder | None = None
        self.outside: list[ExternalBus] = []
        self.openers: dict[str, Callable[[], Any]] = {}
        self.ends: dict[str, Any] = {}
        self.servers: list[Any] = []
        self.scheduling = ""
        # made by `begin`, in the body's process
        self.hardware: HardwareInTheLoop | None = None
        self.logs: RunLogs | None = None
        self.printed_files: PrintedFiles | None = None
        self.timeline: Timeline | None = None

    def print(self, line: str) -> None:
        """One line, not cut."""
        self.console.print(line, highlight=False, soft_wrap=True)

    def run(self) -> int:
        """Build the robot, open its connections, run it as processes; returns the exit code."""
        plan, options, console = self.plan, self.options, self.console
        for line in plan.not_here():
            self.print(line)
        firmware = walk.firmware_of(options, console)
        images = images_of(options)
        with (
            walk.printed_by(firmware, console) as self.printed,
            # mode: the supervisor gives every board its process
            contextlib.closing(
                Ranger(
                    plan.scenario,
                    plan.log,
                    plan.quirks,
                    plan.profile,
                    firmware,
                    images=images,
                    printed=self.printed,
                    mode=InProcess(),
                    require_confined=options.require_confined,
                )
            ) as robot,
        ):
            self.connect(robot)
            # written and finished in the plant's process; if that is lost, the folder says that the run broke off
            with gdb_options.debuggers(robot, options, gdb_options.never, console) as debuggers:
                self.folder = walk.claimed(options, plan.stop, console) if options.out else None
                supervisor = Supervisor(robot, plan.settings, plan.stop, self.finish, self.view, self.begin, debuggers)
                self.scheduling = supervisor.describe()
                return supervisor.run()

    def connect(self, robot: Ranger) -> None:
        """Open serial ports and servers, and print where they are; buses outside are opened by `begin`."""
        plan, options = self.plan, self.options
        bit_rates = {each.name: each.bitrate for each in robot.buses}
        self.outside = [external(each, bit_rates[each.name]) for each in plan.outside]
        if plan.peers:
            from ranger_sim.can_bus.edge.external_bus import opener

            self.openers = {board: opener(board, dict(keywords)) for board, keywords in plan.peers.items()}
        self.ends, lines = serial_options.connect(robot, options)
        self.servers, where = bus.open_servers({each.name: each for each in robot.buses}, options)
        lines += where
        if plan.xcp_udp is not None:
            from ranger_sim.harness.xcp.udp import XcpUdpServer

            xcp = XcpUdpServer(robot, plan.xcp_udp)
            robot.attach(xcp)
            lines.append(f"XCP on UDP: {xcp.host}:{xcp.port}, described by ranger.a2l of the generated files")
        for server in (*self.servers, FeedServer(robot, plan.settings.name)):
            robot.attach(server)
        for line in lines:
            self.print(line)
        if not loading.RUNS_COMPILED:
            self.print(f"running interpreted, slowly: {loading.RUNS_INTERPRETED_BECAUSE}")

    def begin(self, robot: Ranger) -> None:
        """In the body's process, before time passes: open buses outside, arm faults, begin the files."""
        plan, options = self.plan, self.options
        for each in self.outside:
            move_bus(robot, each, self.openers, plan.settings.boards)
        if plan.xcp_can is not None:
            self.begin_xcp_on_can(robot, plan.xcp_can)
        if plan.profile is not None and plan.has_hardware:
            self.hardware = HardwareInTheLoop(robot, plan.profile, self.outside)
        for fault in plan.faults:
            robot.arm(fault)
        self.logs = walk.logs_of(robot, options, self.folder)
        if self.printed is not None and self.folder is not None:
            self.printed_files = PrintedFiles(self.printed, self.folder)
        self.timeline = trace.attach(robot, options)
        for each in self.outside:
            self.print(f"{each.name} is outside: this run is asynchronous and cannot be repeated")
        self.view.say(f"ranger-sim up, name {plan.settings.name}: {self.scheduling}")

    def begin_xcp_on_can(self, robot: Ranger, channel: str) -> None:
        """Let a calibration program measure on this bus, as far as the robot leaves it free."""
        from ranger_sim.harness.xcp.can import MOST_LOAD, XcpCanProbe

        probe = XcpCanProbe(robot, channel, next((each for each in self.outside if each.name == channel), None))
        robot.attach(probe)
        self.print(
            f"XCP on CAN: {probe.bus}, commands {XCP_MASTER_ID}, answers {XCP_SLAVE_ID}; the robot needs at "
            f"most {float(probe.robots_share):.1%} of it, measurements may fill it to {float(MOST_LOAD):.0%}"
        )

    def finish(self, robot: Ranger, run: PlantRun, interrupted: bool) -> int:
        """In the body's process, when time has ended: write files, print the summary; returns the exit code."""
        options, console = self.options, self.console
        summary = {**robot.summary(), "interrupted": interrupted}
        failed = [name for name in summary["failed_boards"] if name in self.plan.settings.boards]
        if run.lost and run.lost not in failed:
            failed.append(run.lost)
        summary["failed_boards"] = failed
        summary["processes"] = self.processes_summary(robot, run)
        if self.hardware is not None:
            summary["processes"]["external_boards"] = self.hardware.watch.report()
            for line in self.hardware.watch.lines():
                self.print(line)
        for line in serial_options.report(self.ends):
            self.print(line)
        stop = StopRule(time_s=robot.time_s) if run.stopping else self.plan.stop
        summary["command"] = walk_options.command_again(options, stop)
        walk.finish_printed(self.printed, self.printed_files)
        is_complete = walk.finish(robot, summary, options, self.folder, self.logs, self.json_file, console)
        print_processes(summary["processes"], console)
        trace.write(self.timeline, options, console)
        return exit_code(summary, is_complete)

    def processes_summary(self, robot: Ranger, run: PlantRun) -> dict:
        """The part of `--json` about the processes: pace, lateness, turns, damage, deaths, traffic from outside."""
        boards = {}
        for name, block in run.blocks.items():
            words = block.words
            bins = words[places.LATENESS : places.LATENESS + places.LATENESS_WORDS]
            boards[name] = {
                "lateness": figures(bins, words[places.LATE_MAX] / 1000.0),
                "turns_per_s": run.remotes[name].turns / robot.time_s if robot.time_s > 0.0 else 0.0,
                "damaged_messages": words[places.DAMAGED] + run.remotes[name].from_board.damaged,
            }
        sent = sum(server.counters().get("frames_in", 0) for server in self.servers)
        is_asynchronous = self.outside or sent or any(end.asynchronous for end in self.ends.values())
        return {
            "speed": run.settings.speed if run.settings.speed is not None else "max",
            "wall_s": run.wall_s,
            "paced_factor": robot.time_s / run.wall_s if run.wall_s > 0.0 else None,
            "boards": boards,
            "deaths": run.deaths,
            "asynchronous": bool(is_asynchronous),
            "frames_from_clients": sent,
            "sent_away": sent_away(self.servers),
            "outside": {each.name: {**each.counters(), "last_error": each.last_error} for each in self.outside},
        }


def external(planned: OutsideBus, own_rate: int) -> ExternalBus:
    """The bus, not opened yet. own_rate: of the emulated bus, bit/s."""
    from ranger_sim.can_bus.edge.external_bus import ExternalBus, opener  # python-can: only where it is used

    rate = own_rate if planned.bit_rate is None else planned.bit_rate
    return ExternalBus(planned.name, rate, opener(planned.name, dict(planned.keywords)))


def exit_code(summary: dict, is_complete: bool) -> int:
    """As for `walk`: 0, 1 after a fall or with a failed board, 2, 3 with a fault that did not act, 130."""
    if not is_complete:
        return walk.EXIT_INCOMPLETE
    if summary["interrupted"]:
        return interrupts.EXIT_INTERRUPTED
    if not all(fault["acted"] for fault in summary["faults"]):
        return faults.EXIT_INVALID
    return 1 if summary["fell"] or summary["failed_boards"] else 0
