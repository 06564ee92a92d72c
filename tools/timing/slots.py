"""`ranger-sim slots`: the time that each function needs of a board's slots, line by line as in its firmware's table."""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
from typing import Any

from rich.console import Console
from rich.table import Table

from ranger_sim.foundation.user_error import UserError, unknown
from ranger_sim.harness.timing.slots import SlotView, Statistics
from ranger_sim.ranger.board_programs import BOARD_CLASSES
from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.ranger.timing import robot_figures, static_check
from ranger_sim.ranger.timing.static_check import OVERRUNS, BoardBound, FunctionBound
from ranger_sim.tools.command_line import streams, terminal
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.units import TIMES, number, quantity, whole_number

EXIT_DONE, EXIT_OVERRAN = 0, 1
USUAL_TIME_S = 4.0  # the robot is let go after half of it and walks the rest (chosen by us: seconds of computing)
# The time before is not usual: the main brain's first slot sends every command once
FIRST_SECONDS = 0.1


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "slots",
        description="The schedule of a board, line by line, in cycles: what each function costs, may cost, cost at "
        "most in a run of the robot, and can cost at most; then rows with their margins, and interrupts. The robot's "
        "own figures are next to them (docs/robot.md T). Exit code 1 when a slot of the run overran.",
    )
    command.add_argument(
        "board", nargs="?", metavar="BOARD", help=f"one of {', '.join(BOARD_CLASSES)} (default: all, rows only)"
    )
    length = command.add_mutually_exclusive_group()
    length.add_argument("--static", action="store_true", help="only what is known without a run")
    length.add_argument(
        "--time", type=quantity(TIMES, "s", 0.0), metavar="2s", help=f"virtual time of the run ({USUAL_TIME_S:g} s)"
    )
    length.add_argument("--steps", type=whole_number(1), metavar="N", help="run for this many steps")
    command.add_argument("--seed", type=whole_number(0), default=1, metavar="N", help="seed of the run (1)")
    command.add_argument(
        "--edge-rate",
        type=number(least=0.0, most=1e9),
        metavar="N",
        help="edges per second of every encoder (default: its motor at 6300 rpm)",
    )
    command.add_argument("--full-bus", action="store_true", help="as many frames as the wire can carry in a slot")
    command.add_argument("--json", metavar="FILE|-", help="everything as JSON; - prints it and nothing else")
    command.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Check, run, print; 0, or 1 when a slot of the run overran."""
    names = list(BOARD_CLASSES) if options.board is None else [options.board]
    if options.board is not None and options.board not in BOARD_CLASSES:
        raise UserError(unknown("board", options.board, BOARD_CLASSES))
    if options.time is not None and options.time <= FIRST_SECONDS:
        raise UserError(f"--time {options.time:g}: the first {FIRST_SECONDS:g} s do not count, so more are needed")
    json_file = json_target(options.json)
    with contextlib.closing(Ranger(Scenario(seed=options.seed))) as robot:
        bounds = {name: static_check.check(robot.boards[name], options.edge_rate, options.full_bus) for name in names}
        views = {} if options.static else seen(robot, names, options)
        boards = [facts(bounds[name], views.get(name)) for name in names]
    ran = None if options.static else run_facts(robot, options)
    text = json.dumps({"run": ran, "boards": boards}, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    else:
        console = terminal.console(markup=True, highlight=False)
        for board in boards:
            show(board, ran, console, whole=options.board is not None)
    return EXIT_OVERRAN if any(board["seen"] and board["seen"]["overruns"] for board in boards) else EXIT_DONE


def seen(robot: Ranger, names: list[str], options: argparse.Namespace) -> dict[str, SlotView]:
    """Run the robot with these boards recorded."""
    screen = terminal.console(stderr=True, quiet=options.json == "-")
    if screen.is_terminal:
        screen.print("the robot runs", highlight=False)
    robot.run_for(FIRST_SECONDS)
    views: dict[str, SlotView] = {name: robot.slots(name) for name in names}  # type: ignore[arg-type]
    if options.steps is not None:
        stop = StopRule(steps=options.steps)
    else:
        stop = StopRule(time_s=options.time if options.time is not None else USUAL_TIME_S)
    while not robot.run(stop):
        pass
    return views


def run_facts(robot: Ranger, options: argparse.Namespace) -> dict:
    """The run that the measured figures come from."""
    return {"seed": options.seed, "time_s": round(robot.time_s, 6), "steps": robot.steps, "ended": robot.ended}


def facts(bound: BoardBound, view: SlotView | None) -> dict:
    """A board as plain values, in cycles unless a name says otherwise."""
    functions = view.functions if view is not None else {}
    interrupts = view.interrupts if view is not None else {}
    image = robot_figures.EXECUTION_TIME_US.get(bound.board)
    return {
        "board": bound.board,
        "hz": bound.hz,
        "slot_us": bound.slot_ns / 1000,
        "slot_cycles": bound.slot_cycles,
        "assumed": {"edges": dict(bound.edges), "frames": dict(bound.frames)},
        "functions": [function_facts(bound.board, each, functions.get(each.name)) for each in bound.functions],
        "interrupts": [
            dataclasses.asdict(each) | {"seen": interrupt_facts(interrupts.get(each.name))} for each in bound.interrupts
        ],
        "rows": [
            dataclasses.asdict(row) | {"seen": row_facts(view.of_row(row.row)) if view is not None else None}
            for row in bound.rows
        ],
        "seen": row_facts(view) if view is not None else None,
        "robot_execution_time_us": None if image is None else {"held": image[0], "walking": image[1]},
    }


def function_facts(board: str, bound: FunctionBound, ran: Statistics | None) -> dict:
    """A line of the table."""
    counted = robot_figures.cycles_of(board, bound.name)
    return dataclasses.asdict(bound) | {
        "seen": None
        if ran is None
        else {"calls": ran.calls, "least": ran.least, "median": ran.median, "most": ran.most, "items": ran.most_items},
        "robot": None if counted is None else {"least": counted[0], "most": counted[1]},
    }


def interrupt_facts(ran: Statistics | None) -> dict | None:
    """The measured figures of an interrupt source."""
    return None if ran is None else {"served": ran.calls, "most": ran.most, "latency_us": ran.latency_ns / 1000}


def row_facts(view: SlotView) -> dict | None:
    """The measured figures of the slots of a view."""
    if not len(view):
        return None
    worst = view.worst()
    return {
        "slots": len(view),
        "overruns": view.overruns,
        "worst_cycles": worst.cycles,
        "worst_us": worst.taken_ns / 1000,
        "worst_at_s": worst.start_ns * 1e-9,
        "margin": round(worst.margin, 6),
    }


# ---- text output


def show(board: dict, ran: dict | None, console: Console, whole: bool) -> None:
    """Print one board: all of it, or its rows."""
    slot = f"{board['slot_us']:g} us slots of {board['slot_cycles']:,} cycles"
    console.print(f"[bold]{board['board']}[/bold], {slot}, {len(board['rows'])} rows; all in cycles")
    if whole:
        terminal.print_table(console, function_table(board), spare=("robot's image", "per item", "where"))
    terminal.print_table(console, row_table(board), spare=("all limits", "seen margin"))
    if whole:
        terminal.print_table(console, interrupt_table(board), spare=("why so often",))
    for line in notes(board, ran):
        console.print(line, soft_wrap=True)
    console.print()


def function_table(board: dict) -> Table:
    """The schedule, line by line."""
    table = Table(box=None, pad_edge=False)
    table.add_column("function", no_wrap=True)
    table.add_column("where", no_wrap=True)
    for title in ("cost", "per item", "limit", "worst seen", "possible", "robot's image"):
        table.add_column(title, justify="right")
    for each in board["functions"]:
        item = f"{each['per_item']:,} /{each['item']}" if each["per_item"] else ""
        robot = each["robot"]
        image = "" if robot is None else f"{robot['least']:,}"
        if robot is not None and robot["most"] != robot["least"]:
            image += f" - {robot['most']:,}"
        most = each["seen"]["most"] if each["seen"] else None
        mark = "[red]" if most is not None and 0 < each["limit"] < most else ""
        table.add_row(
            each["name"],
            each["place"],
            f"{each['cost']:,}",
            item,
            f"{each['limit']:,}" if each["limit"] else "-",
            "" if most is None else f"{mark}{most:,}",
            f"{each['worst']:,}",
            image,
        )
    return table


def row_table(board: dict) -> Table:
    """Sums of the rows."""
    table = Table(box=None, pad_edge=False, title_justify="left")
    titles = ["row", "costs", "worst possible", "+ interrupts", "margin", "", "all limits"]
    if board["seen"]:
        titles += ["worst seen", "seen margin"]
    for title in titles:
        table.add_column(title, justify="left" if not title else "right")
    for row in board["rows"]:
        saw = row["seen"]
        cells = [
            str(row["row"]),
            f"{row['cost']:,}",
            f"{row['worst']:,}",
            f"{row['interrupts']:,}",
            f"{100 * row['margin']:.1f} %",
            f"[red]{row['verdict']}" if row["verdict"] == OVERRUNS else row["verdict"],
            f"{row['limits']:,}",
        ]
        if saw:
            cells += [f"{saw['worst_cycles']:,}", f"{100 * saw['margin']:.1f} %"]
        table.add_row(*cells)
    return table


def interrupt_table(board: dict) -> Table:
    """The most time that interrupts can take in a slot."""
    table = Table(box=None, pad_edge=False)
    table.add_column("interrupt")
    for title in ("in a slot", "each", "together", "most seen", "latency seen"):
        table.add_column(title, justify="right")
    table.add_column("why so often")
    for each in board["interrupts"]:
        saw = each["seen"]
        table.add_row(
            each["name"],
            str(each["times"]),
            f"{each['cycles']:,}",
            f"{each['worst']:,}",
            f"{saw['most']:,}" if saw else "",
            f"{saw['latency_us']:.2f} us" if saw else "",
            each["why"],
        )
    return table


def notes(board: dict, ran: dict | None) -> list[str]:
    """The basis of the figures."""
    lines = []
    saw = board["seen"]
    if ran is not None and saw is not None:
        steps = "1 step" if ran["steps"] == 1 else f"{ran['steps']} steps"
        lines.append(
            f"Seen in {saw['slots']:,} slots from {FIRST_SECONDS:.2f} to {ran['time_s']:.2f} s, {steps}, seed "
            f"{ran['seed']}: {saw['overruns']} overran; the longest took {saw['worst_us']:.1f} us, "
            f"at {saw['worst_at_s']:.4f} s." + (f" The robot fell: {ran['ended']}." if ran["ended"] else "")
        )
    logs = board["robot_execution_time_us"]
    if logs is not None:
        held, walking = logs["held"], logs["walking"]
        lines.append(
            f"The robot's logs: {held[0]} to {held[1]} us held (median), up to {walking[1]} us walking (robot.md T1)."
        )
    edges = ", ".join(f"{count} edges of {name}" for name, count in board["assumed"]["edges"].items())
    frames = ", ".join(f"{count} frames on {name}" for name, count in board["assumed"]["frames"].items())
    if edges or frames:
        lines.append(f"Possible in one slot: {', '.join(part for part in (edges, frames) if part)}.")
    return lines
