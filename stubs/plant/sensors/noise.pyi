# Generated from plant/sensors/noise.py and plant/sensors/noise.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.random_stream import RandomStream
from typing import Any
from typing import final

TABLE_SIZE: int
BLOCK: int

def quantile_table() -> list[float]: ...

@final
class NoiseSource:
    drawn: int
    ahead: MutableSequence[float]
    left: int
    word: int
    table: MutableSequence[float]
    stream: RandomStream
    def __init__(self, seed: Any, name: Any) -> None: ...
    def normal(self) -> float: ...
    def block(self) -> int: ...
