# Generated from plant/air.py and plant/air.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body

def in_air(body: Body, h: float, stages: int) -> None: ...
