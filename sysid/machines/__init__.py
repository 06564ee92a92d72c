"""The machines of this package, by the name of their experiment."""

import importlib
from typing import Any

MACHINES = {
    "motor-bench": "motor_bench:MotorBench",
    "leg-swing": "leg_swing:LegSwing",
    "positioning": "positioning:Positioning",
    "ankle": "ankle:Ankle",
    "walk": "walk:Walk",
}

ROBOT = ("motor-bench", "leg-swing", "ankle", "walk")  # those that measure the robot, whose simulator can have a cause


def made(experiment: str) -> Any:
    """The class of a machine; loaded only when it is asked for."""
    module, _, name = MACHINES[experiment].partition(":")
    return getattr(importlib.import_module(f"ranger_sim.sysid.machines.{module}"), name)
