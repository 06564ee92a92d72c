# Generated from plant/mechanics/air.py and plant/mechanics/air.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body

def in_air(body: Body, h: float, stages: int) -> None: ...
