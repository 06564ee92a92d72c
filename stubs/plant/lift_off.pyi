# Generated from plant/lift_off.py and plant/lift_off.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body
from ranger_sim.plant.leg import Leg

def lets_go(body: Body, leg: Leg) -> bool: ...
