# Generated from plant/impact.py and plant/impact.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body

COLUMN_VX: int
COLUMN_VY: int
COLUMN_LEG: int
COLUMN_FOOT: int
COLUMN_IMPULSE: int
COLUMN_RIGHT: int
COLUMNS: int

def impact(body: Body, outer: bool, inner: bool) -> None: ...
