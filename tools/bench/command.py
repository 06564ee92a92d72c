"""`ranger-sim bench`: measurements by name. Machines differ and are noisy, so figures matter only in comparison.

Timed cases are measured together: each several times, in turn, in a separate process. Every turn also times
python-can's `virtual` as a measure of the machine, and each figure is compared with it.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import platform
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ranger_sim import loading
from ranger_sim.foundation import wallclock
from ranger_sim.tools.bench.cases import CASES, FRAMES, RUNS, SIMULATED, YARDSTICK, measured
from ranger_sim.tools.command_line import streams
from ranger_sim.tools.command_line.files import json_target, replace_file
from ranger_sim.tools.command_line.help_text import named_lines
from ranger_sim.tools.command_line.units import whole_number

SHOWN = {SIMULATED: "x real time", FRAMES: "frames", RUNS: "runs"}
EXIT_EXCEEDED = 1  # a response came later than its bound


@dataclass(frozen=True)
class Part:
    """One measurement by name: cases that are timed together with those of other parts, or one that runs alone."""

    line: str
    cases: tuple[str, ...] = ()
    alone: Callable[[argparse.Namespace, Callable[[str], None]], Any] | None = None
    only_named: bool = False  # needs more than the package itself


def interfaces(options: argparse.Namespace, report: Callable[[str], None]) -> list[dict]:
    """Frames through python-can interfaces."""
    from ranger_sim.tools.bench import interfaces as part

    return part.run(options.frames, report)


def processes(options: argparse.Namespace, report: Callable[[str], None]) -> list[dict]:
    """The robot as processes."""
    from ranger_sim.tools.bench import processes as part

    return part.run(options.seconds, report)


def walks(options: argparse.Namespace, report: Callable[[str], None]) -> list[dict]:
    """The acceptance walks."""
    from ranger_sim.tools.bench import walks as part

    return part.run(report)


def bounds(options: argparse.Namespace, report: Callable[[str], None]) -> dict:
    """Random message sets against their bounds."""
    from ranger_sim.can_bus import bound_check

    figures = bound_check.random_sets(options.sets, fd=options.fd)
    for name, value in figures.items():
        report(f"{name:28} {value:.4g}" if isinstance(value, float) else f"{name:28} {value}")
    return figures


PARTS = {
    "robot": Part("the whole robot, its trace hashed, nothing kept", ("robot", "robot-longer")),
    "robot-with-log": Part("the same with a log: the last 10 s, and everything", ("robot-window", "robot-full")),
    "user-function": Part("the same with a control law by a user's Python function", ("robot-swapped",)),
    "plant": Part("the body alone", ("plant",)),
    "fmu": Part(
        "the body alone, and as a unit for co-simulation through its C interface",
        ("plant", "fmu", "fmu-fine", "fmu-steps"),
        only_named=True,
    ),
    "boards-in-c": Part(
        "twelve boards in C on one bus: in one process, as processes, and the same in Python",
        (
            "boards-in-c",
            "boards-in-c-ahead",
            "boards-in-c-filtered",
            "boards-in-python",
            "boards-in-python-ahead",
            "boards-in-python-filtered",
            "boards-in-c-processes",
            "boards-in-c-filtered-processes",
        ),
        only_named=True,
    ),
    "start": Part(
        "starts of the command, of a first robot, of pytest with the plugin, and of the bare interpreter",
        ("start-python", "start-version", "start-info", "start-robot", "start-pytest"),
        only_named=True,
    ),
    "campaign": Part(
        "runs of a small machine's campaign with its start, and the machine alone",
        ("campaign", "campaign-bare"),
        only_named=True,
    ),
    "images": Part(
        "a board as an image of the chip, and its program for this computer (needs arm-none-eabi-gcc)",
        ("images", "images-native"),
        only_named=True,
    ),
    "trace": Part("a walk without a trace and with one", ("walk", "walk-trace"), only_named=True),
    "rebuild": Part(
        "in a checkout: the build after one module was removed, and with nothing to do",
        ("rebuild", "rebuild-nothing"),
        only_named=True,
    ),
    "bus": Part("four CAN buses alone: full, a quarter full, of eight boards", ("bus", "bus-quarter", "bus-eight")),
    "interpreted": Part(
        "robot, body and buses from the plain sources", ("robot-interpreted", "plant-interpreted", "bus-interpreted")
    ),
    "processes": Part("the robot with a process for each board: pace, lateness of slots", alone=processes),
    "interfaces": Part(
        "--frames through python-can's interfaces and ours: lost, reordered, frames/s", alone=interfaces
    ),
    "walks": Part("how far the parameter sets walk, over seeds and floors (minutes)", alone=walks),
    "bounds": Part("--sets of random messages on the bus against their response-time bounds (minutes)", alone=bounds),
}
TOGETHER = tuple(name for name, part in PARTS.items() if part.cases and not part.only_named)


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "bench",
        description=f"Measurements by name. Without a name:\n{', '.join(TOGETHER)}.\n"
        "These are timed together; the others only when they are named.",
        epilog="parts:\n" + named_lines({name: part.line for name, part in PARTS.items()}, 15),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("part", nargs="*", metavar="PART", help="parts to measure; see below")
    command.add_argument(
        "--runs", type=whole_number(1), default=3, metavar="N", help="repetitions of timed parts (default 3)"
    )
    command.add_argument(
        "--seconds", type=whole_number(1), default=20, metavar="S", help="virtual seconds per run (default 20)"
    )
    command.add_argument(
        "--frames", type=whole_number(3), default=1_000_000, metavar="N", help="of interfaces (default 1000000)"
    )
    command.add_argument("--sets", type=whole_number(1), default=10_000, metavar="N", help="of bounds (default 10000)")
    command.add_argument("--fd", action="store_true", help="of bounds: buses of CAN FD, with two bit rates")
    command.add_argument("--json", metavar="FILE|-", help="everything as JSON; - prints it and nothing else")
    command.set_defaults(run=run, refuse=command.error)


def machine() -> dict:
    """The machine that the figures are taken on, and how busy it is."""
    model = platform.processor() or platform.machine()
    cpuinfo = pathlib.Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [line for line in cpuinfo.read_text(encoding="utf-8").splitlines() if line.startswith("model name")]
        if names:
            model = names[0].partition(":")[2].strip()
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "system": platform.system(),
        "runs": "compiled" if loading.RUNS_COMPILED else f"interpreted: {loading.RUNS_INTERPRETED_BECAUSE}",
        "load_average_before": os.getloadavg()[0],
    }


def run(options: argparse.Namespace) -> int:
    """Run the named measurements; 0 done, 1 when a response on the bus came later than its bound."""
    for name in options.part:
        if name not in PARTS:
            options.refuse(f"{name!r} is not a part (available: {', '.join(PARTS)})")
    json_file = json_target(options.json)
    chosen = [name for name in PARTS if name in (options.part or TOGETHER)]
    result: dict = {"date": wallclock.today_iso(), "machine": machine()}

    def report(text: str) -> None:
        if options.json != "-":
            print(text, flush=True)

    about = result["machine"]
    report(
        f"{about['processor']}, {about['cores']} cores, Python {about['python']}, {about['runs']}; "
        f"load average before: {about['load_average_before']:.2f}"
    )
    cases = [case for name in chosen for case in PARTS[name].cases]
    if cases:
        result.update(runs=options.runs, figures=timed_together(cases, options.runs, options.seconds))
        for line in lines_of(result["figures"], options.runs):
            report(line)
    for name in chosen:
        alone = PARTS[name].alone
        if alone is not None:
            report(f"{name}: {PARTS[name].line}")
            result[name] = alone(options, lambda text: report(f"  {text}"))
    text = json.dumps(result, indent=2)
    if json_file is not None:
        replace_file(json_file, (text + "\n").encode())
    if options.json == "-":
        streams.print_result(text)
    return EXIT_EXCEEDED if result.get("bounds", {}).get("exceeded") else 0


def timed_together(cases: list[str], runs: int, seconds: float) -> dict:
    """Every case and the yardstick `runs` times, in turn: values, median, extremes, and the ratio to the yardstick.

    The ratio is the median of the turns' ratios, because a temporary slowdown of the machine affects both.
    """
    values: dict[str, list[float]] = {name: [] for name in (*cases, YARDSTICK)}
    for turn in range(runs):
        for name, found in values.items():
            if sys.stderr.isatty():
                print(f"\r\033[Krun {turn + 1} of {runs}: {CASES[name].title} ...", end="", file=sys.stderr, flush=True)
            found.append(measured(name, seconds)["figure"])
    if sys.stderr.isatty():
        print("\r\033[K", end="", file=sys.stderr, flush=True)
    return {
        name: {
            "unit": CASES[name].unit,
            "values": found,
            "median": statistics.median(found),
            "min": min(found),
            "max": max(found),
            "ratio_to_virtual": statistics.median(
                one / yardstick for one, yardstick in zip(found, values[YARDSTICK], strict=True)
            ),
        }
        for name, found in values.items()
    }


def lines_of(figures: dict, runs: int) -> list[str]:
    """The figures as lines of a table. Simulated seconds are compared by their cost in frames of the yardstick."""
    lines = [
        f"timed together, {runs} runs of each in turn, each in a separate process:",
        f"  {'per second of processor time':38} {'median':>9} {'least':>9} {'most':>9}  {'':11}  python-can's virtual",
    ]
    for name, figure in figures.items():
        ratio = figure["ratio_to_virtual"]
        one = "1 run" if figure["unit"] == RUNS else "1 s"
        compared = f"{ratio:.3g} times" if figure["unit"] == FRAMES else f"{one} costs {1.0 / ratio:,.0f} of its frames"
        numbers = " ".join(f"{three_digits(figure[key]):>9}" for key in ("median", "min", "max"))
        line = f"  {CASES[name].title:38} {numbers}  {SHOWN[figure['unit']]:11}"
        lines.append(line.rstrip() if name == YARDSTICK else f"{line}  {compared}")
    return lines


def three_digits(value: float) -> str:
    """Three significant digits, with separated thousands."""
    return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"
