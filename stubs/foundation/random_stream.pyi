# Generated from foundation/random_stream.py and foundation/random_stream.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import Any

_MASK: int

def stream_key(seed: int, name: str) -> int: ...

class RandomStream:
    name: str
    state: int
    increment: int
    multiplier_1: int
    multiplier_2: int
    spare: float
    has_spare: bool
    def __init__(self, seed: Any, name: str) -> None: ...
    def bits(self) -> int: ...
    def uniform(self) -> float: ...
    def integer(self, n: int) -> int: ...
    def normal(self) -> float: ...
