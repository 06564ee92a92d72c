"""Cases that `ranger-sim bench` times: each runs in a separate process and returns its work per CPU second.

`python -m ranger_sim.tools.bench.cases CASE SECONDS` is that process; it prints the figures as JSON.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ranger_sim.foundation import wallclock

SIMULATED = "simulated s per CPU s"
FRAMES = "frames per CPU s"
RUNS = "runs per CPU s"
YARDSTICK = "virtual"  # measures the machine: every figure is also given as a ratio to it
BUS_FRAMES_PER_S, VIRTUAL_FRAMES_PER_S = 50_000, 1_000  # frames for each second of --seconds, about as much work
INTERPRETED_SHARE = 10  # the plain sources take at least this many times as long, and get less work in proportion


@dataclass(frozen=True)
class Case:
    """One timed case; `measure(seconds)` runs it for about `seconds` of virtual time: {"figure": ...}."""

    title: str
    unit: str
    measure: Callable[[float], dict]
    interpreted: bool = False


TICK_S = 1e-3  # the shortest time between two ticks of a Linux kernel


def robot(seconds: float, log: str = "none", swap: bool = False) -> dict:
    """The whole robot for `seconds`, without its first second; CPU seconds of the stepping loop only."""
    from ranger_sim.ranger.robot import Ranger
    from ranger_sim.ranger.scenario import Scenario, StopRule

    with contextlib.closing(Ranger(Scenario(), log=log)) as walking:
        if swap:
            walking.replace("MCH", "mc_compliant_control", users_law(walking.board("MCH")), cost=4200, limit=6000)
        walking.run(StopRule(time_s=1.0), 1.0)
        started = wallclock.process_cpu_s()
        walking.run(StopRule(time_s=1.0 + seconds), seconds)
        return {"figure": (walking.time_s - 1.0) / used_s(started), "steps": walking.steps}


def used_s(started: float) -> float:
    """Processor seconds since `started`, at least the resolution of a kernel that counts them in ticks."""
    return max(wallclock.process_cpu_s() - started, TICK_S)


def users_law(board: Any) -> Callable[[], None]:
    """A law that a user might write: the hip's spring-damper in floating-point Python, replacing the firmware's own."""
    law, limits, loop, readings = board.compliance, board.limits, board.current_control, board.readings

    def control() -> None:
        position = board.controlled_position() / 65536.0
        velocity = board.controlled_velocity() / 65536.0
        current = law.command / 65536.0 - law.stiffness / 65536.0 * position - law.dampness / 65536.0 * velocity
        target = limits.limit_target(int(current * 65536.0), int(velocity * 65536.0))
        loop.update(target, readings.motor_current_fixed())

    return control


def plant(seconds: float) -> dict:
    """The body alone, held, motors off."""
    from ranger_sim.plant.ranger import RangerPlant

    body = RangerPlant()
    steps = round(seconds * 1e9 / body.step_ns)
    started = wallclock.process_cpu_s()
    for _ in range(steps):
        body.step()
    return {"figure": seconds / used_s(started)}


def bus(seconds: float, load: float = 1.0, boards: int = 3) -> dict:
    """Our bus: send, arbitrate and deliver on four buses of `boards` boards at `load`."""
    from ranger_sim.tools.bench import traffic

    done = traffic.million_frames(round(BUS_FRAMES_PER_S * seconds), load, boards)
    return {"figure": done["frames_per_s"], **{name: done[name] for name in ("frames", "lost", "out_of_order")}}


def virtual(seconds: float) -> dict:
    """The same work on python-can's `virtual`, which has no arbitration and no timing."""
    from ranger_sim.can_bus.edge import benchmark

    done = benchmark.interface_frames("virtual", round(VIRTUAL_FRAMES_PER_S * seconds))
    return {"figure": done["frames_per_s"], "frames": done["frames"], "lost": done["lost"]}


def fmu(seconds: float, plant_steps: int = 4, exchanged: bool = True) -> dict:
    """The body, held, motors off, as a unit for co-simulation; `exchanged`: every input set and every output read."""
    from ranger_sim.tools.bench import co_simulation

    return co_simulation.measure(seconds, plant_steps, exchanged)


def twelve_boards(seconds: float, **how: bool) -> dict:
    """Twelve boards on one bus, eleven with an encoder; `how` as for `twelve_boards.measure`."""
    from ranger_sim.tools.bench import twelve_boards as part

    return part.measure(seconds, **how)


def waiting(function: str, *arguments: Any, **how: Any) -> dict:
    """A measurement of `waiting`."""
    from ranger_sim.tools.bench import waiting as part

    found: dict = getattr(part, function)(*arguments, **how)
    return found


CASES = {
    "robot": Case("whole robot, trace hashed, nothing kept", SIMULATED, robot),
    "robot-longer": Case("whole robot, four times as long", SIMULATED, lambda s: robot(4 * s)),
    "robot-window": Case("whole robot, last 10 s kept", SIMULATED, lambda s: robot(s, log="window")),
    "robot-full": Case("whole robot, everything kept", SIMULATED, lambda s: robot(s, log="full")),
    "robot-swapped": Case("hip control law by a user's function", SIMULATED, lambda s: robot(s, swap=True)),
    "plant": Case("body alone", SIMULATED, plant),
    "fmu": Case("body as FMU, 1 ms, 102 values exchanged", SIMULATED, fmu),
    "fmu-fine": Case("body as FMU, 250 us, 102 values", SIMULATED, lambda s: fmu(s / 4, 1)),
    "fmu-steps": Case("body as FMU, 1 ms, steps only", SIMULATED, lambda s: fmu(s, 4, False)),
    "bus": Case("four buses, every buffer always full", FRAMES, bus),
    "bus-quarter": Case("four buses at 25 % load", FRAMES, lambda s: bus(s, 0.25)),
    "bus-eight": Case("four buses of eight boards, 75 % load", FRAMES, lambda s: bus(s, 0.75, 8)),
    "boards-in-c": Case("twelve boards in C", SIMULATED, twelve_boards),
    "boards-in-c-ahead": Case("the same, running ahead", SIMULATED, lambda s: twelve_boards(s, ahead=True)),
    "boards-in-python": Case("the same boards in Python", SIMULATED, lambda s: twelve_boards(s, in_c=False)),
    "boards-in-python-ahead": Case(
        "the same in Python, running ahead", SIMULATED, lambda s: twelve_boards(s, in_c=False, ahead=True)
    ),
    "boards-in-c-processes": Case(
        "in C, ahead, a process for each board", SIMULATED, lambda s: twelve_boards(s, ahead=True, processes=True)
    ),
    "boards-in-c-filtered": Case(
        "in C, ahead, with acceptance filters", SIMULATED, lambda s: twelve_boards(s, ahead=True, filtered=True)
    ),
    "boards-in-python-filtered": Case(
        "in Python, ahead, with acceptance filters",
        SIMULATED,
        lambda s: twelve_boards(s, in_c=False, ahead=True, filtered=True),
    ),
    "boards-in-c-filtered-processes": Case(
        "in C, ahead, with filters, as processes",
        SIMULATED,
        lambda s: twelve_boards(s, ahead=True, processes=True, filtered=True),
    ),
    "start-python": Case("the bare interpreter", RUNS, lambda s: waiting("start", s, "python")),
    "start-version": Case("ranger-sim --version", RUNS, lambda s: waiting("start", s, "version")),
    "start-info": Case("ranger-sim info", RUNS, lambda s: waiting("start", s, "info")),
    "start-robot": Case("a first Ranger()", RUNS, lambda s: waiting("start", s, "robot")),
    "start-pytest": Case("pytest collects one test", RUNS, lambda s: waiting("start", s, "pytest")),
    "campaign": Case("campaign of `new`, start included", RUNS, lambda _: waiting("campaign")),
    "campaign-bare": Case("its machine alone, for as long", RUNS, lambda _: waiting("campaign", bare=True)),
    "images": Case("a board as an image", SIMULATED, lambda s: waiting("image", s / 10)),
    "images-native": Case("its program for this computer", SIMULATED, lambda s: waiting("image", s, native=True)),
    "walk": Case("a walk, start included", SIMULATED, lambda s: waiting("walk", s)),
    "walk-trace": Case("the same with its trace", SIMULATED, lambda s: waiting("walk", s, trace=True)),
    "rebuild": Case("build of one module", RUNS, lambda _: waiting("rebuild")),
    "rebuild-nothing": Case("build with nothing to do", RUNS, lambda _: waiting("rebuild", nothing=True)),
    "robot-interpreted": Case("whole robot, interpreted", SIMULATED, robot, interpreted=True),
    "plant-interpreted": Case("body alone, interpreted", SIMULATED, plant, interpreted=True),
    "bus-interpreted": Case("four full buses, interpreted", FRAMES, bus, interpreted=True),
    YARDSTICK: Case("python-can's virtual, three boards", FRAMES, virtual),
}


def measured(name: str, seconds: float) -> dict:
    """One case in a separate process. RuntimeError with the last line of its output when it fails."""
    case = CASES[name]
    environment = {key: value for key, value in os.environ.items() if key != "RANGER_SIM_INTERPRETED"}
    if case.interpreted:
        environment["RANGER_SIM_INTERPRETED"] = "1"
        seconds /= INTERPRETED_SHARE
    call = [sys.executable, "-m", "ranger_sim.tools.bench.cases", name, str(seconds)]
    done = subprocess.run(call, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"bench: case {name}: {(done.stderr.strip() or 'no word').splitlines()[-1]}")
    figures: dict = json.loads(done.stdout)
    return figures


if __name__ == "__main__":
    print(json.dumps(CASES[sys.argv[1]].measure(float(sys.argv[2]))))
