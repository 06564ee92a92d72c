# Generated from plant/mechanics/contact_equations.py and plant/mechanics/contact_equations.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.plant.mechanics.leg import Leg
from typing import Any
from typing import final

COLUMN_VX: int
COLUMN_VY: int
COLUMN_LEG: int
COLUMN_FOOT: int
COLUMN_IMPULSE: int
COLUMN_RIGHT: int
COLUMNS: int
APART: int
STICKS: int
SLIDES_ON: int
SLIDES_BACK: int
STATES: int
ARMS: int
PAIRS: tuple[tuple[int, ...], ...]

@final
class ContactEquations:
    matrix: MutableSequence[float]
    solution: MutableSequence[float]
    mass: MutableSequence[float]
    right: MutableSequence[float]
    arm: MutableSequence[float]
    target: MutableSequence[float]
    follow: MutableSequence[float]
    rolling: MutableSequence[float]
    motor: MutableSequence[float]
    brush: MutableSequence[float]
    place: MutableSequence[float]
    rate: MutableSequence[float]
    acceleration: MutableSequence[float]
    first_place: MutableSequence[float]
    first_rate: MutableSequence[float]
    place_sum: MutableSequence[float]
    rate_sum: MutableSequence[float]
    massless: Any
    moving: Any
    at_floor: Any
    allowed: Any
    state: MutableSequence[int]
    mu: float
    total_mass: float
    def __init__(self) -> None: ...
    def begin(self, outer: Leg, inner: Leg, total_mass: float, hip_rotor: float, mu: float) -> None: ...
    def allow_all(self, side: int) -> None: ...
    def allow_only(self, side: int, state: int) -> None: ...
    def leave_out(self, side: int) -> None: ...
    def solve(self, outer: int, inner: int) -> bool: ...
    def contact_rate(self, side: int, along: int) -> float: ...
    def slack(self, side: int, state: int) -> float: ...
    def settle(self, last: int) -> float: ...
