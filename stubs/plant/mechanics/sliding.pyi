# Generated from plant/mechanics/sliding.py and plant/mechanics/sliding.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body

MOTOR: int
FREEDOMS: int

def slide(body: Body, h: float, stages: int) -> None: ...
def write_forces(body: Body) -> None: ...
