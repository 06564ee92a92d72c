# Generated from plant/stance.py and plant/stance.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.body import Body

def on_feet(body: Body, h: float, stages: int) -> None: ...
