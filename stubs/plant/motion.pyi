# Generated from plant/motion.py and plant/motion.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body

MOST_EVENTS: int
MOST_TRIES: int

def advance(body: Body, h: float) -> None: ...
