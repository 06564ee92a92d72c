"""`ranger-sim bench`: how fast the parts and the whole are, as ratios within one run.

Machines differ and are noisy: every figure is the median of several runs in their own processes, taken in
turn, and what matters is how the figures of one run compare.
"""

import argparse
import json
import os
import pathlib
import platform
import statistics
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from rich.console import Console
from rich.table import Table

from ranger_sim.foundation import wallclock
from ranger_sim.foundation.user_error import UserError
from ranger_sim.tools.files import json_target, replace_file
from ranger_sim.tools.units import whole_number


def register(commands: Any) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser("bench", help="times real time of the whole robot and of its parts")
    command.add_argument("--runs", type=whole_number(1), default=3, help="runs of each case (default 3)")
    command.add_argument("--seconds", type=whole_number(1), default=20, help="virtual seconds per compiled run")
    command.add_argument("--json", metavar="FILE|-", help="figures as JSON; - prints them and nothing else")
    command.add_argument(
        "--walks", action="store_true", help="instead: how far and how the parameter sets walk, over seeds and floors"
    )
    command.add_argument(
        "--interfaces",
        action="store_true",
        help="instead: frames through python-can interfaces, ours first",
    )
    command.add_argument(
        "--frames", type=whole_number(3), default=1_000_000, help="frames of --interfaces (default 1000000)"
    )
    command.add_argument(
        "--bounds",
        type=whole_number(1),
        metavar="SETS",
        help="instead: so many random message sets on the simulated bus against their response-time bounds",
    )
    command.add_argument("--case", choices=sorted(CASES), help=argparse.SUPPRESS)
    command.set_defaults(run=run)


def robot_case(seconds: float, log: str = "none", swap: bool = False) -> dict:
    """Run the whole robot for so long; CPU seconds of the stepping loop only."""
    from ranger_sim.harness.ranger import Ranger
    from ranger_sim.harness.scenario import Scenario, StopRule

    robot = Ranger(Scenario(), log=log)
    if swap:
        robot.replace("MCH", "mc_compliant_control", users_law(robot.board("MCH")), cost=4200, limit=6000)
    robot.run(StopRule(time_s=1.0), 1.0)
    started = wallclock.process_cpu_s()
    robot.run(StopRule(time_s=1.0 + seconds), seconds)
    used = wallclock.process_cpu_s() - started
    steps = robot.steps
    robot.close()
    return {"figure": seconds / used, "unit": "simulated s per CPU s", "steps": steps}


def users_law(board: Any) -> Callable[[], None]:
    """What a user might write: the hip's spring-damper law in floating-point Python, for the firmware's own."""
    law, limits, loop, readings = board.compliance, board.limits, board.current_control, board.readings

    def control() -> None:
        position = board.controlled_position() / 65536.0
        velocity = board.controlled_velocity() / 65536.0
        current = law.command / 65536.0 - law.stiffness / 65536.0 * position - law.dampness / 65536.0 * velocity
        target = limits.limit_target(int(current * 65536.0), int(velocity * 65536.0))
        loop.update(target, readings.motor_current_fixed())

    return control


def plant_case(seconds: float) -> dict:
    """The plant alone, held, motors off."""
    from ranger_sim.plant.ranger import RangerPlant

    plant = RangerPlant()
    steps = round(seconds * 1e9 / plant.step_ns)
    started = wallclock.process_cpu_s()
    for _ in range(steps):
        plant.step()
    return {"figure": seconds / (wallclock.process_cpu_s() - started), "unit": "simulated s per CPU s"}


def bus_case(frames: int, load: float = 1.0, nodes: int = 3) -> dict:
    """Our bus: send, arbitrate and deliver on four buses of `nodes` boards at `load`."""
    from ranger_sim.can_bus import benchmark

    done = benchmark.million_frames(frames, load, nodes)
    return {
        "figure": done["frames_per_s"],
        "unit": "frames per CPU s",
        "frames": done["frames"],
        "lost": done["lost"],
        "out_of_order": done["out_of_order"],
    }


def virtual_case(frames: int) -> dict:
    """The same work on python-can's `virtual` interface."""
    from ranger_sim.can_bus.edge import benchmark

    return {"figure": benchmark.virtual_frames(frames)["frames_per_s"], "unit": "frames per CPU s"}


def fuzz_case(cases: int) -> dict:
    """Wrong bytes on the data link, both ways; everything accounted for, or an error."""
    from ranger_sim.tools import fuzz_serial

    return fuzz_serial.benchmark(cases)


def can_fuzz_case(cases: int) -> dict:
    """Frames of every kind and bytes that are none, from outside onto a whole robot's buses."""
    from ranger_sim.tools import fuzz_can

    return fuzz_can.benchmark(cases)


def channel_fuzz_case(cases: int) -> dict:
    """Damaged messages in the channel of a board process."""
    from ranger_sim.tools import fuzz_channel

    return fuzz_channel.benchmark(cases)


def profile_fuzz_case(cases: int) -> dict:
    """Damaged profiles and schedules."""
    from ranger_sim.tools import fuzz_profiles

    return fuzz_profiles.benchmark(cases)


CASES = {
    # case: (title, function of the virtual seconds)
    "robot": ("whole robot, digest on, logs off", lambda s: robot_case(s)),
    "robot-window": ("whole robot, last 10 s kept", lambda s: robot_case(s, log="window")),
    "robot-full": ("whole robot, everything kept", lambda s: robot_case(s, log="full")),
    "robot-swapped": ("hip control law replaced by a user's function", lambda s: robot_case(s, swap=True)),
    "robot-longer": ("whole robot, four times the simulated time", lambda s: robot_case(4 * s)),
    "plant": ("plant alone", lambda s: plant_case(s)),
    "bus": ("our four buses, every buffer always full", lambda s: bus_case(50_000 * int(s))),
    "bus-quarter": ("our four buses at 25 % load", lambda s: bus_case(50_000 * int(s), 0.25)),
    "bus-eight": ("our four buses, eight boards each, 75 % load", lambda s: bus_case(50_000 * int(s), 0.75, 8)),
    "serial-fuzz": ("wrong bytes on the serial line", lambda s: fuzz_case(5_000 * int(s))),
    "can-fuzz": ("wrong and foreign frames on the buses", lambda s: can_fuzz_case(5_000 * int(s))),
    "channel-fuzz": ("damaged messages to a board process", lambda s: channel_fuzz_case(5_000 * int(s))),
    "profile-fuzz": ("damaged profiles and schedules", lambda s: profile_fuzz_case(5_000 * int(s))),
    "virtual": ("python-can virtual, three boards", lambda s: virtual_case(1_000 * int(s))),
}
INTERPRETED = ("robot", "plant", "bus")


def measured(case: str, seconds: float, interpreted: bool) -> dict:
    """One case in its own process."""
    environment = dict(os.environ)
    environment.pop("RANGER_SIM_INTERPRETED", None)
    if interpreted:
        environment["RANGER_SIM_INTERPRETED"] = "1"
    call = [sys.executable, "-m", "ranger_sim", "bench", "--case", case, "--seconds", str(max(1, int(seconds)))]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise UserError(f"bench: case {case} failed: {done.stderr.strip().splitlines()[-1:]}")
    return json.loads(done.stdout)


# What `--walks` walks: parameter set, seeds, steps, roughness in m.
WALKS = (
    ("robust", range(1, 4), 1000, 0.0),
    ("robust", range(1, 4), 200, 0.001),
    ("record-2011", range(1, 21), 1000, 0.0),
)
KEPT = (
    "controller",
    "seed",
    "floor_roughness_m",
    "steps",
    "fell",
    "fall_cause",
    "mean_step_length_m",
    "std_step_length_m",
    "mean_step_time_s",
    "motor_power_W",
    "tcot",
    "heel_strike_delay_ms",
    "trace_digest",
)


def walks(options: argparse.Namespace) -> int:
    """Walk every case of WALKS; a line each, and everything as JSON."""
    from ranger_sim.harness.ranger import Ranger
    from ranger_sim.harness.scenario import Scenario, StopRule

    console = Console(stderr=True, quiet=options.json == "-")
    rows = []
    for controller, seeds, steps, roughness in WALKS:
        for seed in seeds:
            robot = Ranger(Scenario(controller=controller, seed=seed, floor_roughness_m=roughness))
            while not robot.run(StopRule(steps=steps), 10.0):
                pass
            summary = robot.summary()
            robot.close()
            row = {key: summary[key] for key in KEPT}
            row["lost"] = sum(bus["lost"] for bus in summary["can"].values())
            row["overruns"] = sum(board["overruns"] for board in summary["slots"].values())
            rows.append(row)
            console.print(
                f"{controller}, seed {seed}, {1000 * roughness:g} mm: {row['steps']} of {steps} steps"
                f"{', ' + row['fall_cause'] if row['fell'] else ''}; {row['mean_step_length_m']:.3f} m, "
                f"{row['mean_step_time_s']:.3f} s, {row['motor_power_W']:.1f} W, "
                f"lost {row['lost']}, overruns {row['overruns']}",
                highlight=False,
                soft_wrap=True,
            )
    result = {"date": wallclock.today_iso(), "machine": machine(), "walks": rows}
    if options.json == "-":
        print(json.dumps(result, indent=2))
    elif options.json:
        replace_file(pathlib.Path(options.json), (json.dumps(result, indent=2) + "\n").encode())
    return 0


def bounds(options: argparse.Namespace) -> int:
    """Random message sets against their bounds; exit code 1 when an answer came later than its bound."""
    from ranger_sim.can_bus import bound_check

    json_file = json_target(options.json)
    figures = bound_check.random_sets(options.bounds)
    result = {"date": wallclock.today_iso(), "machine": machine(), "bounds": figures}
    if json_file is not None:
        replace_file(json_file, (json.dumps(result, indent=2) + "\n").encode())
    if options.json == "-":
        print(json.dumps(result, indent=2))
    else:
        for name, value in figures.items():
            print(f"{name:28} {value:.4g}" if isinstance(value, float) else f"{name:28} {value}")
    return 1 if figures["exceeded"] else 0


def interfaces(options: argparse.Namespace) -> int:
    """Frames through python-can interfaces, ours first; a table, and everything as JSON."""
    from ranger_sim.tools.interface_bench import compare, table_of

    json_file = json_target(options.json)
    rows = compare(options.frames, Console(stderr=True, quiet=options.json == "-"))
    result = {"date": wallclock.today_iso(), "machine": machine(), "interfaces": rows}
    if options.json == "-":
        print(json.dumps(result, indent=2))
        return 0
    if json_file is not None:
        replace_file(json_file, (json.dumps(result, indent=2) + "\n").encode())
    Console().print(table_of(rows))
    return 0


def machine() -> dict:
    """What the figures were taken on."""
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
    }


def run(options: argparse.Namespace) -> int:
    """Measure every case `--runs` times in turn; print medians and the ratio to the whole robot."""
    if options.walks:
        return walks(options)
    if options.interfaces:
        return interfaces(options)
    if options.bounds:
        return bounds(options)
    if options.case:
        print(json.dumps(CASES[options.case][1](options.seconds)))
        return 0
    json_file = json_target(options.json)
    plan = [(case, False, options.seconds) for case in CASES]
    plan += [(case, True, max(1, options.seconds // 10)) for case in INTERPRETED]
    figures: dict = {}
    console = Console(stderr=True, quiet=options.json == "-")
    with console.status("measuring ...") as status:
        for turn in range(options.runs):
            for case, interpreted, seconds in plan:
                status.update(f"run {turn + 1} of {options.runs}: {CASES[case][0]}")
                result = measured(case, seconds, interpreted)
                key = case + (" (interpreted)" if interpreted else "")
                figures.setdefault(key, {"unit": result["unit"], "values": []})["values"].append(result["figure"])
    base = statistics.median(figures["robot"]["values"])
    for figure in figures.values():
        figure["median"] = statistics.median(figure["values"])
        figure["min"], figure["max"] = min(figure["values"]), max(figure["values"])
        if figure["unit"] == "simulated s per CPU s":
            figure["ratio_to_robot"] = figure["median"] / base
    result = {"date": wallclock.today_iso(), "machine": machine(), "runs": options.runs, "figures": figures}
    if options.json == "-":
        print(json.dumps(result, indent=2))
        return 0
    if json_file is not None:
        replace_file(json_file, (json.dumps(result, indent=2) + "\n").encode())
    table = Table(title="ranger-sim bench")
    for column in ("case", "median", "min", "max", "unit", "/ robot"):
        table.add_column(column, justify="left" if column in ("case", "unit") else "right")
    for key, figure in figures.items():
        case = key.removesuffix(" (interpreted)")
        title = CASES[case][0] + (", interpreted" if case != key else "")
        ratio = f"{figure['ratio_to_robot']:.3f}" if "ratio_to_robot" in figure else ""
        table.add_row(title, *(f"{figure[k]:,.4g}" for k in ("median", "min", "max")), figure["unit"], ratio)
    Console().print(table)
    return 0
