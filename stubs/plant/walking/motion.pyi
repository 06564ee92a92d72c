# Generated from plant/walking/motion.py and plant/walking/motion.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body

MOST_EVENTS: int
MOST_TRIES: int

def advance(body: Body, h: float) -> None: ...
