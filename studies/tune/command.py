"""`python -m studies.tune`: search controller parameters by walking the whole robot.

Two searches. `pattern` (Hooke and Jeeves) moves one parameter at a time: each in turn is tried one step up and one step
down; a change stays only when it lowers the cost by at least `--worth`, so that few parameters end up different from
where they began. After each round without a change the steps are halved. `evolution` (CMA-ES, evolution.py) moves all
of them at once and finds improvements that need several; every parameter ends up a little different. The same
call on the same program gives the same file, with however many `--jobs`.

Every try is walked with seven boards, buses and body, once per seed and floor. The cost of a walk: by `--aim robot` 0
for a walk like the robot's in the 65 km of May 2011, plus the squares of the differences, each divided by its
tolerance; by `--aim energy` a hundred times its cost of transport. A fall costs more than any walk without one, and the
less the later it happens.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import pathlib
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

from rich.console import Console

from ranger_sim.boards.main_brain import controllers, programs
from ranger_sim.foundation.user_error import UserError
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools import cli
from ranger_sim.tools.command_line import terminal
from ranger_sim.tools.command_line.units import LENGTHS, number, quantity, whole_number
from ranger_sim.tools.command_line.workers import workers
from studies.tune.evolution import Evolution

COMMAND = "python -m studies.tune"

# The target of a walk, and the deviation that costs 1. Values: the robot's in May 2011 (0.35 m, 0.60 s, 11.3 W,
# 0.28, 14 ms); tolerances: a quarter of the length, 15 % of the time, and such that 6 ... 15 W, 0.19 ... 0.35 and
# 8 ... 20 ms cost at most 1. Steps should be alike: a spread of a tenth of a step costs 1 (chosen by us).
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
TCOT_COST = 100.0  # per unit of the cost of transport: 28 for the robot's walk, below any fall up to 0.49
WORST_WALK_COST = 0.49 * FALL_COST

# The varied parameters unless the caller names others, by program: parameter and first step (chosen by us: about a
# tenth of the value, or the change in the notes of 2010 and 2011).
RECORD_STEPS = {
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
REFLEX_STEPS = {
    "R_W_REF": 0.03,
    "R_H_SW_I0": 0.2,
    "R_H_SW_DW": 0.5,
    "R_H_PL_PHI": 0.03,
    "R_H_PL_I0": 0.6,
    "R_H_PL_DW": 1.5,
    "R_H_PL_KP": 2.0,
    "R_H_PL_KV": 0.5,
    "R_F_ST_I0": 0.15,
    "R_F_ST_KP": 0.3,
    "R_F_ST_KV": 0.04,
    "R_F_PP_PHI": 0.015,
    "R_F_PP_I0": 0.5,
    "R_F_PP_DW": 0.8,
    "R_F_PP_KV": 0.04,
    "R_F_PU_I0": 0.6,
    "R_F_PU_DW": 0.8,
    "R_F_PU_KV": 0.04,
    "R_F_PU_TIME": 3.0,
    "R_F_FU_I0": 1.0,
    "R_F_FU_KP": 0.8,
    "R_F_FU_KV": 0.06,
    "R_F_FD_PHI": 0.02,
    "R_F_FD_Q3": 0.03,
    "R_F_FD_I0": 0.4,
    "R_F_FD_KP": 1.2,
    "R_F_FD_KV": 0.1,
}
HEAD_STEPS = {
    "CTRL_HIP_KP": 2.0,
    "CTRL_HIP_KD": 0.3,
    "CTRL_WALK_SCISSOR_GAIN": 0.1,
    "CTRL_WALK_SCISSOR_OFFSET": 0.02,
    "HD_H_HOLD": 0.03,
    "HD_F_PUSH": 0.1,
    "HD_TRANS_ANG": 0.01,
}
DEFAULT_STEPS = {"record": RECORD_STEPS, "reflex": REFLEX_STEPS, "head-2015": HEAD_STEPS}
# Both foot pairs have their own trigger; the plant's legs are alike, so these move together.
TOGETHER = {"P_FO_PP_THEIGHT": "P_FI_PP_THEIGHT"}


@dataclasses.dataclass(frozen=True)
class Task:
    """The walks of each candidate: `steps` with every seed on every floor (roughness in m)."""

    base: str
    steps: int
    seeds: tuple
    floors: tuple
    aim: str = "robot"
    body: str = Scenario.body


def parser(_command: str = "") -> cli.OneLineParser:
    """The options."""
    command = cli.OneLineParser(
        prog=COMMAND,
        description="The best set is written as a .toml file, by `evolution` after each generation.",
    )
    command.add_argument("--method", choices=("pattern", "evolution"), default="pattern", help="default pattern")
    command.add_argument("--aim", choices=("robot", "energy"), default="robot", help="objective (default robot)")
    command.add_argument("--body", default=Scenario.body, metavar="NAME", help="body that walks (default ranger)")
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
        help="a parameter and its first step; may be given several times (default: a list of the program's)",
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
        "--worth",
        type=number(least=0.0),
        default=0.05,
        help="a change is kept if it lowers the cost by this much (default 0.05)",
    )
    command.add_argument("--generations", type=whole_number(0), default=20, help="of the evolution (default 20)")
    command.add_argument("--population", type=whole_number(4), help="walkers of a generation (default by their number)")
    command.add_argument(
        "--spread", type=number(above=0.0), default=1.0, help="the evolution's first steps times this (default 1)"
    )
    command.add_argument(
        "--random", type=whole_number(), default=1, metavar="SEED", help="of the evolution (default 1)"
    )
    command.add_argument("--jobs", type=whole_number(1), default=1, help="walks at a time (default 1)")
    command.add_argument("--out", required=True, metavar="FILE.toml", help="file for the set that was found")
    command.set_defaults(run=run)
    return command


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    return cli.main(arguments, parser, COMMAND)


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
    console = terminal.console(stderr=True)
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
        options.aim,
        options.body,
    )
    base = controllers.load(options.base)
    start = controllers.load(options.start) if options.start else base
    if start.program != base.program:
        raise UserError(f"--start {start.name}: for program {start.program!r}, the base is for {base.program!r}")
    changes = {name: value for name, value in start.values.items() if value != base.values[name]}
    steps = dict(options.vary) if options.vary else dict(DEFAULT_STEPS[base.program])
    for name in steps:
        if name not in base.values:
            raise UserError(f"--vary {name}: program {base.program!r} does not read it")
    title = f"{base.title}, tuned"

    def keep(changes: dict) -> None:
        try:
            out.write_text(as_toml(options.base, title, changes, start.reasons))
        except OSError as error:
            raise UserError(f"cannot write {out}: {error.strerror}") from None

    with tempfile.TemporaryDirectory() as folder, workers(options.jobs) as each:
        judge = Judge(task, pathlib.Path(folder), console, each)
        if options.method == "pattern":
            changes, cost, falls = search(judge, base.values, changes, steps, options.rounds, options.worth)
        else:
            evolution = {name: options.spread * step for name, step in steps.items()}
            generations = evolve(
                judge, base.values, changes, evolution, options.generations, options.population, options.random
            )
            for changes, cost, falls in generations:  # noqa: B007
                keep(changes)
    keep(changes)
    console.print(f"{out}: cost {cost:.3f}, {falls} falls in {len(task.seeds) * len(task.floors)} walks")
    return 1 if falls else 0


class Judge:
    """Walks candidates and keeps their costs. Call: judge(changes) -> (cost, falls).

    `each`: a `map`, perhaps one of several processes; `folder`: for the candidates' files.
    """

    def __init__(self, task: Task, folder: pathlib.Path, console: Console, each: Callable = map) -> None:
        self.task = task
        self.folder = folder
        self.console = console
        self.each = each
        self.known: dict[tuple, tuple[float, int]] = {}

    def __call__(self, changes: dict) -> tuple[float, int]:
        return self.all([changes])[0]

    def all(self, candidates: list[dict]) -> list[tuple[float, int]]:
        """(cost, falls) of each candidate; those not known yet are walked, side by side if there are processes."""
        keys = [tuple(sorted(changes.items())) for changes in candidates]
        new = [key for key in dict.fromkeys(keys) if key not in self.known]
        walks = [(key, seed, floor) for key in new for floor in self.task.floors for seed in self.task.seeds]
        files: dict[tuple, pathlib.Path] = {}
        for key in new:
            files[key] = self.folder / f"candidate-{len(self.known) + len(files)}.toml"
            files[key].write_text(as_toml(self.task.base, "candidate", dict(key), {}))
        summaries = list(self.each(walk, [(str(files[key]), seed, floor, self.task) for key, seed, floor in walks]))
        per_candidate = len(self.task.seeds) * len(self.task.floors)
        for place, key in enumerate(new):
            of_key = summaries[place * per_candidate : (place + 1) * per_candidate]
            cost = sum(cost_of(summary, self.task.steps, self.task.aim) for summary in of_key) / per_candidate
            self.known[key] = cost, sum(summary["fell"] for summary in of_key)
            shown = ", ".join(f"{name} {value:g}" for name, value in key)
            self.console.print(f"{cost:8.3f}  {self.known[key][1]} falls  {shown}", highlight=False, soft_wrap=True)
            files[key].unlink()
        return [self.known[key] for key in keys]


def walk(order: tuple[str, int, float, Task]) -> dict:
    """The summary of one walk of the whole robot: (controller file, seed, roughness in m, task)."""
    from ranger_sim.ranger.robot import Ranger  # the whole robot: only when it is to walk

    controller, seed, roughness_m, task = order
    scenario = Scenario(controller=controller, body=task.body, seed=seed, floor_roughness_m=roughness_m)
    with contextlib.closing(Ranger(scenario)) as robot:
        # three times the time of such a walk, so that one without progress ends too (chosen by us)
        stop = StopRule(steps=task.steps, time_s=10.0 + 1.8 * task.steps)
        while not robot.run(stop, 60.0):
            pass
        return robot.summary()


def cost_of(summary: dict, steps: int, aim: str = "robot") -> float:
    """The cost of a walk; see AIMS, and TCOT_COST. A walk that ended early counts as a fall."""
    if summary["fell"] or summary["steps"] < steps:
        return FALL_COST * (1.0 - 0.5 * summary["steps"] / steps)
    if aim == "energy":
        cost = min(TCOT_COST * summary["tcot"], WORST_WALK_COST)
    else:
        figures = (
            (summary[name], aim) for name, aim in AIMS.items() if summary[name] is not None
        )  # 6 steps: no spread
        cost = sum(((figure - wanted) / tolerance) ** 2 for figure, (wanted, tolerance) in figures)
        cost += ((summary["heel_strike_delay_ms"]["mean"] - DELAY_AIM_MS) / DELAY_TOLERANCE_MS) ** 2
    lost = sum(bus["lost"] for bus in summary["can"].values())
    overruns = sum(board["overruns"] for board in summary["slots"].values())
    return cost + LOST_COST * (lost + overruns)


def evolve(
    judge: Any, values: dict, changes: dict, steps: dict, generations: int, population: int | None, seed: int
) -> Iterator[tuple[dict, float, int]]:
    """The evolution, yielding the best so far, (changes, cost, falls), before it and after each generation.

    Beyond its range a parameter is walked at the limit.
    """
    rows = programs.parameter_rows()
    names = [name for name in sorted(steps) if name not in TOGETHER.values()]
    best = (changes, *judge(changes))
    yield best
    begin = [changes.get(name, values[name]) for name in names]
    search = Evolution(begin, [steps[name] for name in names], seed, population)
    for _ in range(generations):
        points = search.ask()
        candidates = []
        for point in points:
            candidate = dict(changes)
            for name, value in zip(names, point.tolist(), strict=True):
                low, high = rows[name].minimum, rows[name].maximum
                candidate = with_value(candidate, values, name, min(max(float(f"{value:.5g}"), low), high))
            candidates.append(candidate)
        judged = judge.all(candidates)
        search.tell(points, [cost for cost, _ in judged])
        for candidate, (cost, falls) in zip(candidates, judged, strict=True):
            if cost < best[1]:
                best = (candidate, cost, falls)
        yield best


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
        # a change that no longer lowers the cost enough is taken back
        for name in sorted(set(changes) - set(TOGETHER.values())):
            candidate = with_value(changes, values, name, values[name])
            new_cost, new_falls = judge(candidate)
            if new_cost < cost + worth:
                changes, cost, falls = candidate, new_cost, new_falls
        if not improved:
            steps = {name: 0.5 * step for name, step in steps.items()}
    return changes, cost, falls


def with_value(changes: dict, values: dict, name: str, value: float) -> dict:
    """`changes` with `name` (and its twin) at `value`, without values equal to the base's."""
    result = dict(changes)
    for each in (name, TOGETHER.get(name)):
        if each is not None:
            result.pop(each, None)
            if value != values[each]:
                result[each] = value
    return result


def as_toml(base: str, title: str, changes: dict, reasons: dict) -> str:
    """A parameter set with these changes against `base`."""
    lines = [
        f'title = "{title}"',
        'description = "found by python -m studies.tune"',
        f'base = "{base}"',
        "",
        "[parameters]",
    ]
    lines += [f"{name} = {value!r}" for name, value in sorted(changes.items())]
    lines += ["", "[reasons]"]
    lines += [
        f'{name} = "{reasons.get(name, "lowers the cost of the walks that the tuner tried")}"'
        for name in sorted(changes)
    ]
    return "\n".join(lines) + "\n"
