# Generated from plant/impact.py and plant/impact.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body
from ranger_sim.plant.leg import Leg

def impact(body: Body, outer: bool, inner: bool) -> None: ...
def collide(body: Body, leg: Leg, other_stands: bool) -> None: ...
