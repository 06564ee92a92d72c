"""Ranger's catalogue of faults: the modes of any machine, those that need its legs, and its places."""

from ranger_sim.harness.faults.catalogue import Catalogue
from ranger_sim.ranger.conditions import condition

# In the order in which places and modes are listed.
MODULES = tuple(
    f"ranger_sim.{name}"
    for name in (
        "ranger.faults.places", "harness.faults.edges", "harness.faults.words", "ranger.faults.voltages",
        "harness.faults.imu", "harness.faults.converters", "ranger.faults.actuators", "ranger.faults.world",
        "harness.faults.frames", "harness.faults.buses", "ranger.faults.links", "ranger.faults.power",
        "ranger.faults.processor",
    )
)  # fmt: skip

CATALOGUE = Catalogue(condition=condition, modules=MODULES, hint="; `ranger-sim faults` lists them")
