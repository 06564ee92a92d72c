"""`ranger-sim bench walks`: how far, how fast and how evenly the parameter sets walk, over seeds and floors."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from ranger_sim.ranger.robot import Ranger
from ranger_sim.ranger.scenario import Scenario, StopRule
from ranger_sim.tools.command_line.units import figure

# parameter set, seeds, steps, roughness in m
WALKS = (
    ("robust", range(1, 4), 1000, 0.0),
    ("robust", range(1, 4), 5000, 0.001),
    ("record-2011", range(1, 21), 1000, 0.0),
    ("record-2011", range(1, 21), 500, 0.001),
)
KEPT = (
    "controller",
    "body",
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


def walked(scenario: Scenario, steps: int) -> dict:
    """One walk of `steps` steps, or until the robot falls: the kept part of its summary, frames lost, slots overrun."""
    with contextlib.closing(Ranger(scenario)) as robot:
        while not robot.run(StopRule(steps=steps), 10.0):
            pass
        summary = robot.summary()
    return {
        **{key: summary[key] for key in KEPT},
        "lost": sum(bus["lost"] for bus in summary["can"].values()),
        "overruns": sum(board["overruns"] for board in summary["slots"].values()),
    }


def run(report: Callable[[str], None]) -> list[dict]:
    """Walk every case of WALKS and report a line for each."""
    rows = []
    for controller, seeds, steps, roughness in WALKS:
        for seed in seeds:
            row = walked(Scenario(controller=controller, seed=seed, floor_roughness_m=roughness), steps)
            rows.append(row)
            report(
                f"{controller}, seed {seed}, {1000 * roughness:g} mm: {row['steps']} of {steps} steps"
                f"{', ' + row['fall_cause'] if row['fell'] else ''}; {figure(row['mean_step_length_m'], '{:.3f} m')}, "
                f"{figure(row['mean_step_time_s'], '{:.3f} s')}, {figure(row['motor_power_W'], '{:.1f} W')}, "
                f"lost {row['lost']}, overruns {row['overruns']}"
            )
    return rows
