"""The machines of this package, by the name of their experiment."""

import importlib
from typing import Any

from ranger_sim.foundation.user_error import ModelError, unknown
from ranger_sim.sysid.machine import Machine

MACHINES = {
    "motor-bench": "motor_bench:MotorBench",
    "leg-swing": "leg_swing:LegSwing",
    "positioning": "positioning:Positioning",
    "ankle": "ankle:Ankle",
    "walk": "walk:Walk",
}

MOTOR_STAGE = "motor-stage"  # sparse samples of meters without a time base in common: it has a diagnosis of its own
EXPERIMENTS = (*MACHINES, MOTOR_STAGE)

ROBOT = ("motor-bench", "leg-swing", "ankle", "walk")  # those that measure the robot, whose simulator can have a cause


def made(experiment: str) -> Any:
    """The class of a machine; loaded only when it is asked for."""
    module, _, name = MACHINES[experiment].partition(":")
    return getattr(importlib.import_module(f"ranger_sim.sysid.machines.{module}"), name)


def is_ours(machine: Machine) -> bool:
    """True for a machine of this package, false for a user's own, including one derived from ours."""
    kind = type(machine)
    module = kind.__module__.removeprefix(f"{__name__}.")
    return MACHINES.get(machine.name, "") == f"{module.partition('.')[0]}:{kind.__name__}"


def missing_members(machine: object) -> list[str]:
    """Members that every machine has (sysid/machine.py) and this object lacks."""
    needed = ("name", "quantities", "parameters", "prepare", "effects", "generic")
    return [each for each in needed if not hasattr(machine, each)]


def machine_of(machine: str | Machine, gear: float | None = None) -> Machine:
    """The machine of this experiment; gear: of the motor bench's gearbox. A machine of the user's own is returned as it
    is. UserError for an unknown experiment, a gear that it does not have, and an object that is not a machine."""
    if not isinstance(machine, str):
        if missing := missing_members(machine):
            raise ModelError(f"the machine {machine!r} has no {', '.join(missing)} (sysid/machine.py has its members)")
        if gear is not None:
            raise ModelError(f"--gear {gear:g}: only the motor bench has a gearbox, not {machine.name}")
        return machine
    if machine == MOTOR_STAGE:
        raise ModelError(f"{machine}: its function is ranger_sim.sysid.machines.motor_stage.diagnose(datasets)")
    if machine not in MACHINES:
        text = unknown("experiment", machine, EXPERIMENTS)
        raise ModelError(f"--experiment {machine}: {text}; a machine of yours is module:object")
    if gear is None:
        return made(machine)()
    if machine != "motor-bench":
        raise ModelError(f"--gear {gear:g}: only the motor bench has a gearbox, not {machine}")
    if not 0.01 <= gear <= 1e4:
        raise ModelError(f"--gear {gear:g}: allowed are 0.01 to 10000")
    return made(machine)(gear)
