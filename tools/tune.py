"""`ranger-sim tune`: search controller parameters by walking the whole robot.

A pattern search along one parameter at a time (Hooke and Jeeves): each parameter in turn is tried one step up
and one step down; a change stays only when it lowers the cost by at least `--worth`, so that few parameters
end up different from where they began. After each round without a change the steps are halved. There is no
chance in it: the same call on the same program gives the same file.

Every try is walked with seven boards, buses and body, once per seed and floor. The cost of a walk is 0 for a
walk like the robot's in the 65 km of May 2011 and grows with the squares of what differs, each in parts of
what is allowed; a fall costs more than any walk that stays up, and the less the later it comes.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import pathlib
import tempfile

from rich.console import Console

from ranger_sim.boards.main_brain import controllers, programs
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.scenario import Scenario, StopRule
from ranger_sim.tools.units import LENGTHS, quantity, whole_number

# What a walk should be, and the deviation that costs 1. Values: the robot's in May 2011 (0.35 m, 0.60 s, 11.3 W,
# 0.28, 14 ms); tolerances: a quarter of the length, 15 % of the time, and what keeps 6 ... 15 W, 0.19 ... 0.35 and
# 8 ... 20 ms inside 1. Steps should be alike: a spread of a tenth of a step costs 1 (chosen by us).
AIMS = {
    "mean_step_length_m": (0.35, 0.0875),
    "mean_step_time_s": (0.60, 0.09),
    "motor_power_W": (11.3, 3.7),
    "tcot": (0.28, 0.07),
    "std_step_length_m": (0.0, 0.035),
}
DELAY_AIM_MS, DELAY_TOLERANCE_MS = 14.0, 6.0
FALL_COST = 100.0  # at the first step; half of it just before the last one
LOST_COST = 10.0  # per lost frame or slot overrun: none is allowed

# What is varied unless the caller says otherwise: parameter and first step (chosen by us: about a tenth of the
# value, or what the notes of 2010 and 2011 changed it by).
DEFAULT_STEPS = {
    "C_H_OUTER_STIFFNESS": 2.0,
    "P_FO_PP_THEIGHT": 0.005,
    "P_FI_PP_THEIGHT": 0.005,
    "P_F_FU_H_ANG": 0.03,
    "P_H_PM_H_TRATE": 0.2,
    "DC2_H_AM_H_RATE1": 0.3,
    "DC2_H_AM_H_RATE2": 0.2,
    "C_F_ST_F_ANG": 1.0,
    "P_F_PP_F_TANG": 0.05,
}
# Both foot pairs have their own trigger; the plant's legs are alike, so these move together.
TOGETHER = {"P_FO_PP_THEIGHT": "P_FI_PP_THEIGHT"}


@dataclasses.dataclass(frozen=True)
class Task:
    """What each candidate has to walk: `steps` with every seed on every floor (roughness in m)."""

    base: str
    steps: int
    seeds: tuple
    floors: tuple


def register(commands: argparse._SubParsersAction) -> None:
    """Add the subcommand to the command line."""
    command = commands.add_parser(
        "tune",
        help="search for better controller parameters by walking the whole robot",
        description="Pattern search, one parameter at a time. The best set is written as a .toml file.",
    )
    command.add_argument(
        "--base",
        default="record-2011",
        metavar="NAME",
        help="parameter set whose values the result leaves out (default record-2011)",
    )
    command.add_argument("--start", metavar="NAME", help="parameter set to begin with (default: the base)")
    command.add_argument(
        "--vary",
        action="append",
        type=parameter_step,
        metavar="NAME=STEP",
        help="a parameter and its first step; may be given several times (default: a list of nine)",
    )
    command.add_argument("--steps", type=whole_number(6), default=100, help="steps of each walk (default 100)")
    command.add_argument("--seeds", type=whole_number(1), default=2, help="walks with seeds 1 ... N (default 2)")
    command.add_argument(
        "--floor-roughness",
        type=quantity(LENGTHS, "m"),
        action="append",
        metavar="1mm",
        help="a floor to walk on; may be given several times (default 0 and 1mm)",
    )
    command.add_argument("--rounds", type=whole_number(0), default=2, help="passes over the parameters (default 2)")
    command.add_argument(
        "--worth", type=float, default=0.05, help="a change is kept that lowers the cost by so much (default 0.05)"
    )
    command.add_argument("--out", required=True, metavar="FILE.toml", help="file for the set that was found")
    command.set_defaults(run=run)


def parameter_step(text: str) -> tuple[str, float]:
    """An argparse type: NAME=STEP."""
    name, sign, step = text.partition("=")
    known = programs.parameter_rows()
    if name not in known:
        raise argparse.ArgumentTypeError(f"{name!r}: no such parameter (`ranger-sim table list --board PC`)")
    try:
        value = float(step)
    except ValueError:
        value = 0.0
    if not sign or not 0.0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"{text!r}: NAME=STEP with a step above 0 is expected")
    return name, value


def run(options: argparse.Namespace) -> int:
    """Search and write the file; 0 when the found set walks every task to its end, else 1."""
    console = Console(stderr=True)
    out = pathlib.Path(options.out)
    if out.suffix != ".toml":
        raise UserError(f"--out {out}: a name ending in .toml is expected")
    if not out.parent.is_dir():
        raise UserError(f"--out {out}: there is no folder {out.parent}")
    task = Task(
        options.base,
        options.steps,
        tuple(range(1, options.seeds + 1)),
        tuple(options.floor_roughness) if options.floor_roughness else (0.0, 0.001),
    )
    base = controllers.load(options.base)
    start = controllers.load(options.start) if options.start else base
    changes = {name: value for name, value in start.values.items() if value != base.values[name]}
    steps = dict(options.vary) if options.vary else dict(DEFAULT_STEPS)
    with tempfile.TemporaryDirectory() as folder:
        judge = Judge(task, pathlib.Path(folder) / "candidate.toml", console)
        changes, cost, falls = search(judge, base.values, changes, steps, options.rounds, options.worth)
    title = f"{base.title}, tuned"
    try:
        out.write_text(as_toml(options.base, title, changes, start.reasons))
    except OSError as error:
        raise UserError(f"cannot write {out}: {error.strerror}") from None
    console.print(f"{out}: cost {cost:.3f}, {falls} falls in {len(task.seeds) * len(task.floors)} walks")
    return 1 if falls else 0


class Judge:
    """Walks candidates and remembers what they cost. Call: judge(changes) -> (cost, falls)."""

    def __init__(self, task: Task, file: pathlib.Path, console: Console) -> None:
        self.task = task
        self.file = file
        self.console = console
        self.known: dict[tuple, tuple[float, int]] = {}

    def __call__(self, changes: dict) -> tuple[float, int]:
        key = tuple(sorted(changes.items()))
        if key not in self.known:
            self.file.write_text(as_toml(self.task.base, "candidate", changes, {}))
            walks = [
                walk(str(self.file), seed, floor, self.task.steps)
                for floor in self.task.floors
                for seed in self.task.seeds
            ]
            cost = sum(cost_of(summary, self.task.steps) for summary in walks) / len(walks)
            self.known[key] = cost, sum(summary["fell"] for summary in walks)
            shown = ", ".join(f"{name} {value:g}" for name, value in key)
            self.console.print(f"{cost:8.3f}  {self.known[key][1]} falls  {shown}", highlight=False, soft_wrap=True)
        return self.known[key]


def walk(controller: str, seed: int, roughness_m: float, steps: int) -> dict:
    """The summary of one walk of the whole robot."""
    from ranger_sim.harness.ranger import Ranger  # the whole robot: only when it is to walk

    with contextlib.closing(Ranger(Scenario(controller=controller, seed=seed, floor_roughness_m=roughness_m))) as robot:
        # three times the time of such a walk, so that one that stands still ends too (chosen by us)
        stop = StopRule(steps=steps, time_s=10.0 + 1.8 * steps)
        while not robot.run(stop, 60.0):
            pass
        return robot.summary()


def cost_of(summary: dict, steps: int) -> float:
    """How far a walk is from the robot's; see AIMS. A walk that ended early counts as a fall."""
    if summary["fell"] or summary["steps"] < steps:
        return FALL_COST * (1.0 - 0.5 * summary["steps"] / steps)
    cost = sum(((summary[name] - aim) / tolerance) ** 2 for name, (aim, tolerance) in AIMS.items())
    cost += ((summary["heel_strike_delay_ms"]["mean"] - DELAY_AIM_MS) / DELAY_TOLERANCE_MS) ** 2
    lost = sum(bus["lost"] for bus in summary["can"].values())
    overruns = sum(board["overruns"] for board in summary["slots"].values())
    return cost + LOST_COST * (lost + overruns)


def search(
    judge: Judge, values: dict, changes: dict, steps: dict, rounds: int, worth: float
) -> tuple[dict, float, int]:
    """The pattern search: (changes, cost, falls). `values`: those of the base; `steps`: name -> first step."""
    rows = programs.parameter_rows()
    steps = dict(steps)
    cost, falls = judge(changes)
    for _ in range(rounds):
        improved = False
        for name in sorted(steps):
            if name in TOGETHER.values():
                continue
            now = changes.get(name, values[name])
            for tried in (now + steps[name], now - steps[name]):
                low, high = rows[name].minimum, rows[name].maximum
                tried = min(max(round(tried, 9), low), high)
                candidate = with_value(changes, values, name, tried)
                new_cost, new_falls = judge(candidate)
                if new_cost < cost - worth:
                    changes, cost, falls, improved = candidate, new_cost, new_falls, True
                    break
        # a change that no longer earns its keep is taken back
        for name in sorted(set(changes) - set(TOGETHER.values())):
            candidate = with_value(changes, values, name, values[name])
            new_cost, new_falls = judge(candidate)
            if new_cost < cost + worth:
                changes, cost, falls = candidate, new_cost, new_falls
        if not improved:
            steps = {name: 0.5 * step for name, step in steps.items()}
    return changes, cost, falls


def with_value(changes: dict, values: dict, name: str, value: float) -> dict:
    """`changes` with `name` (and its twin) at `value`; what equals the base is left out."""
    result = dict(changes)
    for each in (name, TOGETHER.get(name)):
        if each is not None:
            result.pop(each, None)
            if value != values[each]:
                result[each] = value
    return result


def as_toml(base: str, title: str, changes: dict, reasons: dict) -> str:
    """A parameter set with these changes against `base`."""
    lines = [f'title = "{title}"', 'description = "found by ranger-sim tune"', f'base = "{base}"', "", "[parameters]"]
    lines += [f"{name} = {value!r}" for name, value in sorted(changes.items())]
    lines += ["", "[reasons]"]
    lines += [
        f'{name} = "{reasons.get(name, "lowers the cost of the walks that the tuner tried")}"'
        for name in sorted(changes)
    ]
    return "\n".join(lines) + "\n"
