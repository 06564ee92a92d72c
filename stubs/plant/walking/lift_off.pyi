# Generated from plant/walking/lift_off.py and plant/walking/lift_off.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body
from ranger_sim.plant.mechanics.leg import Leg

def lets_go(body: Body, leg: Leg) -> bool: ...
