"""`ranger-sim walk`: run the robot, watch it, keep its logs."""

from __future__ import annotations

import argparse
import contextlib
import json
import pathlib
import shlex
import sys
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

from ranger_sim import loading
from ranger_sim.firmware_sim.native import coverage
from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness import normal_errors
from ranger_sim.harness.firmware.native_firmware import Firmware
from ranger_sim.harness.firmware.printed import Printed
from ranger_sim.harness.outside.profile import Profile
from ranger_sim.harness.outside.profile import load as load_profile
from ranger_sim.plant import terms
from ranger_sim.ranger.faults.catalogue import CATALOGUE
from ranger_sim.ranger.firmware import native_boards
from ranger_sim.ranger.names import RANGER
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools import faults
from ranger_sim.tools.command_line import interrupts, libraries, streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file, writable_folder
from ranger_sim.tools.command_line.units import duration_text, figure, length_text
from ranger_sim.tools.firmware import gdb_options
from ranger_sim.tools.firmware.command import (
    confined_lines,
    coverage_lines,
    folders_of,
    run_sanitized,
    wants_another_process,
)
from ranger_sim.tools.firmware.images import images_of
from ranger_sim.tools.run import serial_options, unexpected
from ranger_sim.tools.run.folder import LCOV, REPORT, SUMMARY, RunFolder
from ranger_sim.tools.run.logs import PrintedFiles, RunLogs, write_frames
from ranger_sim.tools.run.walk_options import add_walk_options, command_again, log_of, scenario_of, stop_of
from ranger_sim.tools.timing import trace

if TYPE_CHECKING:
    from collections.abc import Iterator

    from ranger_sim.harness.faults.fault import Fault
    from ranger_sim.ranger.robot import Ranger

__all__ = ["walk", "write_frames"]

DEFAULT_STEPS = 100
EXIT_INCOMPLETE = 2  # a requested file is not whole: the disk is full
SLICE_S = 0.05  # virtual seconds between two checks of the screen and of Ctrl-C
PROGRESS_EVERY_S = 60.0  # of the wall clock: a line of progress if there is no screen to draw it on (chosen by us)
PACED_SLICE_S = 0.005  # the same when a serial port is connected: the longest time that a byte waits


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "walk",
        description="All seven boards, four buses and the body in virtual time. Without an end it walks 100 steps.",
    )
    add_walk_options(command)
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Walk, write the files, print the summary.

    0 done, 1 fell or a board failed, 3 a fault did not act, 130 interrupted.
    """
    if wants_another_process(options):
        return run_sanitized(options, folders_of(options))
    stop = stop_of(options) or StopRule(steps=DEFAULT_STEPS)
    with interrupts.noted() as interrupted:
        return run_scenario(scenario_of(options), stop, options, interrupted)


def profile_of(options: argparse.Namespace, console: Console) -> Profile | None:
    """The requested profile; in lockstep all its boards run here, and its buses inside."""
    if options.profile is None:
        return None
    profile = load_profile(options.profile)
    if profile.absent():
        raise UserError(
            f"{profile.path}: {', '.join(profile.absent())} absent: walk needs every board; up runs without some"
        )
    if profile.external():
        console.print(
            f"{', '.join(profile.external())}: emulated as well, and every bus inside: a walk is in virtual time",
            highlight=False,
            soft_wrap=True,
        )
    return profile


def run_scenario(scenario: Scenario, stop: StopRule, options: argparse.Namespace, interrupted: list[bool]) -> int:
    """`run` with everything checked; `interrupted` is filled by Ctrl-C."""
    from ranger_sim.ranger.robot import Ranger  # the whole robot: only when it is to walk

    if options.out:
        writable_folder(options.out)
    json_file = json_target(options.json)
    console = terminal.for_progress(options)
    if options.log and not options.out:
        console.print(f"--log {options.log} is ignored: there is no folder for logs (--out DIR)", soft_wrap=True)
    quirks = serial_options.quirks_of(options)
    profile = profile_of(options, console)
    faults.load_modules(options)
    if scenario.model_file is not None:
        for name in terms.load(scenario.model_file).left_out:
            console.print(f"{scenario.model_file}: {name} is left out", highlight=False, soft_wrap=True)
    wanted = [CATALOGUE.typed(text) for text in options.fault]
    log = log_of(options)
    firmware = firmware_of(options, console)
    images = images_of(options)
    with (
        printed_by(firmware, console) as printed,
        contextlib.closing(
            Ranger(
                scenario,
                log,
                quirks,
                profile,
                firmware,
                options.in_process,
                images,
                options.board_deadline,
                printed,
                require_confined=options.require_confined,
            )
        ) as robot,
    ):
        arm(robot, wanted, options.proof)
        timeline = trace.attach(robot, options)
        ends, places = serial_options.connect(robot, options)
        for place in places:
            console.print(place, highlight=False, soft_wrap=True)
        if not loading.RUNS_COMPILED:
            console.print(
                f"running interpreted, slowly: {loading.RUNS_INTERPRETED_BECAUSE}", highlight=False, soft_wrap=True
            )
        with (
            gdb_options.debuggers(robot, options, lambda: bool(interrupted), console) as servers,
            claimed(options, stop, console) if options.out else contextlib.nullcontext() as folder,
        ):
            kept = PrintedFiles(printed, folder) if printed is not None and folder is not None else None
            logs = logs_of(robot, options, folder)
            if servers:
                servers[0].wait_for_debugger()
            every_s = terminal.progress_every_s(options, PROGRESS_EVERY_S)
            walk(robot, stop, console, interrupted, paced=bool(ends), every_s=every_s)
            for line in serial_options.report(ends):
                console.print(line, highlight=False, soft_wrap=True)
            summary = {**robot.summary(), "interrupted": bool(interrupted)}
            summary["command"] = command_again(options, StopRule(time_s=robot.time_s) if interrupted else stop)
            finish_printed(printed, kept)
            is_complete = finish(robot, summary, options, folder, logs, json_file, console)
        trace.write(timeline, options, console)
    if not is_complete:
        return EXIT_INCOMPLETE
    if interrupted:
        return interrupts.EXIT_INTERRUPTED
    if not all(fault["acted"] for fault in summary["faults"]):
        return faults.EXIT_INVALID
    return 1 if summary["fell"] or summary["failed_boards"] else 0


def firmware_folders(options: argparse.Namespace) -> dict[str, str]:
    """The folders of --firmware, by board. UserError for a board that is unknown or has two."""
    wanted: dict[str, str] = {}
    for text in options.firmware:
        board, folder = native_boards.placed(text)
        if board in wanted:
            raise UserError(f"--firmware {text}: {board} has {wanted[board]} already")
        wanted[board] = folder
    return wanted


def firmware_of(options: argparse.Namespace, console: Console) -> dict[str, Firmware]:
    """The requested firmware in C, by board, compiled."""
    wanted = firmware_folders(options)
    if options.coverage and not wanted:
        raise UserError("--coverage: there is no firmware in C in this run; --firmware BOARD=DIR gives a board one")
    if options.coverage:
        coverage.gcov()  # reports an error before anything runs
    firmware = {
        board: native_boards.build(folder, options.sanitize, options.coverage) for board, folder in wanted.items()
    }
    for each in firmware.values():
        for line in each.warnings:
            console.print(line, highlight=False, markup=False, soft_wrap=True)
    return firmware


@contextlib.contextmanager
def printed_by(firmware: dict[str, Firmware], console: Console) -> Iterator[Printed | None]:
    """Takes the output of programs in C; without a folder it goes to standard error. None without such programs.

    It also goes there with `--json -`, which prints nothing else.
    """
    if not firmware:
        yield None
        return

    def show(line: str) -> None:
        if console.quiet:
            print(line, file=sys.stderr)
        else:
            console.print(line, highlight=False, soft_wrap=True)

    with contextlib.closing(Printed(show)) as printed:
        try:
            yield printed
        except BaseException:
            printed.finish()  # output of a program before it failed
            raise


def finish_printed(printed: Printed | None, kept: PrintedFiles | None) -> None:
    """Pass on the rest of what the programs in C have printed."""
    if printed is not None:
        printed.finish()
    if kept is not None:
        kept.finish()


def arm(robot: Ranger, wanted: list[Fault], proof: bool) -> None:
    """Arm the faults; with `proof`, also a golden run without any, in parallel."""
    if proof and not wanted:
        raise UserError("--proof: there is no --fault to compare with a walk without it")
    if wanted:
        robot.start()
    twin = None
    if proof:
        from ranger_sim.harness.faults.twin import Twin

        twin = Twin(robot)
    for fault in wanted:
        fault.twin = twin
        robot.arm(fault)


def claimed(options: argparse.Namespace, stop: StopRule, console: Console) -> RunFolder:
    """The requested folder, for this run alone. Errors in a run's options must have been reported before."""

    def report(line: str) -> None:
        console.print(line, highlight=False, soft_wrap=True)

    return RunFolder(options.out, command_again(options, stop), report)


def comparison(folder: str) -> str:
    """The command that compares the walk of a run's folder with its twins."""
    return shlex.join(["ranger-sim", "diagnose", folder, "--experiment", "walk", "--out", f"{folder}-twins"])


def logs_of(robot: Ranger, options: argparse.Namespace, folder: RunFolder | None) -> RunLogs | None:
    """The logs of a folder; with --log full they are written from now on."""
    if folder is None or robot.logbook.mode == "none":
        return None
    return RunLogs(robot, folder, follow=options.log == "full")


def finish(
    robot: Ranger,
    summary: dict,
    options: argparse.Namespace,
    folder: RunFolder | None,
    logs: RunLogs | None,
    json_file: pathlib.Path | None,
    console: Console,
) -> bool:
    """Print the summary and write the requested files; False when one of them is not complete."""
    if options.json != "-":
        print_summary(summary, robot.plant.parameters.floor_friction, console)
    summary.update(complete=folder is None, files={})
    try:
        if folder is not None:
            write_files(robot, summary, folder, logs, console, options.twins)
    finally:  # even if the folder fails
        text = json.dumps(summary, indent=2)
        if options.json == "-":
            streams.print_result(text)
        elif json_file is not None:
            replace_file(json_file, (text + "\n").encode())
    if folder is None:
        kept = "only the summary was kept" if json_file is not None or options.json else "nothing was kept"
        console.print(f"{kept}: --out runs/NAME keeps summary, logs and report there", highlight=False, soft_wrap=True)
        return True
    name = REPORT if REPORT in folder.files else SUMMARY
    if folder.files.get(name, "complete") == "complete":
        console.print(f"{pathlib.Path(name).stem}: {folder.path / name}", highlight=False, soft_wrap=True)
    return folder.is_complete


def walk(
    robot: Ranger,
    stop: StopRule,
    console: Console,
    interrupted: list[bool],
    paced: bool = False,
    every_s: float = PROGRESS_EVERY_S,
) -> None:
    """Run until the stop rule, a fall, empty batteries, or Ctrl-C (at least one slice, so that files have something).

    paced: not faster than the wall clock, because an external program takes part. every_s: of the wall clock between
    two lines of progress where there is no terminal.
    """
    started = wallclock.monotonic_s()
    with Progress(
        SpinnerColumn(),
        BarColumn(bar_width=20),
        TextColumn("{task.fields[progress]}"),
        console=console,
        transient=False,
        disable=not console.is_terminal,
    ) as progress:
        task = progress.add_task("walk", total=1.0, progress="")
        line_at = started + every_s
        done, reported = False, 0
        while not done:
            done = robot.run(stop, PACED_SLICE_S if paced else SLICE_S) or bool(interrupted)
            for death in robot.deaths[reported:]:
                reported += 1
                console.print(loss_text(death), highlight=False, soft_wrap=True)
            wall = wallclock.monotonic_s() - started
            if paced and not done and robot.time_s > wall:
                wallclock.sleep_s(robot.time_s - wall)
            if console.is_terminal:
                progress.update(task, completed=robot.fraction_done(stop), progress=progress_text(robot, stop, wall))
            elif started + wall >= line_at:
                line_at += every_s
                console.print(progress_text(robot, stop, wall), highlight=False, soft_wrap=True)


def loss_text(death: dict) -> str:
    """The lost board, the time, and the place of its program."""
    why = death["why"] or f"its process {death.get('how', 'ended')}"
    return f"{death['board']} was lost at {death['time_s']:.3f} s: {why}"


def progress_text(robot: Ranger, stop: StopRule, wall_s: float) -> str:
    """Progress of the walk after `wall_s` seconds of the wall clock, and the seconds left at this rate."""
    speed = robot.mean_speed_m_per_s()
    share = robot.fraction_done(stop)
    left = clock_text(wall_s * (1.0 - share) / share) if share > 0.0 else "?"
    charge = max(0.0, robot.plant.electrics.battery.charge)
    factor = robot.time_s / wall_s if wall_s > 0.0 else 0.0
    return (  # a narrow screen cuts off the last part
        f"{length_text(robot.distance_m)}, {robot.steps} steps, {left} left; {clock_text(robot.time_s)} "
        f"at {speed:.2f} m/s, {factor:.1f} x real time, battery {100.0 * charge:.0f} %"
    )


def clock_text(seconds: float) -> str:
    """Hours, minutes and seconds."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02d}:{whole % 60:02d}"


def write_files(
    robot: Ranger, summary: dict, folder: RunFolder, logs: RunLogs | None, console: Console, with_twins: bool
) -> None:
    """Write logs and report, if the run has data for them, then the summary. with_twins: the walk compared with its
    twins is in the report."""
    if any(each.coverage for each in robot.firmware.values()):
        with folder.file(LCOV) as path:
            path.write_text(coverage.lcov(coverage.merged(each.ran() for each in robot.firmware.values())), "utf-8")
    if logs is not None:
        done = "logs and report, twins compared" if with_twins else "logs and report"
        with console.status(f"writing {done} ..."):
            logs.finish()
            try:
                from ranger_sim.tools.report import page  # half a second of imports
            except ModuleNotFoundError as error:  # the records are complete without it
                without = libraries.missing(error, REPORT)
                if without is None:
                    raise
                console.print(without, highlight=False, soft_wrap=True)
            else:
                twins = None
                if with_twins:
                    from ranger_sim.tools.report.twins import compared  # the diagnosis's imports

                    twins = compared(folder.path, summary)
                with folder.file(REPORT) as path:
                    command = comparison(str(folder.path))
                    path.write_text(page.render(robot, summary, command, twins), encoding="utf-8")
    folder.finish(summary)


def print_summary(summary: dict, floor_friction: float, console: Console) -> None:
    """The walk in a few lines: its results, then the deviations from a healthy walk."""
    console.print(
        f"{summary['steps']} steps, {length_text(summary['distance_m'])} in {duration_text(summary['time_s'])}, "
        f"{end_text(summary)}; "
        f"controller {summary['controller']}, body {summary['body']}; "
        f"step {figure(summary['mean_step_length_m'], '{:.3f} m')}, {figure(summary['mean_step_time_s'], '{:.3f} s')}; "
        f"{figure(summary['total_power_W'], '{:.1f} W')} (motors {figure(summary['motor_power_W'], '{:.1f} W')}), "
        f"TCOT {figure(summary['tcot'], '{:.3f}')}; "
        f"{summary['realtime_factor']:.1f} x real time {'compiled' if summary['compiled'] else 'interpreted'}; "
        f"trace {summary['trace_digest'][:16]}",
        highlight=False,
        soft_wrap=True,
    )
    console.print(energy_text(summary), highlight=False, soft_wrap=True)
    for fault in summary["faults"]:
        console.print(faults.fault_text(fault), highlight=False, soft_wrap=True)
    for line in (*confined_lines(summary), *coverage_lines(summary)):
        console.print(line, highlight=False, soft_wrap=True)
    for line in [*unexpected.lines(summary, floor_friction), *usual_lines(summary["errors"], summary["time_s"])]:
        console.print(line, highlight=False, soft_wrap=True)


def usual_lines(errors: dict, time_s: float) -> list[str]:
    """The number of errors that every healthy walk has too, in a line if there are any."""
    unusual = normal_errors.beyond(RANGER, errors, time_s)
    usual = sum(map(len, errors.values())) - sum(map(len, unusual.values()))
    return [f"errors as in every healthy walk: {usual} kinds (report and summary have them)"] if usual else []


def end_text(summary: dict) -> str:
    """The end of the walk, in words."""
    if summary["battery"]["empty"]:
        return f"{summary['fall_cause']}"
    if summary["fell"]:
        return f"fell: {summary['fall_cause']}"
    return "interrupted, on its feet" if summary["interrupted"] else "on its feet"


def energy_text(summary: dict) -> str:
    """The energy by consumer, and the charge left."""
    energy, battery = summary["energy_Wh"], summary["battery"]
    parts = ", ".join(f"{name.replace('_', ' ')} {Wh:.3g}" for name, Wh in energy.items() if name != "total")
    return (
        f"{energy['total']:.3g} Wh since it was let go: {parts}; "
        f"batteries {100.0 * battery['charge']:.1f} % of {battery['capacity_Wh']:.0f} Wh"
    )
