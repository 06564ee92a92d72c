# Generated from plant/mechanics/stance.py and plant/mechanics/stance.pxd (python -m ranger_sim.tools.stubs); do not edit.

from ranger_sim.plant.mechanics.body import Body

def on_feet(body: Body, h: float, stages: int) -> None: ...
