# Generated from plant/sensors/incremental_encoder.py and plant/sensors/incremental_encoder.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from ranger_sim.foundation.edge_buffer import EdgeBuffer
from ranger_sim.foundation.random_stream import RandomStream
from typing import Any
from typing import final

BOUNCE_NS: int
PI: float

@final
class IncrementalEncoder:
    edges: EdgeBuffer
    calm_rad: float
    calm_from: float
    calm_to: float
    edges_per_rad: float
    edges_at_zero: float
    started: bool
    eccentric: bool
    uneven: bool
    has_errors: bool
    cell: int
    total: int
    u0: float
    du: float
    m0: float
    m1: float
    span_ns: float
    t0: int
    last_time: int
    bounces: int
    jitter: float
    bounce: float
    scale: float
    offset_rad: float
    shaft_per_rad: float
    edges_per_shaft_rad: float
    gear: float
    eccentricity_1: float
    phase_1: float
    eccentricity_2: float
    phase_2: float
    lines: int
    sign: int
    table_size: int
    stream: RandomStream
    errors: MutableSequence[float]
    name: str
    seed: Any
    def __init__(self, name: str, lines: int, gear: float = 1.0, sign: int = 1, line_error: Any = 0.0, duty_error: Any = 0.0, jitter: float = 0.0, bounce: float = 0.0, seed: Any = 0) -> None: ...
    def set_disc(self, line_error: Any, duty_error: Any) -> None: ...
    def position(self, angle: float) -> float: ...
    def speed(self, angle: float, rate: float) -> float: ...
    def threshold(self, n: int) -> float: ...
    def reset(self, angle: float) -> None: ...
    def level_a(self) -> int: ...
    def level_b(self, angle: float) -> int: ...
    def update(self, t0: int, t1: int, angle0: float, rate0: float, angle1: float, rate1: float) -> int: ...
    def add_bounces(self, t1: int) -> int: ...
    def _value(self, x: float) -> float: ...
    def _turning(self, t0: int, t1: int, u0: float, u1: float, m0: float, m1: float) -> None: ...
    def _piece(self, x0: float, x1: float) -> None: ...
    def _emit(self, x0: float, x1: float, level: float, level_b: int) -> None: ...
