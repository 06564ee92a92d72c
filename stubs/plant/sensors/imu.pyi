# Generated from plant/sensors/imu.py and plant/sensors/imu.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.edge_buffer import ByteBuffer
from ranger_sim.foundation.random_stream import RandomStream
from typing import Any
from typing import final

SILENT: int
HEADER_ANGLES_AND_RATES: int
HEADER_RATES: int
SET_MODE: int
SET_MODE_SECOND: int
SET_MODE_THIRD: int
PACKET_BYTES: int
MAX_FILTER: int

@final
class Imu:
    bytes: ByteBuffer
    next_sample_ns: int
    acknowledge: int
    line_free_ns: int
    byte_ns: int
    checksum: int
    mode: int
    samples: int
    packets: int
    rate_scale: float
    lag_s: float
    cross_x_from_z: float
    bias_rad_s: float
    noise_rad_s: float
    roll_bias_rad: float
    roll_noise_rad: float
    stream: RandomStream
    filter_samples: int
    latency_ns: int
    baud: int
    sample_ns: int
    fusion_divider: int
    ppb: int
    phase_ns: int
    lagged: float
    rate_x: float
    roll: float
    command: int
    acknowledge_ns: int
    ring_sum: float
    ring: MutableSequence[float]
    def __init__(self, seed: Any = 0, bias_rad_s: float = ..., noise_rad_s: float = 0.004, roll_bias_rad: float = ..., roll_noise_rad: float = 0.001, filter_samples: int = 1, latency_ns: int = 500000, baud: int = 460800, sample_ns: int = 1000000, fusion_divider: int = 4, ppb: int = 0, phase_ns: int = 0) -> None: ...
    def receive_byte(self, time: int, byte: int) -> None: ...
    def sample_time(self, n: int) -> int: ...
    def is_due(self, t1: int) -> bool: ...
    def update(self, t0: int, t1: int, lean0: float, rate0: float, lean1: float, rate1: float, yaw: float = 0.0, yaw_rate: float = 0.0) -> None: ...
    def _begin(self) -> None: ...
    def _send(self, byte: int) -> None: ...
    def _word(self, word: int) -> None: ...
    def _sum(self) -> None: ...
    def _packet(self, start: int, first: float, second: float, third: float, yaw_rate: float) -> None: ...
    def _acknowledge(self) -> None: ...
