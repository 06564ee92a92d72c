# Generated from plant/walking/impact.py and plant/walking/impact.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body
from ranger_sim.plant.mechanics.leg import Leg

def impact(body: Body, outer: bool, inner: bool) -> None: ...
def collide(body: Body, leg: Leg, other_stands: bool) -> None: ...
