"""The description of a run: one frozen record, checked when it is made."""

import dataclasses
import math
import os

from ranger_sim.foundation.user_error import ScenarioError
from ranger_sim.harness.stop_rule import StopRule
from ranger_sim.plant.electrics.battery import BatteryParameters
from ranger_sim.plant.electrics.electrics import ElectricsParameters
from ranger_sim.plant.electrics.electronics import SWITCHES

__all__ = ["LIMITS", "Scenario", "StopRule"]

# {field: (lowest, highest, unit)}; beyond these the walking model itself means nothing: chosen by us
LIMITS: dict[str, tuple[float, float, str]] = {
    "slope_rad": (-0.5, 0.5, "rad"),
    "floor_roughness_m": (0.0, 0.1, "m"),
    "start_uptime_ms": (0, 2**32 - 1, "ms"),
    "battery_charge": (1e-6, 1.0, "(full)"),
    "battery_capacity_Wh": (1e-3, 1e6, "Wh"),
}


@dataclasses.dataclass(frozen=True)
class Scenario:
    """One run of the whole robot. The same scenario gives the same bytes.

    controller: name of a parameter set in boards/main_brain/parameters, or the path of a .toml file.
    body: name of a body in plant/bodies, or the path of a .toml file.
    seed: 0 or more; chooses every crystal, phase, noise and foothold.
    slope_rad: positive downhill. floor_roughness_m: standard deviation of the height per foothold.
    start_uptime_ms: network time at power-up, so that wraps and long runs can be tested.
    battery_charge: of the packs at power-up, 1 is full. battery_capacity_Wh: of all of them together.
    electronics_off: names of `plant.electrics.electronics.SWITCHES`, parts that draw no power in this walk.
    """

    controller: str = "record-2011"
    body: str = "ranger"
    seed: int = 1
    slope_rad: float = 0.0
    floor_roughness_m: float = 0.0
    start_uptime_ms: int = 0
    model_file: str | None = None  # additional named terms of motors, joints and sensors
    battery_charge: float = 1.0  # packs are charged before a walk, and checked for it by voltmeter [A 3.10]
    battery_capacity_Wh: float = 469.0  # seven packs of 67 Wh nominal [A 3.10]; the 65 km walk used 493 Wh
    electronics_off: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, (low, high, unit) in LIMITS.items():
            value = getattr(self, name)
            if not (isinstance(value, int | float) and math.isfinite(value) and low <= value <= high):
                raise ScenarioError(f"scenario: {name} is {value!r}, allowed are {low} to {high} {unit}")
        if not isinstance(self.seed, int) or isinstance(self.seed, bool) or self.seed < 0:
            raise ScenarioError(f"scenario: seed is {self.seed!r}, a whole number from 0 on is expected")
        for name in ("controller", "body", "model_file"):
            value = getattr(self, name)
            if not isinstance(value, str | os.PathLike) and (name, value) != ("model_file", None):
                raise ScenarioError(f"scenario: {name} is {value!r}, a name or the path of a .toml file is expected")
        for name in self.electronics_off:
            if name not in SWITCHES:
                raise ScenarioError(f"scenario: electronics_off {name!r}: what can be off is {', '.join(SWITCHES)}")

    def electrics(self, body: ElectricsParameters) -> ElectricsParameters:
        """Motors and sensors of the body with this walk's batteries and electronics."""
        packs = BatteryParameters().packs
        battery = BatteryParameters(charge=self.battery_charge, pack_energy_Wh=self.battery_capacity_Wh / packs)
        return dataclasses.replace(body, battery=battery, electronics_off=self.electronics_off)
