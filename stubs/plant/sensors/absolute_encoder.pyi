# Generated from plant/sensors/absolute_encoder.py and plant/sensors/absolute_encoder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.foundation.random_stream import RandomStream
from ranger_sim.plant.sensors.noise import NoiseSource
from typing import Any
from typing import final

WORD_BITS: int
COUNTS_PER_TURN: int
PI: float

@final
class AbsoluteEncoder:
    noise: NoiseSource
    scale: float
    offset_rad: float
    lag_s: float
    eccentricity_1: float
    eccentricity_2: float
    counts_per_rad: float
    noise_counts: float
    bit_flip: float
    zero: int
    phase_1: float
    phase_2: float
    angle: float
    started: bool
    flips: RandomStream
    sign: int
    flipped: int
    name: str
    def __init__(self, name: str, zero: int, sign: int = 1, noise_counts: float = 0.3, bit_flip: float = 0.0, seed: Any = 0) -> None: ...
    def word(self, angle: float, h: float = 0.0) -> int: ...
