# Generated from plant/compliant.py and plant/compliant.pxd (python -m ranger_sim.tools.stubs); do not edit.

PARTS: int
