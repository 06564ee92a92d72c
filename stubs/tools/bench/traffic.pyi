# Generated from tools/bench/traffic.py and tools/bench/traffic.pxd (python -m ranger_sim.tools.stubs); do not edit.

from collections.abc import MutableSequence
from typing import Any

ROBOT_BIT_RATE: int
ROBOT_BUSES: int

class Load:
    buses: list[Any]
    inboxes: list[Any]
    per_node: int
    nodes_per_bus: int
    period_ns: int
    quantum_ns: int
    time: int
    requested: int
    delivered: int
    done: int
    out_of_order: int
    wrong: int
    sent: MutableSequence[int]
    expected: MutableSequence[int]
    free: MutableSequence[int]
    word: MutableSequence[int]
    def __init__(self, buses: Any = 4, nodes_per_bus: int = 3, load: Any = 0.75, per_node: int = 3) -> None: ...
    def run(self, frames: int) -> None: ...

def million_frames(frames: int = 1000000, load: float = 1.0, nodes_per_bus: int = 3) -> dict[Any, Any]: ...
