"""Ranger's catalogue of faults: the modes of any machine, those that need its legs, and its places."""

from ranger_sim.harness.conditions import condition
from ranger_sim.harness.faults.catalogue import Catalogue

# In the order in which places and modes are listed.
MODULES = (
    "places", "edges", "words", "ranger_voltages", "imu", "converters", "actuators", "world",
    "frames", "buses", "links", "power", "processor",
)  # fmt: skip

CATALOGUE = Catalogue(condition=condition, modules=MODULES, hint="; `ranger-sim faults` lists them")
