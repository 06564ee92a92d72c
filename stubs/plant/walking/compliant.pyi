# Generated from plant/walking/compliant.py and plant/walking/compliant.pxd (python -m ranger_sim.tools.stubs); do not edit.

PARTS: int
