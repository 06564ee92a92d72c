# Generated from plant/walking/grip.py and plant/walking/grip.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body

NO_EVENT: int
TOUCH: int
LIFT_OFF: int
SLIDE: int
STICK: int

def regrip(body: Body) -> bool: ...
