# Generated from boards/main_brain/filters.py and boards/main_brain/filters.pxd (python -m ranger_sim.tools.stubs); do not edit.

SETTLED: int

class ButterworthFilter:
    b0: float
    b1: float
    b2: float
    a1: float
    a2: float
    violations: int
    stamp: int
    started: bool
    x1: float
    x2: float
    y1: float
    y2: float
    output: float
    held: float
    def __init__(self, cutoff_hz: float, sample_hz: float) -> None: ...
    def rest_at(self, value: float) -> None: ...
    def push(self, value: float) -> float: ...
    def push_stamped(self, value: float, stamp_ms: int) -> float: ...
