"""The machines of this room, by the name of their experiment."""

from collections.abc import Callable
from typing import Any

from ranger_sim.sysid.machines.motor_bench import MotorBench
from ranger_sim.sysid.machines.positioning import Positioning

MACHINES: dict[str, Callable[..., Any]] = {MotorBench.name: MotorBench, Positioning.name: Positioning}
