# Generated from plant/electrics/battery.py and plant/electrics/battery.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any
from typing import final
import dataclasses

CELL_VOLTS: tuple[float, ...]

@dataclasses.dataclass(frozen=True)
class BatteryParameters:
    packs: int = ...
    cells_in_series: int = ...
    pack_energy_Wh: float = ...
    pack_resistance_ohm: float = ...
    charge: float = ...
    cell_volts: tuple[float, ...] = ...
    def __post_init__(self) -> None: ...
    @property
    def capacity_As(self) -> float: ...

@final
class Battery:
    voltage_V: float
    current_A: float
    open_voltage_V: float
    resistance_ohm: float
    per_As: float
    charge: float
    delivered_J: float
    lost_J: float
    cut_off: bool
    intervals: int
    curve: MutableSequence[float]
    parameters: Any
    def __init__(self, parameters: Any = None) -> None: ...
    def open_circuit_V(self, charge: float) -> float: ...
    def step(self, h: float, motor_current_A: float, electronics_W: float) -> None: ...
