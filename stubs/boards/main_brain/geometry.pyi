# Generated from boards/main_brain/geometry.py and boards/main_brain/geometry.pxd (python -m ranger_sim.tools.stubs); do not edit.

class FloorGeometry:
    leg_m: float
    inner_radius_m: float
    inner_ankle_m: float
    outer_radius_m: float
    outer_ankle_m: float
    front_foot: float
    rear_foot: float
    front_leg: float
    rear_leg: float
    ankle_distance_m: float
    def __init__(self) -> None: ...
    def solve(self, hip: float, outer: float, inner: float) -> bool: ...
