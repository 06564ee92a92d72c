"""Measuring instruments as they err: offset and gain of each, noise and quantisation of each reading, ends of range.

Offset and gain are drawn once for a recording, noise for every reading. What a data sheet gives as a limit counts as
two standard deviations. A fit that uses such readings has offset and gain as parameters with these uncertainties.
"""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ranger_sim.foundation.random_arrays import generator

Array = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Instrument:
    """In `unit`: noise, offset as standard deviations, resolution of one count, ends of the range; gain: standard
    deviation of the relative error. source: data sheet, or "chosen by us, because ..."."""

    name: str
    unit: str
    noise: float
    resolution: float
    offset: float
    gain: float
    source: str
    low: float = -math.inf
    high: float = math.inf

    @property
    def sigma(self) -> float:
        """Standard deviation of one reading about its mean: noise, and rounding to counts."""
        return math.hypot(self.noise, self.resolution / math.sqrt(12.0))

    def errors(self, seed: int, place: str) -> tuple[float, float]:
        """Offset and relative gain error of the one instrument at `place`."""
        random = generator(seed, f"{place}, {self.name}: error")
        return self.offset * float(random.standard_normal()), self.gain * float(random.standard_normal())

    def read(self, truth: Array, seed: int, place: str) -> Array:
        """What it shows, shape as `truth`."""
        offset, gain = self.errors(seed, place)
        noise = self.noise * generator(seed, f"{place}, {self.name}: noise").standard_normal(np.shape(truth))
        shown = (1.0 + gain) * np.asarray(truth, dtype=np.float64) + offset + noise
        if self.resolution > 0.0:
            shown = self.resolution * np.round(shown / self.resolution)
        return np.asarray(np.clip(shown, self.low, self.high), dtype=np.float64)


VOLTMETER = Instrument(
    "voltmeter",
    "V",
    noise=0.004,
    resolution=20.0 / 2**14,
    offset=0.002,
    gain=0.0005,
    low=-10.0,
    high=10.0,
    source="chosen by us: a data acquisition box of 14 bits over +/-10 V, zeroed; the appendix (8.2) names no type",
)
CURRENT_SENSOR = Instrument(
    "current sensor",
    "A",
    noise=0.004,
    resolution=10.0 / 2**14,
    offset=0.003,
    gain=0.003,
    low=-5.0,
    high=5.0,
    source="Hall sensor (appendix 8.2); chosen by us: +/-5 A, zeroed and calibrated, a reading is the mean of 0.1 s",
)
TORQUE_CELL = Instrument(
    "torque cell",
    "N m",
    noise=0.002,
    resolution=0.0005,
    offset=0.001,
    gain=0.002,
    source="load cell MLP-75 on a hinged plate (appendix 8.2), whose arm is not given; so these are chosen by us",
)
SHAFT_SPEED = Instrument(
    "shaft speed",
    "rad/s",
    noise=0.03,
    resolution=0.001,
    offset=0.0,
    gain=0.0,
    source="encoder, differenced and filtered (appendix 8.2): counts have no offset and no gain; noise chosen by us",
)
FISH_SCALE = Instrument(
    "fish scale",
    "N",
    noise=0.03,
    resolution=0.05,
    offset=0.02,
    gain=0.003,
    low=0.0,
    high=500.0,
    source="digital fish scale (appendix 7.3); chosen by us: 5 g counts",
)
INCLINOMETER = Instrument(
    "inclinometer",
    "rad",
    noise=0.0005,
    resolution=math.radians(0.05),
    offset=math.radians(0.05),
    gain=0.0,
    source="chosen by us: a digital level with 0.05 degrees",
)
JOINT_ENCODER = Instrument(
    "joint encoder",
    "rad",
    noise=0.0002,
    resolution=2.0 * math.pi / 8192,
    offset=0.005,
    gain=0.0,
    source="the robot's absolute encoders, 13 bits (EQUATIONS 11.2); noise and error of its zero chosen by us",
)
BOARD_CURRENT = Instrument(
    "board's current",
    "A",
    noise=0.02,
    resolution=0.01,
    offset=0.01,
    gain=0.01,
    source="as the motor board sends it; chosen by us in the size of the scatter in the robot's own logs",
)

TAPE_M = 0.0005  # standard deviation of a length by tape measure: 1 mm as its limit
CALLIPER_M = 0.00005  # of a pulley's radius by calliper: 0.1 mm as its limit
