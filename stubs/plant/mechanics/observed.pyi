# Generated from plant/mechanics/observed.py and plant/mechanics/observed.pxd (python -m ranger_sim.tools.stubs); do not edit.

from typing import final

@final
class Observed:
    foothold_due: bool
    brushing: bool
    passing_gap: float
    scuff_time_s: float
    brush_s: float
    released_s: float
    friction_ratio_max: float
    slip_s: float
    normal_force_min: float
    pull_s: float
    fall_lean: float
    fall_height: float
    fall_split: float
    stall_s: float
    def __init__(self) -> None: ...
    def begin(self, time_s: float) -> None: ...
